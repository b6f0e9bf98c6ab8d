"""Every public function has an example in its docstring, and the examples run."""

import doctest
import inspect
from collections.abc import Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import fmu_build
import supervessel
from supervessel import Twin, load_scene, reference
from supervessel.twin.functions import TwinFunction
from support.processes import ROOT


def documented() -> Iterator[tuple[str, str | None]]:
    """Yields name and docstring of each public function, and of each public class and what it can do."""
    for package in (supervessel, reference, fmu_build):
        for name in package.__all__:
            member = getattr(package, name)
            if inspect.isclass(member) and not issubclass(member, Exception):
                yield from documented_class(member)
            elif inspect.isfunction(member):
                yield f"{package.__name__}.{name}", member.__doc__
    yield from documented_class(TwinFunction)  # what a twin's functions are


def documented_class(owner: type) -> Iterator[tuple[str, str | None]]:
    """Yields name and docstring of a class, its public methods and properties, inherited ones too."""
    yield owner.__name__, owner.__doc__
    for place in owner.__mro__:
        if not place.__module__.startswith("supervessel."):
            continue
        for name, member in vars(place).items():
            function = unwrapped(member)
            if function is not None and not name.startswith("_"):
                yield f"{place.__name__}.{name}", function.__doc__


def unwrapped(member: Any) -> Any:
    """Returns the function that a class's member is made of, None for another member."""
    member = member.func if isinstance(member, cached_property) else member
    member = member.fget if isinstance(member, property) else member
    member = member.__func__ if isinstance(member, classmethod | staticmethod) else member
    return member if inspect.isfunction(member) else None


DOCUMENTED = dict(documented())


@cache
def iss_dg() -> Twin:
    """Returns the twin that examples are given, whose scene they are given too; neither ever changes."""
    return Twin(load_scene(ROOT / "examples" / "iss_dg.toml"))


@pytest.mark.parametrize("name", DOCUMENTED)
def test_each_public_function_has_an_example_that_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    given = {"ca": ca, "np": np, "reference": reference, "scene": iss_dg().scene, "twin": iss_dg()}
    examples = doctest.DocTestParser().get_doctest(DOCUMENTED[name] or "", given, name, None, 0)
    assert examples.examples
    printed: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(examples, out=printed.append)
    assert result.failed == 0, "".join(printed)
