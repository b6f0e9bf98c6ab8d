"""C tables of the composite of many moving vessels, which a loop puts together; see fmu_build/c/loop.c."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from supervessel.assembly import groups, ways
from supervessel.equations import Equations
from supervessel.inertia import UPPER_TRIANGLE
from supervessel.kernels import kernels, lane_kernels
from supervessel.lumps import Places, constant_and_varying, lump, places, seen_in_group
from supervessel.poses import Pose, scaled
from supervessel.scene import Scene
from supervessel.vessels import vessels_shown

LONGEST_CODE = 2000
"""Instructions of a composite beyond which a loop is faster, and compiled in seconds instead of minutes."""

LANES = 2
"""Bodies that are seen at once: doubles in the registers that every x86_64 and every aarch64 has."""

POSE_SIZE = 12  # the most numbers that are held of a body

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


@dataclass
class Tables:
    """Rows of LOOP_FRAMES and LOOP_BODIES, and the numbers of LOOP_HELD."""

    frames: list[str] = field(default_factory=list)
    bodies: list[str] = field(default_factory=list)
    held: list[float] = field(default_factory=list)

    def hold(self, *numbers: object) -> int:
        """Returns the index of constants, given as arrays or symbols that are constant."""
        place = len(self.held)
        for number in numbers:
            values = ca.evalf(number) if isinstance(number, ca.SX) else number
            self.held += np.ravel(np.array(values, dtype=float), order="F").tolist()
        return ~place

    @property
    def work(self) -> int:
        """Numbers that the loop needs for values and their changes."""
        return 2 * (12 * len(self.frames) + 10 * len(self.bodies) + 4 + 3 + 6)


def loop_tables(scene: Scene, model: Equations) -> Tables | None:
    """Returns the tables of a scene whose composite is a loop; None for one that is short or needs more.

    Docks that open, ports with velocities, and what is known of single vessels are for straight code alone.
    """
    inputs = scene.inputs
    if model.composite.n_instructions() <= LONGEST_CODE or vessels_shown(scene):
        return None
    if inputs.docked or inputs.motion or inputs.force or inputs.vessel_torque:
        return None
    tables = Tables()
    where = {name: place for place, name in enumerate(model.p_names)}
    parts = groups(scene)
    inside = places(scene, parts)
    home = {vessel: number for number, part in enumerate(parts) for vessel in part.vessels}
    for number, (way,) in enumerate(ways(scene, parts)):
        if way.joint is None:
            tables.frames.append("{FRAME_ROOT, 0, 0, 0, 0}")
        else:
            joint, parent = way.joint, home[way.joint.parent]
            ports = ", ".join(str(_port(scene, name, where, tables)) for name in joint.ports)
            is_first = parts[parent].reference == joint.parent
            kind = "FRAME_FIRST" if is_first else "FRAME_INSIDE"
            at = 0 if is_first else _hold_pose(tables, inside[parent][joint.parent])
            tables.frames.append(f"{{{kind}, {parent}, {at}, {ports}}}")
        for row in _bodies(scene, number, inside[number], where, tables):
            _add_body(row, tables)
    _fill_up(tables)
    return tables


def _add_body(row: str, tables: Tables) -> None:
    """Adds a row; as many rows of a kind as there are lanes stand together."""
    if tables.bodies and _kind(row) != _kind(tables.bodies[-1]):
        _fill_up(tables)
    tables.bodies.append(row)


def _kind(row: str) -> str:
    return row.partition(",")[0]


def _fill_up(tables: Tables) -> None:
    """Completes the last rows of a kind by bodies that are nothing: they add zeros to sums."""
    while len(tables.bodies) % LANES:
        nothing = tables.hold(np.zeros(POSE_SIZE))
        tables.bodies.append(f"{_kind(tables.bodies[-1])}, 0, {nothing}, {nothing}, {nothing}}}")


def _hold_pose(tables: Tables, pose: Pose) -> int:
    return tables.hold(pose.rotation, pose.origin)


def _port(scene: Scene, name: str, where: dict[str, int], tables: Tables) -> int:
    """Returns the index of a port's position, direction and alignment."""
    if name in scene.inputs.pose:
        return where[f"{name}.position[1]"]
    port = scene.port(name)
    return tables.hold(port.position, scaled(port.direction), scaled(port.alignment))


def _bodies(scene: Scene, frame: int, inside: Places, where: dict[str, int], tables: Tables) -> list[str]:
    """Returns the rows of a group's bodies: what is constant, then vessels that vary."""
    rows = []
    kind = "BODY" if frame else "BODY_OWN"
    constants, varying = constant_and_varying(scene, inside)
    if constants:
        mass, centre, inertia = lump(scene, {name: inside[name] for name in constants})
        held = tables.hold(centre, [inertia[i, j] for i, j in UPPER_TRIANGLE])
        rows.append(f"{{{kind}_FIXED, {frame}, {tables.hold(mass)}, {held}, {held}}}")
    for name in varying:
        mass_at = where[f"{name}.mass"] if f"{name}.mass" in where else tables.hold(scene.vessels[name].mass)
        (centre,), (specific,) = seen_in_group(scene, {name: inside[name]})
        own_axes = frame > 0 and name == next(iter(inside)) and scene.vessels[name].pmi is not None
        if own_axes and not any(scene.vessels[name].centre_of_mass):
            moments = scene.vessels[name].pmi
            at = where[f"{name}.pmi[1]"] if name in scene.inputs.pmi else tables.hold(moments)
            rows.append(f"{{BODY_DIAGONAL, {frame}, {mass_at}, {tables.hold(np.zeros(POSE_SIZE))}, {at}}}")
        elif name in scene.inputs.pmi:
            held = tables.hold(inside[name].rotation, centre)
            rows.append(f"{{{kind}_FREE, {frame}, {mass_at}, {held}, {where[f'{name}.pmi[1]']}}}")
        else:
            held = tables.hold(centre, [specific[i, j] for i, j in UPPER_TRIANGLE])
            rows.append(f"{{{kind}_SCALED, {frame}, {mass_at}, {held}, {held}}}")
    return rows


def loop_functions(scene: Scene, model: Equations) -> list[ca.Function]:
    """Returns what the FMU needs where its composite is a loop."""
    return [f for f in model.functions if not f.name().startswith("composite")] + list(kernels(scene))


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
        f"static inline void lanes_{function.name()}(const Lanes *const arg[], Lanes res[]) {{\n{body}\n}}\n"
    )


def loop_constants(tables: Tables | None) -> dict[str, int]:
    """Returns what the C layer must know of a loop, by name of the macro."""
    if tables is None:
        return {"LOOP": 0}
    return {
        "LOOP": 1,
        "LOOP_LANES": LANES,
        "LOOP_FRAME_COUNT": len(tables.frames),
        "LOOP_BODY_COUNT": len(tables.bodies),
        "LOOP_WORK": tables.work,
    }


def loop_source(tables: Tables | None) -> str:
    """Returns the tables, C; empty without a loop."""
    if tables is None:
        return ""
    return (
        '\n#include "loop.h"\n\n'
        + _array("LoopFrame LOOP_FRAMES", tables.frames)
        + _array("LoopBody LOOP_BODIES", tables.bodies)
        + _array("double LOOP_HELD", [repr(number) for number in tables.held] or ["0.0"])
    )


def _array(declaration: str, rows: Sequence[str]) -> str:
    lines = "\n".join(f"    {row}," for row in rows)
    return f"const {declaration}[] = {{\n{lines}\n}};\n\n"
