"""The torque of gravity's gradient on an assembly, and how its barycentre moves about a centre of gravity."""

import numpy as np
from numpy.typing import ArrayLike

from supervessel.reference.assembly import Array
from supervessel.reference.attitude import rotation_matrix


def gravity_torque(inertia: ArrayLike, attitude: ArrayLike, position: ArrayLike, mu: float) -> Array:
    """Returns the torque of gravity's gradient about the barycentre, (3,) [N m], body axes.

    inertia  : (3, 3) [kg m2], about the barycentre, body axes; under a diagonal law that law's own tensor
    attitude : (4,), unit, scalar first, body to inertial
    position : (3,) [m], of the barycentre from the attracting centre, inertial axes, not zero
    mu       : [m3/s2], gravitational parameter of the centre, which attracts as a point does
    M = 3 mu/|r|^3 n x J n, n being the direction r/|r| in body axes: what the attraction of all points of the
    body adds up to, to first order in its size over the distance. What is left out is that ratio of it.

    Example:
        >>> tilted = [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]  # by 45 degrees about the third axis
        >>> torque = reference.gravity_torque(np.diag([1.0, 3.0, 3.0]), tilted, [7e6, 0, 0], 3.986e14)
        >>> (torque * 7e6**3 / (3 * 3.986e14)).round(9).tolist()
        [0.0, 0.0, -1.0]
    """
    r = np.asarray(position, dtype=float)
    distance = float(np.linalg.norm(r))
    n = rotation_matrix(attitude).T @ (r / distance)
    return 3.0 * (mu / distance**3) * np.cross(n, np.asarray(inertia, dtype=float) @ n)


def orbit_dot(position: ArrayLike, velocity: ArrayLike, mu: float) -> Array:
    """Returns the rate of (position, velocity), (6,) [m/s, m/s2], of a barycentre that nothing else pulls.

    position, velocity : (3,) [m], (3,) [m/s], from the attracting centre, inertial axes; position not zero
    mu                 : [m3/s2]
    Two-body motion, r'' = -mu r/|r|^3: gravity's gradient turns the body and does not move it.

    Example:
        >>> reference.orbit_dot([2.0, 0.0, 0.0], [0.0, 1.0, 0.0], 8.0).tolist()
        [0.0, 1.0, 0.0, -2.0, -0.0, -0.0]
    """
    r = np.asarray(position, dtype=float)
    return np.concatenate([np.asarray(velocity, dtype=float), -mu * r / float(np.linalg.norm(r)) ** 3])
