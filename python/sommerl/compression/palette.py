"""Palettes: what the entries of a compressed material are.

A lattice says which cells or nodes a lookup asks for, and with which weights; an index says which entry each of them
has; a palette says what an entry is, and what f_r is of entries that were blended.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..reflectance.arrays import Array, Triple, gather3, ops
from ..reflectance.brdf import LARGEST, Buffers, Native
from ..reflectance.cells import Lattice
from ..reflectance.lattice import AnyLattice, Interpolation
from ..reflectance.nodes import NodeLattice, from_cube_root
from ..system.errors import MaterialError

MOST_ENTRIES = 2**16  # that an index of 16 bits can tell apart


class Palette(ABC):
    """The entries of a palette, and how an index of the kind that belongs to it is read.

    lut: (M, 3), float64.
    """

    domain: ClassVar[Literal["linear", "cube-root"]]  #: in which entries are blended
    lut: NDArray[np.float64]
    signed: bool = False  #: whether reflectances may be negative

    @property
    @abstractmethod
    def entries(self) -> int:
        """The number of entries, of all its parts."""

    @abstractmethod
    def checked(self, name: str, index: NDArray[Any], lattice: AnyLattice) -> NDArray[Any]:
        """The index as a material keeps it. Raises MaterialError, with the name, for one that does not fit."""

    @abstractmethod
    def stored(self, index: NDArray[Any]) -> NDArray[np.float64]:
        """What each cell or node holds, in the domain, of the shape of a lattice's arrays + (3,)."""

    @abstractmethod
    def buffers(self, index: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """The flat arrays that `fetch` and `reflectance` read; see `Brdf.buffers`."""

    @abstractmethod
    def fetch(self, number: Array, buffers: Buffers) -> Triple:
        """What the cell or node of that number holds."""

    @abstractmethod
    def reflectance(self, value: Triple, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        """f_r [1/sr] of a blended value."""

    @abstractmethod
    def native(self, index: NDArray[Any], lattice: AnyLattice, interpolation: Interpolation) -> Native:
        """The core's lookup in a material of these parts."""


class Reflectances(Palette):
    """The palette of the preset `paper`, for cells: lut[index[cell]] is f_r [1/sr].

    lut: (M, 3), linear RGB; values that the source holds. index: unsigned, of the lattice's shape.
    """

    domain = "linear"

    def __init__(self, lut: ArrayLike) -> None:
        self.lut = np.array(lut, np.float64)

    @property
    def entries(self) -> int:
        return len(self.lut)

    def checked(self, name: str, index: NDArray[Any], lattice: AnyLattice) -> NDArray[Any]:
        """As uint8 or uint16; unused cells, below the horizon, continue those above (`Lattice.extended`)."""
        cells = _cells(name, lattice)
        _check_lut(name, self.lut)
        if not ((self.lut >= 0) & (self.lut <= LARGEST)).all():
            raise MaterialError(f"{name}: expected LUT entries from 0 to {LARGEST:.4g}, found others")
        if index.shape != cells.shape or index.dtype.kind != "u":
            found = f"{index.dtype} of shape {index.shape}"
            raise MaterialError(f"{name}: expected an unsigned index of shape {cells.shape}, found {found}")
        largest = index[cells.above_horizon].max()  # of the others, nothing is read
        if largest >= len(self.lut):
            raise MaterialError(f"{name}: expected indices below {len(self.lut)}, found {largest}")
        return cells.extended(index.astype(np.uint8 if len(self.lut) <= 256 else np.uint16))

    def stored(self, index: NDArray[Any]) -> NDArray[np.float64]:
        return self.lut[index]

    def buffers(self, index: NDArray[Any]) -> dict[str, NDArray[Any]]:
        return {"index": index.reshape(-1), "lut": self.lut.reshape(-1)}

    def fetch(self, number: Array, buffers: Buffers) -> Triple:
        return gather3(buffers["lut"], ops(number).gather(buffers["index"], number))

    def reflectance(self, value: Triple, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        return value

    def native(self, index: NDArray[Any], lattice: AnyLattice, interpolation: Interpolation) -> Native:
        cells, trilinear = _cells("palette", lattice), interpolation == "trilinear"
        return _core.CellLookup(cells.shape, cells.reciprocal, trilinear, self.lut.reshape(-1), index.reshape(-1))


class GainsAndShapes(Palette):
    """The palette of the preset `compact`, for nodes: gain times shape is a value y in the cube-root domain.

    gains: (G,). lut: the shapes, (S, 3), whose mean is 1. scale: of the domain; see `nodes.from_cube_root`. signed:
    whether blended values below 0 give negative reflectances, and not 0. smooth: see `nodes.damped`. index: unsigned,
    (2, nodes): of each node, the number of its gain and of its shape.
    """

    domain = "cube-root"

    def __init__(
        self, gains: ArrayLike, shapes: ArrayLike, scale: float, signed: bool = False, smooth: bool = False
    ) -> None:
        self.gains = np.array(gains, np.float64)
        self.lut = np.array(shapes, np.float64)
        self.scale = float(np.float32(scale))  # as a file holds it
        self.signed, self.smooth = signed, smooth

    @property
    def entries(self) -> int:
        return len(self.lut) + len(self.gains)

    def checked(self, name: str, index: NDArray[Any], lattice: AnyLattice) -> NDArray[Any]:
        """As uint16."""
        nodes = _nodes(name, lattice)
        _check_lut(name, self.lut)
        if index.shape != (2, nodes.size) or index.dtype.kind != "u":
            found = f"{index.dtype} of shape {index.shape}"
            raise MaterialError(f"{name}: expected an unsigned index of shape {(2, nodes.size)}, found {found}")
        for part, rows, entries in (("gains", index[0], len(self.gains)), ("shapes", index[1], len(self.lut))):
            if rows.max() >= entries:
                raise MaterialError(f"{name}: {part}: expected indices below {entries}, found {rows.max()}")
        if not (np.isfinite(self.gains).all() and 0 < self.scale < np.inf):
            raise MaterialError(f"{name}: expected finite gains, and a positive scale, found others")
        return index.astype(np.uint16)

    def stored(self, index: NDArray[Any]) -> NDArray[np.float64]:
        gain, shape = index
        return self.lut[shape] * self.gains[gain][:, None]

    def buffers(self, index: NDArray[Any]) -> dict[str, NDArray[Any]]:
        gain, shape = index
        palette = {"index": shape, "lut": self.lut.reshape(-1), "gain_index": gain, "gains": self.gains}
        return palette | {"scale": np.array(self.scale)}

    def fetch(self, number: Array, buffers: Buffers) -> Triple:
        gather = ops(number).gather
        gain = gather(buffers["gains"], gather(buffers["gain_index"], number))
        r, g, b = gather3(buffers["lut"], gather(buffers["index"], number))
        return gain * r, gain * g, gain * b

    def reflectance(self, value: Triple, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        return from_cube_root(value, wi, wo, buffers["scale"], self.signed, self.smooth)

    def native(self, index: NDArray[Any], lattice: AnyLattice, interpolation: Interpolation) -> Native:
        gain, shape = index
        nodes = _nodes("palette", lattice)
        entries = self.gains, self.lut, gain, shape, self.scale
        return _core.NodeLookup(*nodes.axes(), *entries, **nodes.folds, signed=self.signed, smooth=self.smooth)


def _check_lut(name: str, lut: NDArray[np.float64]) -> None:
    if lut.ndim != 2 or lut.shape[1] != 3 or not 1 <= len(lut) <= MOST_ENTRIES:
        raise MaterialError(f"{name}: expected a LUT of shape (1 to {MOST_ENTRIES}, 3), found {lut.shape}")
    if not np.isfinite(lut).all():
        raise MaterialError(f"{name}: expected finite LUT entries, found others")


def _cells(name: str, lattice: AnyLattice) -> Lattice:
    if not isinstance(lattice, Lattice):
        raise MaterialError(f"{name}: expected cells for a palette of reflectances, found nodes")
    return lattice


def _nodes(name: str, lattice: AnyLattice) -> NodeLattice:
    if not isinstance(lattice, NodeLattice):
        raise MaterialError(f"{name}: expected nodes for a palette of gains and shapes, found cells")
    return lattice
