"""BrdfTable: one reflectance for each cell of a lattice."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..system.errors import MaterialError
from .arrays import Triple, gather3
from .brdf import LARGEST, Brdf, Buffers, Native, OnLattice
from .cells import MERL, Lattice
from .distance import energy_share
from .gamut import without_negatives
from .half_diff import directions
from .info import Counts
from .lattice import Interpolation
from .origin import Source, source_of
from .reciprocal import reciprocal


class BrdfTable(OnLattice):
    """A measured or sampled isotropic BRDF.

    values: f_r [1/sr], linear RGB, float64, of shape `lattice.shape + (3,)`. A table holds no negative numbers: above
        the horizon, colours of the input with a negative channel are moved to where there is none
        (`gamut.without_negatives`), and values that are not finite become 0; `cells_clamped` counts the cells, and
        `energy_clamped` is the share of the energy that was moved (`distance.energy_share`). Cells below the horizon,
        which hold no measurement, continue the last cell above it (`Lattice.extended`).
    interpolation: "trilinear", or "nearest" as in the paper.
    source_sha256: of the file that the table was read from; of the values where there is none.

    Raises MaterialError if the shape is not the lattice's, or nothing above the horizon is positive.

    >>> import numpy as np
    >>> lattice = sommerl.Lattice(8, 8, 12)
    >>> table = BrdfTable(np.full((*lattice.shape, 3), 0.3), lattice, name="paper")
    >>> table.eval([0, 0, 1], [0, 0, 1]).tolist()
    [0.3, 0.3, 0.3]
    """

    kind = "table"
    lattice: Lattice
    source_facts: Mapping[str, Any] = MappingProxyType({})  #: `facts` of what the table was sampled from

    def __init__(
        self,
        values: ArrayLike,
        lattice: Lattice = MERL,
        *,
        name: str = "table",
        interpolation: Interpolation = "trilinear",
        source_sha256: str | None = None,
    ) -> None:
        f_r = np.asarray(values, np.float64)
        if f_r.shape != (*lattice.shape, 3):
            raise MaterialError(f"expected values of shape {(*lattice.shape, 3)}, found {f_r.shape}")
        given = lattice.extended(f_r)
        self.values, changed = representable(given)
        share = energy_share(_difference(given, self.values), given, lattice) if changed.any() else 0.0
        if not (self.values > 0).any():
            raise MaterialError("expected a positive, finite reflectance above the horizon, found none")
        self.name = name
        self.lattice = lattice  # pyright: ignore[reportIncompatibleVariableOverride] # narrower, and never assigned
        self.interpolation: Interpolation = lattice.checked(name, interpolation)
        self._counts = Counts(int(changed[lattice.above_horizon].sum()), share, 0.0)
        self.source = Source(source_sha256 or hashlib.sha256(self.values.astype("<f8").tobytes()).hexdigest())

    @classmethod
    def sampled(cls, brdf: Brdf, lattice: Lattice = MERL) -> BrdfTable:
        """The table of a BRDF's values at the cell centres above the horizon.

        On a reciprocal lattice, those of `reciprocal(brdf)`; the table's counts say how much that changed.
        """
        above = lattice.above_horizon
        wi, wo = directions(*(angle[above] for angle in lattice.angles()))
        values = np.zeros((*lattice.shape, 3))
        source = reciprocal(brdf) if lattice.reciprocal else brdf
        values[above] = source.eval(np.stack(wi, -1), np.stack(wo, -1))
        table = cls(values, lattice, name=brdf.name)
        table._counts = replace(table.counts, energy_averaged=source.counts.energy_averaged or 0.0)
        return table

    @classmethod
    def of(cls, brdf: Brdf) -> BrdfTable:
        """The BRDF itself if it is a table; else the table of its cells, or at MERL's cell centres if it has none."""
        if isinstance(brdf, BrdfTable):
            return brdf
        table = cls.sampled(brdf, brdf.table_lattice)
        table.source_facts = brdf.facts
        source = source_of(brdf)
        table.source = Source(source.sha256 or table.source.sha256, source.made_from)
        return table

    @property
    def facts(self) -> dict[str, Any]:
        return dict(self.source_facts)

    @property
    def counts(self) -> Counts:
        return self._counts

    @property
    def grid(self) -> Lattice:
        return self.lattice

    def details(self) -> dict[str, Any]:
        return {"lattice": list(self.lattice.shape), "interpolation": self.interpolation, "domain": "linear"}

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"values": self.values.reshape(-1)}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        return self.lattice.lookup(wi, wo, self.interpolation, buffers, lambda cell: gather3(buffers["values"], cell))

    def native(self) -> Native:
        trilinear = self.interpolation == "trilinear"
        return _core.CellLookup(self.lattice.shape, self.lattice.reciprocal, trilinear, self.values.reshape(-1))


def representable(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values (..., 3) as a table can hold them, and which colours that changed, (...).

    Numbers that are not finite, or too large for single precision, become 0; for the rest see
    `gamut.without_negatives`.
    """
    usable = np.abs(values) <= LARGEST  # not true of NaN; renderers calculate in single precision
    found = without_negatives(np.where(usable, values, 0.0))
    return found, (found != values).any(axis=-1)


def _difference(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore"):
        return before - after
