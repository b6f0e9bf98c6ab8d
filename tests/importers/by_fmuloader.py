"""fmuloader: the standard's functions one by one, here as a plain master calls them.

Time is summed up, t += h, as many masters do.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from fmpy import extract
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from fmuloader.fmi3 import Fmi3Slave

from importers.flight import Array, Flight, Series, series

SUB_STEPS = 4  # of Runge and Kutta's method: a quarter of a hundredth of a radian or so each


class Slave:
    """An instance of either version by the names of version 3."""

    def __init__(self, flight: Flight) -> None:
        self.flight, described = flight, flight.description
        part = described.modelExchange if flight.exchange else described.coSimulation
        loader = Fmi3Slave if flight.fmi == 3 else Fmi2Slave
        folder = extract(str(flight.fmu), str(flight.folder / "unpacked"))
        self.it: Any = loader(folder, model_identifier=part.modelIdentifier)
        stop = float(flight.times[-1])
        if flight.fmi == 2:
            kind = Fmi2Type.MODEL_EXCHANGE if flight.exchange else Fmi2Type.CO_SIMULATION
            self.it.instantiate("it", kind, guid=described.guid)
            self.it.setup_experiment(0.0, stop)
            self.it.enter_initialization_mode()
        else:
            make = "instantiate_model_exchange" if flight.exchange else "instantiate_co_simulation"
            getattr(self.it, make)("it", instantiation_token=described.guid)
            self.it.enter_initialization_mode(0.0, stop)
        self.set(0, flight.inputs.keys())
        self.it.exit_initialization_mode()

    def set(self, k: int, names: Any) -> None:
        """Sets inputs to what they are at a communication point."""
        flight = self.flight
        reals = [name for name in names if name not in flight.booleans]
        flags = [name for name in names if name in flight.booleans]
        set_reals = self.it.set_float64 if flight.fmi == 3 else self.it.set_real
        for some, setter in ((reals, set_reals), (flags, self.it.set_boolean)):
            if some:
                values: list[Any] = flight.at(k, some)
                setter(
                    [flight.references[name] for name in some], values if some is reals else map_bool(values)
                )

    def read(self) -> list[float]:
        """Returns the outputs that are wanted."""
        get = self.it.get_float64 if self.flight.fmi == 3 else self.it.get_real
        return list(get([self.flight.references[name] for name in self.flight.outputs]))

    def update(self) -> None:
        """Leaves event mode for continuous-time mode."""
        self.it.update_discrete_states() if self.flight.fmi == 3 else self.it.new_discrete_states()
        self.it.enter_continuous_time_mode()

    def rate(self, time: float, state: Array) -> Array:
        """Returns the rates of the states."""
        self.it.set_time(time)
        self.it.set_continuous_states(state.tolist())
        it, count = self.it, len(state)
        found = (
            it.get_continuous_state_derivatives(count) if self.flight.fmi == 3 else it.get_derivatives(count)
        )
        return np.array(found)


def map_bool(values: list[float]) -> list[bool]:
    """Returns numbers as Booleans."""
    return [bool(value) for value in values]


def fly(flight: Flight) -> Series:
    """Flies; in model exchange discrete inputs change in event mode, all others in continuous time."""
    slave, time = Slave(flight), 0.0
    advance = _exchange(slave) if flight.exchange else _co_simulation(slave)
    points = [slave.read()]
    for k in range(len(flight.times) - 1):
        advance(k, time)
        time += flight.step
        points.append(slave.read())
    slave.it.terminate()
    slave.it.free_instance()
    return series(flight.outputs, points)


def _co_simulation(slave: Slave) -> Callable[[int, float], None]:
    def advance(k: int, time: float) -> None:
        slave.set(k, slave.flight.inputs.keys())
        slave.it.do_step(time, slave.flight.step)

    return advance


def _exchange(slave: Slave) -> Callable[[int, float], None]:
    slave.update()
    flight = slave.flight
    steady = [name for name in flight.inputs if name not in flight.discrete]
    known = {name: flight.inputs[name][0] for name in flight.discrete}

    def advance(k: int, time: float) -> None:
        changed = [name for name in known if flight.inputs[name][k] != known[name]]
        slave.set(k, steady)
        if changed:
            slave.it.enter_event_mode()
            slave.set(k, changed)
            known.update({name: flight.inputs[name][k] for name in changed})
            slave.update()
        state = np.array(slave.it.get_continuous_states(flight.description.numberOfContinuousStates))
        h = flight.step / SUB_STEPS
        for _ in range(SUB_STEPS):
            state, time = _runge_kutta(slave, state, time, h), time + h
        slave.it.set_time(time)
        slave.it.set_continuous_states(state.tolist())
        slave.it.completed_integrator_step()

    return advance


def _runge_kutta(slave: Slave, state: Array, time: float, h: float) -> Array:
    """Returns the state after a step of the classical method of order four."""
    a = slave.rate(time, state)
    b = slave.rate(time + h / 2, state + h / 2 * a)
    c = slave.rate(time + h / 2, state + h / 2 * b)
    d = slave.rate(time + h, state + h * c)
    return np.asarray(state + h / 6 * (a + 2 * b + 2 * c + d))
