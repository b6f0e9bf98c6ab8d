"""Hosts that trap floating-point exceptions: no call that succeeds raises one but underflow or inexact.

`support.Instance` watches every call of every test. Here are the cases that raised one, and a host that
traps.
"""

import platform
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description

from fmu_build.compile.compiler import fmi_headers
from fmu_build.platforms import host_platform
from support import ISS_DG, OK, Instance, body, store, unpacked, variant
from support.marks import FMI, some_at_once
from support.traps import FLAGS_KNOWN

needs_glibc = pytest.mark.skipif(
    platform.system() != "Linux" or platform.libc_ver()[0] != "glibc", reason="feenableexcept is glibc's"
)
needs_flags = pytest.mark.skipif(
    not FLAGS_KNOWN, reason="the bits of the floating-point flags are unknown here"
)
PROPAGATORS = ("auto", "taylor", "dop853", "rk4", "exact")
SPINS = {
    "rest": (0.0, 0.0, 0.0),
    "about the first axis": (0.3, 0.0, 0.0),
    "about the middle axis": (0.0, 0.3, 0.0),
    "about the last axis": (0.0, 0.0, -0.3),
    "tumbling": (0.1, 0.2, 0.3),
    "denormal": (1e-310, 1e-310, 0.0),
    "slow": (1e-160, 2e-160, 0.0),
    "fast": (3e5, 0.0, 1e5),
}
MOMENTS = {"general": (1.0, 2.0, 2.5), "symmetric": (1.0, 1.0, 1.5), "spherical": (2.0, 2.0, 2.0)}


@cache
def host() -> Path:
    """Returns the program that traps."""
    program = Path(tempfile.mkdtemp(dir=store())) / "traps"
    command = [sys.executable, "-m", "ziglang", "cc", "-target", host_platform().target, "-std=gnu99", "-O2"]
    command += ["-isystem", str(fmi_headers()), f"-I{Path(__file__).parent.parent / 'support'}"]
    command += [str(Path(__file__).with_name("traps.c")), "-o", str(program), "-lm", "-ldl"]
    subprocess.run(command, check=True)
    return program


@needs_glibc
@pytest.mark.parametrize("spin", some_at_once([name for name in SPINS if name != "fast"], "rest", "denormal"))
@pytest.mark.parametrize("propagator", ["auto", "taylor"])
def test_a_host_that_traps_lives(propagator, spin):
    folder = unpacked(body(propagator=propagator), optimised=True)
    description = read_model_description(str(folder))
    [rate] = [v.valueReference for v in description.modelVariables if v.name == "angular_velocity_start[1]"]
    library = folder / "binaries" / host_platform().name / f"body{host_platform().suffix}"
    words = [host(), library, description.guid, 5, 1.0, rate, *SPINS[spin]]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@needs_flags
@pytest.mark.parametrize("moments", some_at_once(MOMENTS.keys(), "symmetric"))
@pytest.mark.parametrize("propagator", some_at_once(PROPAGATORS, "auto", "taylor", "rk4"))
def test_steps_and_derivatives_of_any_spin_raise_nothing(propagator, moments):
    raw = body(pmi=MOMENTS[moments], propagator=propagator)
    raw["outputs"]["names"] += ["principal_moments", "principal_axes"]
    instance = Instance(raw, optimised=True)
    for spin in SPINS.values():
        assert instance.reset() == OK
        assert instance.initialise(angular_velocity_start=spin) == OK
        for _ in range(3):
            instance.step(0.5)
            for name in instance.references:
                assert instance.get_status(name) == OK
            unknowns = [name for name in instance.references if name.startswith(("der(", "principal", "kin"))]
            knowns = [name for name in instance.references if name.startswith(("torque", "state."))]
            instance.directional(unknowns, knowns, np.ones(len(knowns)))
            instance.adjoint(unknowns, knowns, np.ones(len(unknowns)))
    instance.free()


@needs_flags
@FMI
def test_a_point_whose_rate_stays_raises_nothing(fmi):
    instance = Instance(body(pmi=(0.0, 0.0, 0.0), law="none", propagator="auto"), fmi)
    assert instance.initialise(angular_velocity_start=[0.1, 0.2, 0.3]) == OK
    assert [instance.step(1.0) for _ in range(3)] == [OK] * 3
    instance.free()


@needs_flags
@FMI
def test_what_overflows_unasked_raises_nothing(fmi):
    instance = Instance(body(propagator="auto"), fmi)
    assert instance.initialise(angular_velocity_start=[1e200, 0.0, 0.0]) == OK
    assert instance.get_status("kinetic_energy") != OK
    assert fmi == 2 or instance.get_status("attitude") == OK
    instance.free()


@needs_flags
@FMI
@pytest.mark.parametrize("attitude", [(1e308, 1e308, 1e308, 1e308), (5e-324, 0.0, 0.0, 0.0)])
def test_an_attitude_of_any_length_at_the_start_raises_nothing(attitude, fmi):
    instance = Instance(body(propagator="auto"), fmi)
    assert instance.enter(stop=1.7e308) == OK
    assert instance.set({"attitude_start": attitude}) == OK
    instance.directional(["mass"], ["attitude_start[1]", "attitude_start[2]"], [1.0, 1.0])
    assert instance.exit() == OK
    assert instance.step(1.0) == OK
    instance.free()


@needs_flags
def test_changes_of_the_axes_of_a_symmetric_body_raise_nothing():
    raw = variant(ISS_DG, {"outputs.names": ["mass", "principal_axes"], "inputs.pmi": ["ISS"]})
    raw = variant(raw, {"docks": None, "vessels.DG": None, "inputs": {"pmi": ["ISS"], "torque": True}})
    instance = Instance(variant(raw, {"vessels.ISS.pmi": [385.0, 385.0, 385.0]}))
    assert instance.initialise() == OK
    axes, moments = instance.names("principal_axes"), instance.names("ISS.pmi")
    assert np.all(np.isfinite(instance.directional([*axes, "mass"], moments, [1.0, 2.0, 3.0])))
    assert np.all(np.isfinite(instance.adjoint([*axes, "mass"], moments, np.ones(5))))
    instance.free()


class Named(Instance):
    """An instance that keeps the name that it is logged under, which FMI 2 gives with each message."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.names: list[str] = []
        super().__init__(*given, **named)

    def _log2(self, environment: Any, name: bytes, *message: Any) -> None:
        self.names.append(name.decode())
        super()._log2(environment, name, *message)


@FMI
def test_names_of_the_importers_are_logged_without_controls_and_marks(fmi):
    instance = Named(body(), fmi, name="a\x1b[31m\u202e%n\n" + "é" * 300)
    assert instance.step(-1.0) != OK
    assert all(message.isprintable() and "%" not in message for message in instance.messages())
    instance.free()
    if fmi == 2:
        [name] = set(instance.names)
        assert name.startswith("a\\x1b[31m\\xe2\\x80\\xae\\x25n\\x0aé")
        assert name.isprintable()
        assert len(name) < 900
