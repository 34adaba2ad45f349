"""Our sampler: half vectors from a small table for each elevation of the viewer.

For a viewer at elevation θ_o, half vectors whose light lies above the horizon fill 0 ≤ θ_h ≤ θ_max(φ_h, θ_o), where φ_h
is the azimuth from the viewer's. A unit square is stretched over them. One side is s, with

    sin θ_h = s⁴ sin θ_max,

so that a row of cells costs about as much light as the next whether the material is chrome or chalk. The other is the
place c of φ_h on the rim of a diamond, |x| + |y| = 1 with x = 1 - c, which needs no trigonometry. Every cell of that
square has the probability that the table gives it and is drawn from uniformly; nothing is drawn below the horizon, and
nothing above it is left out. Between two elevations of the table their densities are mixed: one of the two is chosen at
random, then a cell by Walker's alias method.

Tables of directions for each elevation go back to Matusik (2003), half vectors from tabulated distributions to Dupuy et
al. (2015), the domain that follows the horizon to the visible normals of Dupuy and Jakob (2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from ..reflectance.arrays import Array, Triple, gather3, ops
from ..reflectance.brdf import Brdf, Buffers
from .sampler import PI, Sampler

ROWS, COLUMNS = 20, 8  # cells in s and, on one side of the plane of the viewer, in c
ELEVATIONS = 12  # of the viewer; dense at grazing angles, where lobes change fastest
CELLS = ROWS * COLUMNS
SLOTS = 256  # of a cell in the alias table
SLOT_BITS = 8
WHOLE = CELLS * SLOTS  # the probability 1

SMALLEST = 1e-35  # solid angle of a direction that is drawn, times its density in the unit square
TINY = 1e-9  # added to lengths along x, so that the azimuth of the normal itself is defined
LOWEST = 1e-4  # cos θ_o of the table's lowest elevation, 0 but for numbers that need some width
DIFFUSE = 0.01  # share of directions that follow the cosine
FINER = 3  # places looked at along each side of a cell
EXACT = 16  # the same for a single albedo: within 0.1 % where a cell holds no jump
VIEWERS = 31  # elevations that albedos are tabulated for, equal in θ_o
NEIGHBOUR = 0.07  # a cell gets at least that share of the brightest light in and about it, which bounds weights


@dataclass(frozen=True)
class HalfVectorSampler(Sampler):
    """Half vectors from a table for each elevation of the viewer.

    table: of each cell, in 32 bits from the lowest: its probability in units of 1 / WHOLE (16), another cell (8), and
        how many of its own SLOTS that one takes (8); shape (ELEVATIONS, CELLS). A cell's number is
        column + COLUMNS · row.
    """

    brdf: Brdf
    table: NDArray[np.uint32]
    name = "half-vector"

    @classmethod
    def fitted(cls, brdf: Brdf) -> HalfVectorSampler:
        """The sampler of a BRDF, which is evaluated for about 33,000 pairs of directions."""
        return cls(brdf, np.stack([_alias_table(p) for p in _probabilities(brdf)]))

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"table": self.table.reshape(-1)}

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        f = ops(wo[0])
        table = buffers["table"]
        first, t = _elevation(wo[2])
        second = u[0] < t
        again = f.where(second, u[0], u[0] - t) / f.where(second, t, 1.0 - t)
        slot = f.bin(again * WHOLE, WHOLE)
        cell = slot >> SLOT_BITS
        word = f.gather(table, cell + f.where(second, first + CELLS, first))
        cell = f.where((slot & (SLOTS - 1)) < (word >> 24), (word >> 16) & 255, cell)
        side = 2.0 * u[2] - 1.0
        s = ((cell // COLUMNS) + u[1]) * (1.0 / ROWS)
        c = ((cell % COLUMNS) + abs(side)) * (2.0 / COLUMNS)
        wi, solid_angle = _mirrored(s, c, side, wo)
        # Half vectors next to the normal have densities beyond single precision, and weigh nothing.
        drawn = (wo[2] > 0.0) & (wi[2] > 0.0) & (solid_angle > SMALLEST)
        return wi, f.where(drawn, _share(table, first, t, cell) / f.where(drawn, solid_angle, 1.0), 0.0)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        f = ops(wi[0])
        above = (wi[2] > 0.0) & (wo[2] > 0.0)
        # The viewer, raised as in `_mirrored`, and the half vector. Their lengths along the surface need not be known.
        x, y, z = wo[0] + TINY, wo[1], f.maximum(wo[2], LOWEST)
        hx, hy, hz = (wi[0] + wo[0]) + TINY, wi[1] + wo[1], f.where(above, wi[2] + z, 1.0)
        along, across = hx * x + hy * y, hx * y - hy * x
        # In single precision, these lengths can be 0, and products of all of them, too.
        flat = f.maximum(hx * hx + hy * hy, TINY * TINY)
        extent = _extent(along, z * z * flat)
        s = f.sqrt(f.sqrt(f.sqrt(f.minimum(flat / ((flat + hz * hz) * extent), 1.0))))
        rim = 1.0 / f.maximum(abs(along) + abs(across), TINY * TINY)
        c = 1.0 - along * rim
        row = f.bin(s * ROWS, ROWS)
        column = f.bin(c * (COLUMNS / 2), COLUMNS)
        first, t = _elevation(wo[2])
        share = _share(buffers["table"], first, t, column + COLUMNS * row)
        # As in `_mirrored`, with the lengths that cancel left out.
        pdf = share * (s * hz) * ((x * x + y * y) * (rim * rim) * (1.0 / 32))
        return f.where(above, pdf, 0.0)

    def albedo(self, theta: ArrayLike) -> NDArray[np.float64]:
        """The albedo, as `Brdf.albedo` says, from EXACT² places in each cell on either side of the viewer's plane."""
        angles = np.asarray(theta, np.float64)
        known = np.isfinite(angles)
        if ((angles < 0) | (angles > PI / 2)).any():
            raise ValueError("albedo: expected polar angles from 0 to π/2, found others")
        found = np.full((angles.size, 3), np.nan)
        for number in np.flatnonzero(known):
            cos_o = np.cos(angles.reshape(-1)[number : number + 1])
            sides = [_light(self.brdf, cos_o, EXACT, side)[0].mean(axis=(0, 1, 2, 3)) for side in (1.0, -1.0)]
            found[number] = (sides[0] + sides[1]) / 2
        return found.reshape(*angles.shape, 3)


def albedos(brdf: Brdf) -> NDArray[np.float64]:
    """The share of even light that a BRDF reflects to viewers at VIEWERS elevations, (VIEWERS, 3): see `albedo_at`.

    It is evaluated for about 20,000 pairs of directions.
    """
    # At the normal itself, and on the horizon, data may be of another kind than right beside.
    theta = np.clip(np.arange(VIEWERS) / (VIEWERS - 1) * PI / 2, 0.01, PI / 2 - 0.01)
    return _light(brdf, np.cos(theta), 2)[0].mean(axis=(1, 2, 3))


def albedo_at(cos_o: Array, table: Any) -> Triple:
    """The albedo for viewers at that cosine: interpolated in θ_o from a table of `albedos`, flat."""
    f = ops(cos_o)
    sin = f.sqrt(f.maximum(1.0 - cos_o * cos_o, 0.0))
    x = f.atan2(sin, cos_o) * (2 / PI * (VIEWERS - 1))
    first = f.bin(x, VIEWERS - 1)
    t = x - first
    here, next_ = gather3(table, first), gather3(table, first + 1)
    r, g, b = (a + t * (b - a) for a, b in zip(here, next_, strict=True))
    return r, g, b


def _elevation(cos_o: Array) -> tuple[Array, Array]:
    """Of two neighbouring elevations of the table, where the first one's cells begin, and the second one's share."""
    f = ops(cos_o)
    x = f.sqrt(f.maximum(cos_o, 0.0)) * (ELEVATIONS - 1)
    node = f.bin(x, ELEVATIONS - 1)
    return CELLS * node, x - node


def _share(table: Any, first: Array, t: Array, cell: Array) -> Array:
    """The density in a cell of the unit square."""
    gather = ops(t).gather
    here, next_ = (1.0 * (gather(table, first + offset + cell) & 0xFFFF) for offset in (0, CELLS))
    return (here + t * (next_ - here)) * (1.0 / SLOTS)


def _extent(along: Array, upright2: Array) -> Array:
    """sin² θ_max of half vectors in a plane through the normal.

    In that plane the viewer's direction has the components `along` the surface and `upright`, whose square is given, in
    any one unit: at the angle δ = atan2(along, upright) from the normal. Light is on the horizon where
    2 θ_h - δ = π/2, so that sin² θ_max = (1 + sin δ) / 2.
    """
    f = ops(along)
    r = f.sqrt(along * along + upright2)
    a = r + abs(along)
    return f.where(along < 0.0, upright2, a * a) / (2.0 * r * a)


def _mirrored(s: Array, c: Array, side: Array, wo: Triple) -> tuple[Triple, Array]:
    """The direction to the light at a place of the unit square, and the solid angle of the whole square at its scale.

    side: its sign tells the side of the plane of the viewer.
    dω_i = 4 (h·ω_o) dω_h, dω_h = d(sin² θ_h) dφ_h / (2 cos θ_h), dφ_h = dc / (x² + y²).
    """
    f = ops(s)
    x = 1.0 - c
    y = 1.0 - abs(x)
    y = f.where(side < 0.0, -y, y)
    round_ = x * x + y * y
    wx, wy, wz = wo[0] + TINY, wo[1], f.maximum(wo[2], LOWEST)
    across = wx * wx + wy * wy
    scale = 1.0 / f.sqrt(round_ * across)
    tilt = x * across * scale
    extent = _extent(tilt, wz * wz)
    s2 = s * s
    s6 = s2 * s2 * s2
    sin2 = s6 * s2 * extent
    sin, cos = f.sqrt(sin2), f.sqrt(1.0 - sin2)
    dot = sin * tilt + cos * wz
    planar = 2.0 * dot * sin * scale
    wi = planar * (x * wx - y * wy) - wx, planar * (x * wy + y * wx) - wy, 2.0 * dot * cos - wz
    return wi, 64.0 * (s6 * s) * extent * dot / (cos * round_)


def _light(
    brdf: Brdf, cos_o: NDArray[np.float64], finer: int, side: float = 1.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The light f_r cos θ_i dω_i of places in the unit square, finer² in each cell, and cos θ_i dω_i alone; of shape
    (elevations, ROWS, COLUMNS, places, channels) and without channels. side: of the plane of the viewer, 1 or -1."""
    s, c = (((np.arange(finer * n) + 0.5) / (finer * n)) for n in (ROWS, COLUMNS))
    z, s, c = np.broadcast_arrays(cos_o[:, None, None], s[:, None], 2 * c)
    wo = np.sqrt(1 - z * z), np.zeros_like(z), z
    wi, solid_angle = _mirrored(s, c, np.full_like(c, side), wo)
    cosine = np.maximum(wi[2], 0.0) * solid_angle
    light = brdf.eval(np.stack(wi, axis=-1), np.stack(wo, axis=-1)) * cosine[..., None]

    def of_cells(values: NDArray[np.float64], *channels: int) -> NDArray[np.float64]:
        grouped = values.reshape(len(cos_o), ROWS, finer, COLUMNS, finer, *channels).swapaxes(2, 3)
        return grouped.reshape(len(cos_o), ROWS, COLUMNS, finer**2, *channels)

    return of_cells(light, 3), of_cells(cosine)


def _probabilities(brdf: Brdf) -> NDArray[np.float64]:
    """Of every cell, (ELEVATIONS, CELLS), each row with the sum 1.

    A cell's root mean square of light makes the variance of the albedo least; what it gets beyond that bounds weights.
    """
    # Each table serves the elevations about it, so that those between are looked at, too.
    between = 2 * ELEVATIONS - 1
    light, cosine = _light(brdf, np.maximum((np.arange(between) / (between - 1)) ** 2, LOWEST), FINER)
    rms = np.sqrt((light * light).mean(axis=(-2, -1)))
    rms /= _positive(rms.sum(axis=(1, 2), keepdims=True))
    albedo = light.mean(axis=-2, keepdims=True).sum(axis=(1, 2), keepdims=True)
    brightest = (light / _positive(albedo)).max(axis=(-2, -1))
    padded = np.pad(brightest, ((2, 2), (1, 1), (1, 1)), "edge")
    near = sliding_window_view(padded, (5, 3, 3)).max(axis=(-3, -2, -1))
    bounded: NDArray[np.float64] = np.maximum(rms, NEIGHBOUR * near)[::2]
    even: NDArray[np.float64] = cosine[::2].mean(axis=-1)
    total = bounded.sum(axis=(1, 2), keepdims=True)
    even /= even.sum(axis=(1, 2), keepdims=True)
    glossy = np.where(total > 0, bounded / _positive(total), even)  # an elevation may see no light at all
    return ((1 - DIFFUSE) * glossy + DIFFUSE * even).reshape(ELEVATIONS, CELLS)


def _positive(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divisors, 1 where there is no light."""
    return np.where(values > 0, values, 1.0)


def _alias_table(p: NDArray[np.float64]) -> NDArray[np.uint32]:
    """The words of one elevation, (CELLS): see `HalfVectorSampler.table`. Every cell has at least 1 / WHOLE.

    Vose's construction, in whole slots: what is drawn is exactly what the words say.
    """
    exact = p * (WHOLE - CELLS)
    units = 1 + np.floor(exact).astype(np.int64)
    rest = WHOLE - int(units.sum())
    units[np.argsort(np.floor(exact) - exact, kind="stable")[:rest]] += 1
    other, taken, left = np.zeros(CELLS, np.int64), np.zeros(CELLS, np.int64), units.copy()
    small, large = ([int(i) for i in np.flatnonzero(which)] for which in (units < SLOTS, units >= SLOTS))
    while small:
        poor, rich = small.pop(), large[-1]
        other[poor], taken[poor] = rich, SLOTS - left[poor]
        left[rich] -= taken[poor]
        if left[rich] < SLOTS:
            small.append(large.pop())
    return (units | other << 16 | taken << 24).astype(np.uint32)
