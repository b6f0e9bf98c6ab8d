"""The twin against the numpy reference, its derivatives against complex steps of the reference."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from supervessel import Scene, Twin, reference
from support import ISS_DG, LAWS, Array, U, body, scene, variant
from twin.flights import MASS_ULPS, SEEDS, STAGE_ULPS, flight, groups, rk4, twin_of
from twin.scenes import numbers

# Twin and reference reach J by different sums of the same terms. A pose is a product of up to 5 rotations (at
# most 4 docks, and the vessel's own), each of 3-term dot products of triads that are normalised cross
# products: about 20 u a joint, 100 u in all, times the largest length met. An offset rho of a mass enters J
# twice, and 2 sum(m rho delta) <= sqrt(2) M size delta by Cauchy-Schwarz with size^2 = tr(J)/M, against a
# largest element of at least tr(J)/3: a factor 4.3. Both sides may err: 2 * 4.3 * 100 u.
INERTIA_ULPS = 860
# Derivatives by CasADi and by complex step multiply the same partials in other orders: sums of at most 12
# products along 5 joints, with a 3-term dot product in triad, pose and square each, so that 3^3 * 12 terms of
# some 20 roundings meet, on either side. The partials of J^-1 carry the condition number twice.
DERIVATIVE_ULPS = 2 * 27 * 12 * 20
TINY = 1e-30  # step along the imaginary axis; its square is below the last bit of everything here


# Values


def overrides(twin: Twin, p: Array) -> dict[str, float]:
    return dict(zip(twin.p_names, p.tolist(), strict=True))


def inertia_bound(scene: Scene, values: Mapping[str, float], whole: reference.Composite) -> float:
    """Returns the relative difference that two ways to J may show: INERTIA_ULPS u (1 + distance/size)."""
    lengths = [np.abs(origin).max() for _, origin in reference.poses(scene, values).values()]
    lengths += [np.abs(vessel.centre_of_mass).max() for vessel in scene.vessels.values()]
    lengths += [np.abs(port.position).max() for v in scene.vessels.values() for port in v.ports.values()]
    lengths += [abs(value) for name, value in values.items() if ".position[" in name]
    size = np.sqrt(np.trace(whole.inertia) / whole.mass)
    return INERTIA_ULPS * U * (1.0 + float(np.max(lengths)) / size)


def acceleration_bound(J: Array, relative: float, omega: Array, torque: Array) -> float:
    """Returns by how much J^-1 (torque - omega x J omega) may differ if J does by `relative`."""
    moments = np.linalg.eigvalsh(J)
    gyroscopic = moments[2] * (omega @ omega)
    return float(
        (2.0 * relative * moments[2] / moments[0] + STAGE_ULPS * U * moments[2] / moments[0])
        * ((np.linalg.norm(torque) + gyroscopic) / moments[0])
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_composite_agrees_with_the_reference(seed: int) -> None:
    twin = twin_of(seed)
    for m in flight(seed):
        whole = reference.composite(twin.scene, overrides(twin, m.p))
        mass, barycentre, inertia, pmi = (np.array(value) for value in twin.composite(m.p))
        bound = inertia_bound(twin.scene, overrides(twin, m.p), whole)
        largest = np.abs(whole.inertia).max()
        size = np.sqrt(np.trace(whole.inertia) / whole.mass)
        assert abs(mass.item() - whole.mass) <= MASS_ULPS * U * whole.mass
        assert np.abs(barycentre.ravel() - whole.barycentre).max() <= bound * size
        assert np.abs(inertia - whole.inertia).max() <= bound * largest
        assert np.abs(pmi.ravel() - whole.pmi).max() <= (bound + MASS_ULPS * U) * largest / whole.mass


@pytest.mark.parametrize("seed", SEEDS)
def test_ode_and_step_agree_with_the_reference(seed: int) -> None:
    twin = twin_of(seed)
    for m in flight(seed):
        values, torque = overrides(twin, m.p), m.u if len(m.u) else np.zeros(3)
        whole = reference.composite(twin.scene, values)
        J = np.diag(np.diag(whole.inertia)) if twin.scene.rotation.law != "tensor" else whole.inertia
        bound = acceleration_bound(J, inertia_bound(twin.scene, values, whole), m.x[4:], torque)
        rate = reference.ode(twin.scene, m.x, torque, values)
        # Half of three products, each of two roundings more in the sum: 3 u |omega| / 2 on either side.
        attitude_dot_bound = 3 * U * np.linalg.norm(m.x[4:])
        difference = np.abs(numbers(twin.ode(m.x, m.u, m.p)) - rate)
        assert difference[:4].max() <= attitude_dot_bound
        assert difference[4:].max() <= bound
        # Rates grow by a few percent at most within 0.05 rad, so that no stage differs by twice the bound at
        # the start; the sum and the normalisation round as well.
        step = rk4(
            lambda x, torque=torque, values=values: reference.ode(twin.scene, x, torque, values), m.x, m.h
        )
        difference = np.abs(numbers(twin.step(m.x, m.u, m.p, m.h)) - step)
        assert difference[4:].max() <= 2.0 * m.h * bound + 4 * U * np.abs(step[4:]).max()
        assert difference[:4].max() <= m.h * (m.h * bound + attitude_dot_bound) + 8 * U


@pytest.mark.parametrize("seed", SEEDS)
def test_energy_and_momentum_agree_with_the_reference(seed: int) -> None:
    twin = twin_of(seed)
    for m in flight(seed):
        whole = reference.composite(twin.scene, overrides(twin, m.p))
        omega = m.x[4:]
        # A dot product of three terms and a rotation of a dozen operations beside what J itself differs by.
        bound = 3.0 * inertia_bound(twin.scene, overrides(twin, m.p), whole) + 32 * U
        momentum = reference.rotation_matrix(m.x[:4]) @ whole.inertia @ omega
        largest = np.abs(whole.inertia).max() * np.linalg.norm(omega)
        assert np.abs(m.y["angular_momentum"] - momentum).max() <= bound * largest
        energy = 0.5 * omega @ whole.inertia @ omega
        assert abs(m.y["kinetic_energy"][0] - energy) <= bound * largest * np.linalg.norm(omega)


# Derivatives


def unit(vector: NDArray[Any]) -> NDArray[Any]:
    return vector / np.sqrt(vector @ vector)


def complex_composite(scene: Scene, values: Mapping[str, complex]) -> dict[str, NDArray[Any]]:
    """Returns the composite by the parallel-axis theorem, analytic in the inputs."""

    def value(name: str, start: Any) -> NDArray[Any]:
        return np.array([values.get(f"{name}[{i + 1}]", start[i]) for i in range(3)], dtype=complex)

    def port(name: str) -> tuple[NDArray[Any], NDArray[Any]]:
        given = scene.port(name)
        d = unit(value(f"{name}.direction", given.direction))
        a = value(f"{name}.alignment", given.alignment)
        a = unit(a - (a @ d) * d)
        return value(f"{name}.position", given.position), np.column_stack([d, a, np.cross(d, a)])

    placed = {scene.root: (np.eye(3, dtype=complex), np.zeros(3, dtype=complex))}
    while len(placed) < len(scene.vessels):
        for pair in (pair for dock in scene.docks for pair in (dock.ports, dock.ports[::-1])):
            parent, child = (name.partition(".")[0] for name in pair)
            if parent in placed and child not in placed:
                (p_A, F), (p_B, G) = port(pair[0]), port(pair[1])
                R = F @ np.diag([-1.0, 1.0, -1.0]) @ G.T
                R_parent, origin = placed[parent]
                placed[child] = (R_parent @ R, origin + R_parent @ (p_A - R @ p_B))
    bodies = []
    for name, (R, origin) in placed.items():
        vessel = scene.vessels[name]
        k = np.array(vessel.specific_inertia, dtype=complex)
        k = np.diag(value(f"{name}.pmi", vessel.pmi)) if vessel.pmi else k
        bodies.append(
            (values.get(f"{name}.mass", vessel.mass), origin + R @ vessel.centre_of_mass, R @ k @ R.T)
        )
    mass = sum(m for m, _, _ in bodies)
    barycentre = sum(m * r for m, r, _ in bodies) / mass
    inertia = np.zeros((3, 3), dtype=complex)
    for m, r, k in bodies:
        rho = r - barycentre
        inertia += m * (k + (rho @ rho) * np.eye(3) - np.outer(rho, rho))
    return {
        "mass": np.atleast_1d(mass),
        "barycentre": barycentre,
        "inertia": inertia.ravel(),
        "pmi": np.diag(inertia) / mass,
    }


def complex_ode(law: str, J: NDArray[Any], x: NDArray[Any], torque: NDArray[Any]) -> NDArray[Any]:
    q, omega = x[:4], x[4:]
    qdot = 0.5 * np.concatenate([[-(q[1:] @ omega)], q[0] * omega + np.cross(q[1:], omega)])
    if law == "none":
        return np.concatenate([qdot, np.zeros(3)])
    J = J if law == "tensor" else np.diag(np.diag(J))
    gyroscopic = 0.0 if law == "decoupled" else np.cross(omega, J @ omega)
    return np.concatenate([qdot, np.linalg.solve(J, torque - gyroscopic)])


def complex_step(twin: Twin, x: NDArray[Any], u: NDArray[Any], p: NDArray[Any], h: Any) -> NDArray[Any]:
    J = complex_composite(twin.scene, dict(zip(twin.p_names, p, strict=True)))["inertia"].reshape(3, 3)
    torque = u if len(u) else np.zeros(3)
    return rk4(lambda state: complex_ode(twin.scene.rotation.law, J, state, torque), x, h)


def along(function: Any, at: Array) -> Array:
    """Returns the Jacobian of an analytic function, exact to rounding: Im f(z + i TINY s) / (TINY s)."""
    columns = []
    for i in range(len(at)):
        z = at.astype(complex)
        size = max(1.0, abs(at[i]))
        z[i] += 1j * TINY * size
        columns.append(function(z).imag / (TINY * size))
    return np.column_stack(columns)


def assert_jacobian(
    value: Array, truth: Array, names: tuple[str, ...], *, at: Array, size: float, bound: float
) -> None:
    """Compares the columns of each input vector.

    Rounding is measured by their largest element, or by that of a function of this size that grows with the
    input: where contributions cancel, the derivative may be zero.
    """
    assert np.isfinite(value).all()
    for columns in groups(names):
        scale = max(float(np.abs(truth[:, columns]).max()), size / max(1.0, np.abs(at[columns]).max()))
        assert np.abs(value[:, columns] - truth[:, columns]).max() <= bound * scale, names[columns[0]]


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 6, 7, 10, 11])
def test_derivatives_of_the_composite_are_those_by_complex_step(seed: int) -> None:
    twin, p = twin_of(seed), flight(seed)[0].p
    whole = reference.composite(twin.scene, overrides(twin, p))
    bound = DERIVATIVE_ULPS / INERTIA_ULPS * inertia_bound(twin.scene, overrides(twin, p), whole)
    outputs = dict(zip(twin.composite.name_out(), twin.composite.call([twin.p]), strict=True))
    jacobian = np.array(ca.Function("d", [twin.p], [ca.jacobian(ca.veccat(*outputs.values()), twin.p)])(p))

    def function(z: NDArray[Any]) -> NDArray[Any]:
        whole = complex_composite(twin.scene, dict(zip(twin.p_names, z, strict=True)))
        return np.concatenate([whole[name] for name in outputs])

    value, truth = function(p).real, along(function, p)
    start = 0
    for output in outputs.values():
        rows = slice(start, start := start + output.numel())
        assert_jacobian(
            jacobian[rows],
            truth[rows],
            twin.p_names,
            at=p,
            size=float(np.abs(value[rows]).max()),
            bound=bound,
        )


@pytest.mark.parametrize("wrt", ["x", "u", "p", "h"])
@pytest.mark.parametrize("seed", [0, 3, 6, 10])
def test_derivatives_of_the_step_are_those_by_complex_step(seed: int, wrt: str) -> None:
    twin, m = twin_of(seed), flight(seed)[1]
    symbols = {"x": twin.x, "u": twin.u, "p": twin.p, "h": twin.h}
    at: dict[str, Array] = {"x": m.x, "u": m.u, "p": m.p, "h": np.array([m.h])}
    names = {"x": twin.x_names, "u": twin.u_names, "p": twin.p_names, "h": ("h",)}[wrt]
    jacobian = ca.Function(
        "d", list(symbols.values()), [ca.jacobian(twin.step(**symbols)["x_next"], symbols[wrt])]
    )
    value = np.array(jacobian(*at.values()))

    def state(z: NDArray[Any]) -> NDArray[Any]:
        now = at | {wrt: z}
        return complex_step(twin, now["x"], now["u"], now["p"], now["h"][0])

    bound = DERIVATIVE_ULPS * U * float(np.linalg.cond(np.array(twin.composite(m.p)[2]))) ** 2
    truth = along(state, at[wrt])
    for rows in (slice(0, 4), slice(4, 7)):
        size = float(np.abs(m.x_next[rows]).max())
        assert_jacobian(value[rows], truth[rows], names, at=at[wrt], size=size, bound=bound)


EDGES = {
    "at rest": (ISS_DG, {}, (0.0, 0.0, 0.0)),
    "symmetric body": (body(pmi=(2.0, 2.0, 2.0)), {}, (0.1, 0.2, 0.3)),
    "rate along an axis": (body(), {}, (0.0, 0.1, 0.0)),
    "massless ship": (ISS_DG, {"DG.mass": 0.0}, (0.1, 0.2, 0.3)),
    "massless station": (variant(ISS_DG, {"inputs.mass": ["ISS", "DG"]}), {"ISS.mass": 0.0}, (0.1, 0.2, 0.3)),
    "plate": (ISS_DG, {"DG.pmi[3]": 37.6}, (0.1, 0.2, 0.3)),
    "point": (ISS_DG, {f"DG.pmi[{i}]": 0.0 for i in (1, 2, 3)}, (0.1, 0.2, 0.3)),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("edge", EDGES)
def test_derivatives_are_finite_at_the_edges(edge: str, law: str) -> None:
    raw, changes, rates = EDGES[edge]
    twin = Twin(scene(variant(raw, {"rotation.law": law})))
    p = [changes.get(name, start) for name, start in zip(twin.p_names, twin.p_start, strict=True)]
    symbols = [twin.x, twin.u, twin.p, twin.h]
    everything = ca.veccat(twin.step(*symbols), *twin.composite.call([twin.p]))
    jacobian = ca.Function("d", symbols, [ca.jacobian(everything, ca.veccat(*symbols))])
    assert np.isfinite(np.array(jacobian([1.0, 0.0, 0.0, 0.0, *rates], np.zeros(3), p, 0.1))).all()
