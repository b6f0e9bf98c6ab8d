"""Pieces of work that signals do not cut in two, in commands and in programs that use this package."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

from supervessel.shell import ending

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interrupt_afterwards() -> Iterator[None]:
    """Has signals that would raise an exception in a block wait for its end: CasADi swallows some of these.

    Other threads never get one. The handler of our commands raises nothing, so it need not wait.
    """
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    before = {n: handler for n, handler in handlers.items() if callable(handler) and handler != ending.tell}
    if current_thread() is not main_thread():
        yield
        return
    heard: list[tuple[int, FrameType | None]] = []
    for number in before:
        signal.signal(number, lambda number, frame: heard.append((number, frame)))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if heard:
        first, frame = heard[0]
        before[signal.Signals(first)](first, frame)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Has every signal wait for the end of a block, the end of a command too: short pieces of work only.

    What begins in the block and is unfinished without its end: a program that is started and must be known,
    files that come into place together. No two threads are in such blocks at the same time.
    """
    with interrupt_afterwards():
        ending.enter_block()
        try:
            yield
        finally:
            ending.leave_block()


@contextmanager
def finally_done(act: Callable[[], object]) -> Iterator[None]:
    """Calls a function after a block, also when a signal ends the command in it. It must raise nothing."""
    ending.before_end.append(act)
    try:
        yield
    finally:
        act()
        ending.before_end.remove(act)
