"""The factored BRDF: sums of products of small tables.

Lawrence, Rusinkiewicz & Ramamoorthi 2004, "Efficient BRDF Importance Sampling Using a Factored Representation". With
the half vector's angles θ_h and φ_h, where φ_h is counted from the viewer's azimuth, to either side,

    f_r max(cos θ_i, C) = Σ_j F_j(θ_o) G_j(θ_h, φ_h),   G_j = Σ_k u_jk(θ_h) v_jk(φ_h)

F is different for each channel, G is not. Without the bound C, an evaluation next to the horizon would divide by a
cosine of nearly 0, and enlarge the error of the fit. This representation is not reciprocal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, Triple, gather3, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.distance import asymmetry
from ..reflectance.info import Counts
from ..reflectance.origin import Source
from ..system.errors import MaterialError

ELEVATIONS = 32  # intervals of θ_o, of equal size
ROWS, COLUMNS = 90, 48  # intervals of θ_h, equal in √θ_h as MERL's bins are; of φ_h, equal, over half of the circle
LEAST_COSINE = 0.03  # C
UPRIGHT = 1e-9  # added to lengths along x, so that the azimuth of the normal itself is defined
PI = np.pi
MOST, MOST_TERMS = 32, 256  # of lobes, and of terms of a lobe; of terms of all lobes, which a lookup all reads
LARGEST_SCALE = 1e30  # renderers calculate in single precision


class FactoredBrdf(Brdf):
    """A BRDF of J lobes with K terms each.

    lobes: F, shape (ELEVATIONS, J, 3). rows: u, (ROWS, J, K). columns: v, (COLUMNS, J, K). All are from 0 to 1, and
        kept in half precision, as a file holds them. A value belongs to the middle of its interval; between middles
        they are interpolated linearly.
    scale: a factor for each term [1/sr], (J, K). changed: in the source, of what was just factored; no file keeps it.
        Its `cells_clamped` counts pairs of directions, and its `energy_clamped` is a share of f_r max(cos θ_i, C), each
        pair of the fit counted alike.
    """

    kind = "factored"
    compressed = True

    def __init__(
        self,
        lobes: NDArray[Any],
        rows: NDArray[Any],
        columns: NDArray[Any],
        scale: NDArray[Any],
        *,
        name: str = "",
        source_sha256: str = "",
    ) -> None:
        """Raises MaterialError for shapes that do not fit together, and for values out of range."""
        terms = scale.shape
        shapes = (ELEVATIONS, *terms[:1], 3), (ROWS, *terms), (COLUMNS, *terms)
        if len(terms) != 2 or 0 in terms or (lobes.shape, rows.shape, columns.shape) != shapes:
            found = ", ".join(str(part.shape) for part in (lobes, rows, columns, scale))
            raise MaterialError(f"factors: their shapes do not fit together: {found}")
        if not all(((part >= 0) & (part <= 1)).all() for part in (lobes, rows, columns)):
            raise MaterialError("factors: expected values from 0 to 1, found others")
        if max(terms) > MOST or scale.size > MOST_TERMS:
            raise MaterialError(f"factors: expected at most {MOST} × {MOST} and {MOST_TERMS} terms, found {terms}")
        if not ((scale >= 0) & (scale <= LARGEST_SCALE)).all():
            raise MaterialError(f"factors: expected scales from 0 to {LARGEST_SCALE:g}, found others")
        self.name, self.source, self.changed = name, Source(source_sha256), Counts()
        self.lobes, self.rows, self.columns = (part.astype(np.float16) for part in (lobes, rows, columns))
        self.scale = scale.astype(np.float32)

    @property
    def reciprocal(self) -> bool:
        return False

    @property
    def mirrored(self) -> bool:
        return True

    @property
    def counts(self) -> Counts:
        return self.changed

    @property
    def terms(self) -> tuple[int, int]:
        """J and K."""
        lobes, terms = self.scale.shape
        return lobes, terms

    @property
    def facts(self) -> dict[str, Any]:
        """How far from reciprocal it is: see `distance.asymmetry`."""
        buffers = self.buffers()
        return {"asymmetry": asymmetry(lambda wi, wo: self.f_r(wi, wo, buffers))}

    @property
    def lookup(self) -> str:
        return "factored"

    def details(self) -> dict[str, Any]:
        return {"terms": list(self.terms)}

    def buffers(self) -> dict[str, NDArray[Any]]:
        rows = self.rows * self.scale
        return {
            name: np.asarray(values, np.float32).reshape(-1)
            for name, values in (("lobes", self.lobes), ("rows", rows), ("columns", self.columns))
        }

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        lobes, terms = self.terms
        f = ops(wi[0])
        theta_h, phi_h = half_from_viewer(wi, wo)
        row, row_t = between_middles(row_of(theta_h), ROWS)
        column, column_t = between_middles(column_of(phi_h), COLUMNS)
        node, t = between_middles(elevation_of(wo), ELEVATIONS)
        total = 0.0, 0.0, 0.0
        for j in range(lobes):
            g = 0.0
            for jk in range(j * terms, (j + 1) * terms):
                u = _lerp(f.gather, buffers["rows"], lobes * terms, row, row_t, jk)
                g = g + u * _lerp(f.gather, buffers["columns"], lobes * terms, column, column_t, jk)
            here, next_ = (gather3(buffers["lobes"], lobes * (node + step) + j) for step in (0, 1))
            total = tuple(sum_ + g * (a + t * (b - a)) for sum_, a, b in zip(total, here, next_, strict=True))
        share = 1.0 / f.maximum(wi[2], LEAST_COSINE)
        return total[0] * share, total[1] * share, total[2] * share


def half_from_viewer(wi: Triple, wo: Triple) -> tuple[Array, Array]:
    """θ_h, and φ_h measured from the viewer's azimuth to either side, from 0 to π [rad]."""
    f = ops(wi[0])
    hx, hy, hz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    x, y = wo[0] + UPRIGHT, wo[1]
    return f.atan2(f.sqrt(hx * hx + hy * hy), hz), f.atan2(abs(hy * x - hx * y), hx * x + hy * y)


def row_of(theta_h: Array) -> Array:
    """The place of θ_h among the rows, from 0 to ROWS."""
    return ops(theta_h).sqrt(theta_h * (2 / PI)) * ROWS


def column_of(phi_h: Array) -> Array:
    """The place of φ_h among the columns, from 0 to COLUMNS."""
    return phi_h * (COLUMNS / PI)


def elevation_of(wo: Triple) -> Array:
    """The place of θ_o among the intervals of the viewer's elevation, from 0 to ELEVATIONS."""
    f = ops(wo[0])
    return f.atan2(f.sqrt(wo[0] * wo[0] + wo[1] * wo[1]), wo[2]) * (2 / PI * ELEVATIONS)


def between_middles(place: Array, count: int) -> tuple[Array, Array]:
    """The first of the two neighbouring intervals whose middles a place lies between, and the share of the second."""
    f = ops(place)
    from_first = f.minimum(f.maximum(place - 0.5, 0.0), count - 1.0)
    first = f.bin(from_first, count - 1)
    return first, from_first - first


def _lerp(gather: Any, buffer: Any, stride: int, first: Array, t: Array, offset: int) -> Array:
    """Interpolates linearly between rows `first` and `first` + 1 of a flat table, in one of its `stride` columns."""
    a, b = (gather(buffer, stride * (first + step) + offset) for step in (0, 1))
    return a + t * (b - a)
