"""How far two tables are apart, cell by cell; and how far a BRDF is from reciprocal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import Triple
from .cells import Lattice
from .half_diff import directions

LOG_FLOOR = 1e-3  # [1/sr]: reflectances well below it count as black in the log error


QUADRATURE = Lattice(45, 30, 36)  # of the asymmetry


@dataclass(frozen=True)
class TableMetrics:
    """Distances between two tables over their cells above the horizon, all channels together.

    rmse: root of the mean squared difference [1/sr].
    log_error_cosine: root of the mean squared difference of log(f_r + 0.001), each cell weighted by its solid angles
        times cos θ_i cos θ_o: an error over the hemisphere and not over bins.
    relative_error: ‖candidate - reference‖ / ‖reference‖ (L2).
    """

    rmse: float
    log_error_cosine: float
    relative_error: float


def table_metrics(reference: NDArray[np.float64], candidate: NDArray[np.float64], lattice: Lattice) -> TableMetrics:
    """Compares f_r of two tables of shape `lattice.shape + (3,)`."""
    above = lattice.above_horizon
    cos_i, cos_o = lattice.cosines()
    weights = np.where(above, lattice.solid_angles() * cos_i * cos_o, 0.0)
    squared = energy = log_squared = 0.0
    for cells, weight, a, b in zip(above, weights, reference, candidate, strict=True):  # a slice of θ_h at a time
        squared += float(((b - a)[cells] ** 2).sum())
        energy += float((a[cells] ** 2).sum())
        log_difference = np.log(np.where(cells[..., None], (b + LOG_FLOOR) / (a + LOG_FLOOR), 1.0))
        log_squared += float((weight[..., None] * log_difference**2).sum())
    return TableMetrics(
        rmse=float(np.sqrt(squared / (3 * above.sum()))),
        log_error_cosine=float(np.sqrt(log_squared / (3 * weights.sum()))),
        relative_error=float(np.sqrt(squared / energy)),
    )


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
    """How far from reciprocal a BRDF is: ∬ |f(a, b) − f(b, a)| cos cos dω dω over the same integral of their mean,
    channels added. 0 for a reciprocal one, and for a black one.
    """
    weight = (QUADRATURE.solid_angles() * np.prod(QUADRATURE.cosines(), axis=0))[QUADRATURE.above_horizon]
    wi, wo = directions(*(angle[QUADRATURE.above_horizon] for angle in QUADRATURE.angles()))
    one, other = np.sum(f_r(wi, wo), axis=0), np.sum(f_r(wo, wi), axis=0)
    return float((weight * abs(one - other)).sum() / max((weight * (one + other) / 2).sum(), 1e-300))
