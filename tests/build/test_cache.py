"""The cache: nothing of a user's is touched, nothing that others could have written is taken for ours."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fmu_build.compile.compiler import TRIAL_FLAGS, compile_library
from fmu_build.compile.library import compile_sources
from fmu_build.errors import BuildError
from fmu_build.flight.results import keep, place_of, read
from fmu_build.generate.model import generate
from fmu_build.generate.sources import source_file_names, source_files
from fmu_build.platforms import host_platform
from fmu_build.storage import cache as caches
from fmu_build.storage import compiler_files, temporary
from fmu_build.storage.cache import FULL, LARGEST, OURS, TAG, TAG_TEXT, USED, cache_folder, folder_for
from fmu_build.storage.compiler_files import FOLDER, RECORD
from fmu_build.storage.temporary import temporary_folder
from supervessel.__main__ import main
from support import body, scene
from support.marks import some_at_once
from support.processes import ROOT, begin_cache, needs_posix

SCENE = 'name = "ball"\nroot = "B"\n[vessels.B]\nmass = 2.0\npmi = [1.0, 1.5, 2.0]\n'

STRANGER = 54321

needs_root = pytest.mark.skipif(
    getattr(os, "geteuid", lambda: 1)() != 0, reason="only root can give files to another user"
)


@pytest.fixture
def base(tmp_path, monkeypatch):
    """A folder that SUPERVESSEL_CACHE names."""
    folder = tmp_path / "base"
    folder.mkdir()
    monkeypatch.setenv("SUPERVESSEL_CACHE", str(folder))
    caches._say.cache_clear()
    return folder


@pytest.fixture
def generation(base):
    """The generation in use of a cache that is new."""
    return cache_folder()


def everything(folder):
    """Returns what is in a folder: names, and contents of files."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
        if OURS not in path.parts
    }


def old(path):
    """Makes a path two days old."""
    os.utime(path, (time.time() - 2e5,) * 2)


def pipe(path):
    """Makes a named pipe: who opens it waits for somebody at its other end."""
    os.mkfifo(path)


# A folder of our own.


def test_a_folder_that_is_named_keeps_all_that_the_user_has_in_it(base):
    for kind in ("tmp", "sources", "o", "h", "z", "trade", "accuracy", "supervessel-old"):
        (base / kind).mkdir()
        for name in ("thesis.tex", "generation-1"):
            (base / kind / name).write_text(kind)
            old(base / kind / name)
        old(base / kind)
    before = everything(base)
    folder_for("libraries")
    (cache_folder() / FULL).touch()
    folder_for("libraries")
    main(["cache", "--clear"])
    assert everything(base) == before
    assert sorted(path.name for path in base.iterdir() if path.name not in before) == []


def test_our_folder_is_the_users_alone_and_says_that_it_is_a_cache(base, generation):
    assert generation == base / OURS / "generation-1"
    assert (base / OURS / TAG).read_text().startswith("Signature: 8a477f597d28d172789f06886806bc55\n")
    if os.name == "posix":
        assert (base / OURS).stat().st_mode & 0o777 == 0o700


def unused(base, capsys):
    """Returns why a cache is left unused, which is said once; another takes its place."""
    assert base not in cache_folder().parents
    cache_folder()
    said = capsys.readouterr().err
    beginning = "the cache is left unused, nothing is kept: "
    assert said.startswith(beginning)
    assert said.count("\n") == 1
    assert main(["cache"]) == 0
    reason = said.removeprefix(beginning).strip()
    assert capsys.readouterr().out.splitlines()[1] == f"left unused: {reason}"
    return reason


def test_a_folder_of_the_users_that_is_called_as_ours_is_left_alone(base, capsys):
    (base / OURS).mkdir()
    (base / OURS / "README").write_text("a clone")
    assert unused(base, capsys) == (
        f"{base / OURS} has not been made by supervessel, its CACHEDIR.TAG is another or missing"
    )
    main(["cache", "--clear"])
    assert (base / OURS / "README").read_text() == "a clone"


@needs_posix
def test_a_cache_that_is_a_link_is_left_unused_and_what_it_leads_to_alone(base, tmp_path, capsys):
    victim = tmp_path / "victim"
    (victim / "generation-1").mkdir(parents=True)
    (victim / TAG).write_bytes(TAG_TEXT)
    (victim / "generation-1" / "thesis.tex").write_text("x")
    (base / OURS).symlink_to(victim)
    assert unused(base, capsys) == f"{base / OURS} is no folder, or a link to one"
    main(["cache", "--clear"])
    assert (victim / "generation-1" / "thesis.tex").read_text() == "x"


@needs_posix
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702, 0o1777])
def test_a_cache_that_others_may_write_is_left_unused(base, generation, capsys, mode):
    (base / OURS).chmod(mode)
    assert unused(base, capsys) == (
        f"others may write {base / OURS} and may have changed what is in it; remove it, and another is made"
    )
    assert main(["cache", "--clear"]) == 0
    assert generation.exists()


@needs_posix
@pytest.mark.parametrize("at", [".", ".."])
def test_a_cache_in_a_folder_that_others_may_write_is_left_unused(base, capsys, at):
    """They could put theirs in its place; not where the sticky bit forbids that, as in /tmp."""
    outer = Path(os.path.realpath(base / at))
    outer.chmod(0o777)
    assert unused(base, capsys) == f"others may write {outer}, and so replace what is in it"
    outer.chmod(0o1777)
    assert base in cache_folder().parents


@needs_posix
@needs_root
@pytest.mark.parametrize("which", ["base", "ours"])
def test_a_cache_of_another_user_is_left_unused(base, generation, capsys, which):
    folder = base if which == "base" else base / OURS
    os.chown(folder, STRANGER, STRANGER)
    assert unused(base, capsys) == f"{folder} belongs to another user"


def test_a_user_whose_home_is_no_path_has_no_cache_in_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.delenv("SUPERVESSEL_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "")
    monkeypatch.chdir(tmp_path)
    cache_folder()
    assert list(tmp_path.iterdir()) == []


# What is in it, is looked at.


@pytest.fixture
def place(generation):
    """The place of an answer that is kept."""
    place = place_of("trade", scene(body()), "asked")
    keep(place, {"samples": [1.0, 2.0]})
    assert read(place) == {"samples": [1.0, 2.0]}
    return place


def put(content):
    return lambda place: place.write_bytes(content)


CHANGES = {
    "brackets": put(b"[" * 100_000),
    "brackets in a whole": put(b'{"sha256": "", "kept": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"),
    "no UTF-8": put(b'{"kept": "\xff"}'),
    "nothing": put(b""),
    "a number too long": put(b"9" * 5000),
    "no end": lambda place: os.truncate(place, 1 << 40),
    "another value": lambda place: place.write_text(place.read_text().replace("2.0", "3.0")),
    "a folder": lambda place: (place.unlink(), place.mkdir(), (place / "x").touch()),
}

POSIX_CHANGES = {
    "a pipe": lambda place: (place.unlink(), os.mkfifo(place)),
    "a link": lambda place: (place.rename(place.with_name("x")), place.symlink_to("x")),
    "a loop": lambda place: (place.unlink(), place.symlink_to(place.name)),
}


@pytest.mark.parametrize(
    "change", [*CHANGES.values(), *POSIX_CHANGES.values()], ids=[*CHANGES, *POSIX_CHANGES]
)
def test_an_answer_that_has_been_changed_is_not_read_and_is_kept_anew(place, change):
    if change in POSIX_CHANGES.values() and os.name != "posix":
        pytest.skip("needs pipes and links")
    change(place)
    assert read(place) is None
    keep(place, "anew")
    assert read(place) == "anew"


def test_an_answer_to_another_question_is_not_believed(place):
    other = place_of("trade", scene(body()), "asked something else")
    shutil.copy(place, other)
    assert read(other) is None


def test_a_file_in_place_of_the_folder_of_answers_is_removed(place):
    shutil.rmtree(place.parent)
    place.parent.touch()
    assert place_of("trade", scene(body()), "asked") == place
    keep(place, "anew")
    assert read(place) == "anew"


# Its size is bounded.


def test_a_generation_that_is_full_is_followed_by_the_next(base, generation):
    (generation / FULL).touch()
    assert cache_folder() == base / OURS / "generation-2"
    assert generation.exists()  # a compiler may be at work in it
    old(generation / USED)
    assert cache_folder() == base / OURS / "generation-2"
    assert not generation.exists()


def test_a_generation_is_measured_now_and_then(generation, monkeypatch):
    monkeypatch.setattr(caches, "MEASURED_EVERY", 3)
    large = generation / "large"
    large.write_bytes(b"x" * 10_000)
    for bound, follows in ((LARGEST, False), (9_999, True)):
        monkeypatch.setattr(caches, "LARGEST", bound)
        for _ in range(3):
            caches.count_compilation(generation)
        assert (cache_folder() != generation) is follows


def test_every_compilation_counts(generation, tmp_path):
    source = tmp_path / "small.c"
    source.write_text("int answer(void) { return 42; }\n")
    compile_library([source], host_platform(), tmp_path / "small.o", ("-c", "-O0"))
    assert (generation / USED).stat().st_size == 1


@needs_posix
def test_whatever_has_the_name_of_a_generation_is_passed_over(base, generation, tmp_path):
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "thesis.tex").touch()
    old(victim)
    (base / OURS / "generation-7").symlink_to(victim)
    os.mkfifo(base / OURS / "generation-8")
    (base / OURS / "generation-9").touch()
    assert cache_folder() == base / OURS / "generation-10"
    cache_folder()
    assert (victim / "thesis.tex").exists()


@needs_posix
@pytest.mark.parametrize("make", [pipe, Path.mkdir, lambda path: path.symlink_to("/dev/null")])
def test_a_count_that_is_no_file_disturbs_nobody(generation, make):
    (generation / USED).unlink()
    make(generation / USED)
    assert cache_folder() == generation
    caches.count_compilation(generation)


# The command.


def test_the_command_shows_the_cache_and_clears_it(base, capsys):
    assert main(["cache"]) == 0
    assert capsys.readouterr().out == f"{base / OURS}\nnothing is kept there\n"
    assert list(base.iterdir()) == []  # showing makes nothing
    folder_for("libraries")
    assert main(["cache"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == str(base / OURS)
    assert lines[1].startswith("generation-1: ")
    assert "2 GiB" in lines[2]
    assert main(["cache", "--clear"]) == 0
    assert capsys.readouterr().out.startswith(f"removed: {base / OURS}, ")
    assert list(base.iterdir()) == []


@needs_posix
def test_clearing_follows_no_link(base, generation, tmp_path):
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "thesis.tex").touch()
    (generation / "tmp").symlink_to(victim)
    (base / OURS / "generation-2").symlink_to(victim)
    (base / "supervessel-3").symlink_to(victim)
    assert main(["cache", "--clear"]) == 0
    assert (victim / "thesis.tex").exists()
    assert [path.name for path in base.iterdir()] == ["supervessel-3"]


def test_other_layouts_of_our_making_are_cleared_too(base):
    for name in ("supervessel-0", "supervessel-12", "supervessel-x"):
        (base / name).mkdir()
        (base / name / TAG).write_bytes(TAG_TEXT)
    assert main(["cache", "--clear"]) == 0
    assert [path.name for path in base.iterdir()] == ["supervessel-x"]


# Folders in TMPDIR.

WAITING = """
import sys, time
from fmu_build.storage.compiler_files import FOLDER, RECORD
from fmu_build.storage.temporary import temporary_folder
with temporary_folder() as folder:
    (folder / "large").write_text("x")
    print(folder, flush=True)
    time.sleep(600)
"""


@pytest.fixture
def temporaries(tmp_path, monkeypatch):
    """A folder for temporary files that nobody has looked at."""
    folder = tmp_path / "temporaries"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    temporary.clear_left.cache_clear()
    return folder


def waiting(folder):
    """Starts a program that has a temporary folder in a folder; returns it, and its own folder."""
    running = subprocess.Popen(
        [sys.executable, "-c", WAITING],
        env=os.environ
        | {"TMPDIR": str(folder), "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "model")))},
        stdout=subprocess.PIPE,
        text=True,
    )
    return running, Path(running.stdout.readline().strip())


@needs_posix
def test_what_a_killed_run_leaves_a_later_one_clears_and_nothing_else(temporaries):
    (temporaries / "supervessel-notes").mkdir()
    (temporaries / "supervessel-notes" / "thesis.tex").touch()
    (temporaries / "supervessel-link").symlink_to(temporaries / "supervessel-notes")
    running, its_own = waiting(temporaries)
    killed, left = waiting(temporaries)
    try:
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        assert (left / "large").exists()
        with temporary_folder() as mine:
            assert not left.exists()
            assert (its_own / "large").exists()
            names = {mine.name, its_own.name, "supervessel-notes", "supervessel-link"}
            assert {path.name for path in temporaries.iterdir()} == names
        assert not mine.exists()
        assert (temporaries / "supervessel-notes" / "thesis.tex").exists()
    finally:
        for process in (running, killed):
            process.kill()
            process.communicate()


@needs_posix
@pytest.mark.parametrize(
    "make",
    [
        pipe,
        Path.mkdir,
        Path.touch,
        lambda lock: lock.write_text("mine"),
        lambda lock: (lock.with_name("x").write_bytes(temporary.SIGNATURE), lock.symlink_to("x")),
    ],
    ids=["a pipe", "a folder", "an empty file", "another file", "a link"],
)
def test_a_folder_without_our_lock_is_the_users(temporaries, make):
    (temporaries / "supervessel-notes").mkdir()
    make(temporaries / "supervessel-notes" / temporary.LOCK)
    with temporary_folder():
        assert (temporaries / "supervessel-notes").exists()


@needs_posix
@needs_root
def test_a_folder_of_another_user_is_left(temporaries):
    (temporaries / "supervessel-left").mkdir()
    (temporaries / "supervessel-left" / temporary.LOCK).write_bytes(temporary.SIGNATURE)
    os.chown(temporaries / "supervessel-left", STRANGER, STRANGER)
    with temporary_folder():
        assert (temporaries / "supervessel-left").exists()


# Paths of every kind.


def build(folder, **environment):
    """Builds a ball in a folder."""
    path = os.pathsep.join((str(ROOT), str(ROOT / "model")))
    (folder / "ball.toml").write_text(SCENE)
    return subprocess.run(
        [sys.executable, "-m", "fmu_build", "ball.toml"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path} | environment,
        capture_output=True,
        check=False,
    )


STRANGE = {
    "percent": b"a%sb%n",
    "line break": b"a\nb",
    "space and quotes": b"a 'b' \"c\"",
    "backslash": b"a\\b",
    "no UTF-8": b"a\xffb",
    "umlaut": "\u00e4\u65e5".encode(),
    "long": b"/".join([b"l" * 200] * 4),
}


@needs_posix
@pytest.mark.parametrize("name", some_at_once(STRANGE, "percent", "no UTF-8"))
def test_a_temporary_folder_of_any_name_works_or_is_refused_by_name(tmp_path, name):
    work, folder = tmp_path / "work", tmp_path / os.fsdecode(name)
    work.mkdir()
    folder.mkdir(parents=True)
    done = build(work, TMPDIR=str(folder))
    if name == STRANGE["no UTF-8"]:
        assert done.returncode == 1
        assert done.stderr.decode() == f"{str(folder)!a}: must be UTF-8, to be worked in\n"
        assert [path.name for path in work.iterdir()] == ["ball.toml"]
    else:
        assert (done.returncode, done.stderr) == (0, b"")
    assert list(folder.iterdir()) == []


@needs_posix
@pytest.mark.parametrize("name", [STRANGE["percent"], STRANGE["line break"]], ids=["percent", "line break"])
@pytest.mark.parametrize("variable", ["SUPERVESSEL_CACHE", "TMPDIR"])
def test_a_cache_that_no_compiler_can_work_in_is_refused_by_name(tmp_path, variable, name):
    """A temporary cache too, where there is no other."""
    work, folder = tmp_path / "work", tmp_path / os.fsdecode(name)
    work.mkdir()
    folder.mkdir()
    nowhere = {"HOME": "/dev/null", "XDG_CACHE_HOME": "", "SUPERVESSEL_CACHE": ""}
    done = build(work, **({} if variable == "SUPERVESSEL_CACHE" else nowhere), **{variable: str(folder)})
    assert done.returncode == 1
    [line] = done.stderr.decode().splitlines()
    assert "the compiler works in no folder whose path holds " in line
    assert str(tmp_path) in line
    assert [path.name for path in work.iterdir()] == ["ball.toml"]
    assert list(folder.iterdir()) == []


@needs_posix
def test_a_library_can_be_written_where_the_linker_could_not(tmp_path):
    folder = tmp_path / "a%sb"
    folder.mkdir()
    source = folder / "small.c"
    source.write_text("int answer(void) { return 42; }\n")
    compile_library([source], host_platform(), folder / "small.o", ("-c", "-O0"))
    assert (folder / "small.o").stat().st_size > 0
    broken = tmp_path / "a\nb.c"
    broken.write_text("int a;\n")
    with pytest.raises(BuildError, match="reads no file whose path holds a line break"):
        compile_library([broken], host_platform(), tmp_path / "b.o")


@needs_posix
def test_an_error_is_told_for_what_it_is():
    denied = OSError(13, os.strerror(13))
    assert caches.reason(denied, "to compile in") == os.strerror(13)
    full = OSError(28, os.strerror(28))
    assert caches.reason(full, "to compile in") == f"no room to compile in: {os.strerror(28)}"


def test_the_name_of_an_answer_is_all_of_the_question(generation):
    """And the answer says so itself."""
    place = place_of("trade", scene(body()), "asked")
    keep(place, 1)
    assert set(json.loads(place.read_text())) == {"sha256", "kept"}
    assert place != place_of("trade", scene(body()), "asked otherwise")


@pytest.fixture
def compiled_cold(generation):
    """Compiles a body's library in a cache that is new, with all that the compiler makes for itself."""
    raw = scene(body())
    packed = source_files(generate(raw, 3)[0], 3, raw.name)
    names = source_file_names(generate(raw, 3)[0], 3)
    return lambda: compile_sources(packed, names, 3, [host_platform()], raw.name, TRIAL_FLAGS)


@pytest.fixture
def compiled(base, compiled_cold):
    """The same where the compiler's own files are there."""
    begin_cache(base)
    return compiled_cold


def test_a_library_that_has_been_damaged_is_compiled_anew(generation, compiled):
    """The compiler believes what it has kept; what we keep stands behind its digest."""
    first = compiled()
    (kept,) = (generation / "libraries").iterdir()
    other = kept.with_name("0" * 64)
    caches.keep_bytes(other, b"another's")
    for damage in (b"", kept.read_bytes()[:-1], bytes(len(kept.read_bytes())), other.read_bytes()):
        kept.write_bytes(damage)
        assert compiled() == first
        assert kept.read_bytes()[32:] in first.values()
    objects = [path for path in generation.rglob("*.o") if "whole" in path.name]
    assert objects == []  # nothing compiled from our sources is left for a compiler to believe


def test_what_the_compiler_has_kept_for_itself_is_not_believed_where_it_has_changed(
    base, generation, compiled
):
    """An empty library of C, to link with, once gave FMUs that found no function of mathematics."""
    first = compiled()
    shutil.rmtree(generation / "libraries")
    [libm] = (generation / FOLDER).rglob("libm.so.6")
    libm.unlink()  # other caches have links to its content
    libm.write_bytes(b"")
    assert compiler_files.is_changed(generation / FOLDER)
    compiler_files._was_changed.cache_clear()  # as in a program that begins
    assert compiled() == first
    assert [path.name for path in (base / OURS).glob("*/libraries")] == ["libraries"]
    assert cache_folder() == base / OURS / "generation-2"


def test_a_record_that_has_been_damaged_or_is_gone_is_not_believed(generation, compiled):
    compiled()
    record, folder = generation / RECORD, generation / FOLDER
    record.write_bytes(record.read_bytes()[:-1])
    assert compiler_files.is_changed(folder)
    record.unlink()
    assert compiler_files.is_changed(folder)
    with caches.in_use(generation):  # what a compiler at work makes is recorded when it ends
        assert not compiler_files.is_changed(folder)


def test_a_kept_file_is_there_while_it_is_written_again(tmp_path):
    """Who looks in between would take the compiler's folder for one that nobody has recorded."""
    place = tmp_path / "kept"
    caches.keep_bytes(place, b"0")
    missing, ended = [], threading.Event()

    def look():
        while not ended.is_set():
            missing.append(not os.path.lexists(place))

    with ThreadPoolExecutor(1) as other:
        looking = other.submit(look)
        for number in range(2000):
            caches.keep_bytes(place, b"%d" % number)
        ended.set()
        looking.result()
    assert len(missing) > 1000
    assert not any(missing)


def test_a_kept_file_takes_the_place_of_a_folder(tmp_path):
    place = tmp_path / "kept"
    (place / "another").mkdir(parents=True)
    caches.keep_bytes(place, b"content")
    assert caches.read_bytes(place) == b"content"


@needs_posix
def test_a_compiler_is_known_to_be_at_work_though_another_asks_as_it_begins(generation):
    asking = caches.open_lock(generation / caches.LOCK)
    assert temporary.lock(asking)
    threading.Timer(0.1, os.close, [asking]).start()
    with caches.in_use(generation):
        assert caches.is_in_use(generation)
    assert not caches.is_in_use(generation)


@needs_posix
@pytest.mark.parametrize("number", some_at_once([errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP], errno.ENOLCK))
def test_where_a_file_system_has_no_locks_the_compilers_files_are_recorded_and_a_cache_cleared(
    generation, compiled_cold, monkeypatch, capsys, number
):
    def no_locks(file, kind):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(temporary.fcntl, "flock", no_locks)
    compiled_cold()
    assert (generation / RECORD).exists()
    assert main(["cache", "--clear"]) == 0
    assert capsys.readouterr().out.startswith("removed: ")


@pytest.mark.thorough
def test_a_compiler_whose_manifests_lead_nowhere_is_started_again_with_new_files(generation, compiled):
    """Its files are as recorded, but a manifest names others: it fails, and not because of our sources."""
    first = compiled()
    shutil.rmtree(generation / "libraries")
    shutil.rmtree(generation / FOLDER / "o")
    compiler_files.record(generation / FOLDER)
    compiler_files._was_changed.cache_clear()
    assert compiled() == first
    assert cache_folder() != generation


def test_a_cache_in_use_is_not_cleared_and_a_clear_leaves_nothing(base, generation, capsys):
    with caches.in_use(generation):
        assert main(["cache", "--clear"]) == 0
        assert capsys.readouterr().out == f"left: {base / OURS} is in use by a build\n"
        assert generation.exists()
    left = base / ".supervessel-going-0123"  # of a clear that was killed
    left.mkdir(0o700)
    (left / TAG).write_bytes(TAG_TEXT)
    assert main(["cache", "--clear"]) == 0
    assert not left.exists()
    assert list(base.glob("*supervessel*")) == []


@needs_posix
def test_a_generation_that_others_could_reach_is_not_used_again(generation):
    """Whoever could write there may have planted something before the permissions were mended."""
    generation.chmod(0o755)
    assert cache_folder() != generation
