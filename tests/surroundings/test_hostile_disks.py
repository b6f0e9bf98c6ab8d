"""Commands on disks that are full or read-only, and with files and folders that nobody may read or write."""

import os
import subprocess
import tempfile

import pytest

from support.surroundings import (
    AS_STRANGER,
    BUILD,
    CHOICE,
    COMMANDS,
    IMPORT,
    MADE,
    TRADE,
    assert_clean,
    assert_refused,
    assert_right,
    needs_linux,
    needs_root,
    place,
    right_or_refused,
    run,
    strangers,
)

__all__ = ["place", "strangers"]

pytestmark = [pytest.mark.surroundings, needs_linux]


# Disks.


def is_mountable():
    if os.geteuid() != 0:
        return False
    with tempfile.TemporaryDirectory() as name:
        mount = ["mount", "-t", "tmpfs", "none", name]
        if subprocess.run(mount, capture_output=True, check=False).returncode:
            return False
        subprocess.run(["umount", name], check=True)
    return True


@pytest.fixture
def small(tmp_path, request):
    """A disk of so many KiB, or one that is read-only."""
    if not is_mountable():
        pytest.skip("only root, where it may mount, can make a small disk")
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", request.param, "none", disk], check=True)
    yield disk
    subprocess.run(["umount", disk], check=True)


SIZES = [f"size={size}k" for size in (4, 64, 1024, 8192, 32768)]


@pytest.mark.parametrize("small", [*SIZES, "ro", "nr_inodes=2", "nr_inodes=40"], indirect=True)
def test_a_cache_on_a_full_disk_is_told_in_words(place, small):
    done = run(BUILD, place, {"SUPERVESSEL_CACHE": str(small)})
    assert_clean(done, place)
    assert (done.status, done.out, done.made) == (1, "", {}), done
    assert "No space left on device" in done.error or "NoSpaceLeft" in done.error or "Read-only" in done.error


@pytest.mark.parametrize("small", [*SIZES[:4], "ro", "nr_inodes=2"], indirect=True)
@pytest.mark.parametrize("words", [BUILD, CHOICE, TRADE], ids=["build", "choice", "trade"])
def test_temporary_files_on_a_full_disk_are_told_in_words(place, small, words):
    done = run(words, place, {"TMPDIR": str(small)})
    assert list(small.iterdir()) == []
    if done.error.startswith("no plot: "):  # tables and figures are there all the same
        assert_clean(done, place)
        assert (done.status, done.error.count("\n")) == (0, 1), done
        assert set(done.made) == {name for name in MADE[words] if not name.endswith((".png", ".svg"))}
        return
    right_or_refused(done, place, words)


@pytest.mark.parametrize("small", ["size=4k", "size=64k", "ro", "nr_inodes=1"], indirect=True)
@pytest.mark.parametrize("words", [BUILD, IMPORT], ids=["build", "import"])
def test_an_output_on_a_full_disk_is_told_in_a_line_and_leaves_nothing(place, small, words):
    output = small / "out"
    named = (*words[: words.index("-o")], "-o") if "-o" in words else (*words, "-o")
    done = run((*named, str(output)), place)
    if done.status == 0:  # a scene is small
        assert words == IMPORT
        return
    assert list(small.iterdir()) == []
    assert_clean(done, place)
    assert done.status == 1
    assert done.error.splitlines()[-1].startswith(f"{output}: cannot be written: ")


@pytest.mark.parametrize("blocks", [0, 8, 250])
@pytest.mark.parametrize("words", [BUILD, CHOICE, IMPORT], ids=["build", "choice", "import"])
def test_files_that_may_not_grow_are_told_in_a_line(place, blocks, words):
    done = run(words, place, shell=f'ulimit -f {blocks}; exec "$@"')
    right_or_refused(done, place, words)


# Modes.


@pytest.mark.parametrize("mask", ["000", "777", "077"])
@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_whatever_the_umask_a_command_works_and_honours_it(place, mask, words):
    done = run(words, place, shell=f'umask {mask}; exec "$@"')
    assert_right(done, place, words)
    for name in MADE[words]:
        path = place.work / name
        assert path.stat().st_mode & 0o777 == (0o777 if path.is_dir() else 0o666) & ~int(mask, 8)


@needs_root
@pytest.mark.parametrize("mask", ["000", "777", "077"])
def test_whatever_the_umask_of_an_ordinary_user_a_cache_is_begun_or_one_line_says_why_not(strangers, mask):
    done = run(BUILD, strangers, shell=f'umask {mask}; exec "$@"', before=AS_STRANGER)
    right_or_refused(done, strangers, BUILD)


@needs_root
@pytest.mark.parametrize("words", [BUILD, CHOICE, TRADE, IMPORT], ids=["build", "choice", "trade", "import"])
def test_a_working_folder_that_is_read_only_is_told_before_any_work(strangers, words):
    strangers.work.chmod(0o555)
    done = run(words, strangers, before=AS_STRANGER)
    assert_refused(done, strangers, "cannot be written: Permission denied")
    assert list(strangers.cache.iterdir()) == []


def test_a_scene_that_cannot_be_read_is_told_in_a_line(place):
    assert_refused(run(("fmu_build", "/proc/self/mem"), place), place, "cannot be read: ")
    assert_refused(run(("fmu_build", "/proc/self/clear_refs"), place), place, "cannot be read: ")
    assert_refused(run(("fmu_build", "Config"), place), place, "cannot be read: Is a directory")
