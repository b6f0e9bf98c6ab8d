"""Interrupts that are not lost: CasADi swallows some while expressions are made; and that come once only."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interrupt_afterwards() -> Iterator[None]:
    """Has signals that would interrupt a block wait for its end; other threads never get one."""
    before = {number: handler for number in SIGNALS if callable(handler := signal.getsignal(number))}
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
def interrupted_once() -> Iterator[None]:
    """Has SIGTERM interrupt a program's main block as the keyboard does, with KeyboardInterrupt.

    From the first one on all others are ignored: the program ends, and nothing shall disturb that. A signal
    that is ignored already stays so. Once interrupted they stay ignored: Python's own end takes some time.
    """
    if current_thread() is not main_thread():
        yield
        return

    heard: list[int] = []

    def interrupt(number: int, _frame: FrameType | None) -> None:
        if not heard:
            heard.append(number)
            raise KeyboardInterrupt

    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    before = {n: handler for n, handler in handlers.items() if handler not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if heard else handler)
