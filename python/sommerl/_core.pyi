"""The Rust core. `som_man/reference.py` says the same in plain NumPy."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

STORED: int
"""Stored originals of a unit (the paper's k)."""
EMPTY: int
"""The cell number of a storage slot that holds nothing."""

class Learner:
    """Units of the SOM and their MANs, in training (phases 1 and 2)."""

    def __init__(
        self,
        triples: NDArray[np.float32],
        weights: NDArray[np.float32],
        rule: Literal["paper", "kohonen"],
        columns: int,
    ) -> None:
        """triples (n, 3): what the cells hold, in [0, 1]; weights (M, 3): the units' first weights;
        columns: units in a row of the sheet."""

    def present(self, cells: NDArray[np.uint32], alpha: float, falloff: NDArray[np.float32]) -> float:
        """Presents cells in order; returns the sum of their distances to their winners' weights.

        falloff: learning weight by distance along a row or a column of the sheet; [1] moves the winner alone.
        """

    def weights(self) -> NDArray[np.float32]:
        """(M, 3)."""

    def stored_cells(self) -> NDArray[np.uint32]:
        """(M, STORED): the cells whose triples each unit stores; EMPTY where it stores none."""

def query(triples: NDArray[np.float32], lut: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The nearest entry of lut (M, 3), the lowest one of several, for each of triples (n, 3): phase 3."""
