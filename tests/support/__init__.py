"""Shared by the tests: scenes, numbers, FMUs; further subjects have modules of their own."""

from support.fmus import DISCARD, ERROR, OK, WARNING, Instance, built, flying, store, unpacked
from support.numbers import (
    COMPOSITE_TOLERANCE,
    EPS,
    INF,
    NAN,
    UNIT_TOLERANCE,
    Array,
    U,
    hamilton,
    random_rotation,
    relative_error,
)
from support.scenes import BALL, ISS_DG, LAWS, PROPAGATORS, body, draw_inputs, scene, variant

__all__ = [
    "BALL",
    "COMPOSITE_TOLERANCE",
    "DISCARD",
    "EPS",
    "ERROR",
    "INF",
    "ISS_DG",
    "LAWS",
    "NAN",
    "OK",
    "PROPAGATORS",
    "UNIT_TOLERANCE",
    "WARNING",
    "Array",
    "Instance",
    "U",
    "body",
    "built",
    "draw_inputs",
    "flying",
    "hamilton",
    "random_rotation",
    "relative_error",
    "scene",
    "store",
    "unpacked",
    "variant",
]
