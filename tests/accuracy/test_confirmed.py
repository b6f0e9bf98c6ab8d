"""The claim of `[accuracy]`, confirmed: delivered FMUs, other histories of inputs, another solver."""

import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from accuracy.confirm import Confirmed, confirmed, random_scene


def one(seed: int) -> Confirmed:
    with tempfile.TemporaryDirectory() as folder:
        return confirmed(random_scene(seed), Path(folder), seed)


def report(found: list[Confirmed]) -> str:
    """Returns how often the claim held, and with how much room, as text."""
    built = [c for c in found if c.refused is None]
    used = np.array([max(c.used.values()) for c in built])
    room = np.array([c.evidence["asked"]["attitude"] / c.evidence["attitude"] for c in built])
    laws = Counter(f"{c.evidence['choice']['law']} {c.evidence['choice']['propagator']}" for c in built)
    quantiles = ", ".join(f"{q:.0%}: {np.quantile(used, q):.2g}" for q in (0.5, 0.9, 0.99, 1.0))
    return "\n".join(
        [
            f"{len(found)} scenes: {len(built)} built, {len(found) - len(built)} refused",
            f"the claim holds in {sum(c.holds for c in built)} of {len(built)}",
            f"largest error over what is asked, quantiles: {quantiles}",
            f"asked over the largest error in the choice's own flights, median: {np.median(room):.3g}",
            f"errors above those of the choice's own flights: {sum(_above(c) > 1.0 for c in built)}, "
            f"at most {max(map(_above, built)):.3g} times",
            f"a cheaper candidate would have done: {sum(c.cheaper for c in built)}",
            *(f"{count:4d} {name}" for name, count in laws.most_common()),
            *(f"refused: {c.refused}" for c in found if c.refused is not None),
        ]
    )


def _above(c: Confirmed) -> float:
    """Returns the error of the attitude over the largest one that the choice had found."""
    return max(c.attitude.values()) / c.evidence["attitude"]


@pytest.mark.accuracy
def test_the_fmu_of_a_random_scene_keeps_what_is_claimed():
    found = one(5)
    assert found.refused is None
    assert found.holds, found.used


@pytest.mark.accuracy
def test_the_claim_holds_for_random_scenes(scene_count, capsys):
    with ProcessPoolExecutor(2) as pool:
        found = []
        for seed, result in enumerate(pool.map(one, range(scene_count))):
            found.append(result)
            if not result.holds:
                with capsys.disabled():
                    print(f"seed {seed}: {result.used} {result.evidence['choice']}")
    with capsys.disabled():
        print("\n" + report(found))
    assert all(c.holds for c in found)
    assert sum(c.refused is not None for c in found) < 0.1 * len(found)
