"""The lattice of cells in half/difference angles on which tables and SOM-MAN materials are stored.

The default is MERL's: 90 × 90 × 180 cells, dense in θ_h near the highlight (Matusik et al. 2003).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..system.errors import MaterialError
from .arrays import Array, Triple, ops
from .half_diff import TWO_PI, half_diff, phi_d_range
from .lattice import AnyLattice, Interpolation

HALF_PI = TWO_PI / 4
ON_HORIZON = 1e-12  # a cosine up to that is 0 but for rounding; files depend on which cells count


@dataclass(frozen=True)
class Lattice(AnyLattice):
    """Cells in (θ_h, θ_d, φ_d). Cell number = φ_d + phi_d · (θ_d + theta_d · θ_h), of the bin numbers.

    theta_h, theta_d, phi_d: number of bins. θ_h bins are equal in √θ_h, the others are equal in the angle.
    reciprocal: φ_d covers [0, π), and a pair of directions falls into the same cell in both orders; otherwise
        φ_d covers [0, 2π).

    >>> Lattice(90, 90, 180).size  # MERL's
    1458000
    """

    theta_h: int = 90
    theta_d: int = 90
    phi_d: int = 180
    reciprocal: bool = True
    interpolations: ClassVar[tuple[Interpolation, ...]] = ("nearest", "trilinear")

    def __post_init__(self) -> None:
        if min(self.shape) < 1:
            raise MaterialError(f"lattice: expected at least one bin in each angle, found {self.shape}")

    @property
    def shape(self) -> tuple[int, int, int]:
        return self.theta_h, self.theta_d, self.phi_d

    @property
    def size(self) -> int:
        """The number of cells."""
        return self.theta_h * self.theta_d * self.phi_d

    @property
    def grid(self) -> Lattice:
        return self

    @property
    def array_shape(self) -> tuple[int, int, int]:
        return self.shape

    @property
    def phi_d_range(self) -> float:
        """The period of φ_d [rad]."""
        return phi_d_range(self.reciprocal)

    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """(θ_h, θ_d, φ_d) [rad] at the centres of the bins, of shapes that broadcast to the lattice's."""
        theta_h = ((np.arange(self.theta_h) + 0.5) / self.theta_h) ** 2 * HALF_PI
        theta_d = (np.arange(self.theta_d) + 0.5) / self.theta_d * HALF_PI
        phi_d = (np.arange(self.phi_d) + 0.5) / self.phi_d * self.phi_d_range
        return theta_h[:, None, None], theta_d[None, :, None], phi_d[None, None, :]

    def angles(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """(θ_h, θ_d, φ_d) [rad] at the centre of every cell, each of the lattice's shape."""
        theta_h, theta_d, phi_d = np.broadcast_arrays(*self.axes())
        return theta_h, theta_d, phi_d

    def cosines(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """cos θ_i and cos θ_o at the centre of every cell, each of the lattice's shape."""
        theta_h, theta_d, phi_d = self.axes()
        along_normal = np.cos(theta_h) * np.cos(theta_d)
        tilt = (np.sin(theta_h) * np.sin(theta_d)) * np.cos(phi_d)
        return along_normal - tilt, along_normal + tilt

    @cached_property
    def above_horizon(self) -> NDArray[np.bool_]:
        """Cells with both directions above the horizon at their centre, of the lattice's shape.

        They are those with cos θ_h cos θ_d > |sin θ_h sin θ_d cos φ_d|: for each (θ_h, φ_d), the first few in θ_d.
        Those on the horizon are not among them, however a machine rounds.
        """
        return np.minimum(*self.cosines()) > ON_HORIZON

    def solid_angles(self) -> NDArray[np.float64]:
        """dω_i dω_o of every cell, up to a constant factor: sin θ_h sin θ_d cos θ_d dθ_h (Rusinkiewicz 1998)."""
        theta_h, theta_d, _ = self.angles()
        return np.sin(theta_h) * np.sqrt(theta_h) * np.sin(theta_d) * np.cos(theta_d)

    def extended(self, values: NDArray[Any]) -> NDArray[Any]:
        """`values`, of the lattice's shape (…), with every cell below the horizon set to the last one above it in θ_d.

        Where a coarse lattice has none in θ_d, it is the last in θ_h that has.
        A pair of directions just above the horizon may fall into a cell whose centre is below it, or have such a cell
        as a neighbour when interpolating.
        """
        h, _, p = np.nonzero(~self.above_horizon)
        h = np.minimum(h, self.above_horizon[:, 0].sum(axis=0)[p] - 1)
        last = self.above_horizon.sum(axis=1) - 1
        extended = values.copy()
        extended[~self.above_horizon] = values[h, last[h, p], p]
        return extended

    def place(self, wi: Triple, wo: Triple) -> Triple:
        """(θ_h, θ_d, φ_d) [rad] of pairs of directions."""
        return half_diff(wi, wo, self.reciprocal)

    def cell(self, theta_h: Array, theta_d: Array, phi_d: Array) -> Array:
        """The number of the cell that holds the given angles [rad]."""
        f = ops(theta_h)
        u, v, w = self._position(theta_h, theta_d, phi_d)
        i = f.bin(u, self.theta_h)
        j = f.bin(v, self.theta_d)
        k = f.bin(w, self.phi_d)
        return k + self.phi_d * (j + self.theta_d * i)

    def corners(
        self, x: Array, y: Array, z: Array, buffers: Mapping[str, Any] | None = None
    ) -> list[tuple[Array, Array]]:
        """The 8 cells about the angles θ_h, θ_d, φ_d [rad], and their weights, which add up to 1.

        Weights are linear in the bins' numbers between cell centres; φ_d wraps, θ_h and θ_d clamp.
        """
        f = ops(x)
        u, v, w = self._position(x, y, z)
        (i0, i1, a), (j0, j1, b) = _between(f, u, self.theta_h), _between(f, v, self.theta_d)
        w = w - 0.5
        below = f.floor(w)
        c = w - below
        k0 = f.bin(f.where(below < 0.0, below + self.phi_d, below), self.phi_d)
        k1 = f.where(k0 + 1 >= self.phi_d, 0 * k0, k0 + 1)
        return [
            (k + self.phi_d * (j + self.theta_d * i), p * q * r)
            for i, p in ((i0, 1.0 - a), (i1, a))
            for j, q in ((j0, 1.0 - b), (j1, b))
            for k, r in ((k0, 1.0 - c), (k1, c))
        ]

    def lookup(
        self,
        wi: Triple,
        wo: Triple,
        interpolation: Interpolation,
        buffers: Mapping[str, Any],
        fetch: Callable[[Array], Triple],
    ) -> Triple:
        if interpolation == "nearest":
            return fetch(self.cell(*self.place(wi, wo)))
        return super().lookup(wi, wo, interpolation, buffers, fetch)

    def _position(self, theta_h: Array, theta_d: Array, phi_d: Array) -> Triple:
        """Continuous bin numbers: bin i covers [i, i + 1)."""
        f = ops(theta_h)
        return (
            self.theta_h * f.sqrt(theta_h * (1 / HALF_PI)),
            theta_d * (self.theta_d / HALF_PI),
            phi_d * (self.phi_d / self.phi_d_range),
        )


MERL = Lattice()


def _between(f: Any, position: Array, bins: int) -> tuple[Array, Array, Array]:
    """The bins whose centres are on either side, clamped, and the weight of the upper one."""
    x = f.minimum(f.maximum(position - 0.5, 0.0), bins - 1.0)
    lower = f.minimum(f.floor(x), max(bins - 2.0, 0.0))
    index = f.bin(lower, max(bins - 1, 1))
    return index, index + min(1, bins - 1), x - lower
