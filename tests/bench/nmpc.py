"""How long the solves of the NMPC example take, in closed loop on the FMU from random starts: `make slews`.

Beside fatrop: plain ipopt, and sqpmethod with qrqp for a tenth of the starts. Starts are attitudes of both
signs, rates up to 0.8 of their limit, outside the cone. A solve by fatrop is repeated from the same guess;
the least of ten tries is closer to what it takes where nobody else loads the machine. Arguments: runs,
starts, solves from each.
"""

import sys
import tempfile
import time
from pathlib import Path

import casadi as ca
import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "examples"))

import nmpc_slew as slew  # noqa: E402

from fmu_build import build_fmu  # noqa: E402
from supervessel import Twin, load_scene  # noqa: E402

STARTS, SOLVES, RUNS, TRIES = 20, 40, 3, 10


def solvers(twin: Twin, problem: slew.Problem, folder: Path) -> dict[str, ca.Function]:
    """Returns the solvers by name, fatrop's first."""
    nlp, _, _, hessian = problem
    ipopt = {"print_level": 0, "sb": "yes", "tol": slew.TOLERANCE}
    # of the cost alone: sqpmethod's quadratic problems must be convex
    arguments = [ca.MX.sym(name, *hessian.size_in(name)) for name in hessian.name_in()]
    convex = hessian(*arguments[:3], 0)[1] + 1e-4 * ca.MX.eye(nlp["x"].numel())
    quiet = dict.fromkeys(("print_iter", "print_header", "print_info", "error_on_fail"), False)
    sqp = dict.fromkeys(("print_header", "print_iteration", "print_status"), False) | {
        "hess_lag": ca.Function("nlp_hess_l", arguments, [convex], hessian.name_in(), ["hess_gamma_x_x"]),
        "qpsol": "qrqp",
        "qpsol_options": quiet,
        "tol_pr": slew.TOLERANCE,
        "tol_du": slew.TOLERANCE,
    }
    return {
        "fatrop, compiled": slew.fatrop(twin, problem, folder),
        "ipopt": ca.nlpsol("ipopt", "ipopt", nlp, slew.OPTIONS | {"ipopt": ipopt}),
        "sqpmethod with qrqp": ca.nlpsol("sqp", "sqpmethod", nlp, slew.OPTIONS | sqp),
    }


def random_starts(count: int, seed: int) -> slew.Array:
    """Returns states, (count, 7), outside the cone."""
    generator, starts = np.random.default_rng(seed), []
    while len(starts) < count:
        q = generator.normal(size=4)
        rates = generator.uniform(-0.8, 0.8, 3) * slew.PLANNED_RATE
        x = np.append(q / np.linalg.norm(q), rates)
        if slew.off_sun(x) < np.cos(slew.PLANNED_CONE):
            starts.append(x)
    return np.array(starts)


def measured(fmu, solver, bounds, starts, solves, *, tries=1):
    """Returns a row for each solve: first try [s], least of the tries [s], iterations, success."""
    rows = []

    def timed(**arguments):
        taken = []
        for _ in range(tries):
            begun = time.perf_counter()
            solution = solver(**arguments)
            taken.append(time.perf_counter() - begun)
        rows.append([taken[0], min(taken), solver.stats()["iter_count"], solver.stats()["success"]])
        return solution

    for start in starts:
        guess = slew.first_guess(start)

        def control(x, guess=guess):
            guess[:] = np.array(timed(x0=guess, p=x, **bounds)["x"]).ravel()
            return slew.TORQUE * guess[:3]

        slew.fly(fmu, control, start, duration=slew.PERIOD * (solves - 1))
    return np.array(rows)


def main(runs: int, starts: int, solves: int) -> None:
    """Prints the table, a run after the other."""
    scene = load_scene(HERE.parents[1] / "examples" / "servicer.toml")
    twin = Twin(scene, propagator="rk4", fixed=True)
    problem = slew.slew_problem(twin)
    print(
        "| run, solver | solves | failed | iterations, median, most | median [ms] | worst, cold too [ms] |",
        end="",
    )
    print(" least of ten: median, worst [ms] | median against ipopt |\n|---|" + "---:|" * 7)
    with tempfile.TemporaryDirectory() as name:
        fmu = build_fmu(scene, Path(name) / "servicer.fmu")
        ways = solvers(twin, problem, Path(name))
        for run in range(runs):
            at = random_starts(starts, seed=run)
            rows = {}
            for way, solver in ways.items():
                few = at[::10] if way.startswith("sqp") else at
                tries = TRIES if way.startswith("fatrop") else 1
                rows[way] = measured(fmu, solver, problem[1], few, solves, tries=tries)
            by_ipopt = np.median(rows["ipopt"][:, 0])
            for way, each in rows.items():
                first, least = 1e3 * each[:, 0], 1e3 * each[:, 1]
                iterations = f"{np.median(each[:, 2]):.0f}, {each[:, 2].max():.0f}"
                print(
                    f"| {run + 1}, {way} | {len(each)} | {np.sum(each[:, 3] == 0)} | {iterations} "
                    f"| {np.median(first):.2f} | {first.max():.1f} "
                    f"| {np.median(least):.2f}, {least.max():.1f} "
                    f"| {1e3 * by_ipopt / np.median(first):.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main(*(int(n) for n in sys.argv[1:]) if len(sys.argv) > 1 else (RUNS, STARTS, SOLVES))
