"""The composite of a scene of many moving vessels as steps that a loop in C takes vessel by vessel.

The equations and their order are those of `bodies.composite_body` and `inertia.combine`, and so is every bit
of the result. Those two write the equations out for all vessels at once, so that their code grows with the
scene; the code of these steps does not.

The loop has three passes: it finds the pose of each rigid group from that of its parent's group; it brings
each body into root axes and sums masses and first moments; with the barycentre known it sums the tensors.
Root axes are the root vessel's. Arguments and results of the steps are columns:

pose    : (12,), R_outer_inner, column by column, and the origin of the inner axes [m], outer axes
inside  : (12,), the pose of a vessel in the axes of its group; in "free", R_group_vessel and the vessel's
          centre of mass [m], group axes
parent  : (9,), position [m], direction and alignment of the parent's port, parent vessel's axes
child   : (9,), the same of the child's port, child vessel's axes
mass    : [kg], of a body: of a vessel, or of the constant vessels of a group together
held    : (9,), constants of a body: centre of mass [m] and inertia [kg m2], or inertia over mass [m2], about
          it, group axes
moments : (3,) [m2], moments of inertia over mass, vessel axes
seen    : (9,), centre of mass c_j [m] of body j and its inertia J_j [kg m2] about that, root axes
first   : (3,) [m], centre of mass c_1 of the first body, root axes
sum     : (4,), mass m [kg] and first moment [kg m] about c_1, root axes, of the bodies taken so far
middle  : (3,) [m], barycentre from c_1, root axes
inertia : (6,) [kg m2], about the barycentre, root axes, of the bodies taken so far

Tensors stand as xx, yy, zz, xy, xz, yz.
Source: [EQ] The assembly, eqs. (4) to (6).
"""

import casadi as ca

from supervessel.composite.bodies import by_convention
from supervessel.composite.inertia import (
    Body,
    from_upper_triangle,
    offset_tensor,
    orbiter_moments,
    placed_body,
    upper_triangle,
)
from supervessel.composite.parts import body_parts
from supervessel.composite.poses import Pose, mated_pose, port_axes
from supervessel.derivatives import derivatives
from supervessel.scene.schema import Scene
from supervessel.simplification import simplification


@simplification(True)
def lane_kernels(scene: Scene) -> tuple[ca.Function, ...]:
    """Returns the steps that C takes for several vessels at once; the module says what the arguments are.

    mated  : parent, child -> pose of the child vessel in the parent vessel's axes, [CV] eqs. (8), (9)
    then   : pose, inside -> pose of the vessel in the outer axes
    lever  : mass, seen, first -> first moment of the body about c_1, m_j (c_j - c_1), (3,) [kg m]
    spread : mass, seen, first, middle -> tensor of the body about the barycentre, (6,) [kg m2]:
             J_j + m_j (|rho|^2 E - rho rho^T), rho = c_j - c_1 - middle
    and fixed, scaled, free, diagonal, own_fixed, own_scaled, own_free: see `kernels`
    """
    pose, inside = _pose("pose"), _pose("inside")
    parent, child, seen = (ca.SX.sym(name, 9) for name in ("parent", "child", "seen"))
    mass, first, middle = ca.SX.sym("mass"), ca.SX.sym("first", 3), ca.SX.sym("middle", 3)
    steps = {
        "mated": ([parent, child], _flat(mated_pose(_port(parent), _port(child)))),
        "then": ([pose, inside], _flat(_as_pose(pose).then(_as_pose(inside)))),
        **_seen_bodies(scene),
        "lever": ([mass, seen, first], _lever(mass, seen[:3], first)),
        "spread": ([mass, seen, first, middle], _spread(mass, seen, first, middle)),
    }
    return tuple(ca.Function(name, arguments, [ca.densify(r)]) for name, (arguments, r) in steps.items())


TAKEN_ONCE = ("middle", "finish")
"""Steps whose values C takes from `kernels`. The values of the other steps come from `lane_kernels`."""


@simplification(True)
def kernels(scene: Scene) -> tuple[ca.Function, ...]:
    """Returns the steps of TAKEN_ONCE and the derivatives of all steps; every name begins with loop_.

    The module says what the arguments are. Steps to the pose of a group in root axes:
    hang        : pose of the parent's group, parent, child -> pose of the child's group, where the parent's
                  axes are its group's
    hang_inside : pose of the parent's group, inside, parent, child -> the same for any other parent

    Steps from the pose of a group to one of its bodies in root axes, four arguments each:
    fixed       : pose, mass, held, unused moments -> seen; constant vessels as one body
    scaled      : pose, mass, held with inertia over mass, unused moments -> seen
    free        : pose, mass, inside, moments -> seen
    diagonal    : pose, mass, unused inside, moments -> seen, for a vessel whose axes are its group's, its
                  centre of mass at their origin
    own_fixed, own_scaled, own_free : the same for the root's own group: the pose is not used

    Steps to the composite:
    weigh       : sum, mass, seen, first -> sum with that body
    middle      : sum -> middle, first moment over mass
    add         : inertia, mass, seen, first, middle -> inertia with that body
    finish      : sum, first, middle, inertia -> c, see `parts.body_parts`
    """
    functions: list[ca.Function] = []
    for step, (arguments, result) in _steps(scene).items():
        name, results = f"loop_{step}", [ca.densify(result)]
        if step in TAKEN_ONCE:
            functions.append(ca.Function(name, arguments, results))
        functions += derivatives(name, arguments, results)
    return tuple(functions)


def _steps(scene: Scene) -> dict[str, tuple[list[ca.SX], ca.SX]]:
    """Returns arguments and result of each step by name; `kernels` says what the steps are."""
    pose, inside = _pose("pose"), _pose("inside")
    parent, child, seen = (ca.SX.sym(name, 9) for name in ("parent", "child", "seen"))
    mass = ca.SX.sym("mass")
    total, first, middle, inertia = (
        ca.SX.sym(name, size) for name, size in (("sum", 4), ("first", 3), ("middle", 3), ("inertia", 6))
    )
    step = mated_pose(_port(parent), _port(child))
    whole = Body(total[0], first + middle, from_upper_triangle(inertia))
    return {
        "hang": ([pose, parent, child], _flat(_as_pose(pose).then(step))),
        "hang_inside": (
            [pose, inside, parent, child],
            _flat(_as_pose(pose).then(_as_pose(inside).then(step))),
        ),
        **_seen_bodies(scene),
        "weigh": ([total, mass, seen, first], total + ca.vertcat(mass, _lever(mass, seen[:3], first))),
        "middle": ([total], total[1:] / total[0]),
        "add": (
            [inertia, mass, seen, first, middle],
            inertia + _spread(mass, seen, first, middle),
        ),
        "finish": (
            [total, first, middle, inertia],
            ca.vertcat(*body_parts(scene, by_convention(scene, whole)).values()),
        ),
    }


def _seen_bodies(scene: Scene) -> dict[str, tuple[list[ca.SX], ca.SX]]:
    """Returns arguments and result, `seen`, of each step that brings a body into root axes, by name."""
    pose, inside = _pose("pose"), _pose("inside")
    mass, held, moments = ca.SX.sym("mass"), ca.SX.sym("held", 9), ca.SX.sym("moments", 3)
    own = ca.diag(orbiter_moments(moments) if scene.convention == "orbiter" else moments)
    fixed = Body(mass, held[:3], from_upper_triangle(held[3:]))
    scaled = Body(mass, held[:3], mass * from_upper_triangle(held[3:]))
    turned = placed_body(mass, own, ca.SX.zeros(3), _as_pose(inside).rotation, inside[9:])
    diagonal = Body(mass, ca.SX.zeros(3), mass * own)
    return {
        "fixed": ([pose, mass, held, moments], _seen(fixed, pose)),
        "scaled": ([pose, mass, held, moments], _seen(scaled, pose)),
        "free": ([pose, mass, inside, moments], _seen(turned, pose)),
        "diagonal": ([pose, mass, inside, moments], _seen(diagonal, pose)),
        "own_fixed": ([pose, mass, held, moments], _flat_body(fixed)),
        "own_scaled": ([pose, mass, held, moments], _flat_body(scaled)),
        "own_free": ([pose, mass, inside, moments], _flat_body(turned)),
    }


def _lever(mass: ca.SX, centre: ca.SX, first: ca.SX) -> ca.SX:
    """Returns the first moment of a body about the first body's centre, (3,) [kg m]."""
    return mass * (centre - first)


def _spread(mass: ca.SX, seen: ca.SX, first: ca.SX, middle: ca.SX) -> ca.SX:
    """Returns the tensor of a body about the barycentre, (6,) [kg m2]."""
    return seen[3:] + mass * upper_triangle(offset_tensor(seen[:3] - first - middle))


def _pose(name: str) -> ca.SX:
    """Returns symbols of a pose as a column, (12,)."""
    return ca.SX.sym(name, 12)


def _as_pose(numbers: ca.SX) -> Pose:
    """Returns the pose of a column (12,)."""
    return Pose(ca.reshape(numbers[:9], 3, 3), numbers[9:])


def _flat(pose: Pose) -> ca.SX:
    """Returns a pose at rest as a column, (12,)."""
    return ca.vertcat(ca.vec(pose.rotation), pose.origin)


def _port(numbers: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns position, (3,) [m], and R_vessel_port, (3, 3), of a port as a column (9,)."""
    return numbers[:3], port_axes(numbers[3:6], numbers[6:])


def _seen(body: Body, pose: ca.SX) -> ca.SX:
    """Returns a body, given in the axes of its group, in root axes, (9,); pose : of the group, (12,)."""
    placed = _as_pose(pose)
    return _flat_body(body.seen_from(placed.rotation, placed.origin))


def _flat_body(body: Body) -> ca.SX:
    """Returns centre of mass and inertia of a body as a column, (9,)."""
    return ca.vertcat(body.centre, upper_triangle(body.inertia))
