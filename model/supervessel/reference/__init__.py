"""The model in numpy, written for reading: a second opinion that shares no code with the symbolic one.

Everything takes and returns plain arrays in SI units; `values` overrides inputs by the names that the FMU
gives them. The body axes are those of the root vessel. It is for tests and for users: nothing that makes an
FMU, a twin or a drawing imports it.

In the examples `scene` is `load_scene("examples/iss_dg.toml")`, with `from supervessel import reference`.
"""

from supervessel.reference.assembly import (
    Composite,
    Motion,
    Points,
    barycentre_velocity,
    closed_docks,
    composite,
    internal_momentum,
    joined,
    motions,
    points,
    port_axes,
    poses,
    sample_points,
)
from supervessel.reference.attitude import attitude_dot, quaternion, rotation_matrix
from supervessel.reference.changes import at_contact, before_arrivals, change, stages
from supervessel.reference.gravity import gravity_torque, orbit_dot
from supervessel.reference.hand_over import barycentre_jumps, leaving_vessels
from supervessel.reference.jets import jet_torque
from supervessel.reference.laws import angular_acceleration, law_tensor
from supervessel.reference.loads import loads, point_outputs
from supervessel.reference.rotation import (
    angular_momentum,
    angular_velocity,
    external_torque,
    gradient_torque,
    inner_momentum,
    momentum_ode,
    net_force,
    ode,
    total_kinetic_energy,
    turning_tensor,
    vessel_outputs,
    vessel_outputs_after,
)
from supervessel.reference.wheels import Wheels, wheel_outputs, wheels_of

__all__ = [
    "Composite",
    "Motion",
    "Points",
    "Wheels",
    "angular_acceleration",
    "angular_momentum",
    "angular_velocity",
    "at_contact",
    "attitude_dot",
    "barycentre_jumps",
    "barycentre_velocity",
    "before_arrivals",
    "change",
    "closed_docks",
    "composite",
    "external_torque",
    "gradient_torque",
    "gravity_torque",
    "inner_momentum",
    "internal_momentum",
    "jet_torque",
    "joined",
    "law_tensor",
    "leaving_vessels",
    "loads",
    "momentum_ode",
    "motions",
    "net_force",
    "ode",
    "orbit_dot",
    "point_outputs",
    "points",
    "port_axes",
    "poses",
    "quaternion",
    "rotation_matrix",
    "sample_points",
    "stages",
    "total_kinetic_energy",
    "turning_tensor",
    "vessel_outputs",
    "vessel_outputs_after",
    "wheel_outputs",
    "wheels_of",
]
