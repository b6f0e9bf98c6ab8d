"""Parametrisations that many modules share.

They need pytest, which what `make peers` installs does not bring: `support` itself does not import them.
"""

import pytest

FMI = pytest.mark.parametrize("fmi", [2, 3])
KIND = pytest.mark.parametrize("exchange", [False, True], ids=["co-simulation", "model exchange"])
