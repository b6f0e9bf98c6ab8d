"""The versions of the FMI standard that FMUs are built for, and what differs between them: a row each.

Another version is a row here, the writer of its modelDescription.xml (`interface.model_description.WRITERS`),
and its entry points in C: c/fmiN.c and c/fmiN_unsupported.c, by the number of its row.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Version:
    """A version of the FMI standard.

    name            : fmiVersion in modelDescription.xml
    token           : the attribute there that holds the instantiation token
    lists_sources   : whether the C files are listed there; else buildDescription.xml is among them
    icon            : the icon's file in the archive, beside those in terminalsAndIcons/; "": none
    terminals       : fmiVersion in terminalsAndIcons.xml, of the version that defines the file
    platform_tuples : whether folders of binaries/ are named by platform tuples; else as FMI 2.0 has them, and
                      Apple silicon's library is also in that of macOS on x86_64
    refusal         : what calls answer to values that cannot be used, for the documentation
    """

    name: str
    token: str
    lists_sources: bool
    icon: str
    terminals: str
    platform_tuples: bool
    refusal: str


VERSIONS: dict[int, Version] = {
    2: Version(
        "2.0",
        token="guid",
        lists_sources=True,
        icon="model.png",
        terminals="3.0",
        platform_tuples=False,
        refusal="The answer is Discard where FMI 2.0 allows it and it helps (a set, a step that is too long; "
        "in model exchange a get and the derivatives too), else Error.",
    ),
    3: Version(
        "3.0",
        token="instantiationToken",
        lists_sources=False,
        icon="",
        terminals="3.0",
        platform_tuples=True,
        refusal="The answer is Discard.",
    ),
}
"""By the number that `build_fmu` takes."""

NEWEST = max(VERSIONS)


def check_version(fmi: int) -> None:
    """Raises ValueError for a number that is none of VERSIONS."""
    if fmi not in VERSIONS:
        raise ValueError(f"fmi = {fmi}: must be {' or '.join(map(str, VERSIONS))}")
