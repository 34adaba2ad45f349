"""FittedTable: a material on nodes of its own before its values are quantised."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...reflectance.arrays import Triple, gather3
from ...reflectance.brdf import Brdf, Buffers
from ...reflectance.nodes import NodeLattice, from_cube_root
from ...system.errors import MaterialError


class FittedTable(Brdf):
    """A material as values on a lattice of nodes, in the cube-root domain.

    node_values: y of each node, (lattice.size, 3); signed: whether negative ones count; see `nodes.from_cube_root`.
    `lattice_fit` makes them.
    """

    def __init__(
        self, lattice: NodeLattice, node_values: NDArray[np.float64], scale: float, *, signed: bool, name: str
    ) -> None:
        """Raises MaterialError for values of another shape, or that are not finite."""
        if node_values.shape != (lattice.size, 3) or not np.isfinite(node_values).all():
            shape = (lattice.size, 3)
            raise MaterialError(f"{name}: expected finite values of shape {shape}, found {node_values.shape}")
        self.name, self.lattice, self.node_values, self.scale = name, lattice, node_values, scale
        self._signed = signed

    @property
    def reciprocal(self) -> bool:
        return self.lattice.reciprocal

    @property
    def mirrored(self) -> bool:
        return self.lattice.mirrored

    @property
    def signed(self) -> bool:
        return self._signed

    def buffers(self) -> dict[str, NDArray[Any]]:
        return self.lattice.buffers() | {"values": self.node_values.reshape(-1), "scale": np.array(self.scale)}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        y = self.lattice.lookup(wi, wo, "trilinear", buffers, lambda node: gather3(buffers["values"], node))
        return from_cube_root(y, wi, wo, buffers["scale"], self._signed, smooth=True)
