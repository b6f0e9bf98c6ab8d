"""What the same work costs by well-known engines, in plain RK4 steps of C and beside this project's FMU.

A body of diag(1, 2, 3) kg m2 turns at (1, 2, 0.5) rad/s for 100 s, free or under a constant torque, its state
wanted every 0.1 s or at the end alone. Each engine is taken at its cheapest setting whose attitude ends
within 1e-8 rad, or at the most accurate one tried, with that error. Time is the processor's; the plain step
is timed in the same process, in turn. What is not installed is left out.

    python tests/peers/work.py              (needs tests and tests/bench on the path)
    python tests/peers/work.py scipy bsk    only these packages beside this project's own
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fliers
import numpy as np
import own
from fliers import Work
from ladder import Judge, Ladder, Result, Settings
from run import build_host

from peers import NAMES, version
from support import series

HERE = Path(__file__).resolve().parent
MODULES = (HERE.parent, HERE.parent / "bench")
ENOUGH = 1e-8  # rad
SECONDS = 300.0  # of one way on one work, then its process ends
LADDER = Ladder(ENOUGH, 4.0, 15.0)
TORQUE = (0.1, -0.2, 0.15)  # N m
FREE = (0.0, 0.0, 0.0)
WORKS = {
    "free, every 0.1 s": Work(FREE, 1000),
    "free, one step": Work(FREE, 1),
    "torque, every 0.1 s": Work(TORQUE, 1000),
    "torque, one step": Work(TORQUE, 1),
}
ANGLES = [0.03 * 2.0 ** (-quarter / 4.0) for quarter in range(14)]  # rad, of rk4's sub-steps


Measured = Result | None


def by_ladder(ways: Callable[[Work], Settings]) -> Callable[[Path, Work, Judge], Measured]:
    """Returns the measurement of a way in Python: its first setting that is accurate enough, or its best."""
    return lambda folder, work, judge: LADDER.climb(ways(work), folder, judge)


def natively(propagator: str) -> Callable[[Path, Work, Judge], Measured]:
    """Returns the measurement of this project's FMU: its tolerances, for rk4 its sub-steps, in turn."""

    def measure(folder: Path, work: Work, judge: Judge) -> Measured:
        host, best = build_host("flight", folder), None
        rungs = (
            [(a, 0.0) for a in ANGLES] if propagator == "rk4" else [(0.05, 10.0**-d) for d in range(5, 14)]
        )
        for angle, tolerance in rungs[: 1 if propagator == "exact" else None]:
            flown = own.native(host, own.built(folder, propagator, angle), work, tolerance)
            if flown is None:
                return None
            text = f"sub-steps of {angle:.2g} rad" if propagator == "rk4" else f"tolerance {tolerance:.0e}"
            result = Result(flown[0], judge(flown[1]), text if propagator != "exact" else "")
            best = result if best is None or result.error < best.error else best
            if result.error <= ENOUGH:
                break
        return best

    return measure


@dataclass(frozen=True)
class Way:
    """A row of the table; `package` as pip knows it."""

    label: str
    package: str
    measure: Callable[[Path, Work, Judge], Measured]


def ways(folder: Path) -> list[Way]:
    """Returns the rows; what they make lies in a folder."""
    ours = "supervessel"
    found = [Way(f"FMU, `{p}`", ours, natively(p)) for p in ("auto", "exact", "taylor", "dop853", "rk4")]
    found += [Way("FMU through FMPy, `auto`", ours, by_ladder(own.through_fmpy(folder, "auto")))]
    found += [Way(f"twin, `{p}`", ours, by_ladder(own.twin(folder, p))) for p in ("exact", "taylor")]
    found += [Way(f"SciPy {m}", "scipy", by_ladder(fliers.scipy(m))) for m in ("DOP853", "LSODA")]
    found += [Way(f"CasADi {n}", "casadi", by_ladder(fliers.casadi(n))) for n in ("rk", "cvodes")]
    found += [Way("MuJoCo RK4", "mujoco", by_ladder(fliers.mujoco))]
    found += [Way("Drake RK5", "drake", by_ladder(fliers.drake("runge_kutta5")))]
    found += [Way("Basilisk RK4", "bsk", by_ladder(fliers.basilisk(None)))]
    found += [Way("Basilisk RKF78", "bsk", by_ladder(fliers.basilisk("svIntegratorRKF78")))]
    found += [Way("Pinocchio aba, SciPy DOP853", "pin", by_ladder(fliers.pinocchio))]
    return [*found, Way("pythonfmu, RK4 in Python", "pythonfmu", by_ladder(fliers.python_fmu(folder)))]


def by_series(work: Work) -> list[float]:
    """Returns the attitude at the end, from a series with 20 digits."""
    inertia = np.diag(fliers.MOMENTS).tolist()
    end = series.flight("tensor", inertia, fliers.START, work.torque, fliers.DURATION, digits=20)
    return [float(x) for x in end[:4]]


def measure(index: int, work: Work, end: list[float]) -> Measured:
    """Returns what one way costs for one work."""

    def judge(q: Any) -> float:
        gap = min(np.linalg.norm(np.array(q) - s * np.array(end)) for s in (1.0, -1.0))
        return float(2.0 * gap) if math.isfinite(gap) else math.inf

    with tempfile.TemporaryDirectory() as name:
        return ways(Path(name))[index].measure(Path(name), work, judge)


def _measured(index: int, work: str, end: list[float]) -> Measured | str:
    """Returns what `measure` does, in a process of its own; or what was said instead."""
    words = [sys.executable, str(Path(__file__).resolve()), "--measure", str(index), work]
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo leaves a log
        try:
            done = subprocess.run(
                words,
                input=json.dumps(end),
                capture_output=True,
                text=True,
                timeout=SECONDS,
                cwd=folder,
                check=False,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, MODULES))},
            )
        except subprocess.TimeoutExpired:
            return f"> {SECONDS:.0f} s"
    if done.returncode:
        return "died: " + (done.stderr.strip().split("\n")[-1][:70] or f"status {done.returncode}")
    answer = json.loads(done.stdout.strip().split("\n")[-1])
    return Result(**answer) if answer else None


def _cell(result: Measured | str, unit: float) -> str:
    if not isinstance(result, Result):
        return result or "-"
    note = "" if result.error <= ENOUGH else f" ({result.error:.0e} rad)"
    return f"{result.cost:.3g}, {result.cost / unit:.3g}{note}"


def main(packages: list[str]) -> None:
    """Prints the table, then the settings."""
    ends = {name: by_series(work) for name, work in WORKS.items() if work.spans == 1}
    ends |= {name: ends[name.replace("every 0.1 s", "one step")] for name in WORKS}
    with tempfile.TemporaryDirectory() as name:
        rows = [
            (i, w.label, w.package)
            for i, w in enumerate(ways(Path(name)))
            if not packages or w.package in (*packages, "supervessel")
        ]
    for package in dict.fromkeys(p for *_, p in rows if version(p) is None):
        print(f"{NAMES[package]} is not installed: left out\n")
    print("| to 1e-8 rad: plain RK4 steps, times the FMU's | " + " | ".join(WORKS) + " |")
    print("|---|" + "---:|" * len(WORKS))
    units: dict[str, float] = {}
    settings = []
    for index, label, package in rows:
        if version(package) is None:
            continue
        results = {work: _measured(index, work, ends[work]) for work in WORKS}
        for work, result in results.items():
            if isinstance(result, Result):
                units.setdefault(work, result.cost)  # of the first row, the FMU by `auto`
        cells = [_cell(result, units.get(work, math.nan)) for work, result in results.items()]
        print(f"| {label} | " + " | ".join(cells) + " |", flush=True)
        texts = [f"{r.text} ({r.error:.0e})" if isinstance(r, Result) else "-" for r in results.values()]
        settings.append(f"- {label}, {NAMES[package]} {version(package)}: " + "; ".join(texts))
    print("\n-: a torque, which `exact` discards; one step, by an engine whose steps are its setting.")
    print("Settings and errors [rad], column by column:\n")
    print("\n".join(settings))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        found = measure(int(sys.argv[2]), WORKS[sys.argv[3]], json.load(sys.stdin))
        print()
        print(json.dumps(found and vars(found)))
    else:
        main(sys.argv[1:])
