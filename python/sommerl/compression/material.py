"""SomManBrdf: a palette of reflectances and, for each cell or node of a lattice, the number of its entry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..reflectance.arrays import Array, Triple, gather3, ops
from ..reflectance.brdf import Buffers, OnLattice
from ..reflectance.cells import Interpolation, Lattice, checked
from ..reflectance.nodes import NodeLattice, from_cube_root
from ..system.errors import MaterialError

LARGEST = float(np.finfo(np.float32).max)  # renderers calculate in single precision


class SomManBrdf(OnLattice):
    """A material compressed by the paper's method: a lookup finds entries of a palette and blends them.

    The preset `paper` has MERL's lattice of cells, and lut[index[cell]] is f_r. The preset `compact` has a lattice of
    nodes, and gains[gain_index[node]] · lut[index[node]], gain times shape, is the node's value in the cube-root domain
    (`nodes.from_cube_root`).

    lut: (M, 3), linear RGB, float64: f_r [1/sr], values that the source holds; or shapes, whose mean is 1.
    index: unsigned, of the lattice's shape, or (nodes,): the LUT entry of each cell or node. Below the horizon it is
        not used.
    gains, gain_index: (G,) and (nodes,), with a NodeLattice alone. scale: of the cube-root domain.
    name, options, metrics, source_sha256: what was compressed, how, and how well. made_from: what that was made from,
        if it was a compressed material itself; see `origin`.

    Raises MaterialError if shapes do not fit or an index lies outside the LUT.
    """

    compressed_as = "som-man"

    def __init__(
        self,
        lut: ArrayLike,
        index: NDArray[Any],
        lattice: Lattice | NodeLattice,
        *,
        name: str,
        interpolation: Interpolation | None = None,
        gains: ArrayLike = (),
        gain_index: NDArray[Any] | None = None,
        scale: float = 1.0,
        options: Mapping[str, Any] | None = None,
        metrics: Mapping[str, Any] | None = None,
        source_sha256: str = "",
        made_from: tuple[Mapping[str, str], ...] = (),
    ) -> None:
        self.name = name
        self.lut = np.array(lut, np.float64)
        self.gains = np.array(gains, np.float64)
        self.lattice = lattice
        self.scale = float(np.float32(scale))  # as a file holds it
        self.interpolation = "trilinear" if isinstance(lattice, NodeLattice) else "nearest"
        self.options = dict(options or {})
        self.metrics = dict(metrics or {})
        self.source_sha256 = source_sha256
        self.made_from = made_from
        if self.lut.ndim != 2 or self.lut.shape[1] != 3 or not 1 <= len(self.lut) <= 2**16:
            raise MaterialError(f"{name}: expected a LUT of shape (1 to 65536, 3), found {self.lut.shape}")
        if not np.isfinite(self.lut).all():
            raise MaterialError(f"{name}: expected finite LUT entries, found others")
        if isinstance(lattice, NodeLattice):
            self._index = self._entries("LUT", index, len(self.lut), np.dtype(np.uint16))
            gain_index = np.zeros(0, np.uint16) if gain_index is None else gain_index
            self.gain_index = self._entries("gains", gain_index, len(self.gains), np.dtype(np.uint16))
            if not (np.isfinite(self.gains).all() and (self.gains >= 0).all() and 0 < self.scale < np.inf):
                raise MaterialError(f"{name}: expected gains that are not negative, and a positive scale, found others")
        else:
            self._index = self._cells(index, lattice)
        if interpolation:
            self._interpolate(interpolation)

    def _cells(self, index: NDArray[Any], lattice: Lattice) -> NDArray[Any]:
        if not ((self.lut >= 0) & (self.lut <= LARGEST)).all():
            raise MaterialError(f"{self.name}: expected LUT entries from 0 to {LARGEST:.4g}, found others")
        if index.shape != lattice.shape or index.dtype.kind != "u":
            found = f"{index.dtype} of shape {index.shape}"
            raise MaterialError(f"{self.name}: expected an unsigned index of shape {lattice.shape}, found {found}")
        if index[lattice.above_horizon].max() >= len(self.lut):
            raise MaterialError(f"{self.name}: expected indices below {len(self.lut)}, found {index.max()}")
        return lattice.extended(index.astype(np.uint8 if len(self.lut) <= 256 else np.uint16))

    def _entries(self, what: str, index: NDArray[Any], entries: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        if index.shape != (self.lattice.size,) or index.dtype.kind != "u":
            found = f"{index.dtype} of shape {index.shape}"
            raise MaterialError(f"{self.name}: {what}: expected an unsigned index for each node, found {found}")
        if index.max() >= entries:
            raise MaterialError(f"{self.name}: {what}: expected indices below {entries}, found {index.max()}")
        return index.astype(dtype)

    @property
    def facts(self) -> dict[str, Any]:
        """Those of what was compressed."""
        return dict(self.options.get("source_facts", {}))

    @property
    def domain(self) -> str:
        """In which values are stored and blended: "linear" or "cube-root"."""
        return "cube-root" if isinstance(self.lattice, NodeLattice) else "linear"

    @property
    def index(self) -> NDArray[Any]:
        """The LUT entry of each cell, of the lattice's shape, uint8 or uint16, 0 below the horizon; or of each node."""
        if isinstance(self.lattice, NodeLattice):
            return self._index
        return np.where(self.lattice.above_horizon, self._index, self._index.dtype.type(0))

    @property
    def grid(self) -> Lattice | None:
        return None if isinstance(self.lattice, NodeLattice) else self.lattice

    def cells(self) -> tuple[NDArray[Any], NDArray[np.float64]]:
        return self._index, self.lut

    @property
    def clusters(self) -> int:
        """The number of entries of the palette: LUT and gains."""
        return len(self.lut) + len(self.gains)

    @property
    def bytes_paper(self) -> int:
        """The size as the paper counts it: 4 bytes a cell and 24 an entry."""
        return 4 * self.lattice.size + 24 * self.clusters

    @property
    def bytes_memory(self) -> int:
        """What a lookup reads."""
        return sum(buffer.nbytes for buffer in self.buffers().values())

    @property
    def values(self) -> NDArray[np.float64]:
        """What each cell holds, f_r [1/sr] of the lattice's shape + (3,); or each node, (nodes, 3), in its domain."""
        values = self.lut[self._index]
        return values if self.grid else values * self.gains[self.gain_index][:, None]

    def buffers(self) -> dict[str, NDArray[Any]]:
        buffers: dict[str, NDArray[Any]] = {"index": self._index.reshape(-1), "lut": self.lut.reshape(-1)}
        if isinstance(self.lattice, NodeLattice):
            buffers |= {"gain_index": self.gain_index, "gains": self.gains, "scale": np.array(self.scale)}
            buffers |= self.lattice.buffers()
        return buffers

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        gather = ops(wi[0]).gather

        def entry(cell: Array) -> Triple:
            return gather3(buffers["lut"], gather(buffers["index"], cell))

        def node(number: Array) -> Triple:
            gain = gather(buffers["gains"], gather(buffers["gain_index"], number))
            r, g, b = entry(number)
            return gain * r, gain * g, gain * b

        if isinstance(self.lattice, NodeLattice):
            return from_cube_root(self.lattice.lookup(wi, wo, node, buffers), wi, wo, buffers["scale"])
        return self.lattice.lookup(wi, wo, self.interpolation, entry)

    def _found(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        if not isinstance(self.lattice, NodeLattice):
            return super()._found(wi, wo)
        return _core.NodeLookup(
            *self.lattice.axes(), self.gains, self.lut, self.gain_index, self._index, self.scale
        ).eval(wi, wo)

    def _interpolate(self, interpolation: Interpolation) -> None:
        if isinstance(self.lattice, NodeLattice) and checked(interpolation) != "trilinear":
            raise MaterialError(f"{self.name}: expected trilinear interpolation between nodes, found {interpolation}")
        super()._interpolate(interpolation)
