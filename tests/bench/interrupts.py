"""How long after a signal commands end, at moments all through them: `make bench`.

The moments are counted from the command's first line; a command that is done sooner is not told to end. In
`row` every mass and pose of 300 vessels is an input: its equations are long pieces of work in CasADi.
"""

import signal
import tempfile
from dataclasses import replace
from pathlib import Path
from statistics import median

from support.signals import CASES, ROW, end

MOMENTS = [0.5 * i for i in range(9)]  # s


def main() -> None:
    """Prints the table."""
    print("| command | signal | told to end | median [s] | worst [s] | at [s] | other ends |")
    print("|---|---|---:|---:|---:|---:|---:|")
    cases = CASES | {"row": replace(CASES["build"], texts=(ROW,))}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        end(CASES["build"], folder / "warm", signal.SIGTERM, 600.0, folder / "cache")
        for what, case in cases.items():
            for number in (signal.SIGINT, signal.SIGTERM):
                place = folder / f"{what}{number}"
                every = {d: end(case, place / str(d), number, d, folder / "cache") for d in MOMENTS}
                told = {delay: ended for delay, ended in every.items() if ended.told}
                seconds = [ended.seconds for ended in told.values()]
                worst = max(told, key=lambda delay: told[delay].seconds)
                others = sum(ended.status != 128 + number or bool(ended.left) for ended in told.values())
                print(
                    f"| {what} | {number.name} | {len(told)} | {median(seconds):.2f} | {max(seconds):.2f} "
                    f"| {worst:g} | {others} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
