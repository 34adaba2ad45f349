"""The Rust core. `som_man/reference.py` says the same in plain NumPy."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

STORED: int
"""Stored originals of a unit (the paper's k)."""
EMPTY: int
"""The cell number of a storage slot that holds nothing."""

def simd_paths() -> list[Literal["portable", "avx2", "avx512"]]:
    """The instruction sets that this processor has and the core is compiled for; the last one is used."""

class Learner:
    """Units of the SOM and their MANs, in training (phases 1 and 2)."""

    def __init__(
        self,
        triples: NDArray[np.float32],
        cells: NDArray[np.uint32],
        weights: NDArray[np.float32],
        rule: Literal["paper", "kohonen"],
        columns: int,
        search: Literal["boxes", "all", "scalar"] = "boxes",
        simd: str | None = None,
    ) -> None:
        """triples (n, 3): what the cells hold, in [0, 1], in the order of presentation; cells (n,): their numbers;
        weights (M, 3): the units' first weights; columns: units in a row of the sheet. search and simd change nothing
        but the time.
        """

    def present(self, start: int, stop: int, alpha: float, falloff: NDArray[np.float32]) -> float:
        """Presents a range of the order; returns the sum of the distances to the winners' weights.

        falloff: learning weight by distance along a row or a column of the sheet; [1] moves the winner alone.
        """

    def settled(self) -> bool:
        """To be asked at the end of each epoch: whether it left everything as it was. Then so will every later one."""

    def weights(self) -> NDArray[np.float32]:
        """(M, 3)."""

    def stored_cells(self) -> NDArray[np.uint32]:
        """(M, STORED): the cells whose triples each unit stores; EMPTY where it stores none."""

class Palette:
    """The LUT, asked for the nearest of its entries (phase 3)."""

    def __init__(
        self,
        lut: NDArray[np.float32],
        search: Literal["boxes", "all"] = "boxes",
        simd: str | None = None,
        threads: int | None = None,
    ) -> None:
        """lut: (M, 3). threads: as many as there are processors, if None."""

    def query(self, triples: NDArray[np.float32]) -> NDArray[np.uint32]:
        """The nearest entry, the lowest one of several, for each of triples (n, 3)."""

def lookup(
    wi: NDArray[np.float64],
    wo: NDArray[np.float64],
    bins: tuple[int, int, int],
    reciprocal: bool,
    trilinear: bool,
    values: NDArray[np.float64],
    index: NDArray[np.uint8] | NDArray[np.uint16] | None = None,
    simd: str | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """f_r (n, 3) of pairs of unit directions (n, 3), as `Brdf.eval` gives it for what is on a lattice.

    values: flat triples, of the cells, or of a LUT if `index` has its entry for each cell. Angles are within 4 ulp of
    NumPy's, so that a pair on the very edge of a cell may fall on the other side.
    """

def lookup_nodes(
    wi: NDArray[np.float64],
    wo: NDArray[np.float64],
    theta_h: list[int],
    band: list[int],
    theta_d: list[list[int]],
    phi_d: list[list[int]],
    gains: NDArray[np.float64],
    shapes: NDArray[np.float64],
    gain: NDArray[np.uint16],
    shape: NDArray[np.uint16],
    scale: float,
    simd: str | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """f_r (n, 3) of pairs of unit directions (n, 3), as `Brdf.eval` gives it for a `FittedTable` of such values.

    theta_h, band, theta_d, phi_d: the fields of the `NodeLattice`. gains (G,), shapes (S, 3), gain (nodes,) and
    shape (nodes,): y of a node is gains[gain] · shapes[shape]. simd and threads change nothing but the time. Raises
    ValueError for what does not fit.
    """
