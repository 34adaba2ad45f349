"""SomManBrdf: a palette of reflectances and, for each cell or node of a lattice, the number of its entry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..reflectance.arrays import Triple
from ..reflectance.brdf import Buffers, Native, OnLattice
from ..reflectance.info import Counts
from ..reflectance.lattice import AnyLattice, Interpolation
from ..reflectance.origin import Link, Source
from ..system.errors import MaterialError
from .palette import Palette, Reflectances
from .smrl.notes import FACTS


class SomManBrdf(OnLattice):
    """A material compressed by the paper's method: a lookup finds entries of a palette and blends them.

    The preset `paper` has MERL's lattice of cells and a palette of reflectances, lut[index[cell]]; the preset `compact`
    has a lattice of nodes, and a palette of gains and shapes. See `palette` for both.

    palette: the entries; an array (M, 3) stands for `Reflectances`.
    index: the entry of each cell or node, as the palette asks for it.
    interpolation: the lattice's usual one if None.
    name, options, metrics: what was compressed, how, and how well. source_sha256, made_from: see `origin.Source`.

    Raises MaterialError if the parts do not fit, or an index lies outside of the palette.

    >>> material, _ = sommerl.train(sommerl.load_table("nickel"), sommerl.TrainOptions(clusters=16, epochs=1))
    >>> material.clusters, material.index.shape, material.lut.shape
    (16, (90, 90, 180), (16, 3))
    """

    kind = "som-man"
    compressed = True

    def __init__(
        self,
        palette: Palette | ArrayLike,
        index: NDArray[Any],
        lattice: AnyLattice,
        *,
        name: str,
        interpolation: Interpolation | None = None,
        options: Mapping[str, Any] | None = None,
        metrics: Mapping[str, Any] | None = None,
        source_sha256: str = "",
        made_from: tuple[Link, ...] = (),
    ) -> None:
        self.name = name
        self.palette = palette if isinstance(palette, Palette) else Reflectances(palette)
        self.lattice = lattice
        self.interpolation = lattice.checked(name, interpolation) if interpolation else lattice.interpolations[0]
        self.options = dict(options or {})
        self.metrics = dict(metrics or {})
        self.source = Source(source_sha256, made_from)
        self._index = self.palette.checked(name, index, lattice)

    @property
    def facts(self) -> dict[str, Any]:
        """Those of what was compressed."""
        return dict(self.options.get(FACTS, {}))

    @property
    def counts(self) -> Counts:
        """Those of what was compressed, as far as the file keeps them."""
        facts = self.facts
        return Counts(*(facts.get(each.name) for each in fields(Counts)))

    @property
    def signed(self) -> bool:
        return self.palette.signed

    @property
    def domain(self) -> str:
        """In which values are stored and blended: "linear" or "cube-root"."""
        return self.palette.domain

    @property
    def index(self) -> NDArray[Any]:
        """The entry of each cell or node, as the palette's class says; 0 for cells below the horizon."""
        if self.grid is None:
            return self._index
        return np.where(self.grid.above_horizon, self._index, self._index.dtype.type(0))

    @property
    def lut(self) -> NDArray[np.float64]:
        """The palette's LUT: reflectances, or shapes."""
        return self.palette.lut

    @property
    def clusters(self) -> int:
        """The number of entries of the palette."""
        return self.palette.entries

    @property
    def bytes_paper(self) -> int:
        """The size as the paper counts it: 4 bytes a cell and 24 an entry."""
        return 4 * self.lattice.size + 24 * self.clusters

    @property
    def values(self) -> NDArray[np.float64]:
        """f_r [1/sr] of each cell, of the lattice's shape + (3,). Raises MaterialError if the material has nodes."""
        if self.grid is None:
            raise MaterialError(f"{self.name}: expected values of cells, found nodes; BrdfTable.of samples them")
        return self.palette.stored(self._index)

    @property
    def node_values(self) -> NDArray[np.float64]:
        """y of each node in the cube-root domain, (nodes, 3). Raises MaterialError if the material has cells."""
        if self.grid is not None:
            raise MaterialError(f"{self.name}: expected values of nodes, found cells")
        return self.palette.stored(self._index)

    def details(self) -> dict[str, Any]:
        return {
            "clusters": self.clusters,
            "lattice": list(self.lattice.shape),
            "nodes": self.lattice.size if self.grid is None else None,
            "interpolation": self.interpolation,
            "domain": self.domain,
            "bytes_paper": self.bytes_paper,
            "options": self.options,
            "metrics": self.metrics,
        }

    def buffers(self) -> dict[str, NDArray[Any]]:
        return self.palette.buffers(self._index) | self.lattice.buffers()

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        value = self.lattice.lookup(
            wi, wo, self.interpolation, buffers, lambda number: self.palette.fetch(number, buffers)
        )
        return self.palette.reflectance(value, wi, wo, buffers)

    def native(self) -> Native:
        return self.palette.native(self._index, self.lattice, self.interpolation)
