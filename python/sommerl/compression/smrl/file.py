"""Writes and reads material files (.smrl), formats 1 and 2. docs/format.md specifies every byte.

    bytes  what
    4      "SMRL"
    2      version: 1 for cells; 2 for nodes, of which 1 is read, too
    4      CRC-32 of all that follows
    1      kind: 0 for cells (the preset `paper`), 1 for nodes (`compact`)
    1, …   length of the name, and the name in UTF-8
    1, …   32 and the SHA-256 of the source, or 0
    2, …   length of the notes, and the notes: JSON in UTF-8, with options and metrics; or 0
    …      cells: lattice, lookup, number of LUT entries, and a deflate stream of LUT and index
           nodes: scale, flags (not in version 1), and a stream of lattice, palette and indices

All numbers are little-endian.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.brdf import LARGEST
from ...reflectance.cells import Lattice
from ...reflectance.lattice import INTERPOLATIONS
from ...reflectance.nodes import NodeLattice
from ...reflectance.origin import Source
from ...system import door, sealed_file
from ...system.errors import FormatError, MaterialError, OptionError, SommerlError
from ...system.files import atomic_write
from ...system.sealed_file import BYTE, Reader
from ..material import SomManBrdf
from ..palette import GainsAndShapes
from . import node_parts, notes

MAGIC = b"SMRL"
SHORT = struct.Struct("<H")
CELLS, NODES = 0, 1
VERSIONS = {CELLS: 1, NODES: 2}  # that are written; the last one is the newest
CELLS_HEAD = struct.Struct("<HHHBBI")
SCALE = struct.Struct("<f")
RECIPROCAL, MIRRORED, SIGNED, SMOOTH = 1, 2, 4, 8  # flags of nodes
MOST_BINS = 2**16 - 1  # on an axis: stored in two bytes
MOST_CELLS = 2**22  # enough for MERL's larger kind of table, which has 2,916,000
# The largest index and the largest LUT, not compressed, and room for the rest.
LONGEST_FILE = 2 * MOST_CELLS + 24 * 2**16 + 2**20
LONGEST_NOTES = 2**16 - 1  # bytes: their length is stored in two bytes


def looks_like(head: bytes) -> bool:
    """Whether a file that begins with these bytes is a material file, by its magic number."""
    return head.startswith(MAGIC)


def save(material: SomManBrdf, path: str | Path) -> int:
    """Writes a material file (.smrl); returns its length [bytes].

    Raises FormatError for a material that `load` would refuse, MaterialError if `material` is not a compressed one,
    OptionError if the name does not end in .smrl, OSError if the file cannot be written.

    >>> material, _ = sommerl.train(sommerl.load_table("nickel"), sommerl.TrainOptions(clusters=16, epochs=1))
    >>> save(material, "nickel.smrl") > 1000
    True
    """
    if not isinstance(material, SomManBrdf):  # pyright: ignore[reportUnnecessaryIsInstance]
        name = getattr(material, "name", "material")
        raise MaterialError(
            f"{name}: expected a compressed material, found {type(material).__name__}; sommerl.train compresses it"
        )
    if Path(path).suffix.lower() != ".smrl":
        raise OptionError(f"{path}: expected a name that ends in .smrl, found {Path(path).suffix!r}")
    notes.parsed(_noted(material))
    data = encode(material)
    with atomic_write(Path(path)) as out:
        out.write(data)
    return len(data)


def load(path: str | Path) -> SomManBrdf:
    """Reads a material file. Raises FormatError if it is of another kind or version, or damaged."""
    return parse(Path(path), door.read(path, LONGEST_FILE))


def parse(path: Path, data: bytes) -> SomManBrdf:
    """The same from the bytes of a file. path: for error messages."""
    return sealed_file.decode_file(path, data, decode)


def encode(material: SomManBrdf) -> bytes:
    """The bytes of a material's file; always the same for the same material. Raises FormatError as `save` does."""
    noted = _noted(material)
    kind, contents = (NODES, _nodes(material)) if material.grid is None else (CELLS, _cells(material, material.grid))
    body = _head(kind, material.name, material.source.sha256, noted) + contents
    return sealed_file.sealed(MAGIC, VERSIONS[kind], body)


def _noted(material: SomManBrdf) -> bytes:
    """The bytes of a material's notes."""
    return notes.written(made_from=list(material.source.made_from), metrics=material.metrics, options=material.options)


def head_bytes(name: str, source: Source) -> int:
    """The length of a compact material's file before its stream [bytes]."""
    head = _head(NODES, name, source.sha256, notes.written(made_from=list(source.made_from)))
    return sealed_file.PREFIX.size + len(head) + SCALE.size + BYTE.size


def _head(kind: int, name: str, source_sha256: str, noted: bytes) -> bytes:
    if len(noted) > LONGEST_NOTES:
        raise FormatError(f"{name}: expected notes of at most {LONGEST_NOTES} bytes, found {len(noted)}")
    return BYTE.pack(kind) + sealed_file.origin(name, source_sha256) + SHORT.pack(len(noted)) + noted


def decode(data: bytes) -> SomManBrdf:
    """Reads a material from the bytes of a file. Raises FormatError if they are not a valid file."""
    version, reader = sealed_file.opened(data, MAGIC, VERSIONS[NODES], "material file (.smrl)")
    try:
        return _material(version, reader)
    except FormatError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError, SommerlError) as error:
        raise FormatError(f"expected a material file's header and contents, found others ({error})") from error


def _material(version: int, reader: Reader) -> SomManBrdf:
    (kind,) = reader.unpack(BYTE)
    kinds = [known for known, newest in VERSIONS.items() if version <= newest]
    if kind not in kinds:
        raise FormatError(f"expected kind {' or '.join(map(str, kinds))}, found {kind}")
    known: dict[str, Any] = reader.origin()
    known |= notes.parsed(reader.take(*reader.unpack(SHORT)))
    return _from_nodes(version, reader, known) if kind == NODES else _from_cells(reader, known)


def _cells(material: SomManBrdf, lattice: Lattice) -> bytes:
    if lattice.size > MOST_CELLS or max(lattice.shape) > MOST_BINS:
        raise FormatError(f"{material.name}: expected at most {MOST_CELLS} cells, found {lattice.shape}")
    index = material.index[lattice.above_horizon]
    payload = material.lut.astype("<f8").tobytes() + index.astype(index.dtype.newbyteorder("<")).tobytes()
    interpolation = INTERPOLATIONS.index(material.interpolation)
    head = CELLS_HEAD.pack(*lattice.shape, lattice.reciprocal, interpolation, len(material.lut))
    return head + sealed_file.deflated(payload)


def _from_cells(reader: Reader, known: dict[str, Any]) -> SomManBrdf:
    theta_h, theta_d, phi_d, reciprocal, interpolation, clusters = map(int, reader.unpack(CELLS_HEAD))
    size = theta_h * theta_d * phi_d
    if not 1 <= size <= MOST_CELLS:
        raise FormatError(f"expected a lattice of 1 to {MOST_CELLS} cells, found {size}")
    if not 1 <= clusters <= 2**16:
        raise FormatError(f"expected a LUT of 1 to {2**16} entries, found {clusters}")
    if reciprocal > 1 or interpolation >= len(INTERPOLATIONS):
        raise FormatError(f"expected flags of 0 or 1, found {reciprocal} and {interpolation}")
    lattice = Lattice(theta_h, theta_d, phi_d, bool(reciprocal))
    above = lattice.above_horizon
    entry = np.dtype("<u1" if clusters <= 256 else "<u2")
    payload = sealed_file.inflated(reader.rest(), 24 * clusters + entry.itemsize * int(above.sum()))
    lut = np.frombuffer(payload, "<f8", 3 * clusters).reshape(clusters, 3)
    entries = np.frombuffer(payload, entry, offset=24 * clusters)
    if not ((lut >= 0) & (lut <= LARGEST)).all():
        raise FormatError("expected LUT entries from 0 to the largest of single precision, found others")
    if entries.max() >= clusters:
        raise FormatError(f"expected indices below {clusters}, found {entries.max()}")
    index: NDArray[Any] = np.zeros(lattice.shape, entry)
    index[above] = entries
    return SomManBrdf(lut, index, lattice, interpolation=INTERPOLATIONS[interpolation], **known)


def _nodes(material: SomManBrdf) -> bytes:
    palette, lattice = material.palette, material.lattice
    assert isinstance(palette, GainsAndShapes)
    assert isinstance(lattice, NodeLattice)
    try:
        coded = node_parts.coded(material)
        flags = RECIPROCAL * lattice.reciprocal | MIRRORED * lattice.mirrored
        flags |= SIGNED * palette.signed | SMOOTH * palette.smooth
        return SCALE.pack(palette.scale) + BYTE.pack(flags) + coded.encode(*material.index)
    except (ValueError, OverflowError) as error:
        raise FormatError(f"{material.name}: {error}") from error


def _from_nodes(version: int, reader: Reader, known: dict[str, Any]) -> SomManBrdf:
    (scale,) = reader.unpack(SCALE)
    node_parts.check_scale(scale)
    (flags,) = reader.unpack(BYTE) if version > 1 else (RECIPROCAL,)
    if flags > RECIPROCAL | MIRRORED | SIGNED | SMOOTH:
        raise FormatError(f"expected flags from 0 to 15, found {flags}")
    folds = bool(flags & RECIPROCAL), bool(flags & MIRRORED)
    try:
        palette, indices = _core.NodePalette.decode(reader.rest(), *folds, version)
    except ValueError as error:
        raise FormatError(str(error)) from error
    domain = scale, bool(flags & SIGNED), bool(flags & SMOOTH)
    return node_parts.material(palette, indices, node_parts.lattice_of(palette), domain, known)
