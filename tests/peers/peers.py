"""How well-known engines turn one rigid body at the extremes, beside this project's FMU: `make peers`.

Prints one Markdown table, errors of attitude in rad against solutions at 50 digits (cases.py), then how each
engine was set (engines.py) and its version. Each flight is a process of its own and has 20 s. What is not
installed is left out.

    python tests/peers/peers.py              (needs tests on the path)
    python tests/peers/peers.py mujoco bsk   only these packages
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from importlib import import_module, metadata
from pathlib import Path

import numpy as np
from engines import OURS, SETTINGS, Body, InsteadError, Setting, our_scene

SECONDS = 20.0
WRONG = 0.1  # rad, beyond which an answer is of no use
WORDS = 70  # characters of a refusal
NAMES = {
    "supervessel": "this project",
    "scipy": "SciPy",
    "mujoco": "MuJoCo",
    "drake": "Drake",
    "bsk": "Basilisk",
    "heyoka": "heyoka",
    "pin": "Pinocchio",
    "casadi": "CasADi",
    "pythonfmu": "pythonfmu",
}


def main(packages: list[str]) -> None:
    """Prints the table, a row for each task."""
    chosen = [(i, s) for i, s in enumerate(SETTINGS) if not packages or s.package in packages]
    versions = {package: version(package) for package in dict.fromkeys(s.package for _, s in chosen)}
    for package in [p for p, version in versions.items() if version is None]:
        print(f"{NAMES[package]} is not installed: left out\n")
    chosen = [(i, s) for i, s in chosen if versions[s.package]]
    if "supervessel" in versions:
        for propagator, tolerance in OURS.items():  # compiled before anything has to be done in time
            import_module("support").built(our_scene(propagator, tolerance), optimised=True)
    print("| case | u (1 + cond) | " + " | ".join(_title(s) for _, s in chosen) + " |")
    print("|---|---:|" + "---:|" * len(chosen))
    doubtful = {}
    for number, task in enumerate(import_module("cases").tasks()):
        case = task.case
        body = Body(
            moments=np.diag(case.inertia).tolist(),
            attitude=case.attitude.tolist(),
            omega=case.omega.tolist(),
            torque=case.torque.tolist(),
            time=case.time,
            steps=task.steps,
        )
        found = [_fly(i, body) for i, _ in chosen]
        cells = [_cell(case, answer, task.exists) for answer in found]
        floor = f"{2.0**-53 * (1.0 + case.cond_attitude):.0e}" if task.exists else ""
        print(f"| {task.label} | {floor} | " + " | ".join(cells) + " |", flush=True)
        if number == 2:  # small steps: whose frames are understood is right
            doubtful = {_title(s): c for (_, s), c in zip(chosen, cells, strict=True) if not _small(c)}
    print("\nErrors in rad, bold beyond 0.1; u = 2^-53, cond: of the attitude to the inputs.\n")
    for _, setting in chosen:
        print(f"- {_title(setting)}, {versions[setting.package]}: {setting.text}")
    for title, cell in doubtful.items():
        print(f"\n{title} ends a plain tumble with {cell}: its conventions are in doubt.")


def _title(setting: Setting) -> str:
    return f"{NAMES[setting.package]} {setting.label}"


def version(package: str) -> str | None:
    """Returns the version of a package; None where it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _fly(index: int, body: Body) -> list[float] | str:
    """Returns the attitude at the end, or what was said instead."""
    words = [sys.executable, str(Path(__file__).resolve()), "--fly", str(index)]
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo leaves a log
        try:
            done = subprocess.run(
                words,
                input=json.dumps(asdict(body)),
                capture_output=True,
                text=True,
                timeout=SECONDS,
                cwd=folder,
                check=False,
                env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[1])},
            )
        except subprocess.TimeoutExpired:
            return f"> {SECONDS:.0f} s"
    if done.returncode:
        return "died: " + (done.stderr.strip().split("\n")[-1] or f"status {done.returncode}")
    answer: list[float] | str = json.loads(done.stdout.strip().split("\n")[-1])
    return answer


def _cell(case: object, answer: list[float] | str, exists: bool) -> str:
    if isinstance(answer, str):
        text = " ".join(answer.replace("|", "/").split())
        return text if len(text) <= WORDS else text[: WORDS - 3] + "..."
    if not all(map(math.isfinite, answer)):
        return "nan"
    if not exists:
        return "accepted"
    attitude_error = import_module("stability.truth").attitude_error
    error = min(attitude_error(case, answer), attitude_error(case, [-x for x in answer]))
    return f"**{error:.1g}**" if error > WRONG else f"{error:.0e}" if error else "0"


def _small(cell: str) -> bool:
    try:
        return float(cell) < 1e-2
    except ValueError:
        return False


def fly(index: int) -> None:
    """Flies what stands on stdin; prints the attitude, or what was said instead."""
    try:
        answer: list[float] | str = [float(x) for x in SETTINGS[index].fly(Body(**json.load(sys.stdin)))]
    except InsteadError as error:
        answer = str(error)
    print()
    print(json.dumps(answer))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--fly"]:
        fly(int(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as cache:  # of compiled code, which others may clear
            os.environ["SUPERVESSEL_CACHE"] = cache
            main(sys.argv[1:])
