"""What holds for any assembly: six points, parallel axes and generated C agree; invariances; near every edge.

Assemblies are drawn as placed vessels; the ports follow from the placing, so that nothing here repeats how
ports are mated. Where digits are counted the truth is a 50-digit sum over the numbers of the scene file.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import hypothesis.strategies as st
import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given

from supervessel import Twin, reference
from supervessel.composite.start import poses_at_start
from support import (
    DISCARD,
    ISS_DG,
    OK,
    Array,
    Instance,
    U,
    flying,
    random_rotation,
    relative_error,
    scene,
    variant,
)
from support.examples import examples
from support.marks import FMI

Whole = tuple[float, Array, Array]  # mass, barycentre, inertia

# A failing example is not shrunk: with a scene to build for each trial that takes minutes.
RUN = examples(10, 30)

# Rounding of J, relative to its largest element: C u (1 + distance/size), with `distance` the largest
# coordinate met on the way from the root's origin and size^2 = tr(J)/M. A pose is a product of at most 5
# rotations of 3-term dot products of normalised triads, some 20 u each: places are off by delta = 100 u
# distance. An offset rho enters J twice, 2 sum(m rho delta) <= sqrt(2) M size delta by Cauchy-Schwarz, and
# the largest element is at least tr(J)/3 = M size^2 / 3: a factor 3 sqrt(2) = 4.3. The vessels' own moments
# round by less, hence the 1. Roundings never all add up: what is seen is 1 % of it, 4 % for barycentres.
INERTIA_ULPS = 430
# Sums of five masses, or of thirty sixths.
MASS_ULPS = 36
# Of a place over `distance`, and of a rotation, as derived above.
POSE_ULPS = 100
# Each turning of a tensor or a place by a drawn rotation, in the test itself, is a sum of 9 products.
TURNING_ULPS = 32


@dataclass(frozen=True)
class Vessel:
    """A vessel placed in the root's axes: mass, tensor over mass and centre in its own axes, its pose."""

    mass: float
    specific: Array
    centre: Array
    rotation: Array
    origin: Array
    by_pmi: bool = True


@dataclass(frozen=True)
class Joint:
    """Two vessels that meet at a point, facing along the first column of `axes`; root axes."""

    parent: str
    child: str
    face: Array
    axes: Array


@dataclass(frozen=True)
class Assembly:
    vessels: dict[str, Vessel]
    joints: tuple[Joint, ...]

    def values(self) -> dict[str, list[float]]:
        """Returns the value of each input that the assembly could have, by group."""
        values: dict[str, list[float]] = {}
        for name, vessel in self.vessels.items():
            values[f"{name}.mass"] = [vessel.mass]
            if vessel.by_pmi:
                values[f"{name}.pmi"] = np.diag(vessel.specific).tolist()
        for joint in self.joints:
            for name, mate, sign in ((joint.parent, joint.child, 1.0), (joint.child, joint.parent, -1.0)):
                vessel = self.vessels[name]
                to_vessel = vessel.rotation.T
                values[f"{name}.to{mate}.position"] = (to_vessel @ (joint.face - vessel.origin)).tolist()
                values[f"{name}.to{mate}.direction"] = (sign * to_vessel @ joint.axes[:, 0]).tolist()
                values[f"{name}.to{mate}.alignment"] = (to_vessel @ joint.axes[:, 1]).tolist()
        return values

    def raw(self) -> dict[str, Any]:
        """Returns the scene; the first vessel is the root, nothing is an input, nothing turns."""
        vessels: dict[str, Any] = {}
        for name, vessel in self.vessels.items():
            moments = {"pmi": np.diag(vessel.specific).tolist()}
            if not vessel.by_pmi:
                moments = {"inertia": (vessel.mass * vessel.specific).tolist()}
            vessels[name] = {
                "mass": vessel.mass,
                "centre_of_mass": vessel.centre.tolist(),
                "ports": {},
                **moments,
            }
        for name, value in self.values().items():
            owner, *port = name.split(".")
            if len(port) == 2:
                vessels[owner]["ports"].setdefault(port[0], {})[port[1]] = value
        pairs = [(f"{j.parent}.to{j.child}", f"{j.child}.to{j.parent}") for j in self.joints]
        return {
            "name": "assembly",
            "root": next(iter(vessels)),
            "vessels": vessels,
            "docks": [{"ports": list(pair)} for pair in pairs],
            "rotation": {"law": "none"},
            "outputs": {"names": ["mass", "barycentre", "inertia"]},
        }


def vector(low: float, high: float) -> st.SearchStrategy[Array]:
    return st.lists(st.floats(low, high), min_size=3, max_size=3).map(np.array)


ROTATIONS = st.one_of(
    st.integers(0, 10**6).map(random_rotation),
    st.sampled_from([np.eye(3), np.diag([-1.0, -1.0, 1.0]), np.roll(np.eye(3), 1, axis=0)]),
)
SQUARES = st.lists(st.one_of(st.just(0.0), st.floats(0.05, 10.0)), min_size=3, max_size=3).map(np.array)
MASSES = st.floats(0.0, 6.0).map(lambda exponent: 10.0**exponent)
NAMES = "ABCDE"
PARENTS = (0, 0, 1, 0)  # of B, C, D, E where the FMU needs one tree
CENTRES = {name: random_rotation(i)[0] for i, name in enumerate(NAMES)}  # there, m


def symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


TENSOR = symmetric(random_rotation(9) @ np.diag([3.0, 4.0, 5.0]) @ random_rotation(9).T)  # E's there, m2


@st.composite
def assemblies(
    draw: st.DrawFn, masses: st.SearchStrategy[float] = MASSES, tensors: bool = True, one_tree: bool = False
) -> Assembly:
    """Draws two to five vessels, or those of the tree that the FMU has, the first at the root's origin."""
    names = NAMES if one_tree else NAMES[: draw(st.integers(2, 5))]
    vessels, joints = {}, []
    for i, name in enumerate(names):
        squares = draw(SQUARES)
        vessel = Vessel(
            draw(masses),
            np.diag(squares.sum() - squares),
            CENTRES[name] if one_tree else draw(vector(-2.0, 2.0)),
            draw(ROTATIONS) if i else np.eye(3),
            draw(vector(-20.0, 20.0)) if i else np.zeros(3),
        )
        if name == "E" if one_tree else tensors and vessel.mass > 0.0 and draw(st.booleans()):
            turn = draw(ROTATIONS)
            specific = TENSOR if one_tree else turn @ vessel.specific @ turn.T
            vessel = replace(vessel, by_pmi=False, specific=symmetric(specific))
        vessels[name] = vessel
        if i:
            parent = PARENTS[i - 1] if one_tree else draw(st.integers(0, i - 1))
            joints.append(Joint(names[parent], name, draw(vector(-20.0, 20.0)), draw(ROTATIONS)))
    return Assembly(vessels, tuple(joints))


def parallel_axis(assembly: Assembly) -> Whole:
    """Returns the whole by the parallel-axis theorem from where the vessels were placed."""
    masses = np.array([v.mass for v in assembly.vessels.values()])
    places = np.array([v.origin + v.rotation @ v.centre for v in assembly.vessels.values()])
    barycentre = masses @ places / masses.sum()
    inertia = np.zeros((3, 3))
    for vessel, rho in zip(assembly.vessels.values(), places - barycentre, strict=True):
        turned = vessel.rotation @ vessel.specific @ vessel.rotation.T
        inertia += vessel.mass * (turned + (rho @ rho) * np.eye(3) - np.outer(rho, rho))
    return masses.sum(), barycentre, inertia


@mp.workdps(50)
def exact(raw: Mapping[str, Any]) -> tuple[Whole, float]:
    """Returns the whole of a scene in 50 digits, from its doubles, and the largest coordinate met."""

    def axes(port: Mapping[str, Any]) -> Any:
        d, a = mp.matrix(port["direction"]), mp.matrix(port["alignment"])
        d = d / mp.norm(d)
        a = a - (a.T * d)[0] * d
        a = a / mp.norm(a)
        third = [d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]]
        return mp.matrix([[d[i], a[i], third[i]] for i in range(3)])

    vessels = raw["vessels"]
    placed = {raw["root"]: (mp.eye(3), mp.zeros(3, 1))}
    while len(placed) < len(vessels):
        for pair in (pair for dock in raw["docks"] for pair in (dock["ports"], dock["ports"][::-1])):
            (parent, here), (child, there) = (name.split(".") for name in pair)
            if parent in placed and child not in placed:
                A, B = vessels[parent]["ports"][here], vessels[child]["ports"][there]
                R_parent, origin = placed[parent]
                R = R_parent * axes(A) * mp.diag([-1, 1, -1]) * axes(B).T
                placed[child] = R, origin + R_parent * mp.matrix(A["position"]) - R * mp.matrix(B["position"])
    distance = max(float(mp.norm(origin)) for _, origin in placed.values())
    bodies = []
    for name, (R, origin) in placed.items():
        vessel = vessels[name]
        mass = mp.mpf(vessel["mass"])
        own = mp.matrix(vessel["inertia"]) if "inertia" in vessel else mass * mp.diag(vessel["pmi"])
        centre = mp.matrix(vessel.get("centre_of_mass", [0, 0, 0]))
        bodies.append((mass, origin + R * centre, R * own * R.T))
        for place in (centre, *(port["position"] for port in vessel["ports"].values())):
            distance = max(distance, float(mp.norm(mp.matrix(place))))
    total = sum(mass for mass, _, _ in bodies)
    barycentre = sum((mass * r for mass, r, _ in bodies), mp.zeros(3, 1)) / total
    inertia = mp.zeros(3)
    for mass, r, own in bodies:
        rho = r - barycentre
        inertia += own + mass * ((rho.T * rho)[0] * mp.eye(3) - rho * rho.T)
    whole = float(total), np.array(barycentre.tolist(), float).ravel(), np.array(inertia.tolist(), float)
    return whole, distance


def size(whole: Whole) -> float:
    """Returns sqrt(tr(J)/M) [m]; assemblies smaller than a millimetre are not drawn."""
    mass, _, inertia = whole
    result = float(np.sqrt(np.trace(inertia) / mass))
    assume(result > 1e-3)
    return result


def by_reference(raw: Mapping[str, Any]) -> Whole:
    whole = reference.composite(scene(raw))
    return whole.mass, whole.barycentre, whole.inertia


def by_twin(raw: Mapping[str, Any]) -> Whole:
    twin = Twin(scene(raw))
    mass, barycentre, inertia, _ = (np.array(value) for value in twin.composite(twin.p_start))
    return float(mass[0, 0]), barycentre.ravel(), inertia


ENGINES = {"reference": by_reference, "twin": by_twin}
both = pytest.mark.parametrize("engine", ENGINES)


class GeneratedC:
    """The FMU of the tree with every mass, moment and pose an input."""

    def __init__(self) -> None:
        vessels = {
            name: Vessel(
                1.0,
                TENSOR if name == "E" else np.diag([1.0, 1.0, 1.0]),
                CENTRES[name],
                np.eye(3),
                np.zeros(3),
            )
            for name in NAMES
        }
        vessels["E"] = replace(vessels["E"], by_pmi=False)
        faces = [Joint(NAMES[p], NAMES[i], np.ones(3), np.eye(3)) for i, p in enumerate(PARENTS, start=1)]
        raw = Assembly(vessels, tuple(faces)).raw()
        ports = [port for dock in raw["docks"] for port in dock["ports"]]
        inputs = {"mass": list(NAMES), "pmi": list(NAMES[:4]), "pose": ports}
        self.fmu = Instance(variant(raw, {"inputs": inputs}))
        assert self.fmu.initialise() == OK, self.fmu.log

    def __call__(self, assembly: Assembly) -> Whole:
        assert self.fmu.set(assembly.values()) == OK
        return self.fmu.get("mass"), self.fmu.get("barycentre"), self.fmu.get("inertia").reshape(3, 3)


@pytest.fixture(scope="module")
def generated_c() -> Iterator[GeneratedC]:
    model = GeneratedC()
    yield model
    model.fmu.free()


def assert_same(value: Whole, truth: Whole, distance: float, sides: int = 1, turning: float = 0.0) -> None:
    """Compares wholes; `sides` of them are rounded, `turning` roundings belong to the test."""
    bound = (sides * INERTIA_ULPS + turning) * U * (1.0 + distance / size(truth))
    assert abs(value[0] - truth[0]) <= MASS_ULPS * U * truth[0]
    assert np.abs(value[1] - truth[1]).max() <= bound * size(truth)
    assert np.abs(value[2] - truth[2]).max() <= bound * np.abs(truth[2]).max()


# Three ways to one tensor


@both
@RUN
@given(assembly=assemblies())
def test_points_and_twin_give_the_parallel_axis_tensor(engine: str, assembly: Assembly) -> None:
    raw = assembly.raw()
    assert_same(ENGINES[engine](raw), parallel_axis(assembly), exact(raw)[1], turning=TURNING_ULPS)


@RUN
@given(assembly=assemblies(one_tree=True))
def test_generated_c_gives_the_parallel_axis_tensor(generated_c: GeneratedC, assembly: Assembly) -> None:
    distance = exact(assembly.raw())[1]
    assert_same(generated_c(assembly), parallel_axis(assembly), distance, turning=TURNING_ULPS)


@RUN
@given(assembly=assemblies(), moving=st.booleans())
def test_vessels_start_where_they_were_placed(assembly: Assembly, moving: bool) -> None:
    raw = assembly.raw()
    inputs = {"pose": raw["docks"][0]["ports"]} if moving else {}
    found, bound = poses_at_start(scene(raw | {"inputs": inputs})), (POSE_ULPS + TURNING_ULPS) * U
    assert list(found) == list(assembly.vessels)
    for name, (R_root_vessel, origin) in found.items():
        assert np.abs(R_root_vessel - assembly.vessels[name].rotation).max() <= bound
        assert np.abs(origin - assembly.vessels[name].origin).max() <= bound * exact(raw)[1]


# Invariances


@both
@RUN
@given(assembly=assemblies(), random=st.randoms(use_true_random=False))
def test_order_in_the_file_does_not_matter(engine: str, assembly: Assembly, random: Any) -> None:
    raw = assembly.raw()
    names, docks = list(raw["vessels"]), [dock["ports"] for dock in raw["docks"]]
    random.shuffle(names)
    random.shuffle(docks)
    shuffled = raw | {
        "vessels": {name: raw["vessels"][name] for name in names},
        "docks": [{"ports": random.sample(pair, 2)} for pair in docks],
    }
    one, other = ENGINES[engine](raw), ENGINES[engine](shuffled)
    assert_same(other, one, exact(raw)[1], sides=2)


@both
@RUN
@given(assembly=assemblies(), choice=st.integers(1, 4))
def test_choice_of_the_root_turns_the_axes_and_no_more(engine: str, assembly: Assembly, choice: int) -> None:
    raw = assembly.raw()
    root = list(assembly.vessels)[choice % len(assembly.vessels)]
    moved = raw | {"root": root}
    R, origin = assembly.vessels[root].rotation, assembly.vessels[root].origin
    mass, barycentre, inertia = ENGINES[engine](raw)
    expected = mass, R.T @ (barycentre - origin), R.T @ inertia @ R
    distance = exact(raw)[1] + exact(moved)[1]
    assert_same(ENGINES[engine](moved), expected, distance, sides=2, turning=TURNING_ULPS)


@st.composite
def with_other_axes(draw: st.DrawFn) -> tuple[Assembly, Assembly, Array, Array]:
    """Draws an assembly, the same with other axes and origins for each vessel, and how the root's moved."""
    old = draw(assemblies(masses=MASSES))
    turns = {name: (draw(ROTATIONS), draw(vector(-20.0, 20.0))) for name in old.vessels}
    Q0, t0 = turns["A"]
    vessels = {}
    for name, vessel in old.vessels.items():
        Q, t = turns[name]
        R = Q0 @ vessel.rotation @ Q.T if name != "A" else np.eye(3)
        vessels[name] = replace(
            vessel,
            by_pmi=False,
            specific=symmetric(Q @ vessel.specific @ Q.T),
            centre=Q @ vessel.centre + t,
            rotation=R,
            origin=Q0 @ vessel.origin + t0 - R @ t if name != "A" else np.zeros(3),
        )
    joints = tuple(replace(j, face=Q0 @ j.face + t0, axes=Q0 @ j.axes) for j in old.joints)
    return old, Assembly(vessels, joints), Q0, t0


@both
@RUN
@given(drawn=with_other_axes())
def test_axes_and_origins_of_vessels_do_not_matter(
    engine: str, drawn: tuple[Assembly, Assembly, Array, Array]
) -> None:
    old, new, Q, t = drawn
    mass, barycentre, inertia = ENGINES[engine](old.raw())
    expected = mass, Q @ barycentre + t, Q @ inertia @ Q.T
    distance = exact(old.raw())[1] + exact(new.raw())[1]
    assert_same(ENGINES[engine](new.raw()), expected, distance, sides=2, turning=3 * TURNING_ULPS)


# Near the edges, against 50 digits


@both
@RUN
@given(assembly=assemblies(masses=st.floats(-12.0, 12.0).map(lambda exponent: 10.0**exponent)))
def test_mass_ratios_of_any_size_cost_no_digits(engine: str, assembly: Assembly) -> None:
    truth, distance = exact(assembly.raw())
    assert_same(ENGINES[engine](assembly.raw()), truth, distance)


@RUN
@given(assembly=assemblies(masses=st.floats(-12.0, 12.0).map(lambda exponent: 10.0**exponent), one_tree=True))
def test_mass_ratios_of_any_size_cost_generated_c_no_digits(
    generated_c: GeneratedC, assembly: Assembly
) -> None:
    truth, distance = exact(assembly.raw())
    assert_same(generated_c(assembly), truth, distance)


@both
@RUN
@given(
    assembly=assemblies(), where=vector(-1e6, 1e6), own=st.lists(vector(-1e6, 1e6), min_size=5, max_size=5)
)
def test_distance_costs_digits_in_proportion(
    engine: str, assembly: Assembly, where: Array, own: list[Array]
) -> None:
    far = {"A": replace(assembly.vessels["A"], centre=assembly.vessels["A"].centre + where)}
    for (name, vessel), t in zip(assembly.vessels.items(), own, strict=False):
        if name != "A":
            origin = vessel.origin + where - vessel.rotation @ t
            far[name] = replace(vessel, centre=vessel.centre + t, origin=origin)
    raw = Assembly(far, tuple(replace(j, face=j.face + where) for j in assembly.joints)).raw()
    truth, distance = exact(raw)
    assert_same(ENGINES[engine](raw), truth, distance)


SOME_ZERO = st.one_of(st.just(0.0), MASSES)


def has_mass(assembly: Assembly) -> bool:
    return any(vessel.mass > 0.0 for vessel in assembly.vessels.values())


@both
@RUN
@given(assembly=assemblies(masses=SOME_ZERO).filter(has_mass))
def test_massless_vessels_carry_the_others(engine: str, assembly: Assembly) -> None:
    truth, distance = exact(assembly.raw())
    assert_same(ENGINES[engine](assembly.raw()), truth, distance)


@RUN
@given(assembly=assemblies(masses=SOME_ZERO, one_tree=True).filter(has_mass))
def test_masses_may_become_zero_while_running(generated_c: GeneratedC, assembly: Assembly) -> None:
    values = assembly.values()
    positive = {name: replace(v, mass=v.mass or 1.0) for name, v in assembly.vessels.items()}
    raw = variant(replace(assembly, vessels=positive).raw(), {})
    for name in assembly.vessels:  # inertia over mass is kept: for the oracle the vessel has neither
        raw["vessels"][name]["mass"] = values[f"{name}.mass"][0]
        if assembly.vessels[name].mass == 0.0 and "inertia" in raw["vessels"][name]:
            raw["vessels"][name]["inertia"] = np.zeros((3, 3)).tolist()
    truth, distance = exact(raw)
    assert_same(generated_c(assembly), truth, distance)


@both
@RUN
@given(assembly=assemblies(masses=SOME_ZERO).filter(has_mass))
def test_principal_moments_are_those_of_a_rigid_body(engine: str, assembly: Assembly) -> None:
    whole = ENGINES[engine](assembly.raw())
    small, middle, large = np.linalg.eigvalsh(whole[2])
    slack = INERTIA_ULPS * U * (1.0 + exact(assembly.raw())[1] / size(whole)) * large
    assert small >= -slack
    assert large <= small + middle + slack


@RUN
@given(assembly=assemblies(one_tree=True))
def test_principal_moments_of_generated_c_are_positive(generated_c: GeneratedC, assembly: Assembly) -> None:
    # The vessel given by its tensor has moments of 3 kg m2 or more; the largest drawn round by 1e-4 kg m2.
    assert np.linalg.eigvalsh(generated_c(assembly)[2])[0] > 0.0


# Lengths of port directions. DeltaGlider's nose looks along (0, 0, -1), aligned along (0, 1, 0).

LENGTHS = [(x, y) for x in (1e-200, 1.0, 1e200) for y in (1e-200, 1.0, 1e200)]
MODERATE = [(1e-90, 1e-90), (1e-90, 1e90), (1e90, 1e90)]
# The nose's axes are those of the ISS_DG scene to the last bit but for one division: 8 roundings.
LENGTH_ULPS = 8


def nose(direction: float, alignment: float) -> dict[str, Any]:
    return {"DG.nose.direction": [0.0, 0.0, -direction], "DG.nose.alignment": [0.0, alignment, 0.0]}


@both
@pytest.mark.parametrize("lengths", LENGTHS + MODERATE)
def test_directions_in_a_scene_have_any_length(engine: str, lengths: tuple[float, float]) -> None:
    changes = {name.replace("nose", "ports.nose"): value for name, value in nose(*lengths).items()}
    raw = variant(ISS_DG, {f"vessels.{path}": value for path, value in changes.items()} | {"inputs": {}})
    inertia = ENGINES[engine](raw)[2]
    assert relative_error(inertia, by_reference(ISS_DG)[2]) <= LENGTH_ULPS * INERTIA_ULPS * U


@FMI
@pytest.mark.parametrize("lengths", LENGTHS + MODERATE)
def test_directions_as_inputs_have_any_length(lengths: tuple[float, float], fmi: int) -> None:
    with flying(ISS_DG, fmi) as fmu:
        before = fmu.get("inertia").tolist()
        assert fmu.set(nose(*lengths)) == OK
        assert fmu.step(0.1) == OK, fmu.messages()
        assert relative_error(fmu.get("inertia"), before) <= LENGTH_ULPS * U


@pytest.mark.parametrize("length", [1e-200, 1e-90, 1.0, 1e90, 1e100, 1e200])
def test_parallel_directions_are_refused_at_any_length(length: float) -> None:
    with flying(ISS_DG) as fmu:
        tilt = 0.5e-6 * length  # half the angle that is allowed
        fmu.set({"DG.nose.direction": [0.0, 0.0, -length], "DG.nose.alignment": [0.0, tilt, length]})
        assert fmu.step(0.1) == DISCARD
