"""Our sampler: half vectors from a small table for each elevation of the viewer.

For a viewer at elevation θ_o, the half vectors that reflect to a light above the horizon are those with
0 ≤ θ_h ≤ θ_max(φ_h, θ_o), where φ_h is the azimuth from the viewer's. They are parametrised by a unit square. One
coordinate is s, with

    sin θ_h = s⁴ sin θ_max,

so that rows of cells get about equal amounts of light, whether the material is chrome or chalk. The other is c, the
place of φ_h on the edge of a diamond, |x| + |y| = 1 with x = 1 - c, which needs no trigonometry. The square is divided
into cells. A cell is drawn with the probability that the table gives, and then a point in it uniformly. So no direction
below the horizon is drawn, and every direction above it can be. Between two elevations of the table, one of the two is
chosen at random, so that the density is a mixture of both; its cell is then found by Walker's alias method.

Tables of directions for each elevation go back to Matusik (2003), half vectors from tabulated distributions to Dupuy et
al. (2015), and a domain that follows the horizon to the visible normals of Dupuy and Jakob (2018).
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

ROWS, COLUMNS = 20, 8  # cells in s, and in c on one side of the viewer's plane
ELEVATIONS = 12  # of the viewer; closer together at grazing angles, where lobes change fastest
CELLS = ROWS * COLUMNS
SLOTS = 256  # of a cell in the alias table
SLOT_BITS = 8
WHOLE = CELLS * SLOTS  # what stands for the probability 1

SMALLEST = 1e-35  # a direction with a smaller solid angle per area of the unit square is not drawn
TINY = 1e-9  # added to lengths along x, so that the azimuth of the normal itself is defined
LOWEST = 1e-4  # cos θ_o of the table's lowest elevation, which would be 0 if that did not make solid angles 0
DIFFUSE = 0.01  # share of directions that follow the cosine
FINER = 3  # points along each side of a cell at which the BRDF is evaluated
EXACT = 16  # the same for a single albedo: within 0.1 % where a cell holds no jump
VIEWERS = 31  # elevations for which albedos are tabulated, at equal steps of θ_o
NEIGHBOUR = 0.07  # a cell gets at least this share of the brightest light in and next to it, which bounds weights


@dataclass(frozen=True)
class HalfVectorSampler(Sampler):
    """Draws half vectors from a table for each elevation of the viewer.

    table: (ELEVATIONS, CELLS), for each cell 32 bits, from the lowest: its probability in units of 1 / WHOLE (16 bits);
        for the alias method, the number of another cell (8 bits), and how many of this cell's SLOTS that one gets
        (8 bits). The number of a cell is column + COLUMNS · row.
    """

    brdf: Brdf
    table: NDArray[np.uint32]
    name = "half-vector"

    @classmethod
    def fitted(cls, brdf: Brdf) -> HalfVectorSampler:
        """A sampler for a BRDF, which is evaluated for about 33,000 pairs of directions."""
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
        # Next to the normal, densities are too large for single precision; what is lost there is negligible.
        drawn = (wo[2] > 0.0) & (wi[2] > 0.0) & (solid_angle > SMALLEST)
        return wi, f.where(drawn, _share(table, first, t, cell) / f.where(drawn, solid_angle, 1.0), 0.0)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        f = ops(wi[0])
        above = (wi[2] > 0.0) & (wo[2] > 0.0)
        # The viewer, raised as in `_mirrored`, and the half vector. Neither has to be normalised.
        x, y, z = wo[0] + TINY, wo[1], f.maximum(wo[2], LOWEST)
        hx, hy, hz = (wi[0] + wo[0]) + TINY, wi[1] + wo[1], f.where(above, wi[2] + z, 1.0)
        along, across = hx * x + hy * y, hx * y - hy * x
        # In single precision, these lengths and their products can be 0.
        flat = f.maximum(hx * hx + hy * hy, TINY * TINY)
        extent = _extent(along, z * z * flat)
        s = f.sqrt(f.sqrt(f.sqrt(f.minimum(flat / ((flat + hz * hz) * extent), 1.0))))
        rim = 1.0 / f.maximum(abs(along) + abs(across), TINY * TINY)
        c = 1.0 - along * rim
        row = f.bin(s * ROWS, ROWS)
        column = f.bin(c * (COLUMNS / 2), COLUMNS)
        first, t = _elevation(wo[2])
        share = _share(buffers["table"], first, t, column + COLUMNS * row)
        # As in `_mirrored`, without the lengths, which cancel.
        pdf = share * (s * hz) * ((x * x + y * y) * (rim * rim) * (1.0 / 32))
        return f.where(above, pdf, 0.0)

    def albedo(self, theta: ArrayLike, *, points: int = EXACT) -> NDArray[np.float64]:
        """The albedo as `Brdf.albedo` defines it, from points² points in each cell on both sides of the viewer's plane.

        theta: the viewer's polar angles [rad], (...). Returns (..., 3). Raises ValueError for angles outside [0, π/2].
        """
        return albedo(self.brdf, theta, points)


def albedo(brdf: Brdf, theta: ArrayLike, points: int = EXACT) -> NDArray[np.float64]:
    """As `HalfVectorSampler.albedo`, for which no sampler has to be fitted."""
    angles = np.asarray(theta, np.float64)
    known = np.isfinite(angles)
    if (known & ((angles < 0) | (angles > PI / 2))).any():
        raise ValueError("albedo: polar angles have to be from 0 to π/2, and some are not")
    found = np.full((angles.size, 3), np.nan)
    for number in np.flatnonzero(known):
        found[number] = _reflected(brdf, np.cos(angles.reshape(-1)[number : number + 1]), points)
    return found.reshape(*angles.shape, 3)


def albedos(brdf: Brdf) -> NDArray[np.float64]:
    """The albedo of a BRDF for viewers at VIEWERS elevations, (VIEWERS, 3): of uniform light, the share that is
    reflected to the viewer.

    The BRDF is evaluated for about 20,000 pairs of directions, or twice as many unless it is mirrored. See `albedo_at`.
    """
    # Not exactly at the normal and the horizon, where measured data may differ from what is right beside.
    theta = np.clip(np.arange(VIEWERS) / (VIEWERS - 1) * PI / 2, 0.01, PI / 2 - 0.01)
    return _reflected(brdf, np.cos(theta), 2)


def _reflected(brdf: Brdf, cos_o: NDArray[np.float64], finer: int) -> NDArray[np.float64]:
    """The albedo for viewers at cos θ_o, (elevations, 3): the mean of both sides of the viewer's plane."""
    sides = (1.0,) if brdf.mirrored else (1.0, -1.0)
    return np.mean([_light(brdf, cos_o, finer, side)[0].mean(axis=(1, 2, 3)) for side in sides], axis=0)


def albedo_at(cos_o: Array, table: Any) -> Triple:
    """The albedo for viewers at cos θ_o, interpolated in θ_o. table: from `albedos`, flat."""
    f = ops(cos_o)
    sin = f.sqrt(f.maximum(1.0 - cos_o * cos_o, 0.0))
    x = f.atan2(sin, cos_o) * (2 / PI * (VIEWERS - 1))
    first = f.bin(x, VIEWERS - 1)
    t = x - first
    here, next_ = gather3(table, first), gather3(table, first + 1)
    r, g, b = (a + t * (b - a) for a, b in zip(here, next_, strict=True))
    return r, g, b


def _elevation(cos_o: Array) -> tuple[Array, Array]:
    """The two elevations of the table that a viewer lies between.

    Returns the number of the first cell of the lower one, and the share of the other one, from 0 to 1.
    """
    f = ops(cos_o)
    x = f.sqrt(f.maximum(cos_o, 0.0)) * (ELEVATIONS - 1)
    node = f.bin(x, ELEVATIONS - 1)
    return CELLS * node, x - node


def _share(table: Any, first: Array, t: Array, cell: Array) -> Array:
    """The density in a cell of the unit square, mixed from two elevations. first, t: from `_elevation`."""
    gather = ops(t).gather
    here, next_ = (1.0 * (gather(table, first + offset + cell) & 0xFFFF) for offset in (0, CELLS))
    return (here + t * (next_ - here)) * (1.0 / SLOTS)


def _extent(along: Array, upright2: Array) -> Array:
    """sin² θ_max for half vectors in a plane through the normal.

    along, upright2: of the viewer's direction, projected into that plane and in any unit of length, the component along
    the surface, and the square of the one along the normal, so that it is at δ = atan2(along, √upright2) from the
    normal. The light is on the horizon where 2 θ_h - δ = π/2, so sin² θ_max = (1 + sin δ) / 2.
    """
    f = ops(along)
    r = f.sqrt(along * along + upright2)
    a = r + abs(along)
    return f.where(along < 0.0, upright2, a * a) / (2.0 * r * a)


def _mirrored(s: Array, c: Array, side: Array, wo: Triple) -> tuple[Triple, Array]:
    """The direction to the light for a point (s, c) of the unit square, and the solid angle per area of the square.

    side: its sign selects the side of the viewer's plane.
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
    """The light f_r cos θ_i dω_i at finer² points in each cell of the unit square, for viewers at cos θ_o; and
    cos θ_i dω_i alone.

    Their shapes are (elevations, ROWS, COLUMNS, points, channels), and the same without channels. side: of the viewer's
    plane, 1 or -1.
    """
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
    """The probabilities of the cells, (ELEVATIONS, CELLS), which add up to 1 for each elevation.

    In proportion to the root mean square of the light in a cell, they would minimise the variance of the albedo. They
    are raised where the brightest light near a cell asks for it (NEIGHBOUR), which bounds the weights of samples.
    """
    # A table is also used for elevations between its own and the next, so these are evaluated, too.
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
    # Where a viewer gets no light at all, the cosine alone.
    glossy = np.where(total > 0, bounded / _positive(total), even)
    return ((1 - DIFFUSE) * glossy + DIFFUSE * even).reshape(ELEVATIONS, CELLS)


def _positive(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values as divisors: 1 in the place of 0."""
    return np.where(values > 0, values, 1.0)


def _alias_table(p: NDArray[np.float64]) -> NDArray[np.uint32]:
    """The table of one elevation, (CELLS), for probabilities p (CELLS): see `HalfVectorSampler.table`.

    This is Vose's construction in whole slots, so that cells are drawn with exactly the probabilities that are stored.
    Every cell has at least the probability 1 / WHOLE.
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
