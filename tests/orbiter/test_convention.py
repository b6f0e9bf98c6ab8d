"""The convention "orbiter": sums of points in reference, twin and FMU, and only where it is asked for."""

import tomllib

import numpy as np
import pytest

from orbiter.points import scene_pmi
from supervessel import SceneError, Twin, parse_scene, reference
from support import ISS_DG, OK, flying, relative_error, scene, variant
from support.marks import FMI
from support.pages import text
from support.processes import ROOT

AGREEMENT = 1e-13
"""Twelve points of some ten operations each, every one good to 1.1e-16 of the largest sum: 900 roundings."""

WHEEL = [26000.0, 26000.0, 52800.0]
"""m2, of Orbiter's Wheel: the third exceeds the other two by 800."""

SIDE = {"position": [15.8, 0.12, -9.5], "direction": [1.0, 0.0, 0.0], "alignment": [0.0, 1.0, 0.0]}
MIR_DG = variant(
    ISS_DG,
    {
        "convention": "orbiter",
        "root": "Mir",
        "vessels": {
            "Mir": {"mass": 124340.0, "pmi": [86.1, 79.6, 37.0], "ports": {"side": SIDE}},
            "DG": ISS_DG["vessels"]["DG"],
        },
        "docks": [{"ports": ["Mir.side", "DG.nose"]}],
    },
)
SCENES = {
    "Mir with a DeltaGlider at its side": MIR_DG,
    "ISS with a DeltaGlider": variant(ISS_DG, {"convention": "orbiter"}),
    "a wheel in Mir's place": variant(MIR_DG, {"vessels.Mir.pmi": WHEEL}),
    "the ship beyond the triangle as well": variant(
        MIR_DG, {"vessels.Mir.pmi": WHEEL, "vessels.DG.pmi": [30.0, 2.0, 1.0]}
    ),
}


@pytest.fixture(params=SCENES.values(), ids=SCENES)
def raw(request):
    return request.param


def test_the_reference_equals_the_sum_of_six_points_a_vessel(raw):
    whole = reference.composite(scene(raw))
    assert relative_error(whole.pmi, scene_pmi(raw)) < AGREEMENT
    assert np.count_nonzero(whole.inertia - np.diag(np.diag(whole.inertia))) == 0


def test_the_twin_equals_the_sum_of_six_points_a_vessel(raw):
    twin = Twin(scene(raw))
    whole = twin.composite(p=twin.p_start)
    assert relative_error(np.array(whole["pmi"]).ravel(), scene_pmi(raw)) < AGREEMENT
    inertia = np.array(whole["inertia"])
    assert np.count_nonzero(inertia - np.diag(np.diag(inertia))) == 0


@FMI
def test_the_fmu_equals_the_sum_of_six_points_a_vessel_as_inputs_change(fmi):
    raw = SCENES["a wheel in Mir's place"]
    later = variant(raw, {"vessels.DG.mass": 11700.0, "vessels.DG.pmi": [1.0, 2.0, 9.0]})
    with flying(raw, fmi) as fmu:
        assert relative_error(fmu.get("pmi"), scene_pmi(raw)) < AGREEMENT
        assert fmu.set({"DG.mass": 11700.0, "DG.pmi": [1.0, 2.0, 9.0]}) == OK
        assert relative_error(fmu.get("pmi"), scene_pmi(later)) < AGREEMENT
        assert fmu.step(0.1) == OK
        assert np.count_nonzero(fmu.get("inertia").reshape(3, 3) - np.diag(fmu.get("inertia")[::4])) == 0


def test_the_laws_turn_the_diagonal_so_that_tensor_and_principal_agree():
    rates = []
    for law in ("tensor", "principal"):
        turning = scene(variant(MIR_DG, {"rotation": {"law": law}}))
        x, u = [1.0, 0.0, 0.0, 0.0, 0.02, -0.03, 0.01], [300.0, -200.0, 100.0]
        twin = Twin(turning)
        rate = np.array(twin.ode(x=x, u=u, p=twin.p_start)["x_dot"]).ravel()
        rates.append(rate)
        assert relative_error(rate, reference.ode(turning, x, u)) < AGREEMENT
    assert relative_error(rates[0], rates[1]) < AGREEMENT


def test_moments_of_a_rigid_body_are_untouched():
    """Only the products are dropped: the diagonal is that of the default convention."""
    default = reference.composite(scene(variant(MIR_DG, {"convention": "rigid_body"})))
    assert relative_error(reference.composite(scene(MIR_DG)).pmi, default.pmi) < AGREEMENT
    assert abs(default.inertia[0, 2]) > 0.02 * default.inertia.max()


def test_it_is_never_the_default():
    assert parse_scene(ISS_DG).convention == "rigid_body"
    with pytest.raises(SceneError, match="no rigid body has these moments"):
        parse_scene(variant(ISS_DG, {"vessels.DG.pmi": WHEEL}))


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"convention": "Orbiter"}, 'convention = "Orbiter": must be one of rigid_body, orbiter'),
        ({"convention": 1}, "convention = 1: must be one of rigid_body, orbiter"),
        (
            {
                "convention": "orbiter",
                "vessels.ISS.pmi": None,
                "vessels.ISS.inertia": [[2.0, 0, 0], [0, 2, 0], [0, 0, 2]],
            },
            'vessels.ISS.inertia: convention = "orbiter" knows no products of inertia; give pmi [m2]',
        ),
        (
            {"convention": "orbiter", "vessels.DG.pmi": [-1.0, 1.0, 1.0]},
            "vessels.DG.pmi = [-1.0, 1.0, 1.0] m2: must be three finite numbers >= 0",
        ),
    ],
    ids=["another word", "a number", "a tensor", "a negative moment"],
)
def test_what_it_cannot_be_is_refused(changes, problem):
    with pytest.raises(SceneError) as caught:
        parse_scene(variant(ISS_DG, changes))
    assert caught.value.problems == (problem,)


def test_a_negative_moment_is_refused_at_run_time_too():
    with flying(MIR_DG) as fmu:
        assert fmu.set({"DG.pmi": [-1.0, 1.0, 1.0]}) == OK
        assert fmu.get_status("pmi") != OK
        assert fmu.messages()[-1].endswith("DG.pmi = (-1, 1, 1) m2: must be >= 0")


def test_the_pages_figures_of_a_ship_at_mirs_side():
    raw = tomllib.loads((ROOT / "examples" / "mir_dg.toml").read_text(encoding="utf-8"))
    both = {key: parse_scene(raw | {"convention": key}) for key in ("rigid_body", "orbiter")}
    shown = {}
    for key, made in both.items():
        whole = reference.composite(made)
        moments, axes = np.linalg.eigh(whole.inertia)
        tilt = np.degrees(np.arccos(np.abs(axes).max(axis=0).min()))
        shown[key] = (*whole.pmi.round(2), *(moments / whole.mass).round(2), round(tilt))
    assert shown["rigid_body"] == (85.66, 174.62, 125.59, 66.31, 144.87, 174.67, 30)
    assert shown["orbiter"] == (85.66, 174.62, 125.59, 85.66, 125.59, 174.62, 0)
    page = text("model/docs/orbiter.md")
    for key, numbers in shown.items():
        pmi, moments = (", ".join(f"{x:.2f}" for x in three) for three in (numbers[:3], numbers[3:6]))
        assert f"| `{key}` | {pmi} | {moments} |" in page
    apart = []
    for time in (60.0, 600.0):
        twins = [Twin(made, propagator="exact") for made in both.values()]
        one, other = (np.array(t.step(x=t.x_start, p=t.p_start, h=time)["x_next"]).ravel()[:4] for t in twins)
        apart.append(np.degrees(2.0 * np.arccos(abs(one @ other))))
    assert [round(apart[0], 1), round(apart[1])] == [2.8, 38]
