"""How a command ends when a signal tells it to: at once, from its first line on, with nothing left behind.

For commands only: a program that uses this package keeps its own handlers of signals (see `interrupts`).
The handler raises no exception, which an import or CasADi could swallow and which threads would not see: it
ends what runs, removes what is unfinished, says one line and ends the process. Python calls it between two
steps of the interpreter, so that a single call of a C library delays it, 0.15 s at most in all that we call.

What this module imports is there before a handler is: nothing that takes time.
"""

import errno
import os
import signal
import sys
import time
from _thread import RLock, get_ident
from collections.abc import Callable
from contextlib import suppress

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Ctrl-C, the usual way to end a program, and a terminal that is closed; Windows has no SIGHUP."""

MADE_WITHIN = 0.5
"""Seconds that are waited for what threads are just making: a busy system lets them wait in that call."""

ROUNDS = 20
"""How often temporary files are removed, until all are gone: a program that ends may still add some."""

before_end: list[Callable[[], object]] = []
"""Called when a signal ends the command, in this order, before temporary files are removed."""

busy = RLock()
"""Held while a thread does what an end must not cut in two; see `interrupts.uninterrupted`."""

_main_thread = 0  # known in a command
_blocks: list[None] = []  # one for each uninterrupted block that the main thread is in
_heard: list[int] = []  # signals that have told the command to end: the first only
_note = ""
_temporary: set[str] = set()
_making: dict[int, str] = {}  # by thread, the temporary file or folder that it is about to make
_ended = False


def run_as_process(main: Callable[[], int]) -> int:
    """Returns what a command returns that this process was started for; from here on signals end it.

    The exit status is then 128 and the signal's number. A signal that is ignored already stays ignored, as
    in a background job. Once the command is done all signals are: Python's own end takes some time.
    """
    global _main_thread  # noqa: PLW0603
    _main_thread = get_ident()
    _open_streams()
    sys.addaudithook(_watch)
    handled = [n for n in SIGNALS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    for number in handled:
        signal.signal(number, tell)
    try:
        return main()
    except Exception as error:
        missing = _missing(error)
        if not missing:
            raise
        _quietly(os.write, 2, f"the system gives this command no more {missing}\n".encode())
        return 1
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_IGN)
        _flush_errors()


def tell(number: int, _frame: object) -> None:
    """Ends the command, unless that has begun; the main thread finishes its uninterrupted block first."""
    if not _heard:
        _heard.append(number)
        if not _blocks:
            _end()


def say(note: str) -> None:
    """Has the line that a command ends with say more: what is true whenever it ends from now on."""
    global _note  # noqa: PLW0603
    _note = note


def enter_block() -> None:
    """Begins what an end must not cut in two: it waits, in whichever thread this is."""
    busy.acquire()
    if get_ident() == _main_thread:
        _blocks.append(None)


def leave_block() -> None:
    """Ends what `enter_block` has begun; then ends the command if it has been told so in the meantime."""
    busy.release()
    if get_ident() == _main_thread:
        _blocks.pop()
        if _heard and not _blocks:
            _end()


def _end() -> None:
    """Ends the process."""
    global _ended  # noqa: PLW0603
    try:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        busy.acquire()  # for good
        _ended = True
        for act in before_end:
            _quietly(act)
        _wait_for_made()
        for _ in range(ROUNDS):
            if not [path for path in tuple(_temporary) if not _remove(path)]:
                break
        if sys.stderr is not None:
            start = "\n" if os.isatty(2) else ""  # a terminal may show there how far the command has come
            _quietly(os.write, 2, f"{start}interrupted{_note}\n".encode())
    finally:
        os._exit(128 + _heard[0])


def _wait_for_made() -> None:
    """Waits until what other threads are about to make is there: it is removed only then."""
    until = time.monotonic() + MADE_WITHIN
    while time.monotonic() < until:
        others = [path for thread, path in tuple(_making.items()) if thread != _main_thread]
        if all(map(os.path.lexists, others)):
            return
        time.sleep(0.001)


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    """Keeps the names of temporary files and folders, of which Python tells before it makes them.

    When the command ends, other threads stop here at their next step into the system: they make nothing new.
    """
    thread = get_ident()
    if _making and not (event in ("open", "os.mkdir") and arguments[0] == _making.get(thread)):
        _making.pop(thread, None)  # whatever comes next, it has been made
    if _ended and thread != _main_thread:
        _making.pop(thread, None)
        busy.acquire()
    if event in ("tempfile.mkdtemp", "tempfile.mkstemp"):
        _making[thread] = path = os.fsdecode(arguments[0])  # type: ignore[arg-type]
        _temporary.add(path)


def _remove(path: str) -> bool:
    """Removes a file, or a folder with all that is in it; returns whether it is gone."""
    if not os.path.islink(path):  # noqa: PTH114
        for folder, folders, files in os.walk(path, topdown=False):
            for name in (*files, *folders):  # what is left of folders are links
                _quietly(os.unlink, os.path.join(folder, name))  # noqa: PTH118
            _quietly(os.rmdir, folder)
    _quietly(os.unlink, path)
    return not os.path.lexists(path)


def _quietly(act: Callable[..., object], *arguments: object) -> None:
    """Does something that may fail: the end goes on."""
    with suppress(Exception):
        act(*arguments)


def _missing(error: BaseException | None) -> str:
    """Returns what the system has refused, if that is behind an error; else nothing."""
    numbers = {errno.EMFILE: "open files", errno.ENFILE: "open files"}
    numbers |= {errno.ENOMEM: "memory", errno.EAGAIN: "processes"}
    words = {"new thread": "processes", "map segment": "memory", "allocate memory": "memory"}
    while error is not None:
        if isinstance(error, MemoryError):
            return "memory"
        if isinstance(error, OSError) and error.errno in numbers:
            return numbers[error.errno]
        for part, missing in words.items():  # of threads, and of libraries that are loaded
            if isinstance(error, RuntimeError | ImportError) and part in str(error):
                return missing
        error = error.__cause__ or error.__context__
    return ""


def _flush_errors() -> None:
    """Drops what standard error has not taken: at its end Python would make another exit status of that."""
    try:
        sys.stderr.flush()
    except (OSError, ValueError):
        _quietly(os.dup2, os.open(os.devnull, os.O_WRONLY), 2)


def _open_streams() -> None:
    """Opens what is closed of standard input, output and error: nothing else gets their numbers."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # it gets the lowest number that is free
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
