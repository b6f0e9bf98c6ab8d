"""The point of each vessel from which places are reckoned, so that where its axes begin costs no digits.

Positions in a vessel's axes may all be far from their origin. Their differences from the centre of mass are
not, and of them alone the composite's tensor is made.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.scene.inputs import vessel_of
from supervessel.scene.schema import Scene


def anchor(scene: Scene, vessel: str) -> NDArray[np.float64]:
    """Returns a vessel's anchor, (3,) [m], vessel axes: its centre of mass.

    The origin of its axes where a port of it has a pose input: C adds that pose up as it is set.
    """
    moved = any(vessel_of(port) == vessel for port in scene.inputs.pose)
    return np.zeros(3) if moved else np.array(scene.vessels[vessel].centre_of_mass, dtype=float)


def from_anchor(scene: Scene, vessel: str, position: ArrayLike) -> NDArray[np.float64]:
    """Returns a position in a vessel's axes, (3,) [m], as seen from the vessel's anchor."""
    return np.asarray(position, dtype=float) - anchor(scene, vessel)
