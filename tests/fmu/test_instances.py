"""Several instances of an FMU side by side: each flies as it does alone."""

from concurrent.futures import ThreadPoolExecutor

from fmu.programmes import SEED, alone, exchange, programme
from support import ISS_DG, Instance
from support.marks import FMI


@FMI
def test_interleaved_instances_give_bit_for_bit_what_they_give_alone(fmi):
    seeds = (SEED, SEED + 1, SEED + 2)
    instances = [Instance(ISS_DG, fmi, name=f"number {seed}") for seed in seeds]
    together = zip(*(programme(i, seed) for i, seed in zip(instances, seeds, strict=True)), strict=True)
    runs = [list(run) for run in zip(*together, strict=True)]
    for instance in instances:
        instance.free()
    assert runs == [alone(fmi, seed) for seed in seeds]


@FMI
def test_instances_on_threads_give_bit_for_bit_what_they_give_alone(fmi):
    seeds = (SEED, SEED + 1)
    with ThreadPoolExecutor(len(seeds)) as pool:
        runs = list(pool.map(lambda seed: alone(fmi, seed, 500), seeds))
    assert runs == [alone(fmi, seed, 500) for seed in seeds]


@FMI
def test_instances_of_both_interfaces_run_side_by_side(fmi):
    stepping, exchanged = Instance(ISS_DG, fmi), Instance(ISS_DG, fmi, exchange=True)
    runs = zip(*zip(programme(stepping, SEED, 13), exchange(exchanged, SEED), strict=True), strict=True)
    steps, moves = map(list, runs)
    stepping.free()
    exchanged.free()
    other = Instance(ISS_DG, fmi, exchange=True, logging=False)
    assert moves == list(exchange(other, SEED))
    assert steps == alone(fmi, SEED, 13)
    other.free()


@FMI
def test_freeing_an_instance_leaves_the_others_alone(fmi):
    kept, freed = Instance(ISS_DG, fmi), Instance(ISS_DG, fmi)
    run, other = programme(kept, SEED), programme(freed, SEED + 1)
    result = [next(run) for _ in range(7)]
    assert next(other)
    freed.free()
    result += list(run)
    kept.free()
    assert result == alone(fmi, SEED)
