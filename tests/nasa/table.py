"""Prints MEASURED.md's tables of NASA's check cases: errors of NASA's own simulators beside those of FMUs.

python -m nasa.table     (in tests, half a minute)
"""

from collections.abc import Callable, Iterable

from nasa.facts import Row, cylinder, station
from nasa.flights import (
    Error,
    brick_errors,
    brick_flight,
    cylinder_flight,
    cylinder_truth,
    station_flight,
    station_truth,
    worst,
)

PROPAGATORS = ("taylor", "dop853", "auto", "rk4", "split")
ONE_STEP = {"rk4": {"max_angle_step": 1.0}, "split": {"tolerance": 0.1}}
"""With these both take one step a communication step in orbit."""


def cells(errors: Iterable[Error | None]) -> str:
    """Returns the cells of a row, the attitude's errors [rad]."""
    return " | ".join(f"{error.attitude:.1e}" if error else "" for error in errors)


def row(name: str, nasa: Error, own: Callable[[str], Error | None]) -> None:
    """Prints a row: NASA's error and that of each propagator."""
    print(f"| {name} | {cells([nasa, *(own(propagator) for propagator in PROPAGATORS)])} |", flush=True)


def of_cylinder(states: Iterable[Row]) -> Error:
    """Returns the worst error of states of the cylinder at the published times."""
    return worst(list(states), [cylinder_truth().at(state.time) for state in cylinder()])


def of_station(propagator: str) -> Error | None:
    """Returns the worst error of the station at the published times; its torque is no weak one."""
    return None if propagator == "split" else worst(station_flight(propagator), station_truth())


def main() -> None:
    """Prints both tables as Markdown."""
    print("| error of the attitude, rad | NASA | " + " | ".join(f"`{name}`" for name in PROPAGATORS) + " |")
    print("|---|" + "---:|" * (len(PROPAGATORS) + 1))
    row("station under a torque, 28 800 s, steps of 20 s", worst(station(), station_truth()), of_station)
    for step in (60.0, 10.0, 1.0):
        row(
            f"cylinder in its orbit, 28 800 s, inputs every {step:g} s",
            of_cylinder(cylinder()),
            lambda propagator, step=step: of_cylinder(
                cylinder_flight(propagator, step, **ONE_STEP.get(propagator, {}))
            ),
        )
    simulators = brick_errors()
    row(
        "tumbling brick, 30 s, steps of 0.1 s; NASA's simulator 01",
        simulators["01"],
        lambda propagator: None if propagator == "split" else brick_flight(propagator),
    )
    print("\n| the brick by NASA's simulator | " + " | ".join(simulators) + " |")
    print("|---|" + "---:|" * len(simulators))
    print(f"| attitude, rad | {cells(simulators.values())} |")
    print("| rates, rad/s | " + " | ".join(f"{error.rates:.1e}" for error in simulators.values()) + " |")


if __name__ == "__main__":
    main()
