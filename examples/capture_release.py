"""A tug captures a satellite that tumbles, stops it, pushes it on and lets it go: the books of both momenta.

Three models run side by side. The FMU of capture_release.toml turns the tug and what is docked to it; this
script moves barycentres around the Earth by two-body motion and the engine's force; a controller turns the
tug by its gyroscopes. The satellite has an FMU of its own until it is captured, and another one after its
release, started from what the tug's FMU tells of it. Prints what is missing in the sums of linear and angular
momentum of everything, burnt propellant included, over each event and over the whole flight; draws
capture_release.png. Argument: a folder (default: build).
"""

import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import matplotlib
import numpy as np
from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu

from fmu_build import build_fmu
from supervessel import Scene, load_scene, parse_scene, reference

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Array = np.ndarray

EXAMPLES = Path(__file__).parent
MU, RADIUS = 3.986004418e14, 6778e3  # m3/s2; m, of the circular orbit that places are given from
RATE = np.sqrt(MU / RADIUS**3)
STEP, BURN, RELEASE, END = 0.1, (120.0, 150.0), 180.0, 240.0  # s
THRUST, EXHAUST = 400.0, 3000.0  # N, along the tug's z; m/s, at which the engine blows out what it burns
BANDWIDTH = 0.15  # rad/s, of the controller, which turns the tug to the inertial axes
TUMBLE, APPROACH = [0.03, -0.02, 0.04], [0.01, 0.0, -0.05]  # rad/s, satellite's axes; m/s, the tug's
WHEELS = ["tug.x", "tug.y", "tug.z"]


class Flown:
    """An FMU (FMI 3, co-simulation) that is stepped; inputs and outputs by name, vectors whole."""

    def __init__(self, path: Path, start: Mapping[str, Any], time: float = 0.0) -> None:
        description = read_model_description(str(path))
        self.folder = extract(str(path))
        self.instance = instantiate_fmu(self.folder, description, "CoSimulation")
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.sizes: dict[str, int] = {}
        for name in self.references:
            group = name.partition("[")[0]
            self.sizes[group] = self.sizes.get(group, 0) + 1
        self.instance.enterInitializationMode(startTime=time)
        self.set(start)
        self.instance.exitInitializationMode()

    def _places(self, name: str) -> list[int]:
        names = (
            [name] if name in self.references else [n for n in self.references if n.startswith(f"{name}[")]
        )
        return [self.references[n] for n in names]

    def set(self, values: Mapping[str, Any]) -> None:
        """Sets inputs and parameters."""
        for name, value in values.items():
            if isinstance(value, bool):
                self.instance.setBoolean(self._places(name), [value])
            else:
                self.instance.setFloat64(self._places(name), np.ravel(value).tolist())

    def get(self, name: str) -> Array:
        """Returns an output, a vector or a single number as a vector."""
        return np.array(self.instance.getFloat64(self._places(name)))

    def step(self, time: float) -> None:
        """Goes on by STEP."""
        self.instance.doStep(time, STEP)

    def free(self) -> None:
        """Ends the FMU."""
        self.instance.freeInstance()
        rmtree(self.folder, ignore_errors=True)


@dataclass
class Orbit:
    """A barycentre in free fall around the Earth.

    x, v : place [m] and velocity [m/s], (3,), relative to a point on a circular orbit, inertial axes
    """

    x: Array
    v: Array

    def fall(self, time: float) -> Array:
        """Goes on by STEP, by classical Runge-Kutta.

        Returns the linear and angular momentum that gravity gives, over the mass, (2, 3).
        """

        def rate(t: float, y: Array) -> Array:
            a = attraction(t, y[0])
            return np.array([y[1], a, a, np.cross(y[0], a)])

        y = np.array([self.x, self.v, np.zeros(3), np.zeros(3)])
        k1 = rate(time, y)
        k2 = rate(time + STEP / 2.0, y + STEP / 2.0 * k1)
        k3 = rate(time + STEP / 2.0, y + STEP / 2.0 * k2)
        k4 = rate(time + STEP, y + STEP * k3)
        self.x, self.v, *given = y + STEP / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return np.array(given)


def attraction(time: float, x: Array) -> Array:
    """Returns how much more than the point on its orbit gravity accelerates what is at x from it, [m/s2]."""
    point = RADIUS * np.array([np.cos(RATE * time), np.sin(RATE * time), 0.0])
    place = point + x
    # 1/|place|^3 - 1/|point|^3 without the difference of large numbers
    q = x @ (x + 2.0 * point) / RADIUS**2
    lack = -q * (3.0 + q * (3.0 + q)) / (1.0 + (1.0 + q) ** 1.5) / (1.0 + q) ** 1.5
    return -MU / RADIUS**3 * (x + lack * place)


def momenta(mass: float, x: Array, v: Array, spin: Array) -> Array:
    """Returns linear [N s] and angular momentum [N m s], (2, 3), about the point on the orbit, inertial axes.

    spin : angular momentum about the body's own barycentre, (3,) [N m s]
    """
    return np.array([mass * v, mass * np.cross(x, v) + spin])


@dataclass
class Vessel:
    """An FMU with its orbit."""

    fmu: Flown
    orbit: Orbit

    @property
    def momenta(self) -> Array:
        """Linear and angular momentum, (2, 3)."""
        spin = self.fmu.get("angular_momentum")
        return momenta(self.fmu.get("mass")[0], self.orbit.x, self.orbit.v, spin)

    @property
    def rotation(self) -> Array:
        """R_inertial_body, (3, 3)."""
        return reference.rotation_matrix(self.fmu.get("attitude"))

    def jump(self) -> None:
        """Takes the barycentre to where the change of inputs has brought it."""
        self.orbit.x = self.orbit.x + self.fmu.get("barycentre_jump")
        self.orbit.v = self.orbit.v + self.fmu.get("barycentre_velocity_jump")

    def push(self, arm: Array, force: Array, side: float) -> Array:
        """Gives half of the impulse that a force [N] has in a step, at a place from the barycentre [m].

        arm, force : (3,), body axes
        side       : 1 at the step's beginning, -1 at its end
        The force turns with the body meanwhile: Hermite's rule, of fourth order in the step.
        Returns the momenta given, (2, 3). What turns the body the FMU does itself.
        """
        R, rate = self.rotation, self.fmu.get("angular_velocity")

        def half(vector: Array) -> Array:
            return R @ (STEP / 2.0 * vector + side * STEP**2 / 12.0 * np.cross(rate, vector))

        impulse = half(force)
        self.orbit.v = self.orbit.v + impulse / self.fmu.get("mass")[0]
        return np.array([impulse, np.cross(self.orbit.x, impulse) + half(np.cross(arm, force))])

    def go_on(self, time: float, arm: Array, force: Array) -> Array:
        """Goes on by STEP; returns the momenta that gravity and the force give, (2, 3)."""
        mass, given = self.fmu.get("mass")[0], self.push(arm, force, 1.0)
        given += mass * self.orbit.fall(time)
        self.fmu.step(time)
        return given + self.push(arm, force, -1.0)


def approaching(scene: Scene, path: Path) -> tuple[Vessel, dict[str, Any]]:
    """Returns the satellite as its ring touches the tug's arm, and the inputs that dock it.

    The tug's barycentre is at the point on the orbit then, and at rest; its axes are the inertial ones.
    """
    R_tug_satellite, origin = reference.poses(scene, {"berth.docked": 1.0})["satellite"]
    place = origin + R_tug_satellite @ scene.vessels["satellite"].centre_of_mass
    rate = R_tug_satellite @ TUMBLE
    velocity = APPROACH + np.cross(rate, place - scene.port("tug.arm").position)
    start = {"attitude_start": reference.quaternion(R_tug_satellite), "angular_velocity_start": TUMBLE}
    motion = {"berth.velocity": APPROACH, "berth.rate": rate}
    return Vessel(Flown(path, start), Orbit(place, velocity)), {"berth.docked": True, **motion}


def released(tug: Vessel, path: Path, time: float) -> Vessel:
    """Returns the satellite in an FMU of its own as the tug lets it go; the tug's barycentre has jumped."""
    R, fmu = tug.rotation, tug.fmu
    R_body_satellite = reference.rotation_matrix(fmu.get("satellite.attitude"))
    start = {
        "attitude_start": reference.quaternion(R @ R_body_satellite),
        "angular_velocity_start": fmu.get("satellite.angular_velocity"),
    }
    place = tug.orbit.x + R @ fmu.get("satellite.centre_of_mass")
    return Vessel(Flown(path, start, time), Orbit(place, tug.orbit.v + fmu.get("satellite.velocity")))


def control(fmu: Flown) -> dict[str, float]:
    """Returns the torques of the gyroscopes, whose opposites turn the body to the inertial axes."""
    attitude, rate, J = fmu.get("attitude"), fmu.get("angular_velocity"), fmu.get("inertia").reshape(3, 3)
    off = 2.0 * attitude[1:] * np.sign(attitude[0])
    torque = J @ (BANDWIDTH**2 * off + 2.0 * BANDWIDTH * rate)
    return {f"{wheel}.torque": u for wheel, u in zip(WHEELS, torque, strict=True)}


def burn(scene: Scene, tug: Vessel) -> Array:
    """Takes the propellant of a step off the tug, the satellite being docked.

    Returns the momenta that the propellant takes along, with a minus, (2, 3): it leaves as it moves in the
    tug, and what the engine does to it is the thrust.
    """
    fmu, R = tug.fmu, tug.rotation
    lost, mass = THRUST / EXHAUST * STEP, fmu.get("mass")[0]
    place, velocity = tug.orbit.x + R @ fmu.get("tug.centre_of_mass"), tug.orbit.v + fmu.get("tug.velocity")
    spin = R @ (lost * np.array(scene.vessels["tug"].pmi) * fmu.get("angular_velocity"))
    fmu.set({"tug.mass": mass - scene.vessels["satellite"].mass - lost})
    tug.jump()
    return -momenta(mass - fmu.get("mass")[0], place, velocity, spin)


@dataclass
class Flight:
    """What was flown, and what is missing in the books of linear [N s] and angular momentum [N m s].

    times   : [s], (n,)
    rates   : of tug and satellite [rad/s], NaN while that is docked, (n, 2, 3)
    missing : lengths, (n, 2)
    events  : by name, time [s], jumps of place [m] and velocity [m/s], and what is missing after it, (2,)
    size    : of all momenta that have been booked, (2,)
    """

    times: list[float] = field(default_factory=list)
    rates: list[Array] = field(default_factory=list)
    missing: list[Array] = field(default_factory=list)
    events: dict[str, tuple[float, float, float, Array]] = field(default_factory=dict)
    size: Array = field(default_factory=lambda: np.zeros(2))


class Books:
    """Momenta of all bodies against those at the start and what has been given since, (2, 3)."""

    def __init__(self, flight: Flight, bodies: list[Vessel]) -> None:
        self.flight, self.start = flight, sum(body.momenta for body in bodies)
        self.given, self.moved = np.zeros((2, 3)), np.linalg.norm(self.start, axis=1)

    def give(self, given: Array) -> None:
        """Adds what bodies are given, or what leaves them, with a minus."""
        self.given, self.moved = self.given + given, self.moved + np.linalg.norm(given, axis=1)

    def missing(self, bodies: list[Vessel]) -> Array:
        """Returns what is missing, lengths, (2,)."""
        self.flight.size = self.moved
        return np.linalg.norm(sum(body.momenta for body in bodies) - self.start - self.given, axis=1)

    def note(self, name: str, time: float, bodies: list[Vessel], before: Orbit) -> None:
        """Notes an event; the first body's orbit was another one before it."""
        after = bodies[0].orbit
        jumps = (float(np.linalg.norm(a - b)) for a, b in ((after.x, before.x), (after.v, before.v)))
        self.flight.events[name] = (time, *jumps, self.missing(bodies))


def fly(scene: Scene, tug_fmu: Path, satellite_fmu: Path) -> Flight:
    """Returns the flight from the capture on."""
    flight, tug = Flight(), Vessel(Flown(tug_fmu, {}), Orbit(np.zeros(3), np.zeros(3)))
    satellite, docking = approaching(scene, satellite_fmu)
    books, bodies = Books(flight, [tug, satellite]), [tug]
    satellite.fmu.free()
    engine = np.array(scene.point("tug.engine").position)
    for number in range(round(END / STEP)):
        time, before = number * STEP, replace(tug.orbit)
        burns = BURN[0] <= time + STEP / 2.0 < BURN[1]
        if number == 0:
            tug.fmu.set(docking)
            tug.jump()
            books.note("capture", time, bodies, before)
        if number == round(RELEASE / STEP):
            tug.fmu.set({"berth.docked": False})
            tug.jump()
            bodies.append(released(tug, satellite_fmu, time))
            books.note("release", time, bodies, before)
        if burns:
            books.give(burn(scene, tug))
            books.note("last instant of the burn", time, bodies, before)
        force = np.array([0.0, 0.0, THRUST if burns else 0.0])
        tug.fmu.set({"tug.engine.force": force, **control(tug.fmu)})
        arm = engine - tug.fmu.get("barycentre")
        books.give(tug.go_on(time, arm, force))
        for body in bodies[1:]:
            books.give(body.go_on(time, arm, 0.0 * force))
        flight.times.append(time + STEP)
        rates = [body.fmu.get("angular_velocity") for body in bodies]
        flight.rates.append(np.array([*rates, np.full(3, np.nan)][:2]))
        flight.missing.append(books.missing(bodies))
    for body in bodies:
        body.fmu.free()
    return flight


def alone(scene: Mapping[str, Any]) -> Scene:
    """Returns the satellite of a scene, given as its file's tables, as a scene of its own."""
    return parse_scene(
        {
            "name": "satellite",
            "root": "satellite",
            "vessels": {"satellite": scene["vessels"]["satellite"]},
            "rotation": {key: scene["rotation"][key] for key in ("propagator", "tolerance")},
            "outputs": {"names": ["mass", "attitude", "angular_velocity", "angular_momentum"]},
        }
    )


def draw(flight: Flight, path: Path) -> None:
    """Draws rates and what is missing in the books."""
    figure, panels = plt.subplots(3, 1, figsize=(8.0, 6.5), sharex=True, layout="constrained")
    rates = np.degrees(np.array(flight.rates))
    for panel, number, name in ((panels[0], 0, "tug"), (panels[1], 1, "satellite, released")):
        panel.plot(flight.times, rates[:, number], label=list("xyz"))
        panel.set(ylabel=f"{name} [deg/s]")
        panel.axvspan(*BURN, color="0.9")
        panel.grid(alpha=0.3)
    panels[0].legend()
    panels[2].semilogy(
        flight.times, np.maximum(flight.missing, 1e-16), label=["linear [N s]", "angular [N m s]"]
    )
    panels[2].set(xlabel="time [s]", ylabel="missing in the books")
    panels[2].legend()
    panels[2].grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def table(flight: Flight) -> str:
    """Returns the events and what is missing in the books after each, as a Markdown table."""
    lines = [
        "| | time [s] | barycentre jumps [m] | its velocity [m/s] | missing [N s] | missing [N m s] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, (time, jump, velocity, missing) in sorted(flight.events.items(), key=lambda event: event[1][0]):
        lines.append(
            f"| {name} | {time:.1f} | {jump:.6f} | {velocity:.6f} | {missing[0]:.0e} | {missing[1]:.0e} |"
        )
    last, size = flight.missing[-1], flight.size
    lines.append(f"| the end | {flight.times[-1]:.1f} | | | {last[0]:.0e} | {last[1]:.0e} |")
    lines.append(f"| booked in all | | | | {size[0]:.0f} | {size[1]:.0f} |")
    return "\n".join(lines)


def main(folder: Path) -> None:
    """Builds both FMUs, flies, draws, prints the table."""
    path = EXAMPLES / "capture_release.toml"
    scene, own = load_scene(path), alone(tomllib.loads(path.read_text()))
    tug, satellite = (build_fmu(each, folder / f"{each.name}.fmu") for each in (scene, own))
    flight = fly(scene, tug, satellite)
    draw(flight, folder / "capture_release.png")
    print(table(flight))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "build")
