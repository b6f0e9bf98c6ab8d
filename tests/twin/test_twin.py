"""The CasADi twin: its interface, the FMU's numbers to the last bit, the numpy reference, derivatives."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from supervessel import Scene, Twin, reference
from support import ISS_DG, LAWS, OK, Array, U, body, flying, scene, variant
from support.marks import FMI
from twin.scenes import numbers, random_inputs, random_scene

SEEDS = range(12)
STATES = tuple(
    f"state.{n}[{i}]" for n, k in (("attitude", 4), ("angular_velocity", 3)) for i in range(1, k + 1)
)
STEPS = 8  # communication steps of a flight, each with new inputs

# Twin and reference reach J by different sums of the same terms. A pose is a product of up to 5 rotations (at
# most 4 docks, and the vessel's own), each of 3-term dot products of triads that are normalised cross
# products: about 20 u a joint, 100 u in all, times the largest length met. An offset rho of a mass enters J
# twice, and 2 sum(m rho delta) <= sqrt(2) M size delta by Cauchy-Schwarz with size^2 = tr(J)/M, against a
# largest element of at least tr(J)/3: a factor 4.3. Both sides may err: 2 * 4.3 * 100 u.
INERTIA_ULPS = 860
# Solving with J multiplies its relative error by the condition number; omega x J omega, its difference from
# the torque and the triangular solves are sums of at most 3 terms: about 16 roundings on either side.
STAGE_ULPS = 32
# The reference adds six sixths of each mass, 30 terms at most; the twin adds five masses.
MASS_ULPS = 36
# Derivatives by CasADi and by complex step multiply the same partials in other orders: sums of at most 12
# products along 5 joints, with a 3-term dot product in triad, pose and square each, so that 3^3 * 12 terms of
# some 20 roundings meet, on either side. The partials of J^-1 carry the condition number twice.
DERIVATIVE_ULPS = 2 * 27 * 12 * 20
# The FMU and the twin differentiate the same operations and multiply the same partials, in another order: 27
# terms of up to 12 products, a rounding each, on either side. Nothing is inverted twice: no condition number.
CHAIN_ULPS = 2 * 27 * 12
TINY = 1e-30  # step along the imaginary axis; its square is below the last bit of everything here


@dataclass(frozen=True)
class Moment:
    """A communication step: before it x, u, p and the FMU's outputs y; after it x_next and y_next."""

    x: Array
    u: Array
    p: Array
    h: float
    y: dict[str, Array]
    x_next: Array
    y_next: dict[str, Array]


@cache
def twin_of(seed: int) -> Twin:
    return Twin(scene(random_scene(seed)))


@cache
def flight(seed: int) -> tuple[Moment, ...]:
    """Returns a flight of the FMU of a random scene, FMI 2 and 3 in turn, each step one sub-step."""
    raw, twin, rng = random_scene(seed), twin_of(seed), np.random.default_rng(1000 + seed)
    moments = []
    with flying(raw, 2 + seed % 2) as fmu:

        def outputs() -> dict[str, Array]:
            return {name: np.atleast_1d(fmu.get(name)) for name in raw["outputs"]["names"]}

        def state() -> Array:
            return np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])

        for _ in range(STEPS):
            x, (p, u) = state(), random_inputs(twin, rng)
            names = (*twin.p_names, *twin.u_names)
            assert fmu.set(dict(zip(names, (*p, *u), strict=True))) == OK, fmu.log
            y = outputs()
            h = min(float(twin.longest_step(x, u, p)), 10.0) * rng.uniform(0.1, 1.0)
            assert fmu.step(h) == OK, fmu.log
            moments.append(Moment(x, u, p, h, y, state(), outputs()))
    return tuple(moments)


def rk4(ode: Any, x: NDArray[Any], h: Any) -> NDArray[Any]:
    """Returns the classical Runge-Kutta step with the attitude at unit length, in plain numpy."""
    k1 = ode(x)
    k2 = ode(x + 0.5 * h * k1)
    k3 = ode(x + 0.5 * h * k2)
    k4 = ode(x + h * k3)
    end = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    a, b, c, d = end[:4]
    return np.concatenate([end[:4] / np.sqrt(a * a + b * b + c * c + d * d), end[4:]])


# Names and signatures


@FMI
def test_p_and_u_names_are_the_inputs_in_the_order_of_the_model_description(fmi: int) -> None:
    twin = twin_of(1)
    with flying(random_scene(1), fmi) as fmu:
        inputs = [v.name for v in fmu.description.modelVariables if v.causality == "input"]
    assert twin.u_names == ("torque[1]", "torque[2]", "torque[3]")
    assert twin.p_names == tuple(name for name in inputs if not name.startswith("torque["))


def test_y_names_are_the_outputs_in_the_order_of_the_model_description() -> None:
    with flying(random_scene(1)) as fmu:
        outputs = [v.name for v in fmu.description.modelVariables if v.causality == "output"]
    assert twin_of(1).y_names == tuple(outputs)


def test_p_start_holds_the_start_values_of_the_model_description() -> None:
    twin = twin_of(1)
    with flying(random_scene(1)) as fmu:
        start = {v.name: v.start for v in fmu.description.modelVariables}
    assert twin.p_start.tolist() == [float(start[name]) for name in twin.p_names]


def test_x_names_are_the_states_of_the_fmu() -> None:
    assert twin_of(0).x_names == STATES


@pytest.mark.parametrize(
    ("function", "inputs", "outputs"),
    [
        ("composite", ["p"], ["mass", "barycentre", "inertia", "pmi"]),
        ("ode", ["x", "u", "p"], ["x_dot"]),
        ("step", ["x", "u", "p", "h"], ["x_next"]),
        ("outputs", ["x", "u", "p"], ["y"]),
    ],
)
def test_functions_have_named_arguments_in_one_order(
    function: str, inputs: list[str], outputs: list[str]
) -> None:
    twin = twin_of(1)
    named = getattr(twin, function)
    sizes = {"x": 7, "u": 3, "p": len(twin.p_names), "h": 1}
    assert (named.name(), named.name_in(), named.name_out()) == (function, inputs, outputs)
    assert [named.numel_in(name) for name in inputs] == [sizes[name] for name in inputs]


def test_symbols_are_handed_out_beside_the_functions() -> None:
    twin = twin_of(1)
    again = ca.Function(
        "again", [twin.x, twin.u, twin.p, twin.h], [twin.step(twin.x, twin.u, twin.p, twin.h)]
    )
    at = (twin.x_start, [1.0, 2.0, 3.0], twin.p_start, 0.1)
    assert numbers(again(*at)).tolist() == numbers(twin.step(*at)).tolist()


def test_functions_take_matrix_symbols_and_keywords() -> None:
    twin = twin_of(1)
    x = ca.MX.sym("x", 7)
    at = {"u": [1.0, 2.0, 3.0], "p": twin.p_start, "h": 0.1}
    step = ca.Function("step", [x], [twin.step(x=x, **at)["x_next"]])
    assert numbers(step(twin.x_start)).tolist() == numbers(twin.step(x=twin.x_start, **at)["x_next"]).tolist()


# The FMU's numbers to the last bit


@pytest.mark.parametrize("seed", SEEDS)
def test_composite_is_the_fmus_to_the_last_bit(seed: int) -> None:
    for moment in flight(seed):
        for value, name in zip(
            twin_of(seed).composite(moment.p), twin_of(seed).composite.name_out(), strict=True
        ):
            assert numbers(value).tolist() == moment.y[name].tolist(), name


@pytest.mark.parametrize("seed", SEEDS)
def test_outputs_are_the_fmus_to_the_last_bit(seed: int) -> None:
    twin = twin_of(seed)
    for moment in flight(seed):
        for x, y in ((moment.x, moment.y), (moment.x_next, moment.y_next)):
            expected = [number for name in twin.scene.outputs.names for number in y[name]]
            assert numbers(twin.outputs(x, moment.u, moment.p)).tolist() == expected


@pytest.mark.parametrize("seed", SEEDS)
def test_chained_steps_are_the_fmus_to_the_last_bit(seed: int) -> None:
    moments = flight(seed)
    x = moments[0].x
    for moment in moments:
        x = numbers(twin_of(seed).step(x, moment.u, moment.p, moment.h))
        assert x.tolist() == moment.x_next.tolist()


@pytest.mark.parametrize("seed", SEEDS)
def test_runge_kutta_over_the_ode_is_the_fmus_step_to_the_last_bit(seed: int) -> None:
    twin = twin_of(seed)
    for m in flight(seed):
        step = rk4(lambda x, m=m: numbers(twin.ode(x, m.u, m.p)), m.x, m.h)
        assert step.tolist() == m.x_next.tolist()


@pytest.mark.parametrize("seed", SEEDS)
def test_state_at_the_start_is_the_fmus_to_the_last_bit(seed: int) -> None:
    assert twin_of(seed).x_start.tolist() == flight(seed)[0].x.tolist()


def test_step_stops_being_the_fmus_where_the_fmu_takes_two_sub_steps() -> None:
    twin = twin_of(9)
    x, u, p = twin.x_start, np.zeros(3), twin.p_start
    h = 1.5 * float(twin.longest_step(x, u, p))
    with flying(random_scene(9)) as fmu:
        assert fmu.step(h) == OK
        rates = fmu.get("angular_velocity")
    half = twin.step(x, u, p, 0.5 * h)
    assert rates.tolist() == numbers(twin.step(half, u, p, 0.5 * h))[4:].tolist()
    assert rates.tolist() != numbers(twin.step(x, u, p, h))[4:].tolist()


def test_two_twins_of_a_scene_give_the_same_numbers() -> None:
    for m in flight(11):
        one, other = (Twin(scene(random_scene(11))) for _ in range(2))
        for name, at in (("composite", (m.p,)), ("ode", (m.x, m.u, m.p)), ("step", (m.x, m.u, m.p, m.h))):
            values = [ca.veccat(*getattr(twin, name).call(at)) for twin in (one, other)]
            assert numbers(values[0]).tolist() == numbers(values[1]).tolist()


# The numpy reference


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


def groups(names: tuple[str, ...]) -> Iterator[list[int]]:
    """Yields the places of the elements of each input vector."""
    kinds = [name.partition("[")[0] for name in names]
    for kind in dict.fromkeys(kinds):
        yield [i for i, other in enumerate(kinds) if other == kind]


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


def response(twin: Twin) -> ca.Function:
    """Returns the twin's outputs and rates and their Jacobian by p, u, x, as a function of those."""
    rows = ca.vertcat(twin.outputs(twin.x, twin.u, twin.p), twin.ode(twin.x, twin.u, twin.p))
    knowns = ca.vertcat(twin.p, twin.u, twin.x)
    return ca.Function("response", [knowns], [ca.jacobian(rows, knowns)])


@pytest.mark.parametrize("seed", SEEDS)
def test_directional_and_adjoint_derivatives_of_the_fmu_are_the_twins(seed: int) -> None:
    raw, twin, rng = random_scene(seed), twin_of(seed), np.random.default_rng(2000 + seed)
    knowns = [*twin.p_names, *twin.u_names, *twin.x_names]
    unknowns = [*twin.y_names, *(f"der({name})" for name in twin.x_names)]
    jacobian = response(twin)
    with flying(raw) as fmu:
        for _ in range(STEPS):
            x = np.concatenate([fmu.get("state.attitude"), fmu.get("state.angular_velocity")])
            p, u = random_inputs(twin, rng)
            assert fmu.set(dict(zip(knowns, (*p, *u), strict=False))) == OK, fmu.log
            at = np.concatenate([p, u, x])
            J = np.array(jacobian(at))
            # Changes are of the inputs' own sizes, rounding that of the largest of an output's elements.
            size = np.maximum(np.abs(at), 1.0)
            share = np.zeros(J.shape)
            for rows in groups(tuple(unknowns)):
                share[rows] = np.abs(J[rows] * size).max(axis=0)
            seeds, weights = rng.normal(size=len(knowns)) * size, rng.normal(size=len(unknowns))
            difference = fmu.directional(unknowns, knowns, seeds) - J @ seeds
            assert (np.abs(difference) <= CHAIN_ULPS * U * (share @ np.abs(seeds / size))).all()
            difference = (fmu.adjoint(unknowns, knowns, weights) - J.T @ weights) * size
            assert (np.abs(difference) <= CHAIN_ULPS * U * (share.T @ np.abs(weights))).all()
            assert fmu.step(0.1) == OK, fmu.log


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


# Scenes with little in them


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "raw", [variant(body(), {"inputs": {}}), variant(ISS_DG, {"inputs": {}})], ids=["one", "two"]
)
def test_scene_without_inputs_has_empty_p_and_u(raw: dict[str, Any], law: str) -> None:
    rates = [0.03, -0.02, 0.01]
    twin = Twin(scene(variant(raw, {"rotation": {"law": law, "angular_velocity": rates}})))
    assert (twin.p_names, twin.u_names, twin.p_start.shape) == ((), (), (0,))
    expected = rk4(lambda x: reference.ode(twin.scene, x), twin.x_start, 0.5)
    # J of these scenes has a condition below 3: what STAGE_ULPS says of a stage, relative to the rates.
    assert np.abs(numbers(twin.step(twin.x_start, [], [], 0.5)) - expected).max() <= 3 * STAGE_ULPS * U
    whole = reference.composite(twin.scene)
    assert abs(float(twin.composite([])[0]) - whole.mass) <= MASS_ULPS * U * whole.mass
    assert numbers(twin.outputs(twin.x_start, [], [])).shape == (len(twin.y_names),)


# CasADi's own settings


@contextmanager
def simplification(setting: bool) -> Iterator[None]:
    found = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(setting)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(found)


@pytest.mark.parametrize("setting", [True, False])
def test_twin_leaves_casadis_simplification_as_it_found_it(setting: bool) -> None:
    with simplification(setting):
        Twin(scene(body()))
        assert ca.GlobalOptions.getSimplificationOnTheFly() is setting


def test_composite_is_the_fmus_whatever_casadis_simplification() -> None:
    with simplification(False):
        twin = Twin(scene(random_scene(7)))
    for m in flight(7):
        assert numbers(twin.composite(m.p)[2]).tolist() == m.y["inertia"].tolist()
