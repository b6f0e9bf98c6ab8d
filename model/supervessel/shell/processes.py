"""Programs run beside this one: none of them outlives an interrupt."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from contextvars import ContextVar, copy_context
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import ParamSpec, Self, TypeVar

from supervessel.shell import ending
from supervessel.shell.interrupts import uninterrupted

P = ParamSpec("P")
T = TypeVar("T")

GRACE = 0.2  # s; a program that is killed takes milliseconds to be gone

_running: dict["subprocess.Popen[str]", tuple["Workers", ...]] = {}
"""Programs, each with the blocks of workers that it is run in."""

_blocks: ContextVar[tuple["Workers", ...]] = ContextVar("blocks", default=())


def run(
    command: Sequence[str],
    time_limit: float,
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
) -> "subprocess.CompletedProcess[str]":
    """Returns what came of a program, its output and its errors as text.

    time_limit : [s], after which it is ended; then raises subprocess.TimeoutExpired
    A program has a process group of its own, where there are any, so that what it starts ends with it.
    """
    begun: list[subprocess.Popen[str]] = []
    try:
        with uninterrupted():
            begun.append(_begin(command, folder, environment))
        out, error = begun[0].communicate(timeout=time_limit)
    except BaseException:
        for process in begun:
            with process:  # waits for it
                _end(process)
        raise
    finally:
        for process in begun:
            _running.pop(process)
    return subprocess.CompletedProcess(command, begun[0].returncode, out, error)


def _begin(
    command: Sequence[str], folder: Path | None, environment: Mapping[str, str] | None
) -> "subprocess.Popen[str]":
    """Returns a program that begins and is known to run in the blocks of its caller."""
    blocks = _blocks.get()
    if any(block.broken for block in blocks):
        raise RuntimeError("an interrupt ends programs: no other begins")
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        process_group=0,
    )
    _running[process] = blocks
    return process


class Workers(ThreadPoolExecutor):
    """Threads that wait for programs.

    An exception that leaves the block, or comes while it waits for its threads, ends all programs that are
    run in it, also in blocks within; no other begins there. It need not be KeyboardInterrupt: CasADi makes
    other exceptions of one. What threads outside of the block run goes on.
    """

    broken = False

    def __enter__(self) -> Self:
        self._outside = _blocks.set((*_blocks.get(), self))
        return self

    def submit(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Has a thread call a function, as one within the blocks of the caller."""
        return super().submit(copy_context().run, partial(function, *args, **kwargs))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Waits for what has begun; nothing else begins."""
        try:
            if kind is None:
                self.shutdown(cancel_futures=True)
                return
        except BaseException:
            self._break()
            raise
        finally:
            _blocks.reset(self._outside)
        self._break()

    def _break(self) -> None:
        """Ends the programs of the block and waits for its threads."""
        with uninterrupted():
            self.broken = True
            for process, blocks in tuple(_running.items()):
                if self in blocks:
                    _end(process)
        self.shutdown(cancel_futures=True)


def _end(process: "subprocess.Popen[str]") -> None:
    """Ends a program, and what it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError, PermissionError):  # it has ended; macOS forbids what is left of it
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def _end_all() -> None:
    """Ends every program; returns when they are gone."""
    programs = tuple(_running)
    for process in programs:
        _end(process)
    late = time.monotonic() + GRACE
    while any(process.poll() is None for process in programs) and time.monotonic() < late:
        time.sleep(0.002)


ending.before_end.append(_end_all)
