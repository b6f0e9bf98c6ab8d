"""Engines, each set up as its users would: a free rigid body, its rotation from a start to an end.

Each function takes a Body and returns the attitude (4,), scalar first, body to inertial; `InsteadError` tells
what the engine did instead. Engines are imported when they are asked: none need be there.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class InsteadError(Exception):
    """What an engine does instead of giving an attitude, in words."""


@dataclass(frozen=True)
class Body:
    """What is flown; see `stability.truth.Case` for frames.

    moments        : (3,) [kg m2], along the body axes
    attitude       : (4,), unit to rounding
    omega, torque  : (3,), (3,) [rad/s], [N m], body axes
    time, steps    : span [s] and the number of equal steps for engines that step
    """

    moments: list[float]
    attitude: list[float]
    omega: list[float]
    torque: list[float]
    time: float
    steps: int

    @property
    def step(self) -> float:
        """One step [s]."""
        return self.time / self.steps


@dataclass(frozen=True)
class Setting:
    """An engine as it is set: a column of the table.

    package : as pip knows it
    text    : what is set, for the reader of the table
    """

    label: str
    package: str
    text: str
    fly: Callable[[Body], Array]


def ours(propagator: str, tolerance: float) -> Callable[[Body], Array]:
    """Returns the flight of an FMU of this project, one communication step."""

    def fly(body: Body) -> Array:
        support = import_module("support")
        it = support.Instance(our_scene(propagator, tolerance), optimised=True)
        status = it.initialise(
            **{
                "B.pmi": body.moments,
                "attitude_start": body.attitude,
                "angular_velocity_start": body.omega,
                "torque": body.torque,
            }
        )
        if status != support.OK or it.step(body.time) != support.OK:
            raise InsteadError("refused:" + it.messages()[-1].split(":", 1)[-1])
        return np.array(it.get("attitude"))

    return fly


def our_scene(propagator: str, tolerance: float) -> dict[str, Any]:
    """Returns the raw scene of a body of 1 kg whose moments are inputs."""
    flights, support = import_module("stability.flights"), import_module("support")
    raw = support.variant(flights.any_diagonal(propagator), {"rotation.tolerance": tolerance})
    return dict(raw)


def scipy_dop853(body: Body) -> Array:
    """Euler's equations and the quaternion's, relative tolerance 1e-10."""
    solve_ivp = import_module("scipy.integrate").solve_ivp
    moments, torque = np.array(body.moments), np.array(body.torque)

    def rate(_: float, x: Array) -> Array:
        q, w = x[:4], x[4:]
        q_dot = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
        return np.concatenate([q_dot, (torque - np.cross(w, moments * w)) / moments])

    start = [*body.attitude, *body.omega]
    done = solve_ivp(rate, (0.0, body.time), start, method="DOP853", rtol=1e-10, atol=1e-12)
    if not done.success:
        raise InsteadError("refused: " + done.message)
    return np.array(done.y[:4, -1])


def mujoco(integrator: str) -> Callable[[Body], Array]:
    """Returns the flight of a free joint; its angular velocity and torque are in body axes."""

    def fly(body: Body) -> Array:
        mj = import_module("mujoco")
        moments = " ".join(map(repr, body.moments))
        try:
            model = mj.MjModel.from_xml_string(
                f"""<mujoco><compiler balanceinertia="false"/>
                <option gravity="0 0 0" integrator="{integrator}"/>
                <worldbody><body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{moments}"/></body>
                </worldbody></mujoco>"""
            )
        except ValueError as error:
            raise InsteadError(
                "refused: " + str(error).removeprefix("Error: ").split("\n")[0].split(";")[0]
            ) from error
        model.opt.timestep = body.step
        data = mj.MjData(model)
        data.qpos[3:], data.qvel[3:], data.qfrc_applied[3:] = body.attitude, body.omega, body.torque
        mj.mj_step(model, data, nstep=body.steps)
        for name, what in (("BADQPOS", "attitude"), ("BADQVEL", "rate"), ("BADQACC", "acceleration")):
            if data.warning[getattr(mj.mjtWarning, f"mjWARN_{name}")].number:
                raise InsteadError(f"set back to the start with a warning: {what} unstable")
        return np.array(data.qpos[3:])

    return fly


def drake(scheme: str | None, accuracy: float | None = None) -> Callable[[Body], Array]:
    """Returns the flight of a MultibodyPlant.

    Without a scheme it is discrete; without an accuracy the Simulator is used as it comes.
    Where an accuracy is set, the longest step is raised to a hundred of the row's. The floating joint's rate
    is in world axes; the torque comes from a Propeller, which turns with the body.
    """

    def fly(body: Body) -> Array:
        d = import_module("pydrake.all")
        builder = d.DiagramBuilder()
        plant = builder.AddSystem(d.MultibodyPlant(0.0 if scheme else body.step))
        try:
            inertia = d.SpatialInertia(1.0, np.zeros(3), d.UnitInertia(*body.moments))
            link = plant.AddRigidBody("body", inertia)
        except RuntimeError as error:
            raise InsteadError(
                "refused: " + str(error).split("\n")[0].removeprefix("Spatial inertia ")
            ) from error
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        plant.Finalize()
        if any(body.torque):
            _drake_torque(d, builder, plant, link, np.array(body.torque))
        simulator = d.Simulator(builder.Build())
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        q = np.array(body.attitude)
        turn = d.RotationMatrix(d.Quaternion(q / np.linalg.norm(q)))
        plant.SetPositions(context, [*(q / np.linalg.norm(q)), 0.0, 0.0, 0.0])
        plant.SetVelocities(context, [*turn.multiply(np.array(body.omega)), 0.0, 0.0, 0.0])
        if scheme and accuracy:
            d.ResetIntegratorFromFlags(simulator, scheme, min(body.time, 100.0 * body.step))
            simulator.get_mutable_integrator().set_target_accuracy(accuracy)
        try:
            # the discrete update at the start of a step makes the state at its end
            simulator.AdvanceTo(body.time if scheme else (body.steps - 0.5) * body.step)
        except RuntimeError as error:
            raise InsteadError(f"refused: {error}") from error
        return np.array(plant.GetPositions(context)[:4])

    return fly


def _drake_torque(d: Any, builder: Any, plant: Any, link: Any, torque: Array) -> None:
    """Connects a torque (3,) [N m] that is constant in body axes."""
    size = float(np.linalg.norm(torque))
    frame = d.RigidTransform(d.RotationMatrix.MakeFromOneVector(torque / size, 2), np.zeros(3))
    info = d.PropellerInfo(link.index(), frame, thrust_ratio=0.0, moment_ratio=1.0)
    propeller = builder.AddSystem(d.Propeller([info]))
    source = builder.AddSystem(d.ConstantVectorSource([size]))
    builder.Connect(source.get_output_port(), propeller.get_command_input_port())
    builder.Connect(plant.get_body_poses_output_port(), propeller.get_body_poses_input_port())
    builder.Connect(propeller.get_spatial_forces_output_port(), plant.get_applied_spatial_force_input_port())


def basilisk(integrator: str | None, tolerance: float | None = None) -> Callable[[Body], Array]:
    """Returns the flight of a Spacecraft; attitude by modified Rodrigues parameters, time in nanoseconds."""

    def fly(body: Body) -> Array:
        nano = round(body.step * 1e9)
        if not math.isclose(nano * body.steps, body.time * 1e9, rel_tol=1e-12):
            raise InsteadError("cannot: time is kept in whole nanoseconds")
        base = import_module("Basilisk.utilities.SimulationBaseClass")
        craft = import_module("Basilisk.simulation.spacecraft").Spacecraft()
        simulation = base.SimBaseClass()
        simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", nano))
        if integrator:
            made = getattr(import_module("Basilisk.simulation.svIntegrators"), integrator)(craft)
            if tolerance:
                made.relTol, made.absTol = tolerance, tolerance / 100.0
            craft.setIntegrator(made)
        craft.hub.mHub = 1.0
        craft.hub.r_BcB_B = [[0.0]] * 3
        craft.hub.IHubPntBc_B = np.diag(body.moments).tolist()
        w, *v = math.copysign(1.0, body.attitude[0]) * np.array(body.attitude)
        craft.hub.sigma_BNInit = [[x / (1.0 + w)] for x in v]
        craft.hub.omega_BN_BInit = [[x] for x in body.omega]
        push = import_module("Basilisk.simulation.extForceTorque").ExtForceTorque()
        push.extTorquePntB_B = [[x] for x in body.torque]
        craft.addDynamicEffector(push)
        simulation.AddModelToTask("task", craft)
        simulation.AddModelToTask("task", push)
        try:
            simulation.InitializeSimulation()
        except Exception as error:
            raise InsteadError(f"refused: {error}") from error
        simulation.ConfigureStopTime(nano * body.steps)
        simulation.ExecuteSimulation()
        return basilisk_attitude(craft)

    return fly


def basilisk_attitude(craft: Any) -> Array:
    """Returns the attitude, (4,), of a Basilisk Spacecraft, which has modified Rodrigues parameters."""
    sigma = np.array(craft.scStateOutMsg.read().sigma_BN)
    square = sigma @ sigma
    return np.array([1.0 - square, *(2.0 * sigma)] / (1.0 + square))


OURS = {"exact": 1e-9, "auto": 1e-9, "taylor": 1e-15}
"""Propagators of this project with their tolerances."""

SETTINGS = [
    *(
        Setting(
            name,
            "supervessel",
            f"FMU, one communication step, tolerance {tolerance:g}",
            ours(name, tolerance),
        )
        for name, tolerance in OURS.items()
    ),
    Setting("DOP853", "scipy", "solve_ivp, rtol 1e-10, atol 1e-12, its own steps", scipy_dop853),
    Setting("Euler", "mujoco", "the default; steps of the row", mujoco("Euler")),
    Setting("implicit", "mujoco", "steps of the row", mujoco("implicit")),
    Setting("RK4", "mujoco", "steps of the row", mujoco("RK4")),
    Setting("discrete", "drake", "MultibodyPlant with time_step, steps of the row", drake(None)),
    Setting(
        "RK3",
        "drake",
        "continuous, the Simulator as it comes: accuracy 1e-4, steps up to 0.1 s",
        drake("default"),
    ),
    Setting(
        "RK3 1e-10",
        "drake",
        "accuracy 1e-10, its own steps up to 100 of the row",
        drake("runge_kutta3", 1e-10),
    ),
    Setting(
        "RK5 1e-10",
        "drake",
        "accuracy 1e-10, its own steps up to 100 of the row",
        drake("runge_kutta5", 1e-10),
    ),
    Setting("RK4", "bsk", "the default; steps of the row", basilisk(None)),
    Setting(
        "RKF78",
        "bsk",
        "as it comes: relTol 1e-4, absTol 1e-8, within each step of the row",
        basilisk("svIntegratorRKF78"),
    ),
    Setting(
        "RKF78 1e-10",
        "bsk",
        "relTol 1e-10, absTol 1e-12, within each step of the row",
        basilisk("svIntegratorRKF78", 1e-10),
    ),
]
