"""Scene files that cannot be read, or not as TOML: the file, the line and the column are named."""

import errno
import os
from pathlib import Path

import pytest

from supervessel import SceneError, load_scene
from support import BALL
from support.refusals import NUMBER


def refusal(path: Path, text: str | bytes | None = None) -> str:
    """Returns what a scene file is refused with, after writing it if there is a text."""
    if text is not None:
        path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return str(caught.value)


def test_every_line_of_the_message_begins_with_the_file_name(tmp_path):
    text = BALL.replace("mass = 2.0", "mass = -1.0").replace('root = "B"', 'root = "C"')
    assert refusal(tmp_path / "ball.toml", text) == (
        f'ball.toml: vessels.B.mass = -1.0 kg: {NUMBER}\nball.toml: root: unknown vessel "C"; known: B'
    )


def test_the_problems_of_an_error_are_its_lines_without_the_file_name(tmp_path):
    path = tmp_path / "ball.toml"
    path.write_text(BALL.replace("pmi", "pmii"))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value) == "\n".join(f"ball.toml: {problem}" for problem in caught.value.problems)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            BALL.replace("mass =", "mass"),
            "Expected '=' after a key in a key/value pair (at line 4, column 6)",
        ),
        (BALL + "mass = 2.0\n", "Cannot overwrite a value (at line 6, column 11)"),
        (BALL.replace("1.0,", "1.0;", 1), "Unclosed array (at line 5, column 11)"),
        (BALL + "[vessels.B]\n", "Cannot declare ('vessels', 'B') twice (at line 6, column 11)"),
    ],
    ids=["no equals sign", "key twice", "semicolon", "table twice"],
)
def test_text_that_is_not_toml_is_named_with_line_and_column(tmp_path, text, expected):
    path = tmp_path / "ball.toml"
    assert refusal(path, text) == f"{path}: is not TOML: {expected}"


def test_a_file_that_is_not_there_is_named(tmp_path):
    path = tmp_path / "ball.toml"
    assert refusal(path) == f"{path}: cannot be read: {os.strerror(errno.ENOENT)}"


@pytest.mark.skipif(os.name == "nt", reason="Windows answers with another system message")
def test_a_folder_in_the_place_of_a_file_is_named(tmp_path):
    assert refusal(tmp_path) == f"{tmp_path}: cannot be read: {os.strerror(errno.EISDIR)}"


def test_a_file_that_is_not_utf8_is_named_with_the_byte(tmp_path):
    path = tmp_path / "ball.toml"
    assert refusal(path, b"# M\xfcller\n") == f"{path}: line 1: is not UTF-8 text (byte 0xfc)"


@pytest.mark.parametrize(
    "value", ["9" * 5000, "[" * 5000 + "]" * 5000], ids=["5000 digits", "arrays 5000 deep"]
)
def test_a_value_that_the_toml_reader_gives_up_on_is_refused(tmp_path, value):
    path = tmp_path / "ball.toml"
    text = BALL.replace("mass = 2.0", f"mass = {value}")
    assert "ball.toml: " in refusal(path, text)


def test_an_integer_too_long_to_print_is_refused_with_its_place(tmp_path):
    message = refusal(tmp_path / "ball.toml", BALL.replace("mass = 2.0", f"mass = 0x{'f' * 5000}"))
    assert message.startswith("ball.toml: vessels.B.mass = ")
    assert "kg: must be" in message
