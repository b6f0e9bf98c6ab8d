"""What the page says of the rotation: equations of the laws, energy and momentum, what changes keep; HTML."""

from supervessel.scene.schema import Law, Scene, discrete_changes

PRIME, MINUS, TIMES = "\N{PRIME}", "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"

LAWS: dict[Law, tuple[str, str]] = {
    "none": (
        f"<i>ω</i>{PRIME} = 0",
        "The angular velocity is given and kept; the inertia tensor has no effect on it.",
    ),
    "decoupled": (
        f"<i>J</i><sub>ii</sub> <i>ω</i><sub>i</sub>{PRIME} = <i>M</i><sub>i</sub>, i = x, y, z",
        "Each axis for itself: no gyroscopic term, no products of inertia. For slow rates and short spans.",
    ),
    "principal": (
        f"<i>J</i><sub>xx</sub> <i>ω</i><sub>x</sub>{PRIME} = <i>M</i><sub>x</sub> {MINUS} "
        f"(<i>J</i><sub>zz</sub> {MINUS} <i>J</i><sub>yy</sub>) <i>ω</i><sub>y</sub> <i>ω</i><sub>z</sub>, "
        "and so on cyclically",
        "Euler's equations with the diagonal of the tensor, without products of inertia ([CV] eq. (2)).",
    ),
    "tensor": (
        f"<i>J ω</i>{PRIME} = <i>M</i> {MINUS} <i>ω</i> {TIMES} <i>J ω</i>",
        "Euler's equations with the full inertia tensor ([CV] eq. (1)).",
    ),
}
"""Equation and description of each rotation law, HTML."""

H = "<i>h</i>"
R_HAT = "r\N{COMBINING CIRCUMFLEX ACCENT}"
RHO = "<i>\N{GREEK SMALL LETTER RHO}</i><sub>j</sub>"

SPINNING_LAWS: dict[Law, str] = {
    "principal": f"{LAWS['principal'][0]}, with <i>J ω</i> + {H} in place of <i>J ω</i>",
    "tensor": f"<i>J ω</i>{PRIME} = <i>M</i> {MINUS} <i>ω</i> {TIMES} (<i>J ω</i> + {H})",
}
"""Equations of the laws that the momentum h of moving ports enters, HTML; in the others it does nothing."""

MU, UNIT = "<i>\N{GREEK SMALL LETTER MU}</i>", f"<i>{R_HAT}</i>"

GRADIENT = (
    "<p>Gravity's gradient adds to <i>M</i>, of a centre that attracts as a mass point does,</p>\n"
    f'<p class="equation">3 {MU}/|<i>r</i>|<sup>3</sup> {UNIT} {TIMES} <i>J</i> {UNIT}, &#160;\n'
    f"{UNIT} = <i>R</i>(<i>q</i>)<sup>T</sup> <i>r</i>/|<i>r</i>|</p>\n"
    "<p>with the input <code>gravity.position</code> for <i>r</i>. Within a communication step the body "
    "moves about the centre from there, beginning with <code>gravity.velocity</code>: "
    f"<i>r</i>{PRIME}{PRIME} = {MINUS}{MU} <i>r</i>/|<i>r</i>|<sup>3</sup>.</p>"
)
"""What the page says of gravity's gradient, HTML."""

SUM = "\N{GREEK CAPITAL LETTER SIGMA}"

WHEELS = (
    "<p>Each wheel has an axis <i>b</i>, an inertia <i>I</i> about it, which is part of <i>J</i>, a momentum "
    f"<i>k</i> along it, and a motor that turns it by the torque <i>u</i>, so that <i>k</i>{PRIME} = "
    "<i>u</i>. In the law above, and in energy and momentum below, "
    f"<i>J</i> {MINUS} {SUM} <i>I b b</i><sup>T</sup> stands in place of <i>J</i>, "
    f"<i>M</i> {MINUS} {SUM} <i>u b</i> in place of <i>M</i> and, but for the energy, "
    f"<i>J ω</i> + {SUM} <i>k b</i> in place of <i>J ω</i>. The energy of wheels is left out.</p>\n"
)
"""What the page says of wheels, HTML."""

CENTRE = "<i>\N{GREEK SMALL LETTER RHO}</i>"

JETS = (
    "<p>Propellant that leaves a vessel at the rate <i>f</i> takes angular momentum along (jet damping). To "
    f"<i>M</i> it adds {MINUS} {SUM} <i>f K ω</i>, with</p>\n"
    f'<p class="equation"><i>K</i> = ⌊<i>r</i>⌋ {MINUS} ⌊{CENTRE}⌋ {MINUS} <i>S</i>, &#160;\n'
    f"⌊<i>d</i>⌋ = |<i>d</i>|<sup>2</sup> <i>E</i> {MINUS} <i>d d</i><sup>T</sup></p>\n"
    f"<p>where <i>r</i> and {CENTRE} are the nozzle and the vessel's centre of mass from the barycentre, and "
    "<i>S</i> is the vessel's inertia tensor over its mass. The vessel's mass, an input, is to fall by its "
    "flows: nothing checks that it does. Thrust is another input.</p>\n"
)
"""What the page says of jet damping, HTML."""

DIAGONAL = "\n<p><i>J</i> is the diagonal there too, as the law has it.</p>"

KEPT_BY = {
    ("mass", "rate"): "When a mass or a moment changes, the <b>angular velocity is kept</b>: mass leaves or "
    "arrives moving with the body.",
    ("mass", "momentum"): "When a mass or a moment changes, the <b>angular momentum is kept</b>: mass moves "
    "inside the assembly.",
    ("pose", "rate"): "When a port's pose changes, the <b>angular velocity is kept</b>. For parts that are "
    "moved inside the assembly that is a modelling error: the angular momentum is then not conserved.",
    ("pose", "momentum"): "When a port's pose changes, the <b>angular momentum is kept</b>: the parts are "
    "moved inside the assembly, and the angular velocity follows.",
}
"""What changes keep, HTML."""

DISCRETE = {
    "mass": "In model exchange masses and moments are discrete here: they change in event mode alone, where "
    "the angular velocity jumps with them.",
    "pose": "In model exchange poses, and motions of ports, are discrete here: they change in event mode "
    "alone, where the angular velocity jumps with them.",
}
"""What is said of a kind of change that is one of `schema.discrete_changes`, HTML."""

DOCKING = (
    "Docks open and close between the steps of co-simulation, or in event mode. What undocks leaves with its "
    "share of the momentum: the angular velocity of the rest is kept. What docks brings its own along: the "
    "momentum of both parts is conserved, by the full inertia tensor under every law but none. The part of "
    "the second port comes with the velocity and the rate, relative to the first port, that are inputs; zero "
    "is a matched approach. A vessel that is not docked to the root's part, even through others, has no "
    "effect on anything; its own outputs are zero."
)


def law_equation(scene: Scene) -> str:
    """Returns the equation of a scene's rotation law."""
    law = scene.rotation.law
    own, _ = LAWS[law]
    return SPINNING_LAWS.get(law, own) if scene.inputs.motion else own


def law_text(scene: Scene) -> str:
    """Returns what a scene's rotation law leaves out, and where it serves."""
    return LAWS[scene.rotation.law][1]


def gradient_text(scene: Scene) -> str:
    """Returns the equations of gravity's gradient and of the motion in a step, or "" without gravity."""
    if scene.gravity is None or scene.rotation.law == "none":
        return ""
    return GRADIENT + (DIAGONAL if scene.rotation.law != "tensor" else "") + "\n"


def wheels_text(scene: Scene) -> str:
    """Returns how wheels enter the equations, or "" without wheels."""
    return WHEELS if scene.wheels else ""


def jets_text(scene: Scene) -> str:
    """Returns what flows of propellant do, or "" without them."""
    return JETS if scene.inputs.flow else ""


def energy_and_momentum(scene: Scene) -> str:
    """Returns the equations of kinetic energy and angular momentum."""
    own = f"<i>J ω</i> + {H}" if scene.inputs.motion else "<i>J ω</i>"
    closed = f"({own})" if scene.inputs.motion else own
    text = (
        '<p class="equation">kinetic energy ½ <i>ω</i> · <i>J ω</i>, &#160;\n'
        f"angular momentum <i>R</i>(<i>q</i>) {closed}</p>"
    )
    if scene.inputs.motion:
        text += (
            f"\n<p>{H} is the angular momentum of the parts that moving ports carry, relative to body axes: "
            f"Σ <i>m</i><sub>j</sub> {RHO} {TIMES} {RHO}{PRIME} + <i>R</i><sub>j</sub> "
            "<i>J</i><sub>j</sub> <i>R</i><sub>j</sub><sup>T</sup> <i>ω</i><sub>j</sub>, with the rate "
            "<i>ω</i><sub>j</sub> of each relative to body axes.</p>"
        )
    return text


def what_changes_keep(scene: Scene) -> str:
    """Returns what a change of inputs keeps, the angular velocity or the angular momentum."""
    texts = [KEPT_BY[kind, kept] for kind, kept in scene.keeps.items()]
    if len(texts) == 2:
        texts.append("Where both change at one instant, masses come first.")
    texts += [DISCRETE[kind] for kind in scene.keeps if kind in discrete_changes(scene)]
    if scene.inputs.docked:
        texts.append(DOCKING)
    return "\n".join(f"<p>{text}</p>" for text in texts) or "<p>No input of this scene changes them.</p>"
