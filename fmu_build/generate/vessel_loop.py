"""C tables of the composite of many moving vessels, which fmu_build/c/vessel_loop.c puts together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.chain import kernels
from supervessel.composite.constants import seen_in_group
from supervessel.composite.docks import Joint
from supervessel.composite.inertia import UPPER_TRIANGLE
from supervessel.composite.poses import from_anchor, scaled
from supervessel.composite.resolved import ResolvedScene, RigidGroup
from supervessel.equations import Equations
from supervessel.scene.inputs import vessel_of

LONGEST_CODE = 2000
"""Instructions of a composite beyond which a loop is faster, and compiled in seconds instead of minutes."""

LANES = 2
"""Bodies that are seen at once: doubles in the registers that every x86_64 and every aarch64 has."""

POSE, PORT, SEEN = 12, 9, 9
"""Numbers of a pose (rotation and origin), a port, and a body as it is seen (centre and inertia)."""

NOWHERE = "{1, 0}"
"""LoopPlace of zeros: LOOP_HELD begins with them."""


@dataclass(frozen=True)
class BodyRow:
    """A row of LOOP_BODIES.

    kind          : name of the body's kind in C, how it is seen from the root's axes
    frame         : number of the frame of the body's group
    mass, moments : where they stand, each a LoopPlace of C
    held          : the body's constants
    """

    kind: str
    frame: int
    mass: str
    held: Sequence[float] = ()
    moments: str = NOWHERE


@dataclass
class LoopTables:
    """Rows of LOOP_FRAMES and LOOP_BODIES, and the numbers of LOOP_HELD."""

    frames: list[str] = field(default_factory=list)
    bodies: list[BodyRow] = field(default_factory=list)
    held: list[float] = field(default_factory=lambda: [0.0] * 3)

    def hold(self, *numbers: object) -> int:
        """Returns the index of constants, given as arrays or symbols that are constant."""
        place = len(self.held)
        for number in numbers:
            values = ca.evalf(number) if isinstance(number, ca.SX) else number
            self.held += np.ravel(np.array(values, dtype=float), order="F").tolist()
        return place

    @property
    def work(self) -> int:
        """Numbers that the loop needs for values and their changes."""
        frames, bodies = len(self.frames), len(self.bodies)
        return POSE * (2 * frames + 2 * LANES) + (2 * SEEN + 1) * bodies + 3 + 2 * (4 + 3 + 6)


@dataclass(frozen=True)
class LoopScene:
    """What the rows of a loop's tables are made from.

    resolved : the scene
    inputs   : where each input that shapes the composite stands in p, by name
    frames   : number of the frame of each vessel: of its rigid group
    seen     : centre (3,) [m] and inertia over mass (3, 3) [m2] of the vessels that vary, each in the axes of
               its group
    """

    resolved: ResolvedScene
    inputs: Mapping[str, int]
    frames: Mapping[str, int]
    seen: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]


def loop_tables(model: Equations) -> LoopTables | None:
    """Returns the tables of a scene whose composite is a loop; None where it is straight code."""
    if not _suits_loop(model):
        return None
    loop, tables = _loop_scene(model), LoopTables()
    for frame, group in enumerate(model.resolved.groups):
        (way,) = group.ways
        tables.frames.append(_frame(loop, way.joint, tables))
        for row in _bodies(loop, frame, group, tables):
            _add_body(row, tables)
    _fill_up(tables)
    return tables


def _suits_loop(model: Equations) -> bool:
    """Whether the composite is long enough for a loop, and made of steps that the loop has.

    The loop has no docks that open, no ports that move, no forces or flows at points, no wheels, and it keeps
    nothing of single vessels, points and docks: that is for straight code alone.
    """
    inputs = model.resolved.scene.inputs
    resolved = model.resolved
    acts = inputs.force or inputs.vessel_torque or inputs.flow
    beyond = inputs.docked or inputs.motion or acts or resolved.scene.wheels
    shown = resolved.vessels_shown or resolved.points_shown or resolved.docks_shown
    return not (beyond or shown or model.composite.n_instructions() <= LONGEST_CODE)


def _loop_scene(model: Equations) -> LoopScene:
    resolved = model.resolved
    placed = {name: group.inside[name] for group in resolved.groups for name in group.varying}
    seen = zip(*seen_in_group(resolved.scene, placed), strict=True) if placed else ()
    return LoopScene(
        resolved,
        inputs={name: place for place, name in enumerate(model.names.p)},
        frames={vessel: number for number, group in enumerate(resolved.groups) for vessel in group.inside},
        seen=dict(zip(placed, seen, strict=True)),
    )


def _frame(loop: LoopScene, joint: Joint | None, tables: LoopTables) -> str:
    """Returns the row of a group's axes.

    joint : of the group's vessel that hangs on another group; None for the root's own group
    """
    if joint is None:
        return f"{{FRAME_ROOT, 0, 0, {NOWHERE}, {NOWHERE}}}"
    frame = loop.frames[joint.parent]
    parent = loop.resolved.groups[frame]
    ports = ", ".join(_port(loop, name, tables) for name in joint.ports)
    if parent.reference == joint.parent:
        return f"{{FRAME_FIRST, {_pose_at(frame)}, 0, {ports}}}"
    pose = parent.inside[joint.parent]
    return f"{{FRAME_INSIDE, {_pose_at(frame)}, {tables.hold(pose.rotation, pose.origin)}, {ports}}}"


def _add_body(row: BodyRow, tables: LoopTables) -> None:
    """Adds a row; rows of a kind stand together in blocks of LANES."""
    if tables.bodies and row.kind != tables.bodies[-1].kind:
        _fill_up(tables)
    tables.bodies.append(row)


def _fill_up(tables: LoopTables) -> None:
    """Completes the last rows of a kind by bodies without mass, which add zeros to sums."""
    while len(tables.bodies) % LANES:
        last = tables.bodies[-1]
        tables.bodies.append(BodyRow(last.kind, 0, NOWHERE, [0.0] * len(last.held)))


def _pose_at(frame: int) -> int:
    """Returns where the pose of a frame stands; see `pose_at` in vessel_loop.c."""
    block, lane = divmod(frame + LANES - 1, LANES)
    return POSE * LANES * block + lane


def _port(loop: LoopScene, name: str, tables: LoopTables) -> str:
    """Returns where a port's position, direction and alignment stand."""
    scene = loop.resolved.scene
    if name in scene.inputs.pose:
        return _input(loop.inputs[f"{name}.position[1]"])
    port = scene.port(name)
    position = from_anchor(scene, vessel_of(name), port.position)
    return _constant(tables.hold(position, scaled(port.direction), scaled(port.alignment)))


def _input(place: int) -> str:
    return f"{{0, {place}}}"


def _constant(place: int) -> str:
    return f"{{1, {place}}}"


def _bodies(loop: LoopScene, frame: int, group: RigidGroup, tables: LoopTables) -> list[BodyRow]:
    """Returns the rows of a group's bodies: its constant vessels as one body, then the vessels that vary."""
    rows = []
    if group.fixed is not None:
        mass, centre, inertia = group.fixed
        kind = f"{_kind(frame)}_FIXED"
        rows.append(BodyRow(kind, frame, _constant(tables.hold(mass)), _body(centre, inertia)))
    return rows + [_varying_body(loop, frame, group, name, tables) for name in group.varying]


def _kind(frame: int) -> str:
    """Returns how the names of a group's kinds of bodies begin; the root's own group is not placed."""
    return "BODY" if frame else "BODY_OWN"


def _varying_body(loop: LoopScene, frame: int, group: RigidGroup, name: str, tables: LoopTables) -> BodyRow:
    """Returns the row of a vessel whose mass or moments vary."""
    vessel, inputs = loop.resolved.scene.vessels[name], loop.inputs
    given = f"{name}.mass" in inputs
    mass = _input(inputs[f"{name}.mass"]) if given else _constant(tables.hold(vessel.mass))
    free = name in loop.resolved.scene.inputs.pmi
    moments = _input(inputs[f"{name}.pmi[1]"]) if free else NOWHERE
    centre, specific = loop.seen[name]
    own_axes = frame > 0 and name == group.reference and not any(centre)
    if own_axes and free:
        return BodyRow("BODY_DIAGONAL_FREE", frame, mass, moments=moments)
    if own_axes and vessel.pmi is not None:
        return BodyRow("BODY_DIAGONAL", frame, mass, vessel.pmi)
    if free:
        R_group_vessel = np.ravel(np.array(ca.evalf(group.inside[name].rotation)), order="F")
        return BodyRow(f"{_kind(frame)}_FREE", frame, mass, [*R_group_vessel, *centre], moments)
    return BodyRow(f"{_kind(frame)}_SCALED", frame, mass, _body(centre, specific))


def _body(centre: NDArray[np.float64], inertia: NDArray[np.float64]) -> list[float]:
    """Returns a centre and the upper triangle of a tensor, (9,)."""
    return [*centre, *(inertia[i, j] for i, j in UPPER_TRIANGLE)]


def _body_rows(tables: LoopTables) -> list[str]:
    """Returns LOOP_BODIES; the constants of bodies that are seen together are held side by side."""
    rows = []
    for first in range(0, len(tables.bodies), LANES):
        block = tables.bodies[first : first + LANES]
        at = tables.hold([body.held for body in block])
        rows += [
            f"{{{body.kind}, {_pose_at(body.frame)}, {body.mass}, {at + lane}, {body.moments}}}"
            for lane, body in enumerate(block)
        ]
    return rows


def loop_functions(model: Equations) -> list[ca.Function]:
    """Returns the functions that the FMU needs where its composite is a loop."""
    return [*model.functions_beside_composite, *kernels(model.resolved.scene)]


def loop_constants(tables: LoopTables | None) -> dict[str, int]:
    """Returns what the C layer must know of a loop, by name of the macro."""
    if tables is None:
        return {}
    return {
        "LOOP_LANES": LANES,
        "LOOP_BLOCK": LANES,
        "LOOP_POSE": POSE,
        "LOOP_PORT": PORT,
        "LOOP_SEEN": SEEN,
        "LOOP_FRAME_COUNT": len(tables.frames),
        "LOOP_BODY_COUNT": len(tables.bodies),
        "LOOP_WORK": tables.work,
    }


def loop_source(tables: LoopTables | None) -> str:
    """Returns the tables, C; empty without a loop."""
    if tables is None:
        return ""
    bodies = _body_rows(tables)
    return (
        '\n#include "vessel_loop.h"\n\n'
        + _array("LoopFrame LOOP_FRAMES", tables.frames)
        + _array("LoopBody LOOP_BODIES", bodies)
        + _array("double LOOP_HELD", [repr(number) for number in tables.held])
    )


def _array(declaration: str, rows: Sequence[str]) -> str:
    lines = "\n".join(f"    {row}," for row in rows)
    return f"const {declaration}[] = {{\n{lines}\n}};\n\n"
