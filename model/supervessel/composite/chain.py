"""The composite of a scene of many moving vessels as steps that a loop takes for one vessel after the other.

The same equations in the same order as `bodies.composite_body` and `inertia.combine` have for all vessels at
once, whose code would grow with the scene; no bit differs from theirs.

Vectors: a pose (12,) is a rotation, column by column, and an origin; a port (9,) position, direction,
alignment; seen (9,) a centre [m] and an inertia [kg m2], root axes, xx, yy, zz, xy, xz, yz; sum (4,) the mass
and the first moment about the first body's centre.
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
    """Returns the steps that are taken for several vessels at once.

    mated    : parent's port in its axes, child's port -> pose of the child in the parent's axes
    then     : pose of axes, pose in them -> pose in the outer axes
    lever    : mass, seen, centre of the first body -> first moment about that
    spread   : mass, seen, centre of the first body, middle -> inertia (6,) about the middle
    fixed, scaled, free, diagonal, own_... : see `kernels`
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
"""Steps of which C takes the values from `kernels`; of the other steps it takes the derivatives alone."""


@simplification(True)
def kernels(scene: Scene) -> tuple[ca.Function, ...]:
    """Returns the steps that are taken once, and the derivatives of all steps; their names begin with loop_.

    hang        : pose of the parent's group, parent's port in its axes, child's port -> pose of the child's
                  group
    hang_inside : likewise, for a parent whose pose in its group comes second
    fixed       : pose of a group, mass, centre and inertia of its body (9,), unused -> seen
    scaled      : the same, with the inertia over mass
    free        : pose, mass, rotation into the group's axes and centre there (12,), moments over mass (3,)
                  -> seen
    diagonal    : the same for a vessel in whose axes its group is put together, with its centre at their
                  origin, (12,) unused
    own_...     : the first three for the root's own group, whose pose is not needed
    weigh       : sum, mass, seen, centre of the first body -> sum
    middle      : sum -> barycentre from the first centre
    add         : inertia (6,), mass, seen, centre of the first, middle -> inertia with that body
    finish      : sum, centre of the first, middle, inertia -> c
    """
    functions: list[ca.Function] = []
    for step, (arguments, result) in _steps(scene).items():
        name, results = f"loop_{step}", [ca.densify(result)]
        if step in TAKEN_ONCE:
            functions.append(ca.Function(name, arguments, results))
        functions += derivatives(name, arguments, results)
    return tuple(functions)


def _steps(scene: Scene) -> dict[str, tuple[list[ca.SX], ca.SX]]:
    """Returns arguments and result of each step; `kernels` says what the steps are."""
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
    """Returns arguments and result of each way to see a body from the root's axes."""
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
    return mass * (centre - first)


def _spread(mass: ca.SX, seen: ca.SX, first: ca.SX, middle: ca.SX) -> ca.SX:
    return seen[3:] + mass * upper_triangle(offset_tensor(seen[:3] - first - middle))


def _pose(name: str) -> ca.SX:
    return ca.SX.sym(name, 12)


def _as_pose(numbers: ca.SX) -> Pose:
    return Pose(ca.reshape(numbers[:9], 3, 3), numbers[9:])


def _flat(pose: Pose) -> ca.SX:
    return ca.vertcat(ca.vec(pose.rotation), pose.origin)


def _port(numbers: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns position and axes of a port."""
    return numbers[:3], port_axes(numbers[3:6], numbers[6:])


def _seen(body: Body, pose: ca.SX) -> ca.SX:
    """Returns a body of a group, (9,), seen from the root's axes."""
    placed = _as_pose(pose)
    return _flat_body(body.seen_from(placed.rotation, placed.origin))


def _flat_body(body: Body) -> ca.SX:
    return ca.vertcat(body.centre, upper_triangle(body.inertia))
