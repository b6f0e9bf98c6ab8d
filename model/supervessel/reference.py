"""The model in numpy, written for reading: a second opinion that shares no code with the symbolic one.

The composite is summed point by point as the technical note does, six points a vessel, products
included. Everything takes and returns plain arrays in SI units; `values` overrides inputs by the names
that the FMU gives them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Composite:
    """Mass distribution of an assembly.

    mass       : [kg]
    barycentre : (3,) [m], root vessel's axes, from its origin
    inertia    : (3, 3) [kg m2], about the barycentre, root vessel's axes
    """

    mass: float
    barycentre: Array
    inertia: Array

    @property
    def pmi(self) -> Array:
        """Mass-normalised moments, (3,) [m2]: the diagonal of the inertia tensor over mass."""
        return np.diag(self.inertia) / self.mass


def sample_points(pmi: ArrayLike, convention: str = "rigid_body") -> Array:
    """Returns the six points, (6, 3) [m], whose equal masses have the given moments.

    pmi : (3,) [m2], mass-normalised moments along the axes
    A square that is negative within rounding (a rod or a plate on the triangle's edge) counts as zero; by the
    convention "orbiter" the absolute value of any square is taken.
    Source: [CV] eqs. (3-7), (12).
    """
    k1, k2, k3 = np.asarray(pmi, dtype=float)
    squares = 1.5 * np.array([k2 + k3 - k1, k3 + k1 - k2, k1 + k2 - k3])
    half = np.diag(np.sqrt(np.abs(squares) if convention == "orbiter" else np.maximum(squares, 0.0)))
    return np.vstack([half, -half])


def port_axes(direction: ArrayLike, alignment: ArrayLike) -> Array:
    """Returns the orthonormal columns (d, a, d x a), (3, 3), of a port, vessel axes.

    direction : (3,), kept but for its length
    alignment : (3,), projected onto the plane across direction
    Both of any length > 0, not parallel (not checked).
    """
    d = np.asarray(direction, dtype=float)
    a = np.asarray(alignment, dtype=float)
    d, a = d / np.abs(d).max(), a / np.abs(a).max()
    d = d / np.linalg.norm(d)
    b = np.cross(d, a)
    b = b / np.linalg.norm(b)
    return np.column_stack([d, np.cross(b, d), b])


def poses(scene: Scene, values: Mapping[str, float] | None = None) -> dict[str, tuple[Array, Array]]:
    """Returns for each vessel its rotation R_root_vessel, (3, 3), and its origin, (3,) [m], root axes.

    Ports are mated face to face with their alignments together: R d_B = -d_A, R a_B = a_A.
    Source: [CV] eqs. (8), (9).
    """
    placed = {scene.root: (np.eye(3), np.zeros(3))}
    while len(placed) < len(scene.vessels):
        for dock in scene.docks:
            for here, there in (dock.ports, dock.ports[::-1]):
                parent, child = here.partition(".")[0], there.partition(".")[0]
                if parent in placed and child not in placed:
                    R_root_parent, origin = placed[parent]
                    position_here, axes_here = _port(scene, here, values)
                    position_there, axes_there = _port(scene, there, values)
                    facing = axes_here * [-1.0, 1.0, -1.0]
                    R_root_child = R_root_parent @ facing @ axes_there.T
                    face = origin + R_root_parent @ position_here
                    placed[child] = (R_root_child, face - R_root_child @ position_there)
    return placed


def _port(scene: Scene, name: str, values: Mapping[str, float] | None) -> tuple[Array, Array]:
    """Returns position, (3,) [m], and axes, (3, 3), of a port in its vessel's axes."""
    port = scene.port(name)
    position = _override(f"{name}.position", port.position, values)
    direction = _override(f"{name}.direction", port.direction, values)
    return position, port_axes(direction, _override(f"{name}.alignment", port.alignment, values))


def _override(group: str, start: ArrayLike, values: Mapping[str, float] | None) -> Array:
    vector = np.array(start, dtype=float)
    for i in range(3):
        vector[i] = (values or {}).get(f"{group}[{i + 1}]", vector[i])
    return vector


def composite(scene: Scene, values: Mapping[str, float] | None = None) -> Composite:
    """Returns the mass distribution of a scene, summed over six points a vessel.

    values : inputs by the FMU's names that differ from the scene's, `{"DG.mass": 12000.0}`
    A vessel given by a full tensor has its points on its own principal axes.
    Source: [CV] eqs. (10), (11), with the products of inertia that the note leaves out; by the convention
    "orbiter" without.
    """
    points, masses = [], []
    for name, (R_root_vessel, origin) in poses(scene, values).items():
        vessel = scene.vessels[name]
        if vessel.pmi is not None:
            own = sample_points(_override(f"{name}.pmi", vessel.pmi, values), scene.convention)
        else:
            moments, axes = np.linalg.eigh(np.array(vessel.specific_inertia))
            own = sample_points(moments) @ axes.T
        points.append(origin + (np.array(vessel.centre_of_mass) + own) @ R_root_vessel.T)
        masses.append(np.full(6, (values or {}).get(f"{name}.mass", vessel.mass) / 6.0))
    m, r = np.concatenate(masses), np.vstack(points)
    barycentre = r[0] + m @ (r - r[0]) / m.sum()
    rho = r - barycentre
    second_moments = (m[:, None] * rho).T @ rho
    inertia = np.trace(second_moments) * np.eye(3) - second_moments
    if scene.convention == "orbiter":
        inertia = np.diag(np.diag(inertia))
    return Composite(float(m.sum()), barycentre, inertia)


def rotation_matrix(attitude: ArrayLike) -> Array:
    """Returns R_inertial_body, (3, 3), of the unit quaternion `attitude`, (4,), scalar first."""
    w, x, y, z = np.asarray(attitude, dtype=float)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Array = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return rotation


def attitude_dot(attitude: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """Returns the rate of the attitude quaternion, (4,) [1/s]: half the product q * (0, omega).

    attitude         : (4,), unit, scalar first, body to inertial
    angular_velocity : (3,) [rad/s], body axes
    """
    q, omega = np.asarray(attitude, dtype=float), np.asarray(angular_velocity, dtype=float)
    return 0.5 * np.concatenate([[-q[1:] @ omega], q[0] * omega + np.cross(q[1:], omega)])


def angular_acceleration(
    law: str, inertia: ArrayLike, angular_velocity: ArrayLike, torque: ArrayLike
) -> Array:
    """Returns the angular acceleration, (3,) [rad/s2], body axes, under a rotation law.

    law              : "none", "decoupled", "principal" or "tensor"
    inertia          : (3, 3) [kg m2], about the barycentre, body axes
    angular_velocity : (3,) [rad/s], body axes
    torque           : (3,) [N m], about the barycentre, body axes
    Source: [CV] eq. (1) for "tensor", eq. (2) for "principal"; "decoupled" leaves out the gyroscopic
    term, "none" keeps the angular velocity.
    """
    J = np.asarray(inertia, dtype=float)
    omega, torque = np.asarray(angular_velocity, dtype=float), np.asarray(torque, dtype=float)
    if law == "none":
        return np.zeros(3)
    if law == "decoupled":
        return torque / np.diag(J)
    if law == "principal":
        J = np.diag(np.diag(J))
    elif law != "tensor":
        raise ValueError(f'law = "{law}": must be one of none, decoupled, principal, tensor')
    acceleration: Array = np.linalg.solve(J, torque - np.cross(omega, J @ omega))
    return acceleration


def ode(
    scene: Scene,
    state: ArrayLike,
    torque: ArrayLike = (0.0, 0.0, 0.0),
    values: Mapping[str, float] | None = None,
) -> Array:
    """Returns the rate of the state (attitude, angular velocity), (7,), of a scene under its own law."""
    state = np.asarray(state, dtype=float)
    acceleration = angular_acceleration(
        scene.rotation.law, composite(scene, values).inertia, state[4:], torque
    )
    return np.concatenate([attitude_dot(state[:4], state[4:]), acceleration])
