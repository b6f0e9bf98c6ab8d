"""C tables of the composite of many moving vessels, which a loop puts together; see fmu_build/c/loop.c."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from supervessel.composite.chain import kernels, lane_kernels
from supervessel.composite.constants import seen_in_group
from supervessel.composite.inertia import UPPER_TRIANGLE
from supervessel.composite.poses import scaled
from supervessel.composite.resolved import ResolvedScene, RigidGroup
from supervessel.equations import Equations
from supervessel.scene.schema import Scene

LONGEST_CODE = 2000
"""Instructions of a composite beyond which a loop is faster, and compiled in seconds instead of minutes."""

LANES = 2
"""Bodies that are seen at once: doubles in the registers that every x86_64 and every aarch64 has."""

NOWHERE = "{1, 0}"
"""LoopPlace of zeros: LOOP_HELD begins with them."""

OPERATIONS = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_SQRT: "lanes_sqrt({})",
    ca.OP_FABS: "lanes_fabs({})",
}
"""What the steps for several vessels at once are made of, C on numbers of type Lanes."""


@dataclass(frozen=True)
class Row:
    """A body of LOOP_BODIES.

    frame         : number of its group's frame
    mass, moments : where they stand, LoopPlace
    held          : its constants
    """

    kind: str
    frame: int
    mass: str
    held: Sequence[float] = ()
    moments: str = NOWHERE


@dataclass
class Tables:
    """Rows of LOOP_FRAMES and LOOP_BODIES, and the numbers of LOOP_HELD."""

    frames: list[str] = field(default_factory=list)
    bodies: list[Row] = field(default_factory=list)
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
        return 12 * (2 * frames + 2 * LANES) + 19 * bodies + 3 + 2 * (4 + 3 + 6)


def loop_tables(model: Equations) -> Tables | None:
    """Returns the tables of a scene whose composite is a loop; None for one that is short or needs more.

    Docks that open, ports with velocities, and what is known of single vessels are for straight code alone.
    """
    resolved, scene = model.resolved, model.resolved.scene
    inputs = scene.inputs
    if model.composite.n_instructions() <= LONGEST_CODE or resolved.vessels_shown:
        return None
    if inputs.docked or inputs.motion or inputs.force or inputs.vessel_torque:
        return None
    tables = Tables()
    where = {name: place for place, name in enumerate(model.names.p)}
    numbers = {vessel: number for number, group in enumerate(resolved.groups) for vessel in group.inside}
    seen = _varying_bodies(resolved)
    for number, group in enumerate(resolved.groups):
        (way,) = group.ways
        if way.joint is None:
            tables.frames.append(f"{{FRAME_ROOT, 0, 0, {NOWHERE}, {NOWHERE}}}")
        else:
            joint, parent = way.joint, numbers[way.joint.parent]
            ports = ", ".join(_port(scene, name, where, tables) for name in joint.ports)
            is_first = resolved.groups[parent].reference == joint.parent
            kind = "FRAME_FIRST" if is_first else "FRAME_INSIDE"
            pose = resolved.groups[parent].inside[joint.parent]
            at = 0 if is_first else tables.hold(pose.rotation, pose.origin)
            tables.frames.append(f"{{{kind}, {_pose_at(parent)}, {at}, {ports}}}")
        for row in _bodies(scene, number, group, seen, where, tables):
            _add_body(row, tables)
    _fill_up(tables)
    return tables


def _add_body(row: Row, tables: Tables) -> None:
    """Adds a row; as many rows of a kind as there are lanes stand together."""
    if tables.bodies and row.kind != tables.bodies[-1].kind:
        _fill_up(tables)
    tables.bodies.append(row)


def _fill_up(tables: Tables) -> None:
    """Completes the last rows of a kind by bodies that are nothing: they add zeros to sums."""
    while len(tables.bodies) % LANES:
        last = tables.bodies[-1]
        tables.bodies.append(Row(last.kind, 0, NOWHERE, [0.0] * len(last.held)))


def _pose_at(frame: int) -> int:
    """Returns where the pose of a frame stands; see `pose_at` in loop.c."""
    block, lane = divmod(frame + LANES - 1, LANES)
    return 12 * LANES * block + lane


def _port(scene: Scene, name: str, where: dict[str, int], tables: Tables) -> str:
    """Returns where a port's position, direction and alignment stand."""
    if name in scene.inputs.pose:
        return _input(where[f"{name}.position[1]"])
    port = scene.port(name)
    return _constant(tables.hold(port.position, scaled(port.direction), scaled(port.alignment)))


def _input(place: int) -> str:
    return f"{{0, {place}}}"


def _constant(place: int) -> str:
    return f"{{1, {place}}}"


Seen = dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Centre (3,) [m] and tensor over mass (3, 3) [m2] of vessels, each in the axes of its group."""


def _varying_bodies(resolved: ResolvedScene) -> Seen:
    """Returns the vessels that vary, of all groups."""
    placed = {name: group.inside[name] for group in resolved.groups for name in group.varying}
    return (
        dict(zip(placed, zip(*seen_in_group(resolved.scene, placed), strict=True), strict=True))
        if placed
        else {}
    )


def _bodies(  # noqa: PLR0913, PLR0917
    scene: Scene, frame: int, group: RigidGroup, seen: Seen, where: dict[str, int], tables: Tables
) -> list[Row]:
    """Returns the rows of a group's bodies: what is constant, then vessels that vary."""
    rows = []
    kind = "BODY" if frame else "BODY_OWN"
    if group.fixed is not None:
        mass, centre, inertia = group.fixed
        rows.append(Row(f"{kind}_FIXED", frame, _constant(tables.hold(mass)), _body(centre, inertia)))
    for name in group.varying:
        vessel = scene.vessels[name]
        given = f"{name}.mass" in where
        mass_at = _input(where[f"{name}.mass"]) if given else _constant(tables.hold(vessel.mass))
        moments_at = _input(where[f"{name}.pmi[1]"]) if name in scene.inputs.pmi else NOWHERE
        centre, specific = seen[name]
        own_axes = frame > 0 and name == group.reference and not any(vessel.centre_of_mass)
        if own_axes and name in scene.inputs.pmi:
            rows.append(Row("BODY_DIAGONAL_FREE", frame, mass_at, moments=moments_at))
        elif own_axes and vessel.pmi is not None:
            rows.append(Row("BODY_DIAGONAL", frame, mass_at, vessel.pmi))
        elif name in scene.inputs.pmi:
            rotation = np.ravel(np.array(ca.evalf(group.inside[name].rotation)), order="F")
            rows.append(Row(f"{kind}_FREE", frame, mass_at, [*rotation, *centre], moments_at))
        else:
            rows.append(Row(f"{kind}_SCALED", frame, mass_at, _body(centre, specific)))
    return rows


def _body(centre: NDArray[np.float64], inertia: NDArray[np.float64]) -> list[float]:
    """Returns a centre and the upper triangle of a tensor, (9,)."""
    return [*centre, *(inertia[i, j] for i, j in UPPER_TRIANGLE)]


def _body_rows(tables: Tables) -> list[str]:
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
    """Returns what the FMU needs where its composite is a loop."""
    return [*model.functions_beside_composite, *kernels(model.resolved.scene)]


def loop_steps(scene: Scene, tables: Tables | None) -> str:
    """Returns lane_kernels.h: the steps for several vessels at once; without a loop, none."""
    if tables is None:
        return "/* Generated: this scene has no loop. */\n"
    return (
        "/* Generated: steps for several vessels at once; see supervessel/kernels.py. */\n"
        '#include "lanes.h"\n\n' + "\n".join(map(_lane_code, lane_kernels(scene)))
    )


def _lane_code(function: ca.Function) -> str:
    """Returns straight C of a function, operation by operation as CasADi has put them in order."""
    lines = []
    for number in range(function.n_instructions()):
        kind, to = function.instruction_id(number), function.instruction_output(number)
        of = function.instruction_input(number)
        if kind == ca.OP_OUTPUT:
            lines.append(f"res[{to[1]}] = w{of[0]};")
        elif kind == ca.OP_INPUT:
            lines.append(f"w{to[0]} = arg[{of[0]}][{of[1]}];")
        elif kind == ca.OP_CONST:
            lines.append(f"w{to[0]} = lanes_all({function.instruction_constant(number)!r});")
        else:
            lines.append(f"w{to[0]} = {OPERATIONS[kind].format(*(f'w{i}' for i in of))};")
    work = ", ".join(f"w{i}" for i in range(function.sz_w()))
    body = "\n".join(f"    {line}" for line in [f"Lanes {work};", *lines])
    return (
        f"LANES_INLINE void lanes_{function.name()}(const Lanes *const arg[], Lanes res[]) {{\n{body}\n}}\n"
    )


def loop_constants(tables: Tables | None) -> dict[str, int]:
    """Returns what the C layer must know of a loop, by name of the macro."""
    if tables is None:
        return {"LOOP": 0}
    return {
        "LOOP": 1,
        "LOOP_LANES": LANES,
        "LOOP_BLOCK": LANES,
        "LOOP_FRAME_COUNT": len(tables.frames),
        "LOOP_BODY_COUNT": len(tables.bodies),
        "LOOP_WORK": tables.work,
    }


def loop_source(tables: Tables | None) -> str:
    """Returns the tables, C; empty without a loop."""
    if tables is None:
        return ""
    bodies = _body_rows(tables)
    return (
        '\n#include "loop.h"\n\n'
        + _array("LoopFrame LOOP_FRAMES", tables.frames)
        + _array("LoopBody LOOP_BODIES", bodies)
        + _array("double LOOP_HELD", [repr(number) for number in tables.held])
    )


def _array(declaration: str, rows: Sequence[str]) -> str:
    lines = "\n".join(f"    {row}," for row in rows)
    return f"const {declaration}[] = {{\n{lines}\n}};\n\n"
