"""How far two tables are apart, cell by cell; and how far a BRDF is from reciprocal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Triple
from .cells import Lattice
from .half_diff import directions
from .metric import Metric, measured

LOG_FLOOR = 1e-3  # [1/sr]: reflectances well below it count as black in the log error
QUADRATURE = Lattice(45, 30, 36)  # of integrals over a BRDF: each pair of directions in one of both orders
# A BRDF that differs by less (`sidedness`, `asymmetry`) is taken for mirrored, or for reciprocal; between sides RGL's
# files differ by 10⁻⁵ at most, between orders by 4 % at least
SYMMETRIC = 1e-3

Values = NDArray[np.float64]
FormulaOfBuffers = Callable[[Triple, Triple, Mapping[str, Any]], Triple]  #: as `Brdf.f_r`


def table_metrics(reference: Values, candidate: Values, lattice: Lattice) -> dict[str, float]:
    """How far apart f_r of two tables is, by the keys of TABLE_METRICS: over their cells above the horizon, all
    channels together. Both have the shape `lattice.shape + (3,)`."""
    return measured(TABLE_METRICS, reference, candidate, lattice)


def rmse(reference: Values, candidate: Values, lattice: Lattice) -> float:
    """The root of the mean squared difference [1/sr]."""
    squared = _squared_difference(reference, candidate, lattice)
    return float(np.sqrt(squared / (3 * lattice.above_horizon.sum())))


def log_error_cosine(reference: Values, candidate: Values, lattice: Lattice) -> float:
    """The root of the mean squared difference of log(f_r + 0.001), each cell weighted by its solid angles times
    cos θ_i cos θ_o: an error over the hemisphere and not over bins."""
    above = lattice.above_horizon
    cos_i, cos_o = lattice.cosines()
    weights = np.where(above, lattice.solid_angles() * cos_i * cos_o, 0.0)
    log_squared = 0.0
    for cells, weight, a, b in zip(above, weights, reference, candidate, strict=True):  # a slice of θ_h at a time
        log_difference = np.log(np.where(cells[..., None], (b + LOG_FLOOR) / (a + LOG_FLOOR), 1.0))
        log_squared += float((weight[..., None] * log_difference**2).sum())
    return float(np.sqrt(log_squared / (3 * weights.sum())))


def relative_error(reference: Values, candidate: Values, lattice: Lattice) -> float:
    """‖candidate − reference‖ / ‖reference‖ (L2)."""
    squared = _squared_difference(reference, candidate, lattice)
    return float(np.sqrt(squared / _sum_of_squares(reference, lattice)))


def _squared_difference(reference: Values, candidate: Values, lattice: Lattice) -> float:
    return _sum_of_squares((b - a for a, b in zip(reference, candidate, strict=True)), lattice)


def _sum_of_squares(values: Iterable[Values], lattice: Lattice) -> float:
    """Over the cells above the horizon. values: (θ_d, φ_d, 3) of each slice of θ_h, so that little memory is taken."""
    return sum(float((part[cells] ** 2).sum()) for cells, part in zip(lattice.above_horizon, values, strict=True))


# What `table_metrics` measures. A value takes reference, candidate and lattice.
TABLE_METRICS: list[Metric] = [
    Metric("rmse", "table: RMSE [1/sr]", rmse, "{:.3g}".format),
    Metric("log_error_cosine", "table: log error, cosine-weighted", log_error_cosine, "{:.4f}".format),
    Metric("relative_error", "table: relative error", relative_error, "{:.3g}".format),
]


def energy_share(part: NDArray[np.float64], whole: NDArray[np.float64], lattice: Lattice) -> float:
    """∬ |part| cos cos dω dω over the same integral of |whole|: sums over the cells above the horizon of two tables of
    shape `lattice.shape + (3,)`, channels added; numbers that are not finite count as 0. 0 if `whole` is black.
    """
    weight = np.where(lattice.above_horizon, lattice.solid_angles() * np.prod(lattice.cosines(), axis=0), 0.0)
    largest = np.max(np.abs(whole), initial=0.0, where=np.isfinite(whole)) or 1.0  # squares of it have no place
    sums = [
        float((weight[..., None] * np.where(np.isfinite(values), np.abs(values) / largest, 0.0)).sum())
        for values in (part, whole)
    ]
    return sums[0] / sums[1] if sums[1] else 0.0


def asymmetry(f_r: Callable[[Triple, Triple], Triple]) -> float:
    """How far from reciprocal a BRDF is: ∬ |f(a, b) − f(b, a)| cos cos dω dω over the same integral of their mean's
    absolute value, channels added. 0 for a reciprocal one, and for a black one.
    """
    wi, wo, weight = _quadrature()
    one, other = np.sum(f_r(wi, wo), axis=0), np.sum(f_r(wo, wi), axis=0)
    return float((weight * abs(one - other)).sum() / max((weight * abs(one + other) / 2).sum(), 1e-300))


def sidedness(f_r: Callable[[Triple, Triple], Triple]) -> float:
    """How far a BRDF is from giving the same for light from both sides of the viewer's plane: as `asymmetry`, with both
    directions reflected in a plane through the normal instead of swapped.
    """
    wi, wo, weight = _quadrature()
    one, other = np.stack(f_r(wi, wo)), np.stack(f_r(*((x, -y, z) for x, y, z in (wi, wo))))
    return float((weight * abs(one - other)).sum() / max((weight * abs(one + other) / 2).sum(), 1e-300))


def negative_share(f_r: Callable[[Triple, Triple], Triple]) -> float:
    """The share of a BRDF's energy in channels that are negative: ∬ max(0, −f) cos cos dω dω over the same integral of
    |f|, channels added. 0 for a black one.
    """
    wi, wo, weight = _both_sides(f_r)
    values = np.stack(f_r(wi, wo))
    return float((weight * np.maximum(-values, 0.0)).sum() / max((weight * abs(values)).sum(), 1e-300))


def moved_share(before: FormulaOfBuffers, after: FormulaOfBuffers, buffers: Mapping[str, Any]) -> float:
    """How much energy a change of a BRDF moved: ∬ |after − before| cos cos dω dω over the same integral of |before|,
    channels added. 0 if it was black. buffers: what both read from.
    """
    wi, wo, weight = _both_sides(lambda wi, wo: before(wi, wo, buffers))
    first, second = (np.stack(f_r(wi, wo, buffers)) for f_r in (before, after))
    return float((weight * abs(second - first)).sum() / max((weight * abs(first)).sum(), 1e-300))


def _both_sides(f_r: Callable[[Triple, Triple], Triple]) -> tuple[Triple, Triple, Values]:
    """As `_quadrature`, whose pairs all have the light on the same side of the viewer's plane; where the BRDF differs
    between the sides, from both.
    """
    wi, wo, weight = _quadrature()
    if sidedness(f_r) < SYMMETRIC:
        return wi, wo, weight
    (x, y, z), (u, v, w) = ((np.tile(a, 2), np.concatenate([b, -b]), np.tile(c, 2)) for a, b, c in (wi, wo))
    return (x, y, z), (u, v, w), np.tile(weight, 2)


def _quadrature() -> tuple[Triple, Triple, Values]:
    """Pairs of directions above the horizon, and their solid angles times cosines."""
    weight = (QUADRATURE.solid_angles() * np.prod(QUADRATURE.cosines(), axis=0))[QUADRATURE.above_horizon]
    return *directions(*(angle[QUADRATURE.above_horizon] for angle in QUADRATURE.angles())), weight
