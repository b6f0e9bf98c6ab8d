"""Rotation of docked spacecraft: scene schema, symbolic model, numpy reference and CasADi twin."""

from supervessel import reference
from supervessel.accuracy import AccuracyError, choose
from supervessel.loading import load_scene, parse_scene
from supervessel.problems import SceneError
from supervessel.scene import Scene
from supervessel.twin import Twin

__all__ = ["AccuracyError", "Scene", "SceneError", "Twin", "choose", "load_scene", "parse_scene", "reference"]
