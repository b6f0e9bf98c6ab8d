"""What propellant that leaves an assembly takes along of its turning: jet damping."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array, joined, motions, points
from supervessel.reference.laws import law_tensor
from supervessel.scene.schema import Scene


def jet_torque(scene: Scene, omega: ArrayLike, values: Mapping[str, float] | None = None) -> Array:
    """Returns the torque of the flows of propellant on what is joined to the root, (3,) [N m], body axes.

    omega : angular velocity, (3,) [rad/s], body axes
    A flow of 1 kg/s takes r x (omega x r) along at its nozzle; what the body's tensor loses with the mass had
    the mean of that over the vessel's points. Laws with a diagonal tensor take the diagonal of this map.

    Example:
        >>> reference.jet_torque(scene, [0, 0.0011, 0]).tolist()
        [0.0, 0.0, 0.0]
    """
    placed, by_axis = motions(scene, values), np.zeros((3, 3))
    for name in scene.inputs.flow:
        vessel = name.partition(".")[0]
        if vessel not in placed:
            continue
        barycentre = joined(points(scene, values).values()).barycentre
        own = points(scene, values)[vessel].positions - barycentre
        nozzle = placed[vessel].carry(np.array(scene.point(name).position))[0] - barycentre
        flow = (values or {}).get(f"{name}.flow", 0.0)
        for i, axis in enumerate(np.eye(3)):
            taken = np.cross(nozzle, np.cross(axis, nozzle))
            by_axis[:, i] += flow * (np.cross(own, np.cross(axis, own)).mean(axis=0) - taken)
    torque: Array = law_tensor(scene.rotation.law, by_axis) @ np.asarray(omega, dtype=float)
    return torque
