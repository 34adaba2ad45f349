"""Material files (.smrl), format 1: docs/format.md has every byte, `reference_codec.py` reads nodes in plain Python.

    bytes  what
    4      "SMRL"
    2      version, 1
    4      CRC-32 of all that follows
    1      kind: 0 for cells (the preset `paper`), 1 for nodes (`compact`)
    1, …   length of the name, and the name in UTF-8
    1, …   32 and the SHA-256 of the source, or 0
    2, …   length of the notes, and notes: JSON in UTF-8, with options and metrics; or 0
    …      cells: lattice, interpolation, number of LUT entries, and a deflate stream of LUT and indices
           nodes: scale, and a stream of lattice, palette and indices

All numbers are little-endian.
"""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import FormatError, SommerlError
from ..files import atomic_write
from ..formats.names import visible
from ..lattice import INTERPOLATIONS, Lattice
from ..nodes import NodeLattice
from .codes import coordinates, gain_codes, gain_values, shape_codes, shape_values
from .material import SomManBrdf

MAGIC = b"SMRL"
VERSION = 1
PREFIX = struct.Struct("<4sHI")
CELLS, NODES = 0, 1
CELLS_HEAD = struct.Struct("<HHHBBI")
NODES_HEAD = struct.Struct("<f")
MOST_BINS = 2**16 - 1  # on an axis
MOST_CELLS = 2**22  # MERL's larger kind of table has 2,916,000
LONGEST_FILE = 2 * MOST_CELLS + 24 * 2**16 + 2**20
LONGEST_NAME, LONGEST_NOTES = 2**8 - 1, 2**16 - 1
DIGEST_BYTES = 32


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
        material = decode(path.read_bytes())
    except SommerlError as error:
        raise FormatError(f"{path}: {error}") from error
    material.name = visible(material.name)
    return material


def encode(material: SomManBrdf) -> bytes:
    """The bytes of a material file. The same material always gives the same bytes."""
    known = {key: value for key, value in (("metrics", material.metrics), ("options", material.options)) if value}
    notes = _json(known) if known else b""
    nodes = isinstance(material.lattice, NodeLattice)
    body = _head(NODES if nodes else CELLS, material.name, material.source_sha256, notes)
    body += _nodes(material) if nodes else _cells(material)
    return PREFIX.pack(MAGIC, VERSION, zlib.crc32(body)) + body


def head_bytes(name: str, source_sha256: str) -> int:
    """What a file of nodes holds before the stream [bytes]."""
    return PREFIX.size + len(_head(NODES, name, source_sha256, b"")) + NODES_HEAD.size


def _head(kind: int, name: str, source_sha256: str, notes: bytes) -> bytes:
    text = name.encode("utf-8", "replace")[:LONGEST_NAME].decode("utf-8", "ignore").encode()
    digest = bytes.fromhex(source_sha256)
    if len(notes) > LONGEST_NOTES or len(digest) not in (0, DIGEST_BYTES):
        raise FormatError(f"{name}: expected notes of at most {LONGEST_NOTES} bytes, found {len(notes)}")
    head = bytes([kind, len(text)]) + text + bytes([len(digest)]) + digest
    return head + struct.pack("<H", len(notes)) + notes


def _json(notes: dict[str, Any]) -> bytes:
    try:
        return json.dumps(notes, sort_keys=True, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    except ValueError as error:
        raise FormatError(f"expected notes that JSON can hold, found others ({error})") from error


def decode(data: bytes) -> SomManBrdf:
    """The material in the bytes of a file. Raises FormatError."""
    if len(data) < PREFIX.size:
        raise FormatError(f"expected at least {PREFIX.size} bytes, found {len(data)}")
    magic, version, crc = PREFIX.unpack_from(data)
    if magic != MAGIC:
        raise FormatError("expected a material file (.smrl), found another kind")
    if version != VERSION:
        hint = "a newer Sommerl may read it" if version > VERSION else "compress the source again"
        raise FormatError(f"expected version {VERSION}, found version {version}; {hint}")
    if zlib.crc32(data[PREFIX.size :]) != crc:
        raise FormatError("expected the checksum in the file, found another: the file is damaged or cut off")
    try:
        return _material(_Reader(data, PREFIX.size))
    except FormatError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError, zlib.error, SommerlError) as error:
        raise FormatError(f"expected a material file's header and contents, found others ({error})") from error


class _Reader:
    """Bytes, one part after the other."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self._at = data, at

    def take(self, count: int) -> bytes:
        part = self._data[self._at : self._at + count]
        if len(part) != count:
            raise FormatError(f"expected {count} more bytes, found {len(part)}")
        self._at += count
        return part

    def unpack(self, layout: struct.Struct) -> tuple[Any, ...]:
        return layout.unpack(self.take(layout.size))

    def rest(self) -> bytes:
        return self._data[self._at :]


BYTE, SHORT = struct.Struct("<B"), struct.Struct("<H")


def _material(reader: _Reader) -> SomManBrdf:
    (kind,) = reader.unpack(BYTE)
    name = reader.take(*reader.unpack(BYTE)).decode()
    (digest,) = reader.unpack(BYTE)
    if kind not in (CELLS, NODES) or digest not in (0, DIGEST_BYTES):
        raise FormatError(f"expected kind 0 or 1 and a digest of 0 or 32 bytes, found kind {kind} and {digest} bytes")
    sha256 = reader.take(digest).hex()
    notes = _object(json.loads(reader.take(*reader.unpack(SHORT)).decode() or "{}", parse_constant=_finite))
    known = {"name": name, "source_sha256": sha256}
    known |= {key: _object(notes.get(key, {})) for key in ("options", "metrics")}
    return _from_nodes(reader, known) if kind == NODES else _from_cells(reader, known)


def _finite(constant: str) -> None:
    raise FormatError(f"expected notes that are JSON, whose numbers are finite, found {constant}")


def _object(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FormatError(f"expected notes of JSON objects, found {type(value).__name__}")
    return cast("dict[str, Any]", value)


def _cells(material: SomManBrdf) -> bytes:
    lattice = material.grid or Lattice()
    if lattice.size > MOST_CELLS or max(lattice.shape) > MOST_BINS:
        raise FormatError(f"{material.name}: expected at most {MOST_CELLS} cells, found {lattice.shape}")
    index = material.index[lattice.above_horizon]
    payload = material.lut.astype("<f8").tobytes() + index.astype(index.dtype.newbyteorder("<")).tobytes()
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS, 9)
    interpolation = INTERPOLATIONS.index(material.interpolation)
    head = CELLS_HEAD.pack(*lattice.shape, lattice.reciprocal, interpolation, len(material.lut))
    return head + packer.compress(payload) + packer.flush()


def _from_cells(reader: _Reader, known: dict[str, Any]) -> SomManBrdf:
    theta_h, theta_d, phi_d, reciprocal, interpolation, clusters = map(int, reader.unpack(CELLS_HEAD))
    if theta_h * theta_d * phi_d > MOST_CELLS or not 1 <= clusters <= 2**16:
        raise FormatError(f"expected a lattice of at most {MOST_CELLS} cells and a LUT of at most 65536 entries")
    if reciprocal > 1 or interpolation >= len(INTERPOLATIONS):
        raise FormatError(f"expected flags of 0 or 1, found {reciprocal} and {interpolation}")
    lattice = Lattice(theta_h, theta_d, phi_d, bool(reciprocal))
    above = lattice.above_horizon
    entry = np.dtype("<u1" if clusters <= 256 else "<u2")
    payload = _inflated(reader.rest(), 24 * clusters + entry.itemsize * int(above.sum()))
    lut = np.frombuffer(payload, "<f8", 3 * clusters).reshape(clusters, 3)
    index: NDArray[Any] = np.zeros(lattice.shape, entry)
    index[above] = np.frombuffer(payload, entry, offset=24 * clusters)
    return SomManBrdf(lut, index, lattice, interpolation=INTERPOLATIONS[interpolation], **known)


def _inflated(compressed: bytes, expected: int) -> bytes:
    """Exactly `expected` bytes, and never more than that in memory."""
    inflater = zlib.decompressobj(-zlib.MAX_WBITS)
    payload = inflater.decompress(compressed, expected)
    if len(payload) == expected and not inflater.eof:
        payload += inflater.decompress(inflater.unconsumed_tail, 1)
    if len(payload) != expected or not inflater.eof or inflater.unused_data:
        raise FormatError(f"expected {expected} bytes of LUT and index, found another number")
    return payload


def _nodes(material: SomManBrdf) -> bytes:
    gains, shapes = gain_codes(material.gains), shape_codes(coordinates(material.lut))
    if not (np.array_equal(gain_values(gains), material.gains) and np.array_equal(shape_values(shapes), material.lut)):
        raise FormatError(f"{material.name}: expected a palette whose values have codes, found others")
    assert isinstance(material.lattice, NodeLattice)
    try:
        palette = _core.NodePalette(*material.lattice.axes(), gains.tolist(), shapes.tolist())
        return NODES_HEAD.pack(material.scale) + palette.encode(material.gain_index, material.index)
    except (ValueError, OverflowError) as error:
        raise FormatError(f"{material.name}: {error}") from error


def _from_nodes(reader: _Reader, known: dict[str, Any]) -> SomManBrdf:
    (scale,) = reader.unpack(NODES_HEAD)
    palette, (gain, shape) = _core.NodePalette.decode(reader.rest())
    axes = (tuple(map(tuple, axis)) for axis in (palette.theta_d, palette.phi_d))
    lattice = NodeLattice(tuple(palette.theta_h), tuple(palette.band), *axes)
    lut, gains = shape_values(np.array(palette.shapes)), gain_values(np.array(palette.gains))
    return SomManBrdf(lut, shape, lattice, gains=gains, gain_index=gain, scale=scale, **known)
