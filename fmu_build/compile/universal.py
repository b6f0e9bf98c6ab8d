"""One macOS library for several machines: thin Mach-O libraries behind a fat header.

The header is that of Apple's <mach-o/fat.h>: big-endian 32-bit words, a magic number and a count, then for
each thin library its machine (two words, as in the library's own header), offset, size and the power of two
that the offset is a multiple of. A thin library's code signature covers its own bytes from its own beginning,
so it stays valid.
"""

import struct
from collections.abc import Sequence

from fmu_build.errors import BuildError

FAT_MAGIC = 0xCAFEBABE
THIN_MAGIC = 0xFEEDFACF  # 64-bit, little-endian
PAGE = {0x01000007: 12, 0x0100000C: 14}
"""Cputype of x86_64 and arm64: the power of two of a page of memory, which a library must begin at."""


def universal_library(libraries: Sequence[bytes]) -> bytes:
    """Returns the Mach-O file that holds these thin 64-bit libraries, unchanged, in this order.

    Raises BuildError for one that is no such library, and for two of the same machine.
    """
    machines = [_machine(library) for library in libraries]
    if len({cputype for cputype, _ in machines}) < len(machines):
        raise BuildError("a universal library holds each machine once")
    rows, end = [], 8 + 20 * len(libraries)
    for (cputype, cpusubtype), library in zip(machines, libraries, strict=True):
        offset = -(-end >> PAGE[cputype]) << PAGE[cputype]
        rows.append((cputype, cpusubtype, offset, len(library), PAGE[cputype]))
        end = offset + len(library)
    header = struct.pack(">2I", FAT_MAGIC, len(rows)) + b"".join(struct.pack(">5I", *row) for row in rows)
    universal = bytearray(end)
    universal[: len(header)] = header
    for (_, _, offset, size, _), library in zip(rows, libraries, strict=True):
        universal[offset : offset + size] = library
    return bytes(universal)


def _machine(library: bytes) -> tuple[int, int]:
    """Returns cputype and cpusubtype from a thin library's header."""
    if len(library) >= 12:
        magic, cputype, cpusubtype = struct.unpack_from("<3I", library)
        if magic == THIN_MAGIC and cputype in PAGE:
            return cputype, cpusubtype
    raise BuildError("not a thin Mach-O library of x86_64 or arm64")
