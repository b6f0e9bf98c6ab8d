"""Principal moments and axes as outputs of the FMU, and their derivatives."""

import numpy as np
import pytest

from fmu.flights import ASSEMBLY_2, OUTPUTS, assembly
from supervessel import reference
from support import OK, Array, Instance, U, body, flying, variant
from support.marks import FMI

SHAPES = {
    "as docked": {},
    "ship turned": {"DG.nose.direction": [0.3, -0.2, -1.0], "DG.nose.alignment": [0.4, 1.0, 0.1]},
    "light ship": {"DG.mass": 1.0},
    "heavy ship": {"DG.mass": 4e6},
    "no ship": {"DG.mass": 0.0},
    "far ship": {"DG.nose.position": [30.0, 40.0, -500.0]},
}


def matrix(q: Array) -> Array:
    return reference.rotation_matrix(q)


@pytest.mark.parametrize("shape", SHAPES)
@FMI
def test_principal_outputs_follow_the_inputs_at_once_and_rebuild_the_inertia(fmi, shape):
    raw = assembly("exact") if fmi == 3 else ASSEMBLY_2
    with flying(raw, fmi) as instance:
        instance.get("principal_moments")  # so that those of the start are known
        assert instance.set(SHAPES[shape]) == OK
        moments, q = instance.get("principal_moments"), instance.get("principal_axes")
        J = instance.get("inertia").reshape(3, 3)
    assert (np.diff(moments) >= 0.0).all()
    assert abs(np.linalg.norm(q) - 1.0) <= 4 * U
    # the largest scalar part of four frames: see supervessel.rotation.principal
    assert q[0] >= 0.5 - 4 * U
    R = matrix(q)
    assert np.linalg.norm(R @ np.diag(moments) @ R.T - J) <= 16 * U * np.linalg.norm(J)
    # eigh's own error: a few u of the largest
    assert np.abs(moments - np.linalg.eigh(J)[0]).max() <= 16 * U * moments[2]


KNOWNS = [
    "DG.mass",
    *(f"DG.nose.position[{i}]" for i in (1, 2, 3)),
    *(f"DG.nose.direction[{i}]" for i in (1, 2, 3)),
]


def names(group: str, *sizes: int) -> list[str]:
    return [f"{group}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(*sizes)]


def test_derivatives_of_the_moments_are_those_of_the_inertia_along_the_axes():
    moments, inertia = names("principal_moments", 3), names("inertia", 3, 3)
    with flying(assembly("exact"), **SHAPES["ship turned"]) as instance:
        R, eigenvalues = matrix(instance.get("principal_axes")), instance.get("principal_moments")
        jacobian = []
        for known in KNOWNS:
            dJ = instance.directional(inertia, [known], [1.0]).reshape(3, 3)
            found = instance.directional(moments, [known], [1.0])
            # dJ is symmetric to rounding; the axes are off by u over the relative gap of the moments
            gap = np.diff(eigenvalues).min() / eigenvalues[2]
            assert np.abs(found - np.diag(R.T @ dJ @ R)).max() <= 64 * U / gap * np.abs(dJ).max()
            jacobian.append(found)
        for weights in np.eye(3):
            gradient = instance.adjoint(moments, KNOWNS, weights)
            expected = np.array(jacobian) @ weights
            assert np.abs(gradient - expected).max() <= 64 * U / gap * np.abs(jacobian).max()


@pytest.mark.parametrize("known", KNOWNS)
def test_derivatives_of_principal_outputs_are_finite_differences(known):
    unknowns = [*names("principal_moments", 3), *names("principal_axes", 4)]
    with flying(assembly("exact"), **SHAPES["ship turned"]) as instance:
        found, at = instance.directional(unknowns, [known], [1.0]), instance.get(known)
        h = 1e-4 * max(1.0, abs(at))
        rows = []
        for step in (-2 * h, -h, h, 2 * h):
            assert instance.set({known: at + step}) == OK
            rows.append(np.concatenate([instance.get("principal_moments"), instance.get("principal_axes")]))
    expected = (rows[0] - 8 * rows[1] + 8 * rows[2] - rows[3]) / (12 * h)
    for part in (slice(0, 3), slice(3, 7)):
        # some dozens of u of the values, over h; the series' next term, of h^4, is less
        rounding = 64 * U * np.abs(rows[0][part]).max() / h * (1.0 if part.start == 0 else 10.0)
        size = np.abs(expected[part]).max()
        assert np.abs(found[part] - expected[part]).max() <= rounding + 1e-9 * size


def test_derivatives_at_equal_moments_are_finite_and_right_where_unique():
    raw = variant(
        body(pmi=(1.0, 2.0, 2.5)), {"inputs": {"mass": ["B"], "pmi": ["B"]}, "outputs.names": OUTPUTS}
    )
    with flying(raw, **{"B.mass": 500.0}) as instance:
        moments, axes, knowns = (
            names("principal_moments", 3),
            names("principal_axes", 4),
            ["B.mass", *names("B.pmi", 3)],
        )
        for pmi in ([2.0, 2.0, 2.0], [2.0, 2.0, 3.0], [3.0, 2.0, 2.0], [2.0, 3.0, 2.0]):
            assert instance.set({"B.pmi": pmi}) == OK
            assert instance.get("principal_moments").tolist() == sorted(500.0 * k for k in map(float, pmi))
            assert instance.directional(moments, ["B.mass"], [1.0]).tolist() == sorted(pmi)
            for known in knowns:
                assert np.isfinite(instance.directional(moments + axes, [known], [1.0])).all()
            for weights in np.eye(7):
                assert np.isfinite(instance.adjoint(moments + axes, knowns, weights)).all()
            # the sum of the moments is smooth: each of the three adds its own
            assert instance.adjoint(moments, names("B.pmi", 3), [1.0, 1.0, 1.0]).tolist() == [500.0] * 3


@FMI
def test_dependencies_of_the_new_outputs_are_declared(fmi):
    instance = Instance(assembly("exact") if fmi == 3 else ASSEMBLY_2, fmi)
    inputs = {name for name in instance.references if name.startswith("DG.")}
    found = {output.variable.name: output for output in instance.description.outputs}
    for name in names("principal_moments", 3) + names("principal_axes", 4):
        assert {v.name for v in found[name].dependencies} == inputs
        assert set(found[name].dependenciesKind or ["dependent"]) == {"dependent"}
    assert found["error_estimate"].dependencies == []
    instance.free()
