"""Compilers that tests put in the place of the installed one."""

from pathlib import Path


def fake_compiler(folder: Path, script: str) -> Path:
    """Makes a package ziglang whose compiler is a shell script; returns the folder for PYTHONPATH."""
    package = folder / "ziglang"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    program = package / "zig"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    return folder
