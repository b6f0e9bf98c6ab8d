"""Engines that carry one rigid body through the same work, each at settings from loose to tight.

A way to fly is a generator: it takes a Work and yields pairs of a setting in words and a function that makes
a flight ready. That returns the flight itself, which is what is timed; a flight returns the attitude (4,) at
its end, scalar first, body to inertial. Engines whose steps are their setting are not asked for one span
alone.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from engines import Array, basilisk_attitude
from ladder import Flight, Settings

MOMENTS = (1.0, 2.0, 3.0)  # kg m2
RATES = (1.0, 2.0, 0.5)  # rad/s
DURATION = 100.0  # s
LONGEST_STEP = 1.0  # s, of Drake's own steps


@dataclass(frozen=True)
class Work:
    """Which torque, (3,) [N m], body axes, acts, and after how many equal spans the state is wanted."""

    torque: tuple[float, float, float]
    spans: int

    @property
    def span(self) -> float:
        """Between two outputs [s]."""
        return DURATION / self.spans


def rate(torque: tuple[float, ...]) -> Callable[[float, Any], list[float]]:
    """Returns Euler's equations and the quaternion's on plain numbers, the fastest way in Python."""
    (a, b, c), (mx, my, mz) = MOMENTS, torque

    def ode(_: float, x: Any) -> list[float]:
        q0, q1, q2, q3, p, q, r = x.tolist() if isinstance(x, np.ndarray) else x
        return [
            -0.5 * (q1 * p + q2 * q + q3 * r),
            0.5 * (q0 * p + q2 * r - q3 * q),
            0.5 * (q0 * q + q3 * p - q1 * r),
            0.5 * (q0 * r + q1 * q - q2 * p),
            (mx - (c - b) * q * r) / a,
            (my - (a - c) * r * p) / b,
            (mz - (b - a) * p * q) / c,
        ]

    return ode


START = [1.0, 0.0, 0.0, 0.0, *RATES]


def tolerances(loosest: float = 1e-7) -> Iterator[float]:
    """Yields tolerances down to 1e-14, two in a decade."""
    yield from (loosest * 10.0 ** (-0.5 * i) for i in range(round(2 * math.log10(loosest / 1e-14)) + 1))


def steps_within(spans: int, fewest: int) -> Iterator[int]:
    """Yields into how many steps to divide a span: first `fewest` in all, doubling with every fourth."""
    least = math.log2(max(1.0, fewest / spans))
    known = set()
    for quarter in count():
        steps = round(2.0 ** (least + quarter / 4.0))
        if steps not in known:
            known.add(steps)
            yield steps


def scipy(method: str) -> Callable[[Work], Settings]:
    """Returns the way of `solve_ivp`."""

    def ways(work: Work) -> Settings:
        solve_ivp = import_module("scipy.integrate").solve_ivp
        ode, times = rate(work.torque), np.linspace(0.0, DURATION, work.spans + 1)[1:]
        for tolerance in tolerances():

            def fly(tolerance: float = tolerance) -> Array:
                done = solve_ivp(
                    ode, (0.0, DURATION), START, method, times, rtol=tolerance, atol=tolerance / 100.0
                )
                return np.array(done.y[:4, -1])

            yield f"rtol {tolerance:.0e}", lambda fly=fly: fly

    return ways


def casadi(name: str) -> Callable[[Work], Settings]:
    """Returns the way of one of CasADi's integrators on an ode written by hand."""

    def ways(work: Work) -> Settings:
        ca = import_module("casadi")
        x, u = ca.SX.sym("x", 7), ca.SX.sym("u", 3)
        q, w, J = x[:4], x[4:], ca.SX(MOMENTS)
        q_dot = 0.5 * ca.vertcat(-ca.dot(q[1:], w), q[0] * w + ca.cross(q[1:], w))
        dae = {"x": x, "u": u, "ode": ca.vertcat(q_dot, (u - ca.cross(w, J * w)) / J)}
        times = np.linspace(0.0, DURATION, work.spans + 1)[1:].tolist()
        if name == "rk":
            options = [
                (f"{n * work.spans} elements", {"number_of_finite_elements": n * work.spans})
                for n, _ in zip(steps_within(work.spans, 20_000), range(16), strict=False)
            ]
        else:
            options = [
                (f"reltol {t:.0e}", {"reltol": t, "abstol": t / 100.0, "max_num_steps": 10**7})
                for t in tolerances(1e-9)
            ]
        for text, option in options:
            flow = ca.integrator("flow", name, dae, 0.0, times, option)

            def fly(flow: Any = flow) -> Array:
                return np.array(flow(x0=START, u=work.torque)["xf"])[:4, -1]

            yield text, lambda fly=fly: fly

    return ways


def mujoco(work: Work) -> Settings:
    """The way of MuJoCo's RK4."""
    mj = import_module("mujoco")
    moments = " ".join(map(str, MOMENTS))
    model = mj.MjModel.from_xml_string(
        '<mujoco><compiler balanceinertia="false"/><option gravity="0 0 0" integrator="RK4"/><worldbody>'
        f'<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{moments}"/></body></worldbody>'
        "</mujoco>"
    )
    for steps in steps_within(work.spans, 16_000) if work.spans > 1 else ():

        def ready(steps: int = steps) -> Flight:
            model.opt.timestep = work.span / steps
            body = mj.MjData(model)
            body.qvel[3:], body.qfrc_applied[3:] = RATES, work.torque
            kept = np.empty((work.spans, 7))

            def fly() -> Array:
                for i in range(work.spans):
                    mj.mj_step(model, body, steps)
                    kept[i, :4], kept[i, 4:] = body.qpos[3:], body.qvel[3:]
                return kept[-1, :4]

            return fly

        yield f"RK4, {steps * work.spans} steps", ready


def drake(scheme: str) -> Callable[[Work], Settings]:
    """Returns the way of one of Drake's integrators with error control."""

    def ways(work: Work) -> Settings:
        d, engines = import_module("pydrake.all"), import_module("engines")
        builder = d.DiagramBuilder()
        plant = builder.AddSystem(d.MultibodyPlant(0.0))
        link = plant.AddRigidBody("body", d.SpatialInertia(1.0, np.zeros(3), d.UnitInertia(*MOMENTS)))
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        plant.Finalize()
        if any(work.torque):
            engines._drake_torque(d, builder, plant, link, np.array(work.torque))
        simulator = d.Simulator(builder.Build())
        for accuracy in tolerances(1e-6):

            def ready(accuracy: float = accuracy) -> Flight:
                context = simulator.get_mutable_context()
                context.SetTime(0.0)
                at = plant.GetMyMutableContextFromRoot(context)
                plant.SetPositions(at, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
                plant.SetVelocities(at, [*RATES, 0.0, 0.0, 0.0])
                d.ResetIntegratorFromFlags(simulator, scheme, min(work.span, LONGEST_STEP))
                simulator.get_mutable_integrator().set_target_accuracy(accuracy)
                simulator.Initialize()
                kept = np.empty((work.spans, 13))

                def fly() -> Array:
                    for i in range(work.spans):
                        simulator.AdvanceTo((i + 1) * work.span)
                        kept[i] = plant.GetPositionsAndVelocities(at)
                    return kept[-1, :4]

                return fly

            yield f"{scheme}, accuracy {accuracy:.0e}", ready

    return ways


def basilisk(integrator: str | None) -> Callable[[Work], Settings]:
    """Returns the way of Basilisk's Spacecraft: RK4, or an integrator that may divide its steps further."""

    def ways(work: Work) -> Settings:
        for steps in steps_within(work.spans, 1000 if integrator else 16_000) if work.spans > 1 else ():
            step = math.floor(work.span / steps * 1e9) / 1e9  # time is kept in whole nanoseconds
            if math.isclose(step * steps, work.span, rel_tol=1e-15):
                yield f"{steps * work.spans} steps", lambda h=step: _basilisk(work, h, integrator)

    return ways


def _basilisk(work: Work, step: float, integrator: str | None) -> Flight:
    """Returns a flight that is ready; each span's end is recorded."""
    base = import_module("Basilisk.utilities.SimulationBaseClass")
    craft = import_module("Basilisk.simulation.spacecraft").Spacecraft()
    simulation = base.SimBaseClass()
    nano = round(step * 1e9)
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", nano))
    if integrator:
        made = getattr(import_module("Basilisk.simulation.svIntegrators"), integrator)(craft)
        made.relTol, made.absTol = 1e-12, 1e-14
        craft.setIntegrator(made)
    craft.hub.mHub = 1.0
    craft.hub.r_BcB_B = [[0.0]] * 3
    craft.hub.IHubPntBc_B = np.diag(MOMENTS).tolist()
    craft.hub.sigma_BNInit = [[0.0]] * 3
    craft.hub.omega_BN_BInit = [[x] for x in RATES]
    push = import_module("Basilisk.simulation.extForceTorque").ExtForceTorque()
    push.extTorquePntB_B = [[x] for x in work.torque]
    craft.addDynamicEffector(push)
    simulation.AddModelToTask("task", craft)
    simulation.AddModelToTask("task", push)
    recorder = craft.scStateOutMsg.recorder(round(work.span * 1e9))
    simulation.AddModelToTask("task", recorder)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(round(DURATION * 1e9))

    def fly() -> Array:
        simulation.ExecuteSimulation()
        return basilisk_attitude(craft)

    return fly


def pinocchio(work: Work) -> Settings:
    """SciPy's DOP853 on the acceleration that Pinocchio's `aba` gives; it has no integrator of its own."""
    pin, solve_ivp = import_module("pinocchio"), import_module("scipy.integrate").solve_ivp
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag(MOMENTS)), pin.SE3.Identity())
    model.gravity.setZero()
    data, aba, kinematics = model.createData(), pin.aba, rate(work.torque)
    place, speed, force = np.array([0.0] * 6 + [1.0]), np.zeros(6), np.array([0.0] * 3 + [*work.torque])
    times = np.linspace(0.0, DURATION, work.spans + 1)[1:]

    def ode(t: float, x: Array) -> list[float]:
        place[3:6], place[6], speed[3:] = x[1:4], x[0], x[4:]
        place[3:] /= math.sqrt(x[:4] @ x[:4])
        return [*kinematics(t, x)[:4], *aba(model, data, place, speed, force)[3:].tolist()]

    for tolerance in tolerances():

        def fly(tolerance: float = tolerance) -> Array:
            done = solve_ivp(
                ode, (0.0, DURATION), START, "DOP853", times, rtol=tolerance, atol=tolerance / 100.0
            )
            return np.array(done.y[:4, -1])

        yield f"rtol {tolerance:.0e}", lambda fly=fly: fly


PYTHON_FMU = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

MOMENTS = {moments}


class PythonBody(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        for name, start in zip(("q0", "q1", "q2", "q3", "w1", "w2", "w3"), {start}):
            setattr(self, name, start)
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        for name in ("m1", "m2", "m3"):
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.input))

    def rate(self, x):
        (a, b, c), (q0, q1, q2, q3, p, q, r) = MOMENTS, x
        return (
            -0.5 * (q1 * p + q2 * q + q3 * r), 0.5 * (q0 * p + q2 * r - q3 * q),
            0.5 * (q0 * q + q3 * p - q1 * r), 0.5 * (q0 * r + q1 * q - q2 * p),
            (self.m1 - (c - b) * q * r) / a, (self.m2 - (a - c) * r * p) / b, (self.m3 - (b - a) * p * q) / c,
        )

    def do_step(self, current_time, h):
        x = (self.q0, self.q1, self.q2, self.q3, self.w1, self.w2, self.w3)
        k1 = self.rate(x)
        k2 = self.rate([v + 0.5 * h * k for v, k in zip(x, k1)])
        k3 = self.rate([v + 0.5 * h * k for v, k in zip(x, k2)])
        k4 = self.rate([v + h * k for v, k in zip(x, k3)])
        s = h / 6.0
        self.q0, self.q1, self.q2, self.q3, self.w1, self.w2, self.w3 = (
            v + s * (a + 2.0 * (b + c) + d) for v, a, b, c, d in zip(x, k1, k2, k3, k4)
        )
        return True
"""
"""An FMU's script whose doStep is one step of RK4 in plain Python."""


def python_fmu(folder: Path) -> Callable[[Work], Settings]:
    """Returns the way of an FMU in Python, flown by FMPy, outputs got after each step."""

    def ways(work: Work) -> Settings:
        fmpy, fmi2 = import_module("fmpy"), import_module("fmpy.fmi2")
        script = folder / "pythonbody.py"
        script.write_text(PYTHON_FMU.format(moments=MOMENTS, start=START))
        fmu = import_module("pythonfmu.builder").FmuBuilder.build_FMU(script, dest=folder)
        unpacked, description = fmpy.extract(str(fmu)), fmpy.read_model_description(str(fmu))
        references = {v.name: v.valueReference for v in description.modelVariables}
        shown = [references[name] for name in ("q0", "q1", "q2", "q3", "w1", "w2", "w3")]
        for steps in steps_within(work.spans, 16_000) if work.spans > 1 else ():

            def ready(steps: int = steps) -> Flight:
                body = fmi2.FMU2Slave(
                    guid=description.guid,
                    unzipDirectory=unpacked,
                    modelIdentifier=description.coSimulation.modelIdentifier,
                    instanceName="body",
                )
                body.instantiate()
                body.setupExperiment(startTime=0.0)
                body.enterInitializationMode()
                body.exitInitializationMode()
                body.setReal([references[name] for name in ("m1", "m2", "m3")], work.torque)
                step = work.span / steps

                def fly() -> Array:
                    for i in range(steps * work.spans):
                        body.doStep(i * step, step)
                        x = body.getReal(shown)
                    return np.array(x[:4])

                return fly

            yield f"{steps * work.spans} steps", ready

    return ways
