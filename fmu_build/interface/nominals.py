"""Nominals: the magnitudes of outputs and states at the start, for an importer's solver."""

from math import hypot, isfinite

import numpy as np

from supervessel.composite.start import composite_at_start
from supervessel.scene.outputs import Magnitudes
from supervessel.scene.schema import Scene
from supervessel.scene.variables import OutputVariable, StateVariable, Variable


def magnitudes_at_start(scene: Scene) -> Magnitudes:
    """Returns the magnitudes of the whole; of the angular velocity [rad/s] the scene's, or 1 from rest."""
    wheels = [scene.wheel(name) for name in scene.wheels]
    stored = max((abs(wheel.momentum) for wheel in wheels), default=0.0)
    spun = max((abs(wheel.momentum) / wheel.inertia for wheel in wheels if wheel.inertia > 0.0), default=0.0)
    whole = composite_at_start(scene)
    moment = float(np.sum(whole["inertia"][:3])) / 3.0
    rate = hypot(*scene.rotation.angular_velocity) or 1.0
    return Magnitudes(float(whole["mass"][0]), moment, rate, stored or 1.0, spun or 1.0)


def nominal_of(variable: Variable, whole: Magnitudes) -> float:
    """Returns a variable's magnitude in three digits, 1 where it would be none: zero or beyond all doubles.

    More digits differ between processors: numpy's library of linear algebra adds up in different orders.
    """
    if not isinstance(variable, OutputVariable | StateVariable):
        return 1.0
    nominal = variable.kind.nominal(whole)
    return float(f"{nominal:.3g}") if isfinite(nominal) and nominal > 0.0 else 1.0
