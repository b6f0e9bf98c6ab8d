"""Programs run beside this one: none of them outlives an interrupt."""

import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Event, Lock
from types import TracebackType

_running: set["subprocess.Popen[str]"] = set()
_starting = Lock()
_interrupted = Event()


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
    with _starting:
        if _interrupted.is_set():
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
        _running.add(process)
    with process:
        try:
            out, error = process.communicate(timeout=time_limit)
        except BaseException:
            _end(process)
            raise
        finally:
            _running.discard(process)
    return subprocess.CompletedProcess(command, process.returncode, out, error)


class Workers(ThreadPoolExecutor):
    """Threads that wait for programs; an interrupt ends these, no other begins until the block is over."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Waits for what has begun; nothing else begins."""
        if kind is None or issubclass(kind, Exception):
            self.shutdown(cancel_futures=True)
            return
        with _starting:
            _interrupted.set()
            for process in tuple(_running):
                _end(process)
        try:
            self.shutdown(cancel_futures=True)
        finally:
            _interrupted.clear()


def _end(process: "subprocess.Popen[str]") -> None:
    """Ends a program, and what it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError, PermissionError):  # it has ended; macOS forbids what is left of it
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
