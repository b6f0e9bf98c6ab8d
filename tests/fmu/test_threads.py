"""Many instances at once, each on a thread of its own: nothing is shared but constants."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from threading import Barrier, get_ident
from typing import Any

import numpy as np

from fmu.exchange import change
from support import DISCARD, ISS_DG, OK, Instance, refusal, variant
from support.marks import FMI, FMI_3_AT_ONCE, KIND

SEED = 20240615
COUNT = 200
LIVES = 8  # different flights among them
STEPS = 6
RAW = variant(ISS_DG, {"name": "threaded", "rotation": {"angular_velocity": [0.05, -0.08, 0.11]}})


def draw(generator: np.random.Generator) -> dict[str, Any]:
    """Returns usable inputs."""
    return {
        "DG.mass": generator.uniform(11e3, 24.5e3),
        "DG.pmi": np.array([15.5, 22.1, 20.0]) * generator.uniform(0.8, 1.2),
        "DG.nose.position": generator.normal([0.0, -0.49, -10.0], 0.5),
        "DG.nose.direction": generator.normal([0.0, 0.0, -1.0], 0.2),
        "torque": generator.normal(size=3) * 1e3,
    }


def life(instance: Instance, exchange: bool, seed: int) -> list[bytes]:
    """Returns every variable after each of some long steps, refusals, derivatives, saved states between."""
    generator = np.random.default_rng(seed)
    assert instance.reset() == OK
    assert instance.initialise() == OK
    if exchange:
        assert instance.run() == OK
    rows = []
    for _ in range(STEPS):
        assert set(change(instance, draw(generator))) == {OK}
        state = instance.fmu.getFMUState()
        if exchange:
            instance.set({"state.angular_velocity": generator.normal(size=3)})
        else:
            assert instance.step(500.0) == OK  # s: a thousand sub-steps
        rows.append(np.array(instance.everything()).tobytes())
        rows.append(instance.directional(["inertia[1,2]"], ["DG.nose.position[2]"], [1.0]).tobytes())
        instance.set({"DG.mass": -1.0})
        if exchange or instance.fmi == 3:
            assert instance.get_status("mass") == DISCARD
        assert instance.set({"DG.mass": 12e3}) == OK  # an event does not begin from a mass that cannot be
        if generator.uniform() < 0.5:
            instance.fmu.setFMUState(state)
            instance.time = instance.get("time")
        instance.fmu.freeFMUState(state)
    return rows


@cache
def alone(fmi: int, exchange: bool, seed: int) -> list[bytes]:
    instance = Instance(RAW, fmi, optimised=True, exchange=exchange)
    result = life(instance, exchange, seed)
    instance.free()
    return result


@KIND
@FMI_3_AT_ONCE
def test_two_hundred_instances_on_threads_give_bit_for_bit_what_each_gives_alone(fmi, exchange):
    instances = [
        Instance(RAW, fmi, optimised=True, exchange=exchange, name=f"number {i}") for i in range(COUNT)
    ]
    together, threads = Barrier(COUNT), set()

    def run(number: int) -> list[bytes]:
        threads.add(get_ident())
        together.wait(timeout=30.0)
        return life(instances[number], exchange, SEED + number % LIVES)

    with ThreadPoolExecutor(COUNT) as pool:
        runs = list(pool.map(run, range(COUNT)))
    assert len(threads) == COUNT
    assert [i for i, found in enumerate(runs) if found != alone(fmi, exchange, SEED + i % LIVES)] == []
    for instance in instances:
        instance.free()


@FMI
def test_log_lines_go_to_the_instance_that_they_are_about(fmi):
    instances = [Instance(RAW, fmi, name=f"number {i}") for i in range(20)]

    def run(number: int) -> list[str]:
        instance = instances[number]
        assert instance.initialise() == OK
        for k in range(50):
            assert instance.set({"DG.mass": -1.0 - number}) == OK
            assert instance.step(0.1) == refusal(fmi), k
        return instance.messages()

    with ThreadPoolExecutor(len(instances)) as pool:
        logs = list(pool.map(run, range(len(instances))))
    assert [{m.partition("DG.mass = ")[2].split()[0] for m in log} for log in logs] == [
        {str(-1 - number)} for number in range(len(instances))
    ]
    for instance in instances:
        instance.free()


def test_instances_are_made_and_freed_on_threads_while_others_fly():
    flying = Instance(RAW)
    functions, token = flying.fmu._functions, flying.fmu.guid.encode()
    arguments = (
        None,
        False,
        False,
        False,
        False,
        None,
        0,
        None,
        flying.fmu.logMessage,
        flying.fmu.intermediateUpdate,
    )

    def make_and_free(number: int) -> bool:
        made = [
            functions["fmi3InstantiateCoSimulation"](f"number {number}.{k}".encode(), token, *arguments)
            for k in range(50)
        ]
        for component in made:
            functions["fmi3FreeInstance"](component)
        return all(made)

    with ThreadPoolExecutor(8) as pool:
        flight = pool.submit(life, flying, False, SEED)
        made = list(pool.map(make_and_free, range(40)))
    assert all(made)
    assert flight.result() == alone(3, False, SEED)
    flying.free()
