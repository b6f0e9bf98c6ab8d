"""What commands do with the place that a user names for their output: `build`, `import` and `trade` alike."""

import json
import os
import stat
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from fmu_build import BuildError, build, build_fmu
from orbiter.files import Files
from supervessel import Twin, commands, load_scene
from support import BALL, processes
from support.marks import some_at_once
from support.processes import cache, needs_posix

__all__ = ["cache"]

SCENE = f"""\
{BALL}
[rotation]
law = "none"
angular_velocity = [0.01, 0.02, 0.03]
[experiment]
duration = 1.0
step = 1.0
"""

IMPORT = ("side.scn", "--config", "Config", "--table", "code.toml")


@dataclass(frozen=True)
class Command:
    """A command, and how its output is named.

    words  : without -o
    named  : what -o gets
    output : the file that is looked at
    input  : a file that it reads
    """

    words: tuple[str, ...]
    named: str
    output: str
    input: str


COMMANDS = {
    "build": Command(("fmu_build", "ball.toml"), "out/ball.fmu", "out/ball.fmu", "ball.toml"),
    "import": Command(("supervessel", "import", *IMPORT), "out/side.toml", "out/side.toml", "side.scn"),
    "trade": Command(("supervessel", "trade", "ball.toml", "--quick"), "out", "out/trade.md", "ball.toml"),
}


@pytest.fixture(params=["build", "import", pytest.param("trade", marks=pytest.mark.surroundings)])
def command(request):
    return COMMANDS[request.param]


@pytest.fixture
def folder(tmp_path):
    """A folder with what the commands read, and one for their output."""
    Files(tmp_path)
    (tmp_path / "ball.toml").write_text(SCENE)
    (tmp_path / "out").mkdir()
    return tmp_path


def run(command, folder, cache, *more, umask=None):
    words = [sys.executable, "-m", *command.words, "-o", command.named, *more]
    if umask is not None:
        words = ["sh", "-c", f'umask {umask} && exec "$@"', "sh", *words]
    return processes.run(words, folder, cache)


def everything(folder):
    """Returns the files below a folder, links and nodes by their kind."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        if path.is_file()
        else stat.S_IFMT(path.lstat().st_mode)
        for path in sorted(folder.rglob("*"))
    }


def assert_refused(command, folder, cache, why, *more):
    """Asserts that a command refuses its output in a line, before it has done anything."""
    before = everything(folder)
    with tempfile.TemporaryDirectory(prefix="supervessel-test-") as empty:
        done = processes.run(
            [sys.executable, "-m", *command.words, "-o", command.named, *more], folder, Path(empty)
        )
        assert everything(Path(empty)) == {}
    output = Path(command.output)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", f"{output}: cannot be written: {why}\n")
    assert everything(folder) == before


@needs_posix
@pytest.mark.parametrize(
    "kind", some_at_once(["a folder", "a named pipe", "a character device"], "a named pipe")
)
def test_what_is_no_regular_file_is_refused_with_its_kind(command, folder, cache, kind):
    output = folder / command.output
    if kind == "a folder":
        output.mkdir()
    elif kind == "a named pipe":
        os.mkfifo(output)
    else:
        try:
            os.mknod(output, stat.S_IFCHR | 0o666, os.makedev(1, 3))
        except PermissionError:
            pytest.skip("device nodes cannot be made here")
    assert_refused(command, folder, cache, f"is {kind}, not a regular file")


@needs_posix
def test_a_link_is_followed_and_stays(command, folder, cache):
    (folder / "elsewhere").mkdir()
    output = folder / command.output
    output.symlink_to(Path("..", "elsewhere", "target"))
    done = run(command, folder, cache)
    assert done.returncode == 0, done.stderr
    assert output.readlink() == Path("..", "elsewhere", "target")
    assert [path.name for path in (folder / "elsewhere").iterdir()] == ["target"]
    assert not (folder / "elsewhere" / "target").is_symlink()


@needs_posix
def test_a_loop_of_links_is_refused(command, folder, cache):
    output = folder / command.output
    output.symlink_to(output.name)
    assert_refused(command, folder, cache, "Too many levels of symbolic links")


@needs_posix
def test_a_new_file_has_what_the_umask_leaves_and_an_old_one_keeps_its_permissions(command, folder, cache):
    output = folder / command.output
    assert run(command, folder, cache, umask="077").returncode == 0
    assert stat.S_IMODE(output.stat().st_mode) == 0o600
    output.chmod(0o664)
    again = ("--force",) if "import" in command.words else ()
    assert run(command, folder, cache, *again, umask="077").returncode == 0
    assert stat.S_IMODE(output.stat().st_mode) == 0o664


def test_a_read_only_file_is_refused(command, folder, cache):
    output = folder / command.output
    output.write_bytes(b"mine")
    output.chmod(0o444)
    assert_refused(
        command, folder, cache, "is read-only", *(("--force",) if "import" in command.words else ())
    )


@pytest.mark.parametrize("how", some_at_once(["hard link", "link"], "link"))
def test_an_input_by_another_name_is_refused(command, folder, cache, how):
    output = folder / command.output
    if how == "link":
        output.symlink_to(folder / command.input)
    else:
        output.hardlink_to(folder / command.input)
    assert_refused(command, folder, cache, f"is a file that is read for it: {command.input}")


def test_a_class_that_is_read_is_no_output_of_import_even_by_force(folder, cache):
    command = COMMANDS["import"]
    (folder / command.output).hardlink_to(folder / "Config" / "Vessels" / "Hub.cfg")
    why = f"is a file that is read for it: {Path('Config/Vessels/Hub.cfg')}"
    assert_refused(command, folder, cache, why, "--force")


WHY = {
    "build": "is there already and is no FMU; remove it or take another name",
    "import": "is there already; --force replaces it",
    "trade": "is there already and is of no trade; remove it or take another folder",
}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize(
    "content", some_at_once({"text": b"my thesis", "empty archive": b"PK\x05\x06" + bytes(18)}, "text")
)
def test_a_file_of_another_kind_is_never_replaced(folder, cache, name, content):
    command = COMMANDS[name]
    (folder / command.output).write_bytes(content)
    assert_refused(command, folder, cache, WHY[name])


def test_an_empty_file_is_replaced(command, folder, cache):
    output = folder / command.output
    output.touch()
    done = run(command, folder, cache)
    assert (done.returncode, done.stderr) == (0, "")
    assert output.stat().st_size > 0


def test_what_a_command_has_made_it_replaces(command, folder, cache):
    assert run(command, folder, cache).returncode == 0
    before = everything(folder / "out")
    done = run(command, folder, cache, *(("--force",) if "import" in command.words else ()))
    assert (done.returncode, done.stderr) == (0, "")
    assert everything(folder / "out") == before


def test_a_json_of_another_in_place_of_a_trades_is_never_replaced(folder, cache):
    (folder / "out" / "trade.json").write_text(json.dumps({"about": "my shop", "choices": []}))
    command = Command(COMMANDS["trade"].words, "out", "out/trade.json", "ball.toml")
    assert_refused(command, folder, cache, WHY["trade"])


@pytest.mark.thorough
def test_a_trade_leaves_other_files_of_its_folder_alone(folder, cache):
    (folder / "out" / "notes.md").write_text("mine")
    assert run(COMMANDS["trade"], folder, cache).returncode == 0
    assert (folder / "out" / "notes.md").read_text() == "mine"


@needs_posix
def test_a_named_pipe_in_place_of_a_trades_folder_is_refused(folder, cache):
    os.mkfifo(folder / "pipe")
    done = processes.run([sys.executable, "-m", *COMMANDS["trade"].words, "-o", "pipe"], folder, cache)
    assert (done.returncode, done.stderr) == (1, "pipe: cannot be written: is a named pipe, not a folder\n")


@needs_posix
def test_build_fmu_refuses_what_the_command_does(folder):
    scene = load_scene(folder / "ball.toml")
    os.mkfifo(folder / "pipe")
    (folder / "thesis.txt").write_text("mine")
    with pytest.raises(BuildError, match=r"pipe: cannot be written: is a named pipe, not a regular file"):
        build_fmu(scene, folder / "pipe")
    with pytest.raises(BuildError, match=r"thesis\.txt: cannot be written: is there already and is no FMU"):
        build_fmu(scene, folder / "thesis.txt")
    assert (folder / "thesis.txt").read_text() == "mine"


def test_generated_c_never_replaces_a_users(folder):
    twin = Twin(load_scene(folder / "ball.toml"))
    file = folder / "out" / "ball_twin.c"
    file.write_text("int mine;\n")
    with pytest.raises(
        BuildError, match=r"ball_twin\.c: cannot be written: is there already and is not CasADi's"
    ):
        twin.generate(folder / "out", ["ode"], derivatives=0)
    assert everything(folder / "out") == {"ball_twin.c": b"int mine;\n"}


def test_what_has_come_in_the_meantime_is_not_replaced_by_a_build(folder, monkeypatch):
    """The check before the work says nothing of what is there when it is done."""
    output, real = folder / "out" / "ball.fmu", build.companions

    def while_it_compiles(*arguments):
        output.write_text("my thesis")
        return real(*arguments)

    monkeypatch.setattr(build, "companions", while_it_compiles)
    with pytest.raises(BuildError, match="is there already and is no FMU"):
        build_fmu(load_scene(folder / "ball.toml"), output)
    assert output.read_text() == "my thesis"


def test_what_has_come_in_the_meantime_is_not_replaced_by_an_import(folder, monkeypatch):
    output, real = folder / "out" / "side.toml", commands.import_scenario

    def while_it_reads(*arguments):
        output.write_text("my thesis")
        return real(*arguments)

    monkeypatch.setattr(commands, "import_scenario", while_it_reads)
    monkeypatch.chdir(folder)
    assert commands.main([*COMMANDS["import"].words[1:], "-o", str(output)]) == 1
    assert output.read_text() == "my thesis"
