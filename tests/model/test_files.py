"""Files that commands leave: whole or not at all, and nothing else of a user's is touched."""

import errno
import os
import socket
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from supervessel.shell import files
from supervessel.shell.files import OutputError, check_output, made_folder, write_file, write_files

ROOT = Path(files.__file__).parents[2]

needs_posix = pytest.mark.skipif(os.name != "posix", reason="needs permissions, links and limits of POSIX")
needs_root = pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only root has other owners")


def node(path, kind):
    """Makes something that is no regular file."""
    if kind == "a folder":
        path.mkdir()
    elif kind == "a named pipe":
        os.mkfifo(path)
    elif kind == "a socket":
        before = Path.cwd()
        os.chdir(path.parent)  # a socket's path may be 100 letters long
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(path.name)
        os.chdir(before)
    else:
        which = stat.S_IFCHR if kind == "a character device" else stat.S_IFBLK
        try:
            os.mknod(path, which | 0o666, os.makedev(1, 3) if which == stat.S_IFCHR else os.makedev(7, 0))
        except PermissionError:
            pytest.skip("device nodes cannot be made here")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture(params=[check_output, lambda path: write_file(path, b"new")], ids=["check", "write"])
def refused(request, tmp_path):
    """Returns why an output is refused, before the work and at its end."""

    def reason(path):
        before = names(path.parent)
        with pytest.raises(OutputError) as caught:
            request.param(path)
        assert names(path.parent) == before
        told, _, why = str(caught.value).partition(": cannot be written: ")
        assert told == str(path)
        return why

    return reason


@needs_posix
@pytest.mark.parametrize(
    "kind", ["a folder", "a named pipe", "a socket", "a character device", "a block device"]
)
@pytest.mark.parametrize("linked", [False, True], ids=["itself", "by a link"])
def test_what_is_no_regular_file_is_refused_with_its_kind_and_stays(tmp_path, refused, kind, linked):
    place, path = tmp_path / "place", tmp_path / ("link" if linked else "place")
    node(place, kind)
    if linked:
        path.symlink_to(place)
    before = place.stat()
    assert refused(path) == f"is {kind}, not a regular file"
    assert place.stat() == before


@needs_posix
def test_the_standard_output_of_a_pipe_is_refused(tmp_path):
    """The link leads to a pipe that has no name among files."""
    if not Path("/proc/self/fd").exists():
        pytest.skip("there is no /proc")
    reading, writing = os.pipe()
    try:
        with pytest.raises(OutputError, match="is a named pipe"):
            check_output(Path(f"/proc/self/fd/{writing}"))
    finally:
        os.close(reading)
        os.close(writing)


@needs_posix
def test_a_file_without_a_name_is_refused(tmp_path):
    if not Path("/proc/self/fd").exists():
        pytest.skip("there is no /proc")
    file = tmp_path / "gone"
    with file.open("w") as stream:
        file.unlink()
        with pytest.raises(OutputError, match="a file that has no name any more"):
            write_file(Path(f"/proc/self/fd/{stream.fileno()}"), b"new")
    assert names(tmp_path) == []


@needs_posix
def test_a_link_stays_and_its_target_gets_the_content(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    target, link, first = tmp_path / "elsewhere" / "target", tmp_path / "link", tmp_path / "first"
    target.write_bytes(b"old")
    link.symlink_to(Path("elsewhere", "target"))
    first.symlink_to("link")
    write_file(first, b"new")
    assert (link.readlink(), first.readlink()) == (Path("elsewhere", "target"), Path("link"))
    assert target.read_bytes() == b"new"
    assert names(tmp_path) == ["elsewhere", "first", "link"]
    assert names(tmp_path / "elsewhere") == ["target"]


@needs_posix
def test_a_dangling_link_has_its_target_made(tmp_path):
    link = tmp_path / "link"
    link.symlink_to("target")
    assert not check_output(link)
    write_file(link, b"new")
    assert link.is_symlink()
    assert (tmp_path / "target").read_bytes() == b"new"


@needs_posix
def test_a_loop_of_links_is_refused(tmp_path, refused):
    one, other = tmp_path / "one", tmp_path / "other"
    one.symlink_to(other)
    other.symlink_to(one)
    assert "symbolic links" in refused(one)
    assert one.readlink() == other


@needs_posix
@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_a_new_file_has_what_the_umask_leaves(tmp_path, umask, mode):
    old = os.umask(umask)
    try:
        write_file(tmp_path / "new", b"new")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == mode


@needs_posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755, 0o666, 0o200])
def test_an_old_file_keeps_its_permissions(tmp_path, mode):
    file = tmp_path / "old"
    file.write_bytes(b"old")
    file.chmod(mode)
    write_file(file, b"new")
    assert stat.S_IMODE(file.stat().st_mode) == mode
    file.chmod(0o600)
    assert file.read_bytes() == b"new"


@needs_root
def test_an_old_file_keeps_its_owner(tmp_path):
    file = tmp_path / "old"
    file.write_bytes(b"old")
    os.chown(file, 54321, 54322)
    write_file(file, b"new")
    assert (file.read_bytes(), file.stat().st_uid, file.stat().st_gid) == (b"new", 54321, 54322)


def test_another_hard_link_keeps_the_old_content(tmp_path):
    file, other = tmp_path / "file", tmp_path / "other"
    file.write_bytes(b"old")
    other.hardlink_to(file)
    write_file(file, b"new")
    assert (file.read_bytes(), other.read_bytes()) == (b"new", b"old")


@pytest.mark.parametrize("how", ["itself", "another path", "hard link", "link"])
def test_an_output_that_is_an_input_is_refused(tmp_path, how):
    scene, output = tmp_path / "scene", tmp_path / "output"
    scene.write_bytes(b"scene")
    if how == "itself":
        output = scene
    elif how == "another path":
        (tmp_path / "folder").mkdir()
        output = tmp_path / "folder" / ".." / "scene"
    elif how == "hard link":
        output.hardlink_to(scene)
    else:
        output.symlink_to(scene)
    with pytest.raises(OutputError, match="is a file that is read for it: "):
        check_output(output, [tmp_path / "not there", scene])


def test_a_check_says_whether_the_output_file_holds_something(tmp_path):
    for name, content in (("full", b"old"), ("empty", b"")):
        (tmp_path / name).write_bytes(content)
    assert [check_output(tmp_path / name) for name in ("full", "empty", "none")] == [True, False, False]
    assert names(tmp_path) == ["empty", "full"]


def test_a_file_that_is_read_only_is_refused(tmp_path, refused):
    file = tmp_path / "file"
    file.write_bytes(b"old")
    file.chmod(0o444)
    assert refused(file) == "is read-only"
    file.chmod(0o644)
    assert file.read_bytes() == b"old"


ATTEMPT = """
import os, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from supervessel.shell.files import OutputError, check_output, write_files
try:
    {preparation}
    write_files({{Path("a"): b"new", Path("file"): b"x" * 10000}})
except OutputError as error:
    print(error)
"""


def attempt(folder, preparation, **options):
    """Returns what a process says of writing two files, after a line of preparation."""
    command = [sys.executable, "-c", ATTEMPT.format(preparation=preparation), str(ROOT / "model")]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, timeout=100, **options
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def open_folder():
    """A folder that others can reach: pytest's own are its user's alone."""
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as name:
        Path(name).chmod(0o755)
        yield Path(name)


@needs_root
def test_a_folder_that_takes_no_files_is_refused(open_folder):
    (open_folder / "file").write_bytes(b"old")
    (open_folder / "file").chmod(0o666)
    said = attempt(open_folder, "os.setuid(54321); check_output(Path('file'))")
    assert said == f"file: cannot be written: {os.strerror(errno.EACCES)}: .\n"
    assert content(open_folder) == {"file": b"old"}


@needs_root
def test_a_file_of_another_in_a_sticky_folder_is_refused(open_folder):
    """It can be written, but be replaced by its owner only."""
    open_folder.chmod(0o1777)
    (open_folder / "file").write_bytes(b"old")
    (open_folder / "file").chmod(0o666)
    said = attempt(open_folder, "os.setuid(54321); check_output(Path('file'))")
    why = "is another user's, in a folder where only they can replace it: ."
    assert said == f"file: cannot be written: {why}\n"
    assert content(open_folder) == {"file": b"old"}


@needs_posix
@pytest.mark.parametrize("size", [0, 5000], ids=["at the first byte", "in the middle"])
def test_a_full_disk_leaves_the_old_files(tmp_path, size):
    """A limit of the size of files stands for it."""
    write_files({tmp_path / name: b"old" for name in ("a", "file")})
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))"
    name = "file" if size else "a"
    assert attempt(tmp_path, limit) == f"{name}: cannot be written: {os.strerror(errno.EFBIG)}\n"
    assert content(tmp_path) == {"a": b"old", "file": b"old"}


def test_files_of_a_set_that_are_one_file_are_refused(tmp_path):
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(OutputError, match="is the same file as"):
        write_files({tmp_path / "a": b"1", tmp_path / "." / ".." / tmp_path.name / "a": b"2"})
    assert (tmp_path / "a").read_bytes() == b"old"


def interrupted(count, write):
    """Whether a call ends before it is interrupted at the so-many-th event in its module's lines."""
    left = count

    def at_event(frame, _event, _argument):
        nonlocal left
        if frame.f_code.co_filename == files.__file__:
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
            return at_event
        return None

    before = sys.gettrace()
    sys.settrace(at_event)
    try:
        write()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_at_any_line_leaves_all_files_old_or_all_new(tmp_path):
    """Between the opening of a file and the block that closes it Python itself closes the file, and warns."""
    old, new = {"a": b"old", "c": b"old"}, dict.fromkeys("abc", b"new")
    for count in range(1, 10000):
        write_files({tmp_path / name: b"old" for name in old})
        (tmp_path / "b").unlink(missing_ok=True)
        if not interrupted(count, lambda: write_files({tmp_path / name: b"new" for name in new})):
            break
        assert content(tmp_path) in (old, new), count
    assert content(tmp_path) == new
    assert count > 100


def test_an_interrupt_at_any_line_of_a_check_leaves_nothing(tmp_path):
    for count in range(1, 10000):
        if not interrupted(count, lambda: check_output(tmp_path / "a")):
            break
        assert content(tmp_path) == {}, count
    assert content(tmp_path) == {}
    assert count > 10


def test_a_folder_is_made_and_taken_away_again_if_nothing_comes_into_it(tmp_path):
    with made_folder(tmp_path / "new"):
        assert (tmp_path / "new").is_dir()
    assert names(tmp_path) == []
    with made_folder(tmp_path / "new"):
        write_file(tmp_path / "new" / "file", b"new")
    with made_folder(tmp_path / "new"):
        (tmp_path / "new" / "file").unlink()
    assert names(tmp_path) == ["new"]


@needs_posix
def test_a_folder_may_be_a_link(tmp_path):
    (tmp_path / "link").symlink_to("target")
    for _ in range(2):
        with made_folder(tmp_path / "link"):
            write_file(tmp_path / "link" / "file", b"new")
    assert (names(tmp_path), names(tmp_path / "target")) == (["link", "target"], ["file"])


@needs_posix
@pytest.mark.parametrize("kind", ["a named pipe", "a socket", "a character device"])
def test_what_is_no_folder_is_refused_with_its_kind(tmp_path, kind):
    node(tmp_path / "place", kind)
    with pytest.raises(OutputError, match=f"is {kind}, not a folder"), made_folder(tmp_path / "place"):
        pass
    assert names(tmp_path) == ["place"]
