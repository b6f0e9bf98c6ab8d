"""Reads what matters of a shared library in ELF, PE or Mach-O form: machine, needs, exports, oldest system.

Written from the formats' public descriptions (System V ABI, Microsoft's PE format, Apple's <mach-o/loader.h>
and <kern/cs_blobs.h>). 64-bit, little-endian libraries only; anything else fails an assertion.
"""

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass


def text_at(content: bytes, offset: int) -> str:
    """Returns the zero-terminated text at an offset."""
    return content[offset : content.index(b"\0", offset)].decode()


def version(word: int) -> tuple[int, int]:
    """Returns Apple's packed version number as (major, minor)."""
    return word >> 16, word >> 8 & 255


@dataclass(frozen=True)
class Elf:
    machine: int
    exports: set[str]
    imports: set[str]
    needed: list[str]
    search_paths: list[str]
    versions: set[str]
    executable_stack: bool
    text_relocations: bool


DT_NEEDED, DT_HASH, DT_STRTAB, DT_SYMTAB, DT_RPATH, DT_TEXTREL, DT_RUNPATH = 1, 4, 5, 6, 15, 22, 29
DT_VERNEED, DT_VERNEEDNUM = 0x6FFFFFFE, 0x6FFFFFFF
PT_LOAD, PT_DYNAMIC, PT_GNU_STACK = 1, 2, 0x6474E551


def read_elf(content: bytes) -> Elf:
    """Returns what an ELF shared library says of itself."""
    assert content[:6] == b"\x7fELF\x02\x01"
    kind, machine = struct.unpack_from("<2H", content, 16)
    assert kind == 3, "not a shared library"
    start, size, count = *struct.unpack_from("<Q", content, 32), *struct.unpack_from("<2H", content, 54)
    segments = [struct.unpack_from("<2I6Q", content, start + i * size) for i in range(count)]

    def place(address: int) -> int:
        for kind, _, offset, begin, _, length, _, _ in segments:
            if kind == PT_LOAD and begin <= address < begin + length:
                return int(offset + address - begin)
        raise AssertionError(f"address {address:#x} is in no segment")

    (dynamic,) = [segment for segment in segments if segment[0] == PT_DYNAMIC]
    entries = list(struct.iter_unpack("<2Q", content[dynamic[2] : dynamic[2] + dynamic[5]]))
    tags = dict(entries)
    strings, symbols = place(tags[DT_STRTAB]), place(tags[DT_SYMTAB])
    defined: dict[bool, set[str]] = {True: set(), False: set()}
    for i in range(1, struct.unpack_from("<2I", content, place(tags[DT_HASH]))[1]):
        name, _, _, section = struct.unpack_from("<I2BH", content, symbols + 24 * i)
        defined[section != 0].add(text_at(content, strings + name))
    return Elf(
        machine=machine,
        exports=defined[True],
        imports=defined[False],
        needed=[text_at(content, strings + value) for tag, value in entries if tag == DT_NEEDED],
        search_paths=[text_at(content, strings + v) for t, v in entries if t in (DT_RPATH, DT_RUNPATH)],
        versions=set(_needed_versions(content, place(tags[DT_VERNEED]), tags[DT_VERNEEDNUM], strings)),
        executable_stack=any(s[0] == PT_GNU_STACK and s[1] & 1 for s in segments),
        text_relocations=DT_TEXTREL in tags,
    )


def _needed_versions(content: bytes, offset: int, count: int, strings: int) -> Iterator[str]:
    for _ in range(count):
        _, versions, _, first, following = struct.unpack_from("<2H3I", content, offset)
        entry = offset + first
        for _ in range(versions):
            _, _, _, name, next_entry = struct.unpack_from("<I2H2I", content, entry)
            yield text_at(content, strings + name)
            entry += next_entry
        offset += following


@dataclass(frozen=True)
class Pe:
    machine: int
    is_dll: bool
    hardening: int
    oldest_system: tuple[int, int]
    exports: set[str]
    imports: dict[str, set[str]]
    debug_kinds: list[int]


def read_pe(content: bytes) -> Pe:
    """Returns what a Windows DLL says of itself."""
    header = struct.unpack_from("<I", content, 0x3C)[0]
    assert content[header : header + 4] == b"PE\0\0"
    machine, section_count = struct.unpack_from("<2H", content, header + 4)
    optional_size, flags = struct.unpack_from("<2H", content, header + 20)
    optional = header + 24
    assert struct.unpack_from("<H", content, optional)[0] == 0x20B, "not a 64-bit PE"
    table = optional + optional_size
    sections = [struct.unpack_from("<4I", content, table + 40 * i + 8) for i in range(section_count)]

    def place(address: int) -> int:
        for size, begin, raw_size, raw in sections:
            if begin <= address < begin + max(size, raw_size):
                return int(raw + address - begin)
        raise AssertionError(f"address {address:#x} is in no section")

    def directory(i: int) -> tuple[int, int]:
        address, size = struct.unpack_from("<2I", content, optional + 112 + 8 * i)
        return (place(address), size) if address else (0, 0)

    exports, _ = directory(0)
    count, names = (struct.unpack_from("<I", content, exports + at)[0] for at in (24, 32))
    addresses = struct.unpack_from(f"<{count}I", content, place(names))
    imports: dict[str, set[str]] = {}
    at, _ = directory(1)
    while (row := struct.unpack_from("<5I", content, at))[3]:
        rows, functions = place(row[0] or row[4]), set()
        while address := struct.unpack_from("<Q", content, rows)[0]:
            functions.add(text_at(content, place(address) + 2))
            rows += 8
        imports[text_at(content, place(row[3])).lower()] = functions
        at += 20
    debug, size = directory(6)
    return Pe(
        machine=machine,
        is_dll=bool(flags & 0x2000),
        hardening=struct.unpack_from("<H", content, optional + 70)[0],
        oldest_system=struct.unpack_from("<2H", content, optional + 48),
        exports={text_at(content, place(address)) for address in addresses},
        imports=imports,
        debug_kinds=[struct.unpack_from("<I", content, debug + 28 * i + 12)[0] for i in range(size // 28)],
    )


@dataclass(frozen=True)
class MachO:
    cputype: int
    install_name: str
    dylibs: list[str]
    search_paths: list[str]
    platform: int
    oldest_system: tuple[int, int]
    exports: set[str]
    signature: bytes


LC_SYMTAB, LC_LOAD_DYLIB, LC_ID_DYLIB, LC_RPATH = 0x2, 0xC, 0xD, 0x8000001C
LC_CODE_SIGNATURE, LC_BUILD_VERSION = 0x1D, 0x32


def read_macho(content: bytes) -> MachO:
    """Returns what a thin macOS library says of itself."""
    magic, cputype, _, kind, count, _, _, _ = struct.unpack_from("<8I", content)
    assert magic == 0xFEEDFACF
    assert kind == 6, "not a dylib"
    commands: dict[int, list[bytes]] = {}
    at = 32
    for _ in range(count):
        command, size = struct.unpack_from("<2I", content, at)
        commands.setdefault(command, []).append(content[at : at + size])
        at += size

    def names(command: int) -> list[str]:
        return [text_at(c, struct.unpack_from("<I", c, 8)[0]) for c in commands.get(command, [])]

    (build,) = commands[LC_BUILD_VERSION]
    platform, oldest = struct.unpack_from("<2I", build, 8)
    symbols, symbol_count, strings, _ = struct.unpack_from("<4I", commands[LC_SYMTAB][0], 8)
    exports = set()
    for i in range(symbol_count):
        name, flags, section = struct.unpack_from("<I2B", content, symbols + 16 * i)
        if flags & 0x01 and not flags & 0x10 and section:  # external, not private, defined
            exports.add(text_at(content, strings + name))
    signature = b""
    for command in commands.get(LC_CODE_SIGNATURE, []):
        offset, size = struct.unpack_from("<2I", command, 8)
        signature = content[offset : offset + size]
    return MachO(
        cputype=cputype,
        install_name=names(LC_ID_DYLIB)[0],
        dylibs=names(LC_LOAD_DYLIB),
        search_paths=names(LC_RPATH),
        platform=platform,
        oldest_system=version(oldest),
        exports=exports,
        signature=signature,
    )


def read_universal(content: bytes) -> list[tuple[int, int, bytes]]:
    """Returns cputype, alignment in bytes and content of each library in a universal one."""
    magic, count = struct.unpack_from(">2I", content)
    assert magic == 0xCAFEBABE
    libraries = []
    for i in range(count):
        cputype, _, offset, size, power = struct.unpack_from(">5I", content, 8 + 20 * i)
        assert offset % (1 << power) == 0
        assert offset + size <= len(content)
        libraries.append((cputype, 1 << power, content[offset : offset + size]))
    return libraries


def signed_pages(content: bytes, signature: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yields, page by page, the hash in a library's code signature and that of the page as it is."""
    magic, _, count = struct.unpack_from(">3I", signature)
    assert magic == 0xFADE0CC0
    slots = dict(struct.unpack_from(">2I", signature, 12 + 8 * i) for i in range(count))
    directory = signature[slots[0] :]
    magic, _, _, flags, hashes, _, _, pages, limit = struct.unpack_from(">9I", directory)
    hash_size, hash_type, _, page_power = struct.unpack_from("4B", directory, 36)
    assert magic == 0xFADE0C02
    assert flags & 2, "not signed ad hoc"
    assert (hash_type, hash_size) == (2, 32), "not SHA-256"
    for page in range(pages):
        begin, end = page << page_power, min(page + 1 << page_power, limit)
        stated = directory[hashes + 32 * page : hashes + 32 * (page + 1)]
        yield stated, hashlib.sha256(content[begin:end]).digest()
