"""Material files (.smrl), version 0: unstable, and read by this version of the program alone.

    bytes  what
    4      "SMRL"
    2      version, 0
    4      CRC-32 of all that follows
    4      length of the header
    …      header: JSON in UTF-8 (keys: see `_header`)
    …      LZMA2 stream of the LUT (M × 3 float64) and the index of the cells above the horizon (uint8 or uint16)

All numbers are little-endian.
"""

from __future__ import annotations

import json
import lzma
import struct
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError, SommerlError
from ..files import atomic_write
from ..lattice import Lattice
from .material import SomManBrdf

MAGIC = b"SMRL"
VERSION = 0
PREFIX = struct.Struct("<4sHII")
MOST_CELLS = 2**22  # MERL's larger kind of table has 2,916,000
LONGEST_FILE = 2 * MOST_CELLS + 24 * 2**16 + 2**20
FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": 0, "lp": 0, "pb": 0}]


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes says that it is a material file."""
    return head.startswith(MAGIC)


def save(material: SomManBrdf, path: str | Path) -> int:
    """Writes a material file; returns its length [bytes]."""
    data = encode(material)
    with atomic_write(Path(path)) as out:
        out.write(data)
    return len(data)


def load(path: str | Path) -> SomManBrdf:
    """The material in a file. Raises FormatError if it is not one, or is damaged, or is of another version."""
    path = Path(path)
    length = path.stat().st_size
    if length > LONGEST_FILE:
        raise FormatError(f"{path}: expected at most {LONGEST_FILE} bytes, found {length}")
    try:
        return decode(path.read_bytes())
    except SommerlError as error:
        raise FormatError(f"{path}: {error}") from error


def encode(material: SomManBrdf) -> bytes:
    """The bytes of a material file. The same material always gives the same bytes."""
    header = json.dumps(_header(material), sort_keys=True, ensure_ascii=False, separators=(",", ":")).encode()
    index = material.index[material.lattice.above_horizon]
    payload = material.lut.astype("<f8").tobytes() + index.astype(index.dtype.newbyteorder("<")).tobytes()
    body = header + lzma.compress(payload, lzma.FORMAT_RAW, filters=FILTERS)
    crc = zlib.crc32(struct.pack("<I", len(header)) + body)
    return PREFIX.pack(MAGIC, VERSION, crc, len(header)) + body


def decode(data: bytes) -> SomManBrdf:
    """The material in the bytes of a file. Raises FormatError."""
    if len(data) < PREFIX.size:
        raise FormatError(f"expected at least {PREFIX.size} bytes, found {len(data)}")
    magic, version, crc, header_bytes = PREFIX.unpack_from(data)
    if magic != MAGIC:
        raise FormatError("expected a material file (.smrl), found another kind")
    if version != VERSION:
        raise FormatError(f"expected version {VERSION}, found version {version}; a newer Sommerl may read it")
    if zlib.crc32(data[PREFIX.size - 4 :]) != crc:
        raise FormatError("expected the checksum in the file, found another: the file is damaged or cut off")
    try:
        header: dict[str, Any] = json.loads(data[PREFIX.size : PREFIX.size + header_bytes])
        return _material(header, data[PREFIX.size + header_bytes :])
    except FormatError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError, lzma.LZMAError, SommerlError) as error:
        raise FormatError(f"expected a material file's header and contents, found others ({error})") from error


def _header(material: SomManBrdf) -> dict[str, Any]:
    return {
        "name": material.name,
        "clusters": material.clusters,
        "lattice": asdict(material.lattice),
        "interpolation": material.interpolation,
        "options": material.options,
        "metrics": material.metrics,
        "source_sha256": material.source_sha256,
    }


def _material(header: dict[str, Any], compressed: bytes) -> SomManBrdf:
    lattice, clusters, interpolation = Lattice(**header["lattice"]), header["clusters"], header["interpolation"]
    sides = (*lattice.shape, clusters)
    if not all(type(n) is int for n in sides) or lattice.size > MOST_CELLS or not 1 <= clusters <= 2**16:
        raise FormatError(f"expected a lattice of at most {MOST_CELLS} cells and a LUT of at most 65536 entries")
    if type(lattice.reciprocal) is not bool:
        raise FormatError(f"expected a lattice that is reciprocal or not, found {lattice.reciprocal}")
    above = lattice.above_horizon
    entry = np.dtype("<u1" if clusters <= 256 else "<u2")
    payload = _decompress(compressed, 24 * clusters + entry.itemsize * int(above.sum()))
    lut = np.frombuffer(payload, "<f8", 3 * clusters).reshape(clusters, 3)
    index: NDArray[Any] = np.zeros(lattice.shape, entry)
    index[above] = np.frombuffer(payload, entry, offset=24 * clusters)
    return SomManBrdf(
        lut,
        index,
        lattice,
        name=str(header["name"]),
        interpolation=interpolation,
        options=dict(header["options"]),
        metrics=dict(header["metrics"]),
        source_sha256=str(header["source_sha256"]),
    )


def _decompress(compressed: bytes, expected: int) -> bytes:
    """Exactly `expected` bytes, and never more than that in memory."""
    decompressor = lzma.LZMADecompressor(lzma.FORMAT_RAW, filters=FILTERS)
    payload = decompressor.decompress(compressed, expected)
    if len(payload) == expected and not decompressor.eof:
        payload += decompressor.decompress(b"", 1)
    if len(payload) != expected or not decompressor.eof or decompressor.unused_data:
        raise FormatError(f"expected {expected} bytes of LUT and index, found another number")
    return payload
