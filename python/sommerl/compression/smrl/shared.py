"""What the materials of a library's file share, where it pays: lattices of nodes, and what the model of their streams
begins with. docs/format.md, *Shared parts*, specifies every byte.

    bytes  what
    1      number of lattices, at least 1
    120    weights of the model, f32: of the gain and of both coordinates of the shape, ten each
    12     usual errors, f32
    …      for each lattice: flags (1 byte), length of a stream (2), and the stream of a material on it that is even

A material that shares them is written as a part: the number of its lattice (1 byte), flags (1), scale (f32), and its
stream without the lattice.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ...reflectance.nodes import NodeLattice
from ...system.errors import FormatError, SommerlError
from ...system.sealed_file import BYTE, Reader
from ..material import SomManBrdf
from ..palette import GainsAndShapes
from . import node_parts
from .file import MIRRORED, RECIPROCAL, SIGNED, SMOOTH
from .node_parts import Prior

MODEL = struct.Struct("<33f")
NEIGHBOURS, COORDINATES = 10, 3
LATTICE = struct.Struct("<BH")  # flags, length of the stream
PART = struct.Struct("<BBf")  # number of the lattice, flags, scale
MOST_LATTICES = 255


@dataclass(frozen=True)
class Shared:
    """lattices: 1 to 255, different ones. prior: in single precision."""

    lattices: tuple[NodeLattice, ...]
    prior: Prior

    def encode(self) -> bytes:
        """The bytes of the section. Raises FormatError for lattices that no file can hold."""
        weights, levels = self.prior
        if not 1 <= len(self.lattices) <= MOST_LATTICES:
            raise FormatError(f"expected 1 to {MOST_LATTICES} shared lattices, found {len(self.lattices)}")
        parts = [BYTE.pack(len(self.lattices)), MODEL.pack(*np.ravel(weights).tolist(), *levels)]
        for lattice in self.lattices:
            even = np.zeros(lattice.size, np.uint16)
            try:
                stream = _even(lattice).encode(even, even)
            except (ValueError, OverflowError) as error:
                raise FormatError(f"shared lattices: {error}") from error
            flags = RECIPROCAL * lattice.reciprocal | MIRRORED * lattice.mirrored
            parts += [LATTICE.pack(flags, len(stream)), stream]
        return b"".join(parts)

    @staticmethod
    def decode(data: bytes) -> Shared:
        """Reads the bytes of the section. Raises FormatError if they are no such section, or not the only one of it."""
        reader = Reader(data, 0)
        (count,) = reader.unpack(BYTE)
        model = list(map(float, reader.unpack(MODEL)))
        weights = [model[NEIGHBOURS * c : NEIGHBOURS * (c + 1)] for c in range(COORDINATES)]
        lattices: list[NodeLattice] = []
        try:
            for _ in range(count):
                flags, length = reader.unpack(LATTICE)
                if flags > RECIPROCAL | MIRRORED:
                    raise FormatError(f"expected flags from 0 to 3 of a shared lattice, found {flags}")
                folds = bool(flags & RECIPROCAL), bool(flags & MIRRORED)
                palette, _ = _core.NodePalette.decode(reader.take(length), *folds)
                lattices.append(node_parts.lattice_of(palette))
            found = Shared(tuple(lattices), (weights, model[NEIGHBOURS * COORDINATES :]))
            _even(lattices[0], found.prior)
        except (ValueError, IndexError, OverflowError, SommerlError) as error:
            raise FormatError(f"shared lattices: {error}") from error
        if found.encode() != data or len(set(lattices)) != count:
            raise FormatError("expected shared lattices that differ, and nothing after them, found others")
        return found

    def part(self, material: SomManBrdf) -> bytes | None:
        """The bytes of a material that shares a lattice; None for one that does not.

        Raises FormatError for what no file can hold.
        """
        lattice, palette = material.lattice, material.palette
        if not isinstance(lattice, NodeLattice) or not isinstance(palette, GainsAndShapes):
            return None
        if lattice not in self.lattices:
            return None
        flags = SIGNED * palette.signed | SMOOTH * palette.smooth
        try:
            stream = node_parts.coded(material, self.prior).encode(*material.index)
        except (ValueError, OverflowError) as error:
            raise FormatError(f"{material.name}: {error}") from error
        return PART.pack(self.lattices.index(lattice), flags, palette.scale) + stream

    def material(self, part: bytes, known: dict[str, Any]) -> SomManBrdf:
        """The material of such bytes. known: other arguments of `SomManBrdf`. Raises FormatError for other bytes."""
        reader = Reader(part, 0)
        fields = reader.unpack(PART)
        number, flags, scale = int(fields[0]), int(fields[1]), float(fields[2])
        node_parts.check_scale(scale)
        if number >= len(self.lattices) or flags & ~(SIGNED | SMOOTH):
            raise FormatError(f"expected the number of a shared lattice and its flags, found {number} and {flags}")
        try:
            palette, indices = _even(self.lattices[number], self.prior).decode_part(reader.rest())
        except ValueError as error:
            raise FormatError(str(error)) from error
        domain = scale, bool(flags & SIGNED), bool(flags & SMOOTH)
        return node_parts.material(palette, indices, self.lattices[number], domain, known)


def _even(lattice: NodeLattice, prior: Prior | None = None) -> _core.NodePalette:
    """The core's object for a lattice and one entry: it writes even materials, and with a prior it reads parts. Raises
    ValueError for a prior that is out of range."""
    return _core.NodePalette(*lattice.axes(), [0], [[0, 0]], **lattice.folds, prior=prior)
