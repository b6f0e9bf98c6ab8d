"""Parametrisations that many modules share.

They need pytest, which what `make peers` installs does not bring: `support` itself does not import them.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import pytest

FMI = pytest.mark.parametrize("fmi", [2, 3])
KIND = pytest.mark.parametrize("exchange", [False, True], ids=["co-simulation", "model exchange"])
FMI_3_AT_ONCE = pytest.mark.parametrize("fmi", [pytest.param(2, marks=pytest.mark.thorough), 3])
"""Both versions in `make thorough`, one in `make test`: where they differ in names and wrappers alone."""


def some_at_once(cases: Iterable[Any] | Mapping[str, Any], *quick: Any) -> list[Any]:
    """Returns cases to parametrise by, of which `make test` runs a few and `make thorough` all.

    cases : values by their ids; or values, a tuple of which holds those of several arguments
    quick : those that `make test` runs: ids, or values
    """
    if isinstance(cases, Mapping):
        named = [(name, pytest.param(case, id=name)) for name, case in cases.items()]
    else:
        named = [(case, pytest.param(*(case if isinstance(case, tuple) else (case,)))) for case in cases]
    unknown = [one for one in quick if not any(one == name for name, _ in named)]
    assert not unknown, unknown
    return [
        case
        if any(name == one for one in quick)
        else pytest.param(*case.values, id=case.id, marks=pytest.mark.thorough)
        for name, case in named
    ]
