"""Matusik's sampler: a table of directions to the light for each elevation of the viewer.

Matusik 2003, "A Data-Driven Reflectance Model" (thesis, MIT), as Lawrence, Rusinkiewicz & Ramamoorthi 2004 describe it
in their section 2; we have not read the thesis itself. For each elevation, f_r cos θ_i sin θ_i (the mean of the
channels) is tabulated over θ_i and φ, and directions are drawn from the marginal distribution of θ_i and the
conditional distribution of φ. We have it for comparison: it follows any material closely, but is as large as one
channel of a measured table.

Two things are our own. We store only half of the circle in φ, since isotropic materials are taken to be symmetric about
the plane of the viewer. Within a cell, directions follow the cosine, so that weights are f_r at the direction divided
by f_r at the centre of the cell, up to the horizon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import spherical
from .sampler import PI, Sampler
from .tables import cumulative, inverted, probability

ELEVATIONS = 90  # of the viewer, one for each degree of θ_o, at its middle
ROWS, COLUMNS = 90, 180  # of a table: equal in θ_i, and in φ over half of the circle
HEIGHT, WIDTH = PI / 2 / ROWS, PI / COLUMNS  # of a cell [rad]
# The share of each distribution that follows the cosine, so that every direction can be drawn. The probability of a
# cell is then at least 50 units in the last place of a CDF in single precision.
FLOOR = 0.01
UPRIGHT = 1e-20  # for a smaller sin² θ_o, the viewer's azimuth is taken for 0


@dataclass(frozen=True)
class MatusikSampler(Sampler):
    """Draws directions to the light from a table for each elevation of the viewer. The tables take several megabytes.

    rows: cumulative probabilities of θ_i's rows, (ELEVATIONS, ROWS + 1), from 0 to 1.
    columns: those of φ's columns in each row, (ELEVATIONS, ROWS, COLUMNS + 1), from 0 to 1. φ is counted from the
        viewer's azimuth, to either side.
    """

    brdf: Brdf
    rows: NDArray[np.float32]
    columns: NDArray[np.float32]
    name = "matusik"

    @classmethod
    def fitted(cls, brdf: Brdf) -> MatusikSampler:
        """The sampler of a BRDF, which is evaluated for 1,458,000 pairs of directions."""
        light = np.stack([_light(brdf, (i + 0.5) * PI / 2 / ELEVATIONS) for i in range(ELEVATIONS)])
        even = np.full(COLUMNS, 1 / COLUMNS)
        return cls(brdf, cumulative(light.sum(axis=-1), _band(np.arange(ROWS)), FLOOR), cumulative(light, even, FLOOR))

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"rows": self.rows.reshape(-1), "columns": self.columns.reshape(-1)}

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        f = ops(wo[0])
        node = _elevation(wo)
        row, down, row_share = inverted(buffers["rows"], node * (ROWS + 1), ROWS, u[1])
        table = (node * ROWS + row) * (COLUMNS + 1)
        column, along, column_share = inverted(buffers["columns"], table, COLUMNS, u[2])
        theta, band = row * HEIGHT, _band(row)
        sin2, cos2 = f.sin(theta) ** 2 + down * band, f.cos(theta) ** 2 - down * band
        sin, cos = f.sqrt(sin2), f.sqrt(f.maximum(cos2, 0.0))
        phi = (column + along) * WIDTH
        x, y = sin * f.cos(phi), sin * f.sin(phi)
        y = f.where(u[0] < 0.5, -y, y)
        east, north = _azimuth(wo)
        wi = x * east - y * north, x * north + y * east, cos
        return wi, f.where((wo[2] > 0.0) & (cos > 0.0), _per_solid_angle(row_share * column_share, band, cos), 0.0)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        f = ops(wi[0])
        node = _elevation(wo)
        row = _bin(_polar(wi), HEIGHT, ROWS)
        east, north = _azimuth(wo)
        phi = f.atan2(abs(wi[1] * east - wi[0] * north), wi[0] * east + wi[1] * north)
        column = _bin(phi, WIDTH, COLUMNS)
        row_share = probability(buffers["rows"], node * (ROWS + 1) + row)
        column_share = probability(buffers["columns"], (node * ROWS + row) * (COLUMNS + 1) + column)
        pdf = _per_solid_angle(row_share * column_share, _band(row), wi[2])
        return f.where((wi[2] > 0.0) & (wo[2] > 0.0), pdf, 0.0)


def _polar(w: Triple) -> Array:
    """The angle from the normal [rad]."""
    f = ops(w[0])
    return f.atan2(f.sqrt(w[0] * w[0] + w[1] * w[1]), w[2])


def _bin(x: Array, width: float, count: int) -> Array:
    """The number of the bin that holds x, or of the last bin if x is beyond it."""
    f = ops(x)
    return f.bin(x * (1 / width), count)


def _elevation(wo: Triple) -> Array:
    """The number of the viewer's table."""
    return _bin(_polar(wo), PI / 2 / ELEVATIONS, ELEVATIONS)


def _azimuth(wo: Triple) -> tuple[Array, Array]:
    """Cosine and sine of the viewer's azimuth."""
    f = ops(wo[0])
    sin2 = wo[0] * wo[0] + wo[1] * wo[1]
    upright = sin2 < UPRIGHT
    sin = f.sqrt(f.where(upright, 1.0, sin2))
    return f.where(upright, 1.0, wo[0] / sin), f.where(upright, 0.0, wo[1] / sin)


def _band(row: Array) -> Array:
    """∫ 2 sin θ cos θ dθ over a row, which is sin² θ at its end minus sin² θ at its start. All rows add up to 1."""
    return math.sin(HEIGHT) * ops(row * HEIGHT).sin((2 * row + 1) * HEIGHT)


def _per_solid_angle(share: Array, band: Array, cos: Array) -> Array:
    """The density [1/sr] of directions that follow the cosine in a cell. share: the cell's probability."""
    return share * cos / (band * WIDTH)


def _light(brdf: Brdf, theta_o: float) -> NDArray[np.float64]:
    """The reflected light of each cell for one elevation of the viewer, (ROWS, COLUMNS), up to a constant factor."""
    theta, phi = (np.arange(ROWS) + 0.5) * HEIGHT, (np.arange(COLUMNS) + 0.5) * WIDTH
    wi = np.stack(spherical(*np.broadcast_arrays(theta[:, None], phi)), axis=-1)
    f_r = brdf.eval(wi, np.array(spherical(np.float64(theta_o), np.float64(0.0))))
    return np.maximum(f_r.mean(axis=-1), 0.0) * _band(np.arange(ROWS))[:, None]
