"""Writes and reads files of many materials (.smrlib), format 1. docs/format.md specifies every byte.

    bytes  what
    4      "SMLB"
    2      version: 1
    4      CRC-32 of the table that follows
    2      number of sections
    …      for each section: type, flags, length, CRC-32
    …      the sections, one after the other: the index; what materials share, if they do (`shared`); and the
           materials in the order of the index

All numbers are little-endian. Places are not in the file: a section, and a material, begins where the one before ends,
so that none can overlap. A reader reads head and index, and of the materials those that are asked for.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from math import isfinite
from typing import BinaryIO

import numpy as np

from ...system.errors import FormatError
from ..material import SomManBrdf
from . import file
from .library_index import COLUMNS, MOST_INFLATED, PART, SMRL, Entry, Index, written
from .shared import Shared

MAGIC, VERSION = b"SMLB", 1
HEAD = struct.Struct("<4sHI")
COUNT = struct.Struct("<H")
SECTION = struct.Struct("<HHQI")  # type, flags, length, CRC-32
INDEX, MATERIALS, SHARED = 1, 2, 3  # types of sections
NEEDED = 1  # flag: who does not know the section cannot read the file
MOST_SECTIONS = 64
LONGEST_SHARED = 2**24  # bytes
ReadPart = Callable[[int, int], bytes]  #: the bytes of a file from a place on, so many or as many as there are


def looks_like(head: bytes) -> bool:
    """Whether a file that begins with these bytes says that it is one of many materials."""
    return head.startswith(MAGIC)


def write(out: BinaryIO, entries: Sequence[Entry], read: Callable[[str], bytes], shared: Shared | None = None) -> int:
    """Writes a file of many materials; returns its length. The same materials give the same bytes in any order.

    read: gives the .smrl of a material by its name; it is called twice, so that no more than one is in memory. shared:
    lattices; materials on them are written without, and lose what their notes say of what they were made from. Raises
    FormatError for what a reader would refuse, and if a material is another one at the second time.
    """
    ordered = sorted(entries, key=lambda entry: entry.name.encode("utf-8", "surrogatepass"))
    columns = {name: np.zeros(len(ordered), kind) for name, kind, _ in COLUMNS if name in ("length", "crc", "kind")}
    for number, entry in enumerate(ordered):
        kind, data = _kind(entry.name, read(entry.name), shared)
        columns["length"][number], columns["crc"][number] = len(data), zlib.crc32(data)
        columns["kind"][number] = kind
    total = int(columns["length"].sum(dtype=np.int64))
    index, common = written(ordered, columns), shared.encode() if shared else b""
    sections = [(INDEX, index), *([(SHARED, common)] if shared else [])]
    table = COUNT.pack(len(sections) + 1)
    for kind, data in sections:
        table += SECTION.pack(kind, NEEDED, len(data), zlib.crc32(data))
    table += SECTION.pack(MATERIALS, NEEDED, total, 0)
    head = HEAD.pack(MAGIC, VERSION, zlib.crc32(table)) + table + index + common
    Index(index, total, len(head) + total, shared is not None)  # refuses what readers would
    out.write(head)
    for entry, crc in zip(ordered, columns["crc"].tolist(), strict=True):
        _, data = _kind(entry.name, read(entry.name), shared)
        if zlib.crc32(data) != crc:
            raise FormatError(f"{entry.name}: expected the same file again, found another: it has changed meanwhile")
        out.write(data)
    return len(head) + total


def _kind(name: str, data: bytes, shared: Shared | None) -> tuple[int, bytes]:
    """How a .smrl is written: its kind, and its bytes. Raises FormatError for what is no .smrl."""
    try:
        material = file.decode(data)
        part = shared.part(material) if shared else None
    except FormatError as error:
        raise FormatError(f"{name}: {error}") from error
    return (SMRL, data) if part is None else (PART, part)


class LibraryFile:
    """A file of many materials, of which head and index are read now, and materials when they are asked for.

    read: its bytes; of bytes that it has not, fewer. length: of the file; None if that is not known beforehand.
    Raises FormatError if it is of another kind or version, damaged, or cut off.
    """

    def __init__(self, read: ReadPart, length: int | None = None) -> None:
        self._read = read
        table = read(0, HEAD.size + COUNT.size + MOST_SECTIONS * SECTION.size)
        sections, at = _sections(table)
        self.bytes = at + sum(size for _, size, _ in sections)
        if length is not None and length != self.bytes:
            raise FormatError(f"expected {self.bytes} bytes, found {length}: the file is cut off or damaged")
        index, self._shared = b"", None
        for kind, size, crc in sections:
            most = {INDEX: MOST_INFLATED, SHARED: LONGEST_SHARED}.get(kind, size)
            if size > most:
                raise FormatError(f"expected a section of type {kind} of at most {most} bytes, found {size}")
            if kind == INDEX:
                index = self._part(at, size, crc)
            elif kind == SHARED:
                self._shared = Shared.decode(self._part(at, size, crc))
            elif kind == MATERIALS:
                self._start = at
            at += size
        (total,) = (size for kind, size, _ in sections if kind == MATERIALS)
        self.index = Index(index, total, self.bytes, self._shared is not None)

    def data(self, name: str) -> bytes:
        """The .smrl of a material. Raises FormatError if there is none of that name, or it is damaged."""
        number = self.index.number(name)
        if number is None:
            raise FormatError(self.index.no_such(name))
        start, size, crc = self.index.place(number)
        data = self._part(self._start + start, size, crc)
        return data if self.index.kind(number) == SMRL else file.encode(self._whole(self.index.entry(number), data))

    def _whole(self, entry: Entry, part: bytes) -> SomManBrdf:
        """A material that shares a lattice."""
        assert self._shared is not None
        # A .smrl holds finite figures only.
        finite = {name: value for name, value in entry.metrics.items() if isfinite(value)}
        noted = {"options": entry.options, "metrics": finite}
        return self._shared.material(part, {"name": entry.name, "source_sha256": entry.source_sha256} | noted)

    def _part(self, start: int, size: int, crc: int) -> bytes:
        data = self._read(start, size)
        if len(data) != size:
            raise FormatError(f"expected {size} bytes from byte {start} on, found {len(data)}: the file is cut off")
        if zlib.crc32(data) != crc:
            raise FormatError(f"expected the checksum of {size} bytes from byte {start} on, found another: damaged")
        return data


def _sections(data: bytes) -> tuple[list[tuple[int, int, int]], int]:
    """Type, length and checksum of each section, and where the first one begins. data: how the file begins."""
    if len(data) < HEAD.size + COUNT.size:
        raise FormatError(f"expected at least {HEAD.size + COUNT.size} bytes, found {len(data)}")
    magic, version, crc = HEAD.unpack_from(data)
    if magic != MAGIC:
        raise FormatError("expected a file of many materials (.smrlib), found another kind")
    if version != VERSION:
        raise FormatError(f"expected version {VERSION}, found version {version}; a newer Sommerl may read it")
    (count,) = COUNT.unpack_from(data, HEAD.size)
    end = HEAD.size + COUNT.size + count * SECTION.size
    if count > MOST_SECTIONS or len(data) < end or zlib.crc32(data[HEAD.size : end]) != crc:
        raise FormatError("expected the checksum of the table of sections, found another: the file is damaged")
    found = [SECTION.unpack_from(data, HEAD.size + COUNT.size + n * SECTION.size) for n in range(count)]
    for kind, flags, _, _ in found:
        if kind not in (INDEX, MATERIALS, SHARED) and flags & NEEDED:
            raise FormatError(f"expected sections of types {INDEX} to {SHARED}, found type {kind}, which is needed")
    kinds = [kind for kind, *_ in found]
    if any(kinds.count(kind) != 1 for kind in (INDEX, MATERIALS)) or kinds.count(SHARED) > 1:
        raise FormatError("expected one index and one section of materials, found others")
    return [(kind, size, crc) for kind, _, size, crc in found], end
