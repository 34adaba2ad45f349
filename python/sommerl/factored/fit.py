"""Factors a BRDF into products of small tables (Lawrence, Rusinkiewicz & Ramamoorthi 2004)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.gamut import without_negatives
from ..reflectance.half_diff import spherical
from ..reflectance.info import Counts
from ..reflectance.origin import source_of
from ..system.errors import OptionError
from ..system.optional import optional
from ..system.whole import make_whole
from .material import COLUMNS, ELEVATIONS, LEAST_COSINE, MOST, MOST_TERMS, PI, ROWS, FactoredBrdf

FIRST_ITERATIONS, ITERATIONS = 200, 100  # of the first factorisations at most, and of all factors together
BELOW = 0.01  # the weight of half vectors that mirror the viewer below the horizon
DARK = 1e-4  # of the largest value: darker rows and columns are not scaled up further
TINY = 1e-300  # added to divisors that may be 0

Matrix = NDArray[np.float64]
Progress = Callable[[int, int], None]  #: iterations done, iterations in all


@dataclass(frozen=True)
class FactorOptions:
    """lobes: J. terms: K, of each lobe. Raises OptionError for values out of range."""

    lobes: int = 16
    terms: int = 4

    def __post_init__(self) -> None:
        make_whole(self, "lobes", "terms")
        for name, value in vars(self).items():
            if not 1 <= value <= MOST:
                raise OptionError(f"{name}: expected 1 to {MOST}, found {value}")
        if self.lobes * self.terms > MOST_TERMS:
            raise OptionError(
                f"terms: expected at most {MOST_TERMS} for all lobes together, found {self.lobes * self.terms}"
            )


def factor(brdf: Brdf, options: FactorOptions | None = None, *, progress: Progress | None = None) -> FactoredBrdf:
    """Factors a BRDF, which is evaluated for 138,240 pairs of directions.

    As in Lawrence et al. (2004), the matrix of elevations by half vectors is factored first, and then each lobe's table
    of θ_h by φ_h. Rows and columns are scaled so that dark ones count, too. Our own addition are the iterations after
    that, which improve all factors together. Half vectors that mirror the viewer below the horizon are fitted to 0, so
    that samplers draw few of them, but with a small weight, since no evaluation reads them. Only light from one side of
    the viewer's plane is looked at: factors give the same for the other side, whatever the BRDF does there.

    progress: called with the iterations done and the iterations in all. Raises MissingDependencyError without
    scikit-learn.
    """
    options = options or FactorOptions()
    data, above, changed = _light(brdf)
    rows, columns = _scales(data)
    f, g = _nmf(data * rows * columns, options.lobes)
    f, g = f / rows, g / columns
    lobes = [_split(lobe, options.terms) for lobe in g.reshape(-1, ROWS, COLUMNS)]
    u, v = (np.stack(parts, axis=1) for parts in zip(*lobes, strict=True))
    f, u, v = _refined(data, np.where(above, 1.0, BELOW) * (rows * columns) ** 2, f, u, v, progress)
    tops = [part.max(axis=0) for part in (f, u, v)]
    f, u, v = (part / np.where(top > 0, top, 1.0) for part, top in zip((f, u, v), tops, strict=True))
    by_lobe = np.moveaxis(f.reshape(ELEVATIONS, 3, -1), 1, 2)
    scale = tops[0][:, None] * tops[1] * tops[2]
    material = FactoredBrdf(by_lobe, u, v, scale, name=brdf.name)
    material.source, material.changed = source_of(brdf), changed
    return material


def _light(brdf: Brdf) -> tuple[Matrix, NDArray[np.bool_], Counts]:
    """f_r max(cos θ_i, C) at the middles of all intervals, 0 where the light is below the horizon; whether the light is
    above it; and what had to be changed since factors hold no negative colours. The first two have the shape
    (ELEVATIONS · 3, ROWS · COLUMNS)."""
    theta_h = ((np.arange(ROWS) + 0.5) / ROWS) ** 2 * PI / 2
    phi_h = (np.arange(COLUMNS) + 0.5) / COLUMNS * PI
    theta_o = (np.arange(ELEVATIONS) + 0.5) / ELEVATIONS * PI / 2
    theta_o, theta_h, phi_h = np.broadcast_arrays(theta_o[:, None, None], theta_h[:, None], phi_h)
    h = np.stack(spherical(theta_h, phi_h), axis=-1)
    wo = np.stack(spherical(theta_o, np.zeros_like(theta_o)), axis=-1)
    wi = 2 * (h * wo).sum(axis=-1, keepdims=True) * h - wo
    given = brdf.eval(wi, wo) * np.maximum(wi[..., 2:], LEAST_COSINE)
    values = without_negatives(given)
    moved = np.abs(values - given).sum() / max(np.abs(given).sum(), TINY)
    changed = Counts(int((values != given).any(axis=-1).sum()), float(moved))
    shape = 3 * ELEVATIONS, ROWS * COLUMNS
    return np.moveaxis(values, -1, 1).reshape(shape), np.repeat(wi[..., 2] > 0, 3, axis=0).reshape(shape), changed


def _scales(data: Matrix) -> tuple[Matrix, Matrix]:
    """Factors that make the means of rows, and those of columns, about equal. They are finite even for black data."""
    least = DARK * data.max() or 1.0
    columns = 1 / np.maximum(data.mean(axis=0, keepdims=True), least)
    return 1 / np.maximum((data * columns).mean(axis=1, keepdims=True), DARK), columns


def _nmf(matrix: Matrix, rank: int) -> tuple[Matrix, Matrix]:
    """Non-negative factors (n, rank) and (rank, m) of a matrix (n, m)."""
    decomposition = optional("sklearn.decomposition", "scikit-learn", "factorisation", "fit")
    model = decomposition.NMF(rank, init="nndsvda", max_iter=FIRST_ITERATIONS, tol=1e-5, random_state=0)
    with warnings.catch_warnings():
        # It need not converge: `_refined` continues from its result.
        warnings.filterwarnings("ignore", "Maximum number of iterations")
        return model.fit_transform(matrix), model.components_


def _split(lobe: Matrix, terms: int) -> tuple[Matrix, Matrix]:
    """Factors one lobe's table into u (ROWS, K) and v (COLUMNS, K)."""
    scale = 1 / np.maximum(lobe.mean(axis=1, keepdims=True), DARK * lobe.mean() or 1.0)
    u, v = _nmf(lobe * scale, terms)
    return u / scale, v.T


def _refined(
    data: Matrix, weights: Matrix, f: Matrix, u: Matrix, v: Matrix, progress: Progress | None
) -> tuple[Matrix, Matrix, Matrix]:
    """Reduces the weighted squared error by multiplicative updates (Lee & Seung 2001) of each factor in turn."""
    target = weights * data

    def gradients(f: Matrix, u: Matrix, v: Matrix) -> tuple[Matrix, Matrix]:
        """The two parts of the gradient by G: of the data, and of the present factors; (J, ROWS, COLUMNS) each."""
        now = weights * (f @ _lobes(u, v))
        return (f.T @ target).reshape(-1, ROWS, COLUMNS), (f.T @ now).reshape(-1, ROWS, COLUMNS)

    for number in range(ITERATIONS):
        if progress:
            progress(number, ITERATIONS)
        g = _lobes(u, v)
        f = f * (target @ g.T) / ((weights * (f @ g)) @ g.T + TINY)
        up, down = gradients(f, u, v)
        u = u * np.einsum("jrc,cjk->rjk", up, v) / (np.einsum("jrc,cjk->rjk", down, v) + TINY)
        up, down = gradients(f, u, v)
        v = v * np.einsum("jrc,rjk->cjk", up, u) / (np.einsum("jrc,rjk->cjk", down, u) + TINY)
    return f, u, v


def _lobes(u: Matrix, v: Matrix) -> Matrix:
    """The lobes G, (J, ROWS · COLUMNS)."""
    return np.einsum("rjk,cjk->jrc", u, v).reshape(u.shape[1], -1)
