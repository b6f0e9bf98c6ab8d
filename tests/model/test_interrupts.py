"""Ctrl-C while equations are made: CasADi swallows it in about a third of the tries, if it may."""

import os
import signal
import sys
from collections import deque
from threading import Timer

import pytest

from supervessel.equations import equations
from support import ISS_DG, scene


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent as POSIX does")
@pytest.mark.parametrize("delay", [0.01 * i for i in range(1, 13)])
def test_an_interrupt_while_equations_are_made_is_not_lost(delay):
    iss = scene(ISS_DG)
    clock = Timer(delay, os.kill, (os.getpid(), signal.SIGINT))
    clock.start()
    with pytest.raises(KeyboardInterrupt):
        deque((equations(iss) for _ in range(100)), maxlen=0)
    clock.join()
