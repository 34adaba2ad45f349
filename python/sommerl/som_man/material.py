"""SomManBrdf: a palette of original reflectances and, for each cell of a lattice, the number of its entry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Triple, gather3, ops
from ..brdf import Buffers, OnLattice
from ..errors import MaterialError
from ..lattice import Interpolation, Lattice, checked


class SomManBrdf(OnLattice):
    """A material compressed by the paper's method: f_r = lut[index[cell]].

    lut: (M, 3) f_r [1/sr], linear RGB, float64: values that the source holds.
    index: of the lattice's shape, unsigned: the LUT entry of each cell. Below the horizon it is not used.
    name, options, metrics, source_sha256: what was compressed, how, and how well.

    Raises MaterialError if shapes do not fit or an index lies outside the LUT.
    """

    def __init__(
        self,
        lut: ArrayLike,
        index: NDArray[Any],
        lattice: Lattice,
        *,
        name: str,
        interpolation: Interpolation = "nearest",
        options: Mapping[str, Any] | None = None,
        metrics: Mapping[str, Any] | None = None,
        source_sha256: str = "",
    ) -> None:
        self.lut = np.array(lut, np.float64)
        if self.lut.ndim != 2 or self.lut.shape[1] != 3 or not 1 <= len(self.lut) <= 2**16:
            raise MaterialError(f"{name}: expected a LUT of shape (1 to 65536, 3), found {self.lut.shape}")
        if not (np.isfinite(self.lut).all() and (self.lut >= 0).all()):
            raise MaterialError(f"{name}: expected finite, non-negative LUT entries, found others")
        if index.shape != lattice.shape or index.dtype.kind != "u":
            found = f"{index.dtype} of shape {index.shape}"
            raise MaterialError(f"{name}: expected an unsigned index of shape {lattice.shape}, found {found}")
        if index[lattice.above_horizon].max() >= len(self.lut):
            raise MaterialError(f"{name}: expected indices below {len(self.lut)}, found {index.max()}")
        self.name = name
        self.lattice = lattice
        self.interpolation: Interpolation = checked(interpolation)
        self.options = dict(options or {})
        self.metrics = dict(metrics or {})
        self.source_sha256 = source_sha256
        self._index = lattice.extended(index.astype(np.uint8 if len(self.lut) <= 256 else np.uint16))

    @property
    def facts(self) -> dict[str, Any]:
        """Those of what was compressed."""
        return dict(self.options.get("source_facts", {}))

    @property
    def index(self) -> NDArray[Any]:
        """The LUT entry of each cell, of the lattice's shape, uint8 or uint16; 0 below the horizon."""
        return np.where(self.lattice.above_horizon, self._index, self._index.dtype.type(0))

    def cells(self) -> tuple[NDArray[Any], NDArray[np.float64]]:
        return self._index, self.lut

    @property
    def clusters(self) -> int:
        """The number of LUT entries."""
        return len(self.lut)

    @property
    def bytes_paper(self) -> int:
        """The size as the paper counts it: 4 bytes a cell and 24 an entry."""
        return 4 * self.lattice.size + 24 * self.clusters

    @property
    def bytes_memory(self) -> int:
        """What index and LUT take in memory."""
        return self._index.nbytes + self.lut.nbytes

    @property
    def values(self) -> NDArray[np.float64]:
        """f_r [1/sr] of each cell, of the lattice's shape + (3,)."""
        return self.lut[self._index]

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"index": self._index.reshape(-1), "lut": self.lut.reshape(-1)}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        gather = ops(wi[0]).gather
        return self.lattice.lookup(
            wi, wo, self.interpolation, lambda cell: gather3(buffers["lut"], gather(buffers["index"], cell))
        )
