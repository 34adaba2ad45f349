"""A lattice of nodes in half/difference angles whose places are chosen for one material.

Where `Lattice` has bins of one size, this one has nodes where the material bends. Places are on a fine grid: θ_h in
steps of √(θ_h / 90°), 1/360 each up to 1/4 and 1/120 each from there, θ_d in 90°/180, φ_d in 180ths of its range. Rows
of equal θ_h are gathered in bands; the rows of a band share their nodes in θ_d and φ_d. A lookup blends 8 nodes at
most.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..system.errors import MaterialError
from .arrays import Array, Triple, ops
from .half_diff import TWO_PI, half_diff, phi_d_range
from .lattice import AnyLattice, Interpolation

FINE = 180  # steps of each axis
KNEE, BELOW, ABOVE = 90, 360, 120  # steps of √(θ_h / 90°) are 1/BELOW up to number KNEE, 1/ABOVE from there
SMALLEST_COSINE = 0.01
HORIZON = 0.0009  # added to squares of cosines
HALF_PI = TWO_PI / 4


@dataclass(frozen=True)
class NodeLattice(AnyLattice):
    """The places of the nodes, as numbers of steps on the fine grid.

    theta_h: of each row, increasing, the first 0 and the last FINE. band: the number of the band that each row belongs
        to. theta_d: of the nodes of each band, increasing, the first 0 and the last FINE. phi_d: of the nodes of each
        band, increasing, the first 0 and the last below FINE; since φ_d turns, the first one follows the last. If
        mirrored, φ_d ends: the last is FINE, or there is none but 0, where all is constant in φ_d.
    reciprocal: whether both orders of the directions give the same. mirrored: whether φ_d and −φ_d do. FINE steps are
        `phi_d_range` of the two.

    Raises MaterialError for axes that are not like that.
    """

    theta_h: tuple[int, ...]
    band: tuple[int, ...]
    theta_d: tuple[tuple[int, ...], ...]
    phi_d: tuple[tuple[int, ...], ...]
    reciprocal: bool = True
    mirrored: bool = False
    interpolations: ClassVar[tuple[Interpolation, ...]] = ("trilinear",)

    def __post_init__(self) -> None:
        bands = sorted(set(self.band))
        whole = all(_spans(axis) for axis in (self.theta_h, *self.theta_d))
        phi_d = all(_turns_back(axis) if self.mirrored else _turns(axis) for axis in self.phi_d)
        counted = len(self.band) == len(self.theta_h) and bands == list(range(len(self.theta_d)))
        if not (whole and phi_d and counted and len(self.theta_d) == len(self.phi_d)):
            raise MaterialError(f"nodes: expected axes that increase from 0 to {FINE}, and a band for each row")

    @cached_property
    def base(self) -> NDArray[np.int64]:
        """The number of the first node of each row; and, last, the number of nodes."""
        sizes = [len(self.theta_d[b]) * len(self.phi_d[b]) for b in self.band]
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    @property
    def size(self) -> int:
        """The number of nodes."""
        return int(self.base[-1])

    @property
    def grid(self) -> None:
        return None

    @property
    def array_shape(self) -> tuple[int]:
        return (self.size,)

    def buffers(self) -> dict[str, NDArray[Any]]:
        """What `corners` reads: for each step of the fine grid the node below, and the nodes' places."""
        return {
            "base": self.base[:-1].astype(np.float64),
            "band": np.array(self.band, np.uint8),
            "row_below": _below(self.theta_h),
            "row_place": np.array(self.theta_h, np.uint8),
            "theta_d_below": np.concatenate([_below(axis) for axis in self.theta_d]),
            "theta_d_place": _padded(self.theta_d),
            "phi_d_below": np.concatenate([_below(_whole(axis)) for axis in self.phi_d]),
            "phi_d_place": _padded([_whole(axis) for axis in self.phi_d]),
            "phi_d_count": np.array([len(axis) for axis in self.phi_d], np.uint8),
        }

    @property
    def shape(self) -> tuple[int, int, int]:
        """The number of rows, and the most nodes in θ_d and in φ_d that a row has."""
        return len(self.theta_h), max(map(len, self.theta_d)), max(map(len, self.phi_d))

    def axes(self) -> tuple[list[int], list[int], list[list[int]], list[list[int]]]:
        """theta_h, band, theta_d, phi_d, as the core takes them."""
        return list(self.theta_h), list(self.band), [*map(list, self.theta_d)], [*map(list, self.phi_d)]

    @property
    def folds(self) -> dict[str, bool]:
        """reciprocal and mirrored, by name, as the core, `place` and `angles_at` take them."""
        return {"reciprocal": self.reciprocal, "mirrored": self.mirrored}

    def place(self, wi: Triple, wo: Triple) -> Triple:
        return place(wi, wo, **self.folds)

    def corners(self, x: Array, y: Array, z: Array, buffers: Mapping[str, Any]) -> list[tuple[Array, Array]]:
        """The 8 nodes about a place on the fine grid (θ_h, θ_d, φ_d), and their weights, which add up to 1."""
        f = ops(x)
        step = [f.bin(c, FINE) for c in (x, y, z)]
        row = f.gather(buffers["row_below"], step[0])
        t = _share(f, buffers["row_place"], row, x)
        found: list[tuple[Array, Array]] = []
        for r, weight in ((row, 1.0 - t), (row + 1, t)):
            band = f.gather(buffers["band"], r)
            base = f.to_index(f.gather(buffers["base"], r))
            d = f.gather(buffers["theta_d_below"], band * FINE + step[1])
            p = f.gather(buffers["phi_d_below"], band * FINE + step[2])
            u = _share(f, buffers["theta_d_place"], band * (FINE + 1) + d, y)
            v = _share(f, buffers["phi_d_place"], band * (FINE + 1) + p, z)
            count = f.gather(buffers["phi_d_count"], band)
            after = f.where(p + 1 >= count, 0 * p, p + 1)
            for i, a in ((d, 1.0 - u), (d + 1, u)):
                found += [(base + i * count + j, weight * a * b) for j, b in ((p, 1.0 - v), (after, v))]
        return found


def place(wi: Triple, wo: Triple, reciprocal: bool = True, mirrored: bool = False) -> Triple:
    """Where pairs of directions lie on the fine grid of lattices with such folds."""
    f = ops(wi[0])
    theta_h, theta_d, phi_d = half_diff(wi, wo, reciprocal, mirrored)
    a = f.sqrt(theta_h * (1 / HALF_PI))
    x = f.where(a < KNEE / BELOW, a * BELOW, KNEE + (a - KNEE / BELOW) * ABOVE)
    z = phi_d * (FINE / phi_d_range(reciprocal, mirrored))
    if not mirrored:
        z = f.where(z >= FINE, z - FINE, z)
    return x, theta_d * (FINE / HALF_PI), z


def angles_at(x: Array, y: Array, z: Array, reciprocal: bool = True, mirrored: bool = False) -> Triple:
    """(θ_h, θ_d, φ_d) [rad] at a place on the fine grid of lattices with such folds."""
    f = ops(x)
    a = f.where(x < KNEE, x / BELOW, KNEE / BELOW + (x - KNEE) / ABOVE)
    return a * a * HALF_PI, y * (HALF_PI / FINE), z * (phi_d_range(reciprocal, mirrored) / FINE)


def damped(wi: Triple, wo: Triple, smooth: bool = False) -> Array:
    """cos θ_i cos θ_o, bounded from below: f_r times this stays small near grazing. Each cosine is taken for
    √(cos² θ + 0.03²) if smooth, else for at least SMALLEST_COSINE.

    Errors of a blended value are divided by it: the former ends without a kink, and enlarges them less.
    """
    f = ops(wi[0])
    if smooth:
        return f.sqrt((wi[2] * wi[2] + HORIZON) * (wo[2] * wo[2] + HORIZON))
    return f.maximum(wi[2], SMALLEST_COSINE) * f.maximum(wo[2], SMALLEST_COSINE)


def from_cube_root(
    y: Triple, wi: Triple, wo: Triple, scale: Array, signed: bool = False, smooth: bool = False
) -> Triple:
    """f_r of values y in the cube-root domain: scale · max(0, y)³ / `damped`, or scale · y³ / `damped` if signed."""
    f = ops(wi[0])
    factor = scale / damped(wi, wo, smooth)

    def channel(value: Array) -> Array:
        root = value if signed else f.maximum(value, 0.0)
        return root * root * root * factor

    return channel(y[0]), channel(y[1]), channel(y[2])


def _increases(axis: tuple[int, ...]) -> bool:
    return all(a < b for a, b in pairwise(axis))


def _spans(axis: tuple[int, ...]) -> bool:
    return len(axis) > 1 and axis[0] == 0 and axis[-1] == FINE and _increases(axis)


def _turns(axis: tuple[int, ...]) -> bool:
    return len(axis) > 0 and axis[0] == 0 and axis[-1] < FINE and _increases(axis)


def _turns_back(axis: tuple[int, ...]) -> bool:
    return axis == (0,) or _spans(axis)


def _whole(axis: tuple[int, ...]) -> tuple[int, ...]:
    """An axis of φ_d up to FINE, where the first node comes again if no other one is there. Where it is the only one of
    an axis that does not turn, it comes again, too.
    """
    return axis if axis[-1] == FINE else (*axis, FINE)


def _below(axis: tuple[int, ...]) -> NDArray[np.uint8]:
    """For each step of the fine grid, the number of the node at or below its start."""
    return (np.searchsorted(axis, np.arange(FINE), side="right") - 1).astype(np.uint8)


def _padded(axes: Any) -> NDArray[np.uint8]:
    """The places of each band's nodes, FINE + 1 entries a band."""
    places = np.full((len(axes), FINE + 1), FINE, np.uint8)
    for row, axis in zip(places, axes, strict=True):
        row[: len(axis)] = axis
    return places.reshape(-1)


def _share(f: Any, places: Any, node: Array, x: Array) -> Array:
    """How far x lies from a node to the next."""
    a, b = f.gather(places, node), f.gather(places, node + 1)
    return f.minimum(f.maximum((x - a) / (b - a), 0.0), 1.0)
