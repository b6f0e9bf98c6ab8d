"""Saved FMU states: in every state of the life cycle, restored there, later, elsewhere, or refused."""

import json
import os
import subprocess
import sys
from ctypes import byref, c_double, c_size_t, c_ubyte, c_void_p, cast
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmu.exchange import change
from fmu.saved_states import bytes_of, function, restore, save
from support import DISCARD, ERROR, ISS_DG, OK, TURNING, Instance, body, draw_inputs, refusal, variant
from support.marks import FMI, KIND

SEED = 20240613
RAW = variant(ISS_DG, {"name": "saved", "rotation": TURNING})

MOMENTS = {
    False: ("instantiated", "initialising", "stepping", "refusing", "terminated", "after an error"),
    True: ("instantiated", "initialising", "event", "continuous", "refusing", "terminated", "after an error"),
}
MOMENT = pytest.mark.parametrize(
    ("exchange", "moment"),
    [(exchange, moment) for exchange, moments in MOMENTS.items() for moment in moments],
)


def draw(seed: int) -> dict[str, Any]:
    """Returns usable inputs."""
    return draw_inputs(np.random.default_rng(seed))


def start(fmi: int, exchange: bool, moment: str, seed: int = SEED) -> Instance:
    """Returns an instance at a moment of its life, with values of its own."""
    instance = Instance(RAW, fmi, exchange=exchange)
    assert instance.set(draw(seed) | {"angular_velocity_start": [0.1, 0.2, 0.3]}) == OK
    if moment == "instantiated":
        return instance
    assert instance.enter(start=3.0, stop=500.0) == OK
    assert instance.set({"attitude_start": [0.0, 1.0, 2.0, 3.0]}) == OK
    if moment == "initialising":
        return instance
    assert instance.exit() == OK
    if moment == "event":
        return instance
    if exchange:
        assert instance.run() == OK
    advance(instance, seed + 1)
    if moment == "refusing":
        assert instance.set({"DG.mass": -1.0}) == OK
        if exchange:
            assert instance.get_status("mass") == DISCARD
        else:
            assert instance.step(0.5) == refusal(fmi)
    if moment == "terminated":
        assert instance._status(instance.fmu.terminate) == OK
    if moment == "after an error":
        assert instance.set({"mass": 1.0}) == ERROR
    instance.log.clear()
    return instance


def advance(instance: Instance, seed: int) -> None:
    """Flies a little: a step, or where an importer's solver would have gone."""
    generator = np.random.default_rng(seed)
    if hasattr(instance.fmu, "doStep"):
        assert instance.step(generator.uniform(0.01, 5.0)) == OK, instance.log
        return
    x = (c_double * 7)(*generator.normal(size=7))
    assert instance._status(instance.fmu.setTime, instance.get("time") + generator.uniform(0.01, 5.0)) == OK
    assert instance._status(instance.fmu.setContinuousStates, x, 7) == OK


def go_on(instance: Instance, exchange: bool, moment: str) -> list[Any]:
    """Returns all that an instance gives and answers from a moment of its life through a short flight."""
    answers: list[Any] = []
    if moment == "instantiated":
        answers.append(instance.enter(start=3.0, stop=500.0))
    if moment in ("instantiated", "initialising"):
        answers += [instance.bits(), instance.exit()]
    if moment in ("terminated", "after an error"):
        return [instance.bits(), instance.set({"DG.mass": 2e4})]
    if moment == "refusing":
        answers += [instance.get("DG.mass"), instance.get("torque").tolist()]
        answers += [instance.set({"DG.mass": 15000.0})]
    if exchange and moment in ("instantiated", "initialising", "event"):
        answers.append(instance.run())
    instance.time = instance.get("time")
    for seed in range(SEED, SEED + 3):
        answers.append(instance.bits())
        answers += change(instance, draw(seed))
        advance(instance, seed)
    return [*answers, instance.bits()]


# Restored.


@MOMENT
@FMI
def test_a_state_restored_later_continues_bit_for_bit(fmi, exchange, moment):
    instance = start(fmi, exchange, moment)
    state = save(instance)
    first = go_on(instance, exchange, moment)
    assert instance._status(instance.fmu.setFMUState, state) == OK
    assert go_on(instance, exchange, moment) == first
    instance.fmu.freeFMUState(state)
    instance.free()


@MOMENT
@FMI
def test_saving_does_not_change_the_flight(fmi, exchange, moment):
    saved, other = start(fmi, exchange, moment), start(fmi, exchange, moment)
    bytes_of(saved)
    assert go_on(saved, exchange, moment) == go_on(other, exchange, moment)
    assert saved.messages() == other.messages()
    saved.free()
    other.free()


@MOMENT
@FMI
def test_a_state_saved_as_bytes_continues_bit_for_bit_in_a_new_instance(fmi, exchange, moment):
    instance = start(fmi, exchange, moment)
    content = bytes_of(instance)
    first = go_on(instance, exchange, moment)
    instance.free()
    instance = Instance(RAW, fmi, exchange=exchange)
    assert restore(instance, content) == OK
    assert go_on(instance, exchange, moment) == first
    instance.free()


@pytest.mark.parametrize("now", MOMENTS[False])
@pytest.mark.parametrize("then", ["instantiated", "initialising", "stepping"])
def test_a_state_can_be_restored_in_every_state_of_the_life_cycle(then, now):
    original, other = start(3, False, then), start(3, False, now, SEED + 50)
    assert restore(other, bytes_of(original)) == OK
    assert go_on(other, False, then) == go_on(original, False, then)
    original.free()
    other.free()


RESTORE = """
import json, sys
from ctypes import c_double
from fmpy import fmi2, fmi3
given = json.load(sys.stdin)
kind = getattr(fmi3 if given["fmi"] == 3 else fmi2, given["class"])
fmu = kind(guid=given["guid"], unzipDirectory=given["folder"], modelIdentifier="saved", instanceName="new")
fmu.instantiate()
fmu.setFMUState(fmu.deserializeFMUState(bytes.fromhex(given["state"])))
references = given["references"]
read = fmu.getFloat64 if given["fmi"] == 3 else fmu.getReal
write = fmu.setFloat64 if given["fmi"] == 3 else fmu.setReal
rows = [read(references)]
write(given["torque"], [1e4, 2e4, 3e4])
if given["class"].endswith("Slave"):
    fmu.doStep(rows[0][0], 2.5)
else:
    fmu.setContinuousStates((c_double * 7)(*range(7)), 7)
rows.append(read(references))
print(json.dumps([[value.hex() for value in row] for row in rows]))
"""


@KIND
@FMI
def test_a_state_saved_as_bytes_continues_bit_for_bit_in_a_new_process(fmi, exchange):
    instance = start(fmi, exchange, "stepping")
    given = {
        "fmi": fmi,
        "class": type(instance.fmu).__name__,
        "guid": instance.fmu.guid,
        "folder": str(instance.fmu.unzipDirectory),
        "state": bytes_of(instance).hex(),
        "references": list(instance.references.values()),
        "torque": [instance.references[f"torque[{i}]"] for i in (1, 2, 3)],
    }
    rows = [instance.bits()]
    instance.set({"torque": [1e4, 2e4, 3e4]})
    if exchange:
        instance.fmu.setContinuousStates((c_double * 7)(*range(7)), 7)
    else:
        instance.time = instance.get("time")
        instance.step(2.5)
    rows.append(instance.bits())
    done = subprocess.run(
        [sys.executable, "-c", RESTORE], input=json.dumps(given), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == rows
    instance.free()


@FMI
def test_steps_rolled_back_and_taken_otherwise_give_the_flight_without_them(fmi):
    straight, rolled = start(fmi, False, "stepping"), start(fmi, False, "stepping")
    for seed in range(SEED, SEED + 20):
        for instance in (straight, rolled):
            instance.set(draw(seed))
        state, time = save(rolled), rolled.time
        for _ in range(2):  # an importer that tries steps that it does not accept
            rolled.set(draw(seed + 1000))
            advance(rolled, seed + 1000)
        rolled.fmu.setFMUState(state)
        rolled.fmu.freeFMUState(state)
        rolled.time = time
        for instance in (straight, rolled):
            advance(instance, seed)
        assert rolled.bits() == straight.bits()
    straight.free()
    rolled.free()


@pytest.mark.parametrize("exchange", [False, True], ids=["co-simulation", "model exchange"])
def test_a_refused_value_is_refused_again_after_a_restore_and_can_be_corrected(exchange):
    instance = start(3, exchange, "refusing")
    content = bytes_of(instance)
    instance.reset()
    assert restore(instance, content) == OK
    assert instance.get("DG.mass") == -1.0
    assert instance.get_status("mass") == DISCARD
    assert "DG.mass = -1 kg: must be >= 0" in instance.messages()[-1]
    assert instance.set({"DG.mass": 2e4}) == OK
    assert instance.get("mass") == 455000.0 + 2e4
    instance.free()


@FMI
def test_the_stop_time_is_part_of_a_state(fmi):
    instance = start(fmi, False, "stepping")
    content = bytes_of(instance)
    instance.reset()
    assert restore(instance, content) == OK
    instance.time = instance.get("time")
    assert instance.step(500.0) == ERROR
    assert "passes stopTime = 500 s" in instance.messages()[-1]
    instance.free()


@FMI
def test_the_log_settings_are_no_part_of_a_state(fmi):
    loud, quiet = start(fmi, False, "stepping"), Instance(RAW, fmi, logging=False)
    assert restore(quiet, bytes_of(loud)) == OK
    assert quiet.set({"mass": 1.0}) == ERROR
    assert quiet.log == []
    loud.free()
    quiet.free()


@FMI
def test_a_saved_state_does_not_follow_the_instance(fmi):
    instance = start(fmi, False, "stepping")
    state = save(instance)
    before = instance.fmu.serializeFMUState(state)
    advance(instance, SEED)
    instance.reset()
    assert instance.fmu.serializeFMUState(state) == before
    instance.fmu.freeFMUState(state)
    instance.free()


@MOMENT
@FMI
def test_the_same_life_gives_the_same_bytes(fmi, exchange, moment):
    one, other = start(fmi, exchange, moment), start(fmi, exchange, moment)
    assert bytes_of(one) == bytes_of(other)
    one.free()
    other.free()


@FMI
def test_a_state_that_is_there_is_used_again(fmi):
    instance = start(fmi, False, "stepping")
    state = save(instance)
    address = state.value
    advance(instance, SEED)
    call = function(instance, "GetFMUState")
    assert call(instance.fmu.component, byref(state)) == OK
    assert state.value == address
    content = instance.fmu.serializeFMUState(state)
    assert content == bytes_of(instance)
    instance.fmu.freeFMUState(state)
    instance.free()


# Refused.


def refused(instance: Instance, content: bytes, text: str) -> None:
    """Checks that bytes are refused with one line and that the instance can be reset."""
    instance.log.clear()
    assert restore(instance, content) == ERROR
    [(status, category, message)] = [line for line in instance.log if line[0] != OK]
    assert (status, category) == (ERROR, "logStatusError")
    assert text in message
    assert instance.reset() == OK


OTHERS = {
    "another model": body(),
    "the same model with another start value": variant(RAW, {"rotation.angular_velocity": [0.0, 0.0, 0.1]}),
}


@pytest.mark.parametrize("other", OTHERS)
@FMI
def test_bytes_of_another_model_are_refused(fmi, other):
    instance, foreign = Instance(RAW, fmi), Instance(OTHERS[other], fmi)
    refused(instance, bytes_of(foreign), "a state of another model, or of another version of this one")
    assert instance.initialise() == OK
    instance.free()
    foreign.free()


@pytest.mark.parametrize(("fmi", "other"), [(2, 3), (3, 2)])
def test_bytes_of_the_other_version_of_fmi_are_refused(fmi, other):
    instance, foreign = Instance(RAW, fmi), Instance(RAW, other)
    refused(instance, bytes_of(foreign), "a state of another model, or of another version of this one")
    instance.free()
    foreign.free()


@KIND
@FMI
def test_a_state_of_the_other_interface_is_refused(fmi, exchange):
    instance, foreign = Instance(RAW, fmi, exchange=exchange), Instance(RAW, fmi, exchange=not exchange)
    refused(instance, bytes_of(foreign), "co-simulation" if exchange else "model exchange")
    instance.free()
    foreign.free()


@FMI
def test_bytes_cut_off_or_added_to_anywhere_are_refused(fmi):
    instance = start(fmi, False, "stepping")
    content = bytes_of(instance)
    for size in [*range(1, len(content), 7), len(content) - 1]:
        refused(instance, content[:size], "bytes")
    refused(instance, content + b"\0", "bytes")
    refused(instance, content + content, "bytes")
    instance.free()


@FMI
def test_no_bytes_are_refused(fmi):
    instance = start(fmi, False, "stepping")
    refused(instance, b"", "the bytes are not a state of such an FMU")
    instance.free()


@FMI
def test_a_single_flipped_bit_is_refused_wherever_it_is(fmi):
    instance = start(fmi, False, "stepping")
    content, generator = bytes_of(instance), np.random.default_rng(SEED)
    drawn = generator.integers(0, 8 * len(content), 500)
    for bit in [*range(8 * 32), *drawn]:
        flipped = bytearray(content)
        flipped[bit // 8] ^= 1 << (bit % 8)
        refused(instance, bytes(flipped), "bytes")
    instance.free()


@FMI
def test_bytes_that_are_no_state_are_refused(fmi):
    instance, generator = start(fmi, False, "stepping"), np.random.default_rng(SEED)
    size = len(bytes_of(instance))
    for length in (1, 8, 24, 25, size, 10 * size):
        refused(instance, generator.bytes(length), "the bytes are not a state of such an FMU")
        refused(instance, bytes(length), "the bytes are not a state of such an FMU")
    instance.free()


NOTHING = {
    "save, no place": ("GetFMUState", (None,)),
    "restore nothing": ("SetFMUState", (None,)),
    "size of nothing": ("SerializedFMUStateSize", (None, byref(c_size_t()))),
    "serialise nothing": ("SerializeFMUState", (None, "buffer", 8)),
    "deserialise nothing": ("DeserializeFMUState", (None, 8, byref(c_void_p()))),
    "deserialise to nowhere": ("DeserializeFMUState", ("buffer", 8, None)),
    "size to nowhere": ("SerializedFMUStateSize", ("state", None)),
    "serialise to nowhere": ("SerializeFMUState", ("state", None, 8)),
    "serialise to a small place": ("SerializeFMUState", ("state", "buffer", 8)),
    "serialise to a large place": ("SerializeFMUState", ("state", "buffer", 100_000)),
}


@pytest.mark.parametrize("case", NOTHING)
@FMI
def test_null_and_wrong_sizes_are_errors_with_one_line(fmi, case):
    name, arguments = NOTHING[case]
    instance = start(fmi, False, "stepping")
    state, call = save(instance), function(instance, name)
    buffer = (c_ubyte * 8)()
    given = [
        cast(buffer, kind) if argument == "buffer" else state if argument == "state" else argument
        for argument, kind in zip(arguments, call.argtypes[1:], strict=True)
    ]
    before = instance.bits()
    assert call(instance.fmu.component, *given) == ERROR
    [message] = instance.messages()
    assert message.lower().startswith(f"fmi{fmi}{name}: ".lower())
    assert instance.bits() == before
    instance.fmu.reset()
    instance.fmu.freeFMUState(state)
    instance.free()


@FMI
def test_freeing_nothing_is_fine_and_a_freed_state_is_nothing(fmi):
    instance = start(fmi, False, "stepping")
    call, state = function(instance, "FreeFMUState"), save(instance)
    assert call(instance.fmu.component, None) == OK
    for _ in range(2):
        assert call(instance.fmu.component, byref(state)) == OK
        assert state.value is None
    advance(instance, SEED)
    assert instance.messages() == []
    instance.free()


# Memory.

CYCLES = 20_000
# A lost state is about a kilobyte: CYCLES of them are 20 MB. The allocator and Python's own objects may take
# some pages of 4 KiB more than in the first cycles.
LEAK_BOUND = 4096  # KiB


MEMORY = Path("/proc/self/statm")


def resident() -> float:
    """Returns the memory that this process holds, KiB."""
    return int(MEMORY.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1024


@pytest.mark.skipif(
    not MEMORY.exists(), reason=f"{MEMORY}, where Linux tells a process its memory, is missing"
)
@pytest.mark.parametrize("way", ["save", "bytes", "again"])
@FMI
def test_many_states_leave_no_memory_behind(fmi, way):
    instance = start(fmi, False, "stepping")
    kept, content = save(instance), bytes_of(instance)

    def cycle() -> None:
        if way == "again":
            function(instance, "GetFMUState")(instance.fmu.component, byref(kept))
        else:
            state = save(instance) if way == "save" else instance.fmu.deserializeFMUState(content)
            instance.fmu.setFMUState(state)
            instance.fmu.freeFMUState(state)

    for _ in range(CYCLES // 10):
        cycle()
    before = resident()
    for _ in range(CYCLES):
        cycle()
    assert resident() - before <= LEAK_BOUND
    instance.fmu.freeFMUState(kept)
    instance.free()
