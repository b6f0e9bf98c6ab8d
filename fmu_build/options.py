"""Options that the commands which build FMUs have in common."""

import argparse

from fmu_build.interface.names import NAMINGS
from fmu_build.platforms import PLATFORMS, Platform, platforms_named


def add_build_options(parser: argparse.ArgumentParser) -> None:
    """Adds --platform and --names."""
    parser.add_argument(
        "--platform",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help=f"to compile for (default: this machine's): {', '.join(p.name for p in PLATFORMS)}; or all",
    )
    parser.add_argument(
        "--names",
        choices=NAMINGS,
        default=NAMINGS[0],
        help="of the FMU's variables: DG.nose.position[1], or flat DG_nose_position_1 (default: %(default)s)",
    )


def platforms_of(parser: argparse.ArgumentParser, options: argparse.Namespace) -> tuple[Platform, ...]:
    """Returns the platforms that options name, none for this machine's; an unknown name is wrong usage."""
    try:
        return platforms_named(options.platform)
    except ValueError as error:
        parser.error(f"--platform: {error}")
