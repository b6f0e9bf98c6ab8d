"""What a change of inputs at one instant does to the barycentre, and vessels that leave, point by point."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array, joined, motions, points
from supervessel.reference.attitude import rotation_matrix
from supervessel.reference.changes import at_contact, before_arrivals, stages
from supervessel.reference.rotation import vessel_outputs_after
from supervessel.scene.schema import Scene


def barycentre_jumps(
    scene: Scene, state: ArrayLike, before: Mapping[str, float], after: Mapping[str, float]
) -> tuple[Array, Array]:
    """Returns the jumps of the barycentre, (3,) [m], and of its velocity, (3,) [m/s], inertial axes.

    state         : (attitude, angular velocity, momenta of wheels), (7 + n,), until inputs change
    before, after : inputs by the FMU's structured names; what is missing has the scene's value
    What comes or goes is weighed point by point: the mean place and velocity of what is there afterwards less
    those of what was there. What is moved within the body changes neither.

    Example:
        >>> state = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01]
        >>> jump, velocity_jump = reference.barycentre_jumps(scene, state, {}, {"DG.mass": 12000.0})
        >>> jump.round(3).tolist()
        [-0.002, 0.711, -0.084]
    """
    state = np.asarray(state, dtype=float)
    left, filled, moved = stages(scene, before, after)
    freed = filled if scene.keeps.get("mass", "rate") == "rate" else left
    gone = _means(scene, state[4:7], freed) - _means(scene, state[4:7], before)
    omega = before_arrivals(scene, state[4:], before, after)[:3]
    touching = joined(at_contact(scene, omega, moved, after).values())
    come = np.array([touching.barycentre, touching.drift]) - _means(scene, omega, moved)
    jump, velocity_jump = (gone + come) @ rotation_matrix(state[:4]).T
    return jump, velocity_jump


def _means(scene: Scene, omega: Array, values: Mapping[str, float]) -> Array:
    """Returns place [m] and velocity [m/s] of the barycentre from the root's origin, (2, 3), root axes; the
    velocity relative to axes that do not turn."""
    whole = joined(points(scene, values).values())
    return np.array([whole.barycentre, whole.drift + np.cross(omega, whole.barycentre)])


def leaving_vessels(
    scene: Scene, state: ArrayLike, before: Mapping[str, float], after: Mapping[str, float]
) -> dict[str, Array]:
    """Returns the outputs, "vessel.output", of the vessels that docks let go, at that instant.

    The arguments are those of `barycentre_jumps`. Places, velocities and momenta are about the barycentre
    after the change.

    Example:
        >>> reference.leaving_vessels(scene, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01], {}, {})
        {}
    """
    state = np.asarray(state, dtype=float)
    R_body_inertial = rotation_matrix(state[:4]).T
    jump, velocity_jump = barycentre_jumps(scene, state, before, after)
    jumps = R_body_inertial @ jump, R_body_inertial @ velocity_jump
    left = motions(scene, before).keys() - motions(scene, after).keys()
    outputs = vessel_outputs_after(scene, state, before, jumps)
    return {name: value for name, value in outputs.items() if name.partition(".")[0] in left}
