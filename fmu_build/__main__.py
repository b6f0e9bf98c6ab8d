"""Command line: python -m fmu_build SCENE.toml [-o OUT.fmu] [--fmi 2|3]."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fmu_build.build import build_fmu
from fmu_build.errors import BuildError
from supervessel import SceneError, load_scene


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds the FMU of a scene file; returns 0 when done, 1 when it failed, each problem on stderr."""
    parser = argparse.ArgumentParser(
        prog="python -m fmu_build", description="Build the FMU of a scene: one line on stdout, its path."
    )
    parser.add_argument("scene", type=Path, metavar="SCENE.toml", help="the scene file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT.fmu", help="the FMU to write (default: NAME.fmu here)"
    )
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=3, help="FMI version (default: 3)")
    options = parser.parse_args(arguments)
    try:
        scene = load_scene(options.scene)
        print(build_fmu(scene, options.output or Path(f"{scene.name}.fmu"), options.fmi))
    except (SceneError, BuildError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
