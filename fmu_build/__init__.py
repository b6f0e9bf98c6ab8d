"""A scene in, a functional mock-up unit out."""

from fmu_build.build import build_fmu
from fmu_build.errors import BuildError

__all__ = ["BuildError", "build_fmu"]
