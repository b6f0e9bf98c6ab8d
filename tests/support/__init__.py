"""Shared by the tests: scenes, numbers, FMUs; further subjects have modules of their own."""

from support.fmus import DISCARD, ERROR, OK, WARNING, Instance, built, flying, store, unpacked
from support.numbers import EPS, INF, NAN, Array, U, hamilton, random_rotation, relative_error
from support.scenes import BALL, ISS_DG, LAWS, PROPAGATORS, body, draw_inputs, scene, variant

__all__ = [
    "BALL",
    "DISCARD",
    "EPS",
    "ERROR",
    "INF",
    "ISS_DG",
    "LAWS",
    "NAN",
    "OK",
    "PROPAGATORS",
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
