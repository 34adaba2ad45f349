"""The Rust core. `compression/paper/reference.py` says the same in plain NumPy.

What does not fit is a ValueError, if not a TypeError or an OverflowError of the conversion. threads: as many as there
are processors if None, and in any case no more than `sommerl.system.threads.limit`. Where the system gives fewer, fewer
do the work.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

VERSION: str
"""The package's, as rust/Cargo.toml has it."""
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
        distinct: bool = False,
    ) -> None:
        """triples (n, 3): what the cells hold, in [0, 1], in the order of presentation; cells (n,): their numbers;
        weights (M, 3): the units' first weights, in [0, 1]; columns: units in a row of the sheet. search and simd
        change nothing but the time. distinct: a cell that a unit has stored keeps its one place when it comes back.
        """

    def present(self, start: int, stop: int, alpha: float, falloff: NDArray[np.float32]) -> float:
        """Presents a range of the order; returns the sum of the distances to the winners' weights.

        alpha: in [0, 1]. falloff: learning weight, in [0, 1], by distance along a row or a column of the sheet; [1]
        moves the winner alone.
        """

    def settled(self) -> bool:
        """To be asked at the end of each epoch: whether it left everything as it was. Then so will every later one."""

    def weights(self) -> NDArray[np.float32]:
        """(M, 3)."""

    def stored_cells(self) -> NDArray[np.uint32]:
        """(M, STORED): the cells whose triples each unit stores; EMPTY where it stores none."""

class Quantiser:
    """A vector quantiser: the LUT, asked for the nearest of its entries (phase 3)."""

    def __init__(
        self,
        lut: NDArray[np.float32],
        search: Literal["boxes", "all"] = "boxes",
        simd: str | None = None,
        threads: int | None = None,
    ) -> None:
        """lut: (M, 3), up to 1e18."""

    def query(self, triples: NDArray[np.float32]) -> NDArray[np.uint32]:
        """The nearest entry, the lowest one of several, for each of triples (n, 3), up to 1e18."""

class NodePalette:
    """The lattice and the palette of a compact material: its stream of bits, and which entries its nodes get.

    docs/format.md says what the bits mean; `compression/smrl/reference_codec.py` reads them in plain Python.
    """

    def __init__(
        self,
        theta_h: list[int],
        band: list[int],
        theta_d: list[list[int]],
        phi_d: list[list[int]],
        gains: list[int],
        shapes: list[list[int]],
        reciprocal: bool = True,
        mirrored: bool = False,
        prior: tuple[list[list[float]], list[float]] | None = None,
    ) -> None:
        """theta_h, band, theta_d, phi_d, reciprocal, mirrored: the fields of the `NodeLattice`; bands in order, at most
        16, and 2¹⁷ nodes. gains (G,) and shapes (S, 2): codes (`compression.smrl.codes`) in order, at most 1024 each.
        prior: what the model of the stream begins with, weights (3, 10) and usual errors (3,); with it, streams leave
        out the lattice (docs/format.md, *Shared parts*). Raises ValueError for others.
        """

    @staticmethod
    def decode(
        data: bytes, reciprocal: bool, mirrored: bool, version: int = 2, simd: str | None = None
    ) -> tuple[NodePalette, tuple[NDArray[np.uint16], NDArray[np.uint16]]]:
        """What a stream holds: lattice and palette; and the gain and the shape of each node, (nodes,) each.

        reciprocal, mirrored: of the lattice. version: of the stream, 1 or 2; in version 1, all are reciprocal and not
        mirrored. simd changes nothing but the time. Raises ValueError for a stream that is not the only one of a
        material, with the same sentence as the other readers.
        """

    def decode_part(
        self, data: bytes, simd: str | None = None
    ) -> tuple[NodePalette, tuple[NDArray[np.uint16], NDArray[np.uint16]]]:
        """What a stream without a lattice holds, on this lattice and with this prior. Raises ValueError as `decode`
        does, and if there is no prior.
        """

    def learnt(self, gain: NDArray[np.uint16], shape: NDArray[np.uint16]) -> tuple[list[list[float]], list[float]]:
        """What the model has learnt when it has seen the material of these indices: weights (3, 10), and usual errors
        (3,). Raises ValueError for what does not fit.
        """

    def encode(self, gain: NDArray[np.uint16], shape: NDArray[np.uint16], simd: str | None = None) -> bytes:
        """The stream, of version 2, of a gain and a shape for each node, (nodes,) each. Raises ValueError for what does
        not fit, and for what would keep readers busy for too long.
        """

    def measure(self, gain: NDArray[np.uint16], shape: NDArray[np.uint16]) -> tuple[float, float]:
        """The bits that the stream would take: for what comes before the indices, and for these."""

    def sweep(
        self,
        gain: NDArray[np.uint16],
        shape: NDArray[np.uint16],
        gain_values: NDArray[np.float64],
        shape_values: NDArray[np.float64],
        equations: NormalEquations,
        price: float | None,
    ) -> float:
        """Gives each node in turn, in place, the gain and the shape that cost the least in error and bits; returns the
        bits of the indices.

        gain_values (G,), shape_values (S, 3): what the codes stand for. equations: of the nodes. price: of a bit, as
        error; None changes nothing. Raises ValueError for what does not fit.
        """

    @property
    def theta_h(self) -> list[int]:
        """The rows' numbers on the fine grid."""

    @property
    def band(self) -> list[int]:
        """Of each row."""

    @property
    def theta_d(self) -> list[list[int]]:
        """For each band."""

    @property
    def phi_d(self) -> list[list[int]]:
        """For each band."""

    @property
    def reciprocal(self) -> bool:
        """Whether both orders of the directions give the same."""

    @property
    def mirrored(self) -> bool:
        """Whether φ_d and −φ_d give the same."""

    @property
    def gains(self) -> list[int]:
        """(G,), codes."""

    @property
    def shapes(self) -> list[list[int]]:
        """(S, 2), codes."""

class CellLookup:
    """A material on a lattice of cells, prepared for many calls of `eval`.

    The arrays are not copied: they are kept alive, and each call reads what they hold at that time.
    """

    def __init__(
        self,
        bins: tuple[int, int, int],
        reciprocal: bool,
        trilinear: bool,
        values: NDArray[np.float64],
        index: NDArray[np.uint8] | NDArray[np.uint16] | None = None,
    ) -> None:
        """bins: in θ_h, θ_d and φ_d. values: flat triples, f_r of the cells; or of a LUT if `index` (cells,) holds the
        entry of each cell. Raises ValueError for what does not fit.
        """

    def eval(
        self,
        wi: NDArray[np.float64],
        wo: NDArray[np.float64],
        simd: str | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """f_r (n, 3) of pairs of directions (n, 3), as `Brdf.eval` gives it for what is on a lattice.

        NaN where the index of a cell leads outside the LUT. Angles are within 4 ulp of NumPy's, so that a pair on the
        very edge of a cell may fall on the other side. simd and threads change nothing but the time. Raises ValueError
        for what does not fit, such as an array that has another length than before.
        """

class NodeLookup:
    """A compact material, on a lattice of nodes, prepared for many calls of `eval`.

    The lattice is copied. The arrays are not: they are kept alive, and each call reads what they hold at that time.
    """

    def __init__(
        self,
        theta_h: list[int],
        band: list[int],
        theta_d: list[list[int]],
        phi_d: list[list[int]],
        gains: NDArray[np.float64],
        shapes: NDArray[np.float64],
        gain: NDArray[np.uint16],
        shape: NDArray[np.uint16],
        scale: float,
        reciprocal: bool = True,
        mirrored: bool = False,
        signed: bool = False,
        smooth: bool = False,
    ) -> None:
        """theta_h, band, theta_d, phi_d, reciprocal, mirrored: the fields of the `NodeLattice`. gains (G,), shapes
        (S, 3), gain (nodes,) and shape (nodes,): y of a node is gains[gain] · shapes[shape]. scale, signed, smooth: see
        `nodes.from_cube_root`. Raises ValueError for what does not fit.
        """

    def eval(
        self,
        wi: NDArray[np.float64],
        wo: NDArray[np.float64],
        simd: str | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """f_r (n, 3) of pairs of directions (n, 3), as `Brdf.eval` gives it for a `FittedTable` of such values.

        0 where the blend contains a node whose gain or shape leads outside its array, which is possible only if an
        array was changed after `__init__`. simd and threads change nothing but the time. Raises ValueError for
        directions that do not fit.
        """

def line_errors(
    places: int,
    y: NDArray[np.float64],
    weight: NDArray[np.float64],
    simd: str | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """The error of linear interpolation between each two places on an axis, (places, places): at [i, j], the weighted
    squared error at all places between i and j, summed over lines along the axis; infinite unless i < j.

    y: (places · lines, 3) and weight: (places · lines,), line after line for each place. simd and threads change
    nothing but the time. Raises ValueError for other shapes.
    """

class NormalEquations:
    """The normal equations of a lattice's nodes, H z = b for each channel; zᵀ H z − 2 bᵀ z + squares is the error of
    values z (nodes, 3). All methods raise ValueError for what does not fit.
    """

    def __init__(
        self,
        starts: NDArray[np.int32],
        columns: NDArray[np.int32],
        values: NDArray[np.float64],
        right: NDArray[np.float64],
    ) -> None:
        """starts (nodes + 1,), columns, values: H, symmetric, sparse and by rows. right: b, (nodes, 3)."""

    @staticmethod
    def of(
        theta_h: list[int],
        band: list[int],
        theta_d: list[list[int]],
        phi_d: list[list[int]],
        places: NDArray[np.float64],
        weights: NDArray[np.float64],
        targets: NDArray[np.float64],
        reciprocal: bool = True,
        mirrored: bool = False,
        threads: int | None = None,
    ) -> NormalEquations:
        """Those of samples: places (n, 3) on the fine grid, of which the first number, θ_h, increases; weights (n,) of
        their squared errors; and targets (n, 3). theta_h, band, theta_d, phi_d, reciprocal, mirrored: the fields of the
        `NodeLattice`. threads changes nothing but the time.
        """

    def held(self, values: NDArray[np.float64], ridge: float) -> NormalEquations:
        """The same with an error that is larger by ridge times the squared distance from `values` (nodes, 3), of which
        `squares` leaves out the constant part.
        """

    def with_right(self, right: NDArray[np.float64]) -> NormalEquations:
        """The same H with another b (nodes, 3)."""

    def solved(self, start: NDArray[np.float64], tolerance: float, most: int) -> NDArray[np.float64]:
        """z (nodes, 3), by conjugate gradients from `start`, each channel until its residual is at most tolerance times
        |b|, or for `most` steps.
        """

    def product(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """H z, (nodes, 3)."""

    def diagonal(self) -> NDArray[np.float64]:
        """H's, (nodes,)."""

    def between_entries(
        self, index: NDArray[np.uint16], factors: NDArray[np.float64], count: int
    ) -> NDArray[np.float64]:
        """The equations' matrix where nodes share entries, (count, count): the sum of H_ij f_i · f_j over the nodes i
        of one entry and j of another. index: each node's entry, (nodes,). factors: f, (nodes, k).
        """

    @property
    def right(self) -> NDArray[np.float64]:
        """b, (nodes, 3)."""

    @property
    def squares(self) -> float:
        """The weighted sum of the targets' squares."""
