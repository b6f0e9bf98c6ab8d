"""Commands with a cache, and with files and folders, that somebody else made, spoilt or took away."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fmu_build.storage.cache import OURS, TAG, TAG_TEXT
from fmu_build.storage.compiler_files import FOLDER, MANIFESTS
from support.processes import begin_cache, kept_in
from support.surroundings import (
    AS_STRANGER,
    BUILD,
    CACHE,
    CHOICE,
    TRADE,
    WATCHDOG,
    assert_clean,
    assert_refused,
    assert_right,
    clean,
    environment,
    needs_linux,
    needs_root,
    place,
    place_in,
    run,
    strangers,
)

__all__ = ["place", "strangers"]

pytestmark = [pytest.mark.surroundings, needs_linux]

UNUSED = "the cache is left unused, nothing is kept: "


# Whose it is.


@needs_root
@pytest.mark.parametrize("words", [BUILD, CHOICE], ids=["build", "choice"])
def test_a_cache_of_another_user_is_left_unused_and_the_result_is_right(strangers, words):
    shutil.rmtree(strangers.cache)
    strangers.cache.mkdir(0o755)
    ours = strangers.cache / OURS
    ours.mkdir()
    (ours / TAG).write_bytes(TAG_TEXT)
    done = run(words, strangers, before=AS_STRANGER)
    assert_right(done, strangers, words, f"{UNUSED}{ours} belongs to another user\n")
    assert sorted(path.name for path in ours.rglob("*")) == [TAG]


@needs_root
def test_a_cache_of_the_users_in_a_folder_of_another_users_is_refused(strangers):
    strangers.cache.rmdir()
    strangers.cache.mkdir(0o755)
    assert_refused(
        run(BUILD, strangers, before=AS_STRANGER),
        strangers,
        f"SUPERVESSEL_CACHE = {strangers.cache}: is no folder that can be written: Permission denied",
    )


@needs_root
@pytest.mark.parametrize("part", ["", OURS])
def test_a_cache_that_is_read_only_is_refused(strangers, part):
    assert_right(run(BUILD, strangers, before=AS_STRANGER), strangers)
    (strangers.work / "ball.fmu").unlink()
    (strangers.cache / part).chmod(0o555)
    done = run(BUILD, strangers, before=AS_STRANGER)
    if part:
        assert_refused(done, strangers, "is no folder that can be written: Permission denied")
    else:
        assert_right(done, strangers)  # our own folder in it can be written
    assert_right(run(CACHE, strangers, before=AS_STRANGER), strangers, CACHE)


@pytest.mark.parametrize(("part", "mode"), [("", 0o777), (OURS, 0o702), (OURS, 0o770)])
def test_a_cache_that_others_may_write_is_left_unused_and_the_result_is_right(place, part, mode):
    (place.cache / part).chmod(mode)
    done = run(BUILD, place)
    assert_clean(done, place)
    assert (done.status, done.out, done.made) == (0, clean(BUILD).out, clean(BUILD).made)
    assert done.error.startswith(f"{UNUSED}others may write {place.cache / part}")
    assert done.error.count("\n") == 1


def test_a_link_to_a_cache_is_followed_and_one_in_the_place_of_our_folder_is_not(place, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(place.cache)
    assert_right(run(BUILD, place, {"SUPERVESSEL_CACHE": str(link)}), place)
    (place.work / "ball.fmu").unlink()
    other = tmp_path / "other"
    other.mkdir()
    (other / OURS).symlink_to(place.cache / OURS)
    done = run(BUILD, place, {"SUPERVESSEL_CACHE": str(other)})
    assert_right(done, place, error=f"{UNUSED}{other / OURS} is no folder, or a link to one\n")


@pytest.mark.parametrize("kind", ["file", "fifo", "dangling link", "loop", "device", "below a file", "long"])
def test_what_is_no_folder_is_refused_as_a_cache(place, tmp_path, kind):
    odd = tmp_path / "odd"
    if kind in ("file", "below a file"):
        odd.touch()
    elif kind == "fifo":
        os.mkfifo(odd)
    elif kind == "loop":
        odd.symlink_to(odd)
    elif kind == "dangling link":
        odd.symlink_to("/proc/missing")
    named = {"device": "/dev/null", "below a file": f"{odd}/a/b", "long": f"{tmp_path}/{'x' * 300}"}
    done = run(BUILD, place, {"SUPERVESSEL_CACHE": named.get(kind, str(odd))})
    assert_refused(done, place, "SUPERVESSEL_CACHE = ", ": is no folder that can be written: ")


# What is in it.


def generation(place):
    return kept_in(place.cache)


FORGED = {
    "constructor": lambda file: file.write_bytes(
        file.read_bytes() + b"\n__attribute__((constructor)) static void f(void) { __builtin_trap(); }\n"
    ),
    "link": lambda file: (file.unlink(), file.symlink_to("/dev/zero")),
    "fifo": lambda file: (file.unlink(), os.mkfifo(file)),
    "folder": lambda file: (file.unlink(), file.mkdir()),
    "missing": lambda file: file.unlink(),
    "huge": lambda file: os.truncate(file, 1 << 40),
    "mode 0": lambda file: file.chmod(0),
}


@pytest.mark.parametrize("forgery", FORGED)
def test_what_the_compiler_has_kept_is_not_believed_where_it_has_changed(place, forgery):
    """Each file that it links, and of the others every fortieth."""
    assert_right(run(BUILD, place), place)
    kept = generation(place) / FOLDER
    files = sorted(file for kind in ("b", "o", "z") for file in (kept / kind).rglob("*") if file.is_file())
    linked = [file for file in files if file.suffix in (".o", ".a") or ".so" in file.name]
    for file in (*linked, *[file for file in files if file not in linked][::40]):
        content = file.read_bytes()
        file.unlink()  # it is a link to the tests' common one
        file.write_bytes(content)
        FORGED[forgery](file)
    for library in (generation(place) / "libraries").iterdir():
        library.unlink()
    (place.work / "ball.fmu").unlink()
    assert_right(run(BUILD, place), place)
    content_is_another = forgery != "mode 0" or os.geteuid() != 0
    assert (place.cache / OURS / "generation-2").exists() is content_is_another


@pytest.mark.parametrize("content", [b"", b"x", b"0 /dev/zero", b"\xff"])
def test_manifests_of_the_compilers_that_have_changed_are_made_anew(place, content):
    for file in (generation(place) / FOLDER / MANIFESTS).iterdir():
        file.write_bytes(content)
    assert_right(run(BUILD, place), place)


@pytest.mark.parametrize("damage", ["constructor", "another's"])
def test_a_library_that_is_forged_is_compiled_anew(place, damage):
    assert_right(run(BUILD, place), place)
    text = (place.work / "ball.toml").read_text()
    (place.work / "ball.toml").write_text(text.replace("mass = 2.0", "mass = 3.0"))
    [library] = (generation(place) / "libraries").iterdir()
    assert run(BUILD, place).status == 0
    (other,) = set((generation(place) / "libraries").iterdir()) - {library}
    (place.work / "ball.toml").write_text(text)
    (place.work / "ball.fmu").unlink()
    if damage == "constructor":
        FORGED[damage](library)
    else:
        shutil.copy(other, library)
    assert_right(run(BUILD, place), place)


def deep(file):
    file.write_bytes(b"[" * 100_000)


def other_numbers(file):
    """Changes every number but keeps what there is in form."""
    text = file.read_text()
    file.write_text(text.replace("1", "2"))


RESULTS = FORGED | {
    "constructor": deep,
    "other numbers": other_numbers,
    "another's": lambda file: (
        shutil.copy(min(file.parent.glob("*.json")), file.with_suffix(".new"))
        and file.with_suffix(".new").replace(file)
    ),
    "null": lambda file: file.write_text("null"),
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A place in which a choice has been made and a trade has been flown."""
    place = place_in(tmp_path_factory.mktemp("flown"))
    for words in (CHOICE, TRADE):
        assert_right(run(words, place), place, words)
    return place


@pytest.mark.parametrize("forgery", ["constructor", "other numbers", "another's", "fifo", "null", "huge"])
def test_a_choice_that_is_forged_is_made_anew(place, flown, forgery):
    kept = shutil.copytree(generation(flown) / "accuracy", generation(place) / "accuracy")
    for file in kept.glob("*.json"):
        RESULTS[forgery](file)
    assert_right(run(CHOICE, place), place, CHOICE)


@pytest.mark.parametrize("forgery", ["constructor", "other numbers"])
def test_results_of_flights_that_are_forged_are_flown_anew(place, flown, forgery):
    kept = shutil.copytree(generation(flown) / "trade", generation(place) / "trade")
    files = sorted(kept.glob("*.json"))
    for file in files[:: len(files) // 4 or 1]:
        RESULTS[forgery](file)
    assert_right(run(TRADE, place), place, TRADE)
    assert all(file.is_file() and "sha256" in json.loads(file.read_text()) for file in files)


NAMES = (
    *("libraries", "accuracy", "used", "full", "generation-2", "made-x", "lock"),
    *("compiler", "compiler.sha256", "compiler/tmp", "compiler/h", "compiler/o", "compiler/z"),
)
KINDS = ("file", "fifo", "link", "loop", "folder")
ODD = [(name, KINDS[(i + j) % 5]) for i, name in enumerate(NAMES) for j in range(2)]
"""Two kinds of things for each name, each kind for four names."""


@pytest.mark.parametrize(("name", "kind"), ODD)
def test_whatever_has_a_name_of_ours_in_the_cache_the_result_is_right(place, tmp_path, name, kind):
    """A link leads to a folder of the user's, in which nothing changes."""
    users = tmp_path / "users"
    users.mkdir()
    (users / "thesis.tex").write_text("mine")
    os.utime(users / "thesis.tex", (0, 0))
    odd = place.cache / OURS / name if name == "generation-2" else generation(place) / name
    if odd.is_dir():
        shutil.rmtree(odd)
    elif os.path.lexists(odd):
        odd.unlink()
    if kind == "file":
        odd.write_text("[")
    elif kind == "fifo":
        os.mkfifo(odd)
    elif kind == "link":
        odd.symlink_to(users)
    elif kind == "loop":
        odd.symlink_to(odd)
    else:
        odd.mkdir()
        (odd / "x").mkdir()
    done = run(BUILD, place)
    assert_clean(done, place)
    assert (users / "thesis.tex").read_text() == "mine"
    if name.startswith("compiler/") and kind != "folder" and done.status == 1:  # the compiler's own
        assert "`supervessel cache --clear` removes it\n" in done.error
        assert done.made == {}
        return
    assert_right(done, place)


def test_a_cache_that_is_removed_while_a_build_runs_gives_the_fmu_or_a_line(tmp_path):
    for number, wanted in enumerate((OURS, FOLDER, "made-*", "o", "z")):
        folder = tmp_path / str(number)
        folder.mkdir()
        place = place_in(folder, linked=False)
        running = subprocess.Popen(
            [sys.executable, "-m", *BUILD],
            cwd=place.work,
            env=environment(place),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        late = time.monotonic() + WATCHDOG
        while not list(place.cache.rglob(wanted)) and running.poll() is None and time.monotonic() < late:
            time.sleep(0.01)
        shutil.rmtree(place.cache, ignore_errors=True)
        out, error = running.communicate(timeout=WATCHDOG)
        assert "Traceback" not in error, error
        assert list(place.temporary.iterdir()) == []
        if running.returncode == 0:
            assert out == clean(BUILD).out
            assert error == "" or error.startswith("the cache is left unused"), error  # seen while it went
            assert error.count("\n") <= 1
            assert (place.work / "ball.fmu").read_bytes() == clean(BUILD).made["ball.fmu"]
        else:
            assert running.returncode == 1, error
            assert error
            assert not (place.work / "ball.fmu").exists()


def test_two_commands_at_once_begin_one_cache(tmp_path):
    place = place_in(tmp_path, linked=False)
    both = [
        subprocess.Popen(
            [sys.executable, "-m", *BUILD, "-o", f"{number}.fmu"],
            cwd=place.work,
            env=environment(place),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for number in range(2)
    ]
    ended = [running.communicate(timeout=WATCHDOG) for running in both]
    assert ended == [("0.fmu\n", ""), ("1.fmu\n", "")]
    for number in range(2):
        assert (place.work / f"{number}.fmu").read_bytes() == clean(BUILD).made["ball.fmu"]
    assert [path.name for path in place.cache.iterdir()] == [OURS]
    assert list(place.temporary.iterdir()) == []


@pytest.mark.parametrize("named", ["home", ".", "", "~"])
@pytest.mark.parametrize("words", [BUILD, CACHE, (*CACHE, "--clear")], ids=["build", "cache", "clear"])
def test_a_folder_of_the_users_that_is_named_as_cache_keeps_all_that_is_in_it(place, named, words):
    for kind in ("tmp", "sources", "o", "h", "z", "accuracy", "made-x", "supervessel-old", "supervessel-"):
        (place.work / kind).mkdir()
        (place.work / kind / "thesis.tex").write_text("mine")
        for path in (place.work / kind / "thesis.tex", place.work / kind):
            os.utime(path, (0, 0))
    begin_cache({"": place.cache / "supervessel", "~": place.work / "~"}.get(named, place.work))
    before = {name: content for name, content in place.files().items() if OURS not in Path(name).parts}
    value = str(place.work) if named == "home" else named
    changes = {"SUPERVESSEL_CACHE": value, "XDG_CACHE_HOME": str(place.cache)}
    done = run(words, place, changes)
    assert_clean(done, place)
    assert (done.status, done.error) == (0, "")
    assert {name: content for name, content in place.files().items() if name in before} == before
    made = {Path(name).parts[0] for name in done.made}
    assert made <= {"ball.fmu", OURS, *(["~"] if named == "~" else [])}
