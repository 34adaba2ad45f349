"""The sampler of a factored BRDF: Lawrence, Rusinkiewicz & Ramamoorthi 2004.

First a lobe and one of its terms are drawn, with probabilities that depend on F(θ_o). Then θ_h is drawn from the term's
u and φ_h from its v, which are taken to be constant over their intervals. The viewer's direction, mirrored about that
half vector, is the direction to the light. A BRDF that is not factored is factored first.

Our addition: a small share of directions follows the cosine, since factors may be 0 where the material is not. As in
their paper, half vectors that mirror the viewer below the horizon are drawn, but give no light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..factored.fit import FactorOptions, factor
from ..factored.material import (
    COLUMNS,
    ELEVATIONS,
    ROWS,
    UPRIGHT,
    FactoredBrdf,
    between_middles,
    column_of,
    elevation_of,
    half_from_viewer,
    row_of,
)
from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import TWO_PI
from .sampler import PI, Sampler
from .tables import cumulative, inverted

FEW = FactorOptions(4, 2)  # for sampling alone: more terms cost more time than they save (docs/sampling.md)
DIFFUSE = 0.01  # share of directions that follow the cosine, as in `half_vector`


@dataclass(frozen=True)
class LawrenceSampler(Sampler):
    """Draws half vectors from the terms of a factored BRDF. A term's probability is its lobe's share times its mass.

    share: of each lobe at each elevation of the viewer, (ELEVATIONS, J); the probabilities add up to 1.
    mass: of each term, its integral over half vectors, relative to all, (J · K).
    terms: the CDF of the terms for each elevation, (ELEVATIONS, J · K + 1).
    rows, columns: the CDFs of θ_h's rows and φ_h's columns, (J · K, ROWS + 1) and (J · K, COLUMNS + 1).
    """

    brdf: Brdf
    share: NDArray[np.float32]
    mass: NDArray[np.float32]
    terms: NDArray[np.float32]
    rows: NDArray[np.float32]
    columns: NDArray[np.float32]
    name = "lawrence"

    @classmethod
    def fitted(cls, brdf: Brdf) -> LawrenceSampler:
        """The sampler of a BRDF, which is factored first if need be. Raises the errors of `factor`."""
        return cls.of(brdf, brdf if isinstance(brdf, FactoredBrdf) else factor(brdf, FEW))

    @classmethod
    def of(cls, brdf: Brdf, factored: FactoredBrdf) -> LawrenceSampler:
        """The sampler for a BRDF that draws from a factored form of it."""
        u, v = (part.astype(np.float64).reshape(len(part), -1).T for part in (factored.rows, factored.columns))
        bands = _bands()
        mass = factored.scale.reshape(-1).astype(np.float64) * (u @ bands) * v.sum(axis=1)
        mass = mass / mass.sum() if mass.any() else np.full_like(mass, 1 / len(mass))
        lobes = factored.lobes.astype(np.float64).mean(axis=-1)
        black = ~(lobes.repeat(factored.terms[1], axis=1) * mass).any(axis=1, keepdims=True)
        share: NDArray[np.float64] = np.where(black, 1.0, lobes)
        each = share.repeat(factored.terms[1], axis=1) * mass
        share /= each.sum(axis=1, keepdims=True)
        return cls(
            brdf,
            share.astype(np.float32),
            mass.astype(np.float32),
            cumulative(each, mass, 0.0),
            cumulative(u * bands, bands / bands.sum(), 0.0),
            cumulative(v, np.full(COLUMNS, 1 / COLUMNS), 0.0),
        )

    def buffers(self) -> dict[str, NDArray[Any]]:
        # The factors of `density`: for each interval and each term, the probability per solid angle.
        per_row = np.diff(self.rows).T / _bands()[:, None] * self.mass
        flat = {"share": self.share, "terms": self.terms, "rows": self.rows, "columns": self.columns}
        flat |= {"per_row": per_row.astype(np.float32), "per_column": np.diff(self.columns).T}
        return {name: values.reshape(-1) for name, values in flat.items()}

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        f = ops(wo[0])
        diffuse = u[0] < DIFFUSE
        again = f.maximum(u[0] - DIFFUSE, 0.0) * (1 / (1 - DIFFUSE))
        first, t = between_middles(elevation_of(wo), ELEVATIONS)
        second = again < t
        again = f.where(second, again, again - t) / f.where(second, t, 1.0 - t)
        count = len(self.mass)
        term, _, _ = inverted(buffers["terms"], f.where(second, first + 1, first) * (count + 1), count, again)
        side = 2.0 * u[2] - 1.0
        row, down, _ = inverted(buffers["rows"], term * (ROWS + 1), ROWS, u[1])
        column, along, _ = inverted(buffers["columns"], term * (COLUMNS + 1), COLUMNS, abs(side))
        top, bottom = _height(1.0 * row), _height(row + 1.0)
        height = top + down * (bottom - top)
        sin, cos = 2.0 * f.sqrt(height * (1.0 - height)), 1.0 - 2.0 * height
        phi = (column + along) * (PI / COLUMNS)
        x, y = sin * f.cos(phi), f.where(side < 0.0, -sin, sin) * f.sin(phi)
        wx, wy = wo[0] + UPRIGHT, wo[1]
        scale = 1.0 / f.sqrt(wx * wx + wy * wy)
        h = (x * wx - y * wy) * scale, (x * wy + y * wx) * scale, cos
        twice = 2.0 * (h[0] * wo[0] + h[1] * wo[1] + h[2] * wo[2])
        radius = f.sqrt(u[1])
        around = radius * f.cos(TWO_PI * u[2]), radius * f.sin(TWO_PI * u[2]), f.sqrt(1.0 - u[1])
        wi = tuple(f.where(diffuse, a, twice * b - c) for a, b, c in zip(around, h, wo, strict=True))
        return wi, self.density(wi, wo, buffers)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        f = ops(wi[0])
        above = (wi[2] > 0.0) & (wo[2] > 0.0)
        theta_h, phi_h = half_from_viewer(wi, wo)
        row = f.bin(row_of(theta_h), ROWS)
        column = f.bin(column_of(phi_h), COLUMNS)
        node, t = between_middles(elevation_of(wo), ELEVATIONS)
        count, lobes = len(self.mass), self.share.shape[1]
        total = 0.0 * t
        for j in range(lobes):
            g = 0.0
            for jk in range(j * (count // lobes), (j + 1) * (count // lobes)):
                per_row = f.gather(buffers["per_row"], row * count + jk)
                g = g + per_row * f.gather(buffers["per_column"], column * count + jk)
            here, next_ = (f.gather(buffers["share"], (node + step) * lobes + j) for step in (0, 1))
            total = total + g * (here + t * (next_ - here))
        hx, hy, hz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
        length = f.where(above, f.sqrt(hx * hx + hy * hy + hz * hz), 1.0)
        # dω_h = dω_i / (4 cos θ_d), and cos θ_d = |ω_i + ω_o| / 2.
        return f.where(above, (1 - DIFFUSE) * total / (2.0 * length) + DIFFUSE * (wi[2] / PI), 0.0)


def _bands() -> NDArray[np.float64]:
    """The solid angle of a cell of each row: of its two halves, to both sides of the viewer, together."""
    return 2 * np.diff(_height(np.arange(ROWS + 1.0))) * (TWO_PI / COLUMNS)


def _height(row: Array) -> Array:
    """sin² (θ_h / 2) at a place on the axis of rows."""
    sin = ops(row).sin((row * row) * (PI / 4 / ROWS**2))
    return sin * sin
