"""The error of a sum of lobes as a fit to samples of a material, with its exact derivatives.

Dr.Jit evaluates the lobes and their derivatives by the shapes in one compiled pass over the samples; the rest is linear
algebra. f_r is linear in the albedos. So for losses that are linear in f_r, the best albedos for given shapes are the
solution of a non-negative least-squares problem with one unknown for each lobe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.family import Angles, Family
from ..reflectance.arrays import Array, split
from ..reflectance.samples import Samples
from ..system.jit import drjit, float64
from ..system.optional import optional
from .loss import Domain
from .options import Loss

Matrix = NDArray[np.float64]

UNSEEN = 1e-12  # a lobe that is darker than this share of the brightest one, in all samples, gets the albedo 0
RANK = 1e-13  # eigenvalues below this share of the largest are taken for rounding errors
HEAVY = 1e6  # the weight of an equation that has to hold exactly


@dataclass(frozen=True)
class Value:
    """distance: the sum of squared differences divided by the sum of squared samples. by_albedos (lobes, 3), by_places:
    its derivatives by the albedos, and by the places of all shape parameters."""

    distance: float
    by_albedos: Matrix
    by_places: NDArray[np.float64]


class Objective:
    """The distance between samples and a sum of lobes of given families.

    In all methods, places are those of `Parameter.place`, lobe after lobe, and albedos have the shape (lobes, 3).
    """

    def __init__(self, families: Sequence[Family], samples: Samples, loss: Loss) -> None:
        self._dr: Any = drjit()
        self._float: Any = float64()
        self.families = families
        self.parameters = [p for family in families for p in family.parameters]
        self._domain = Domain(loss)
        self.linear = self._domain.linear
        wi, wo = (tuple(self._float(component.copy()) for component in split(w)) for w in (samples.wi, samples.wo))
        self._angles = a = Angles(wi, wo)
        # Computed once, not again for every lobe.
        self._dr.eval(a.cos_h, a.sin_h, a.tan2_h, a.theta_h, a.cos_d, a.along)
        self._owner = [lobe for lobe, family in enumerate(families) for _ in family.parameters]
        self._weight = self._domain.weight(a.cos_i)
        measured = [self._float(channel.copy()) * self._weight for channel in samples.f_r.T]
        self._target = [self._domain.mapped(m) for m in measured]
        self._dr.eval(self._target)
        targets = np.stack([t.numpy() for t in self._target])
        self._squared = float((targets**2).sum())
        lobes, shapes = len(families), len(self.parameters)
        # Rows: lobes; their derivatives; samples or, if the loss is not linear, factors of the derivatives.
        self._rows = np.empty((lobes + shapes + 3, len(samples.wi)))
        self._rows[-3:] = targets
        for lobe, family in enumerate(families):
            if not family.parameters:
                self._rows[lobe] = (family.lobe(a) * self._weight).numpy()

    @property
    def count(self) -> int:
        """The number of values that are compared: three for each sample."""
        return 3 * self._rows.shape[1]

    @property
    def scale(self) -> float:
        """The root mean square of the samples in the domain of the loss."""
        return sqrt(self._squared / self.count)

    def solved(self, places: NDArray[np.float64], most: float | None = None) -> tuple[Matrix, Value]:
        """The best albedos for given shapes, and the distance. Only for losses that are linear in f_r.

        No albedo is negative, and those of a channel add up to at most `most`. The derivative by the places already
        includes that the best albedos change with them: at their optimum, this has no effect (the envelope theorem).
        """
        self._evaluate(places)
        moments, lobes = self._rows @ self._rows.T, len(self.families)
        albedos = least_squares(moments[:lobes, :lobes], moments[:lobes, -3:], most)
        return albedos, self._linear(moments, albedos)

    def value(self, places: NDArray[np.float64], albedos: Matrix) -> Value:
        """The distance for given shapes and albedos."""
        if self.linear:
            self._evaluate(places)
            return self._linear(self._rows @ self._rows.T, albedos)
        return self._non_linear(places, albedos)

    def first_albedos(self, places: NDArray[np.float64], most: float | None = None) -> Matrix:
        """The best albedos for given shapes if the loss is linearised at the samples: a start for the search."""
        self._evaluate(places)
        lobes = len(self.families)
        columns: list[Matrix] = []
        for target in self._target:
            measured = self._domain.unmapped(target)
            slope = self._domain.slope(measured)
            weighted = np.concatenate([self._rows[:lobes], [measured.numpy()]]) * slope.numpy()
            moments = weighted @ weighted.T
            columns.append(least_squares(moments[:lobes, :lobes], moments[:lobes, -1:], most))
        return np.concatenate(columns, axis=1)

    def error(self, places: NDArray[np.float64], albedos: Matrix) -> float:
        """The root mean square of the differences. They are added up one by one, so that it is exact even if samples
        and model agree to more than seven digits, where the distance has only rounding errors left."""
        modelled = self._modelled(places, albedos)
        differences = [self._domain.mapped(m) - t for m, t in zip(modelled, self._target, strict=True)]
        return sqrt(sum(float((d.numpy() ** 2).sum()) for d in differences) / self.count)

    def _linear(self, moments: Matrix, albedos: Matrix) -> Value:
        lobes, owner = len(self.families), self._owner
        gram, data = moments[:lobes, :lobes], moments[:lobes, -3:]
        by_albedos = 2 * (gram @ albedos - data)
        squared = float(np.sum(albedos * (gram @ albedos)) - 2 * np.sum(albedos * data)) + self._squared
        towards = moments[lobes:-3, :lobes] @ albedos - moments[lobes:-3, -3:]
        by_places = 2 * np.sum(albedos[owner] * towards, axis=1)
        return Value(max(squared, 0.0) / self._squared, by_albedos / self._squared, by_places / self._squared)

    def _non_linear(self, places: NDArray[np.float64], albedos: Matrix) -> Value:
        modelled = self._modelled(places, albedos)
        squared = 0.0
        differences = [self._domain.mapped(m) - t for m, t in zip(modelled, self._target, strict=True)]
        seeds = [d * self._domain.slope(m) for d, m in zip(differences, modelled, strict=True)]
        self._dr.eval(differences, seeds)
        for channel, (difference, seed) in enumerate(zip(differences, seeds, strict=True)):
            found = difference.numpy()
            squared += float(found @ found)
            self._rows[channel - 3] = seed.numpy()
        lobes = len(self.families)
        moments = self._rows[:-3] @ self._rows[-3:].T
        by_places = 2 * np.sum(albedos[self._owner] * moments[lobes:], axis=1)
        return Value(squared / self._squared, 2 * moments[:lobes] / self._squared, by_places / self._squared)

    def _modelled(self, places: NDArray[np.float64], albedos: Matrix) -> list[Array]:
        """The sum of the lobes, times the weight (cos θ_i or 1): one array for each channel."""
        lobes = self._evaluate(places)
        known = [self._float(row) if lobe is None else lobe for lobe, row in zip(lobes, self._rows, strict=False)]
        opaque = [[self._float([albedo]) for albedo in column] for column in albedos.T]
        self._dr.make_opaque(opaque)
        return [sum((a * s for a, s in zip(column, known, strict=True)), start=self._float(0.0)) for column in opaque]

    def _evaluate(self, places: NDArray[np.float64]) -> list[Any]:
        """Fills the rows of lobes and derivatives; returns the lobes, and None for those without parameters."""
        dr = self._dr
        found: list[Any] = []
        derivatives: list[Any] = []
        remaining = list(places)
        for family in self.families:
            mine, remaining = remaining[: len(family.parameters)], remaining[len(family.parameters) :]
            value = None
            for chosen in range(len(mine)):
                at = [self._float([place]) for place in mine]
                dr.make_opaque(at)  # so that all places use the same compiled kernel
                dr.enable_grad(at[chosen])
                shape = [p.at(place) for p, place in zip(family.parameters, at, strict=True)]
                lobe = family.lobe(self._angles, *shape) * self._weight
                dr.set_grad(at[chosen], 1.0)
                dr.forward_to(lobe)
                derivatives.append(dr.grad(lobe))
                value = dr.detach(lobe)
            found.append(value)
        dr.eval(found, derivatives)
        for row, values in enumerate([*found, *derivatives]):
            if values is not None:
                self._rows[row] = values.numpy()
        return found


def least_squares(gram: Matrix, data: Matrix, most: float | None) -> Matrix:
    """The x ≥ 0, (n, m), that minimises xᵀ gram x − 2 dataᵀ x for each column, with Σ x ≤ `most` unless that is None.

    gram: AᵀA (n, n). data: Aᵀb (n, m).
    """
    nnls = optional("scipy.optimize", "SciPy", "fitting", "fit").nnls
    length = np.sqrt(np.diag(gram))
    seen = length > UNSEEN * length.max()
    scale = np.divide(1.0, length, out=np.zeros_like(length), where=seen)
    values, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    used = values > RANK * values[-1]
    root = (np.sqrt(values[used]) * vectors[:, used]).T
    right = (vectors[:, used] / np.sqrt(values[used])).T @ (data * scale[:, None])
    found = np.stack([nnls(root, column)[0] for column in right.T], axis=1) * scale[:, None]
    if most is not None:
        for channel in np.flatnonzero(found.sum(axis=0) > most):
            # One more equation, Σ x = most, with a weight that makes it hold exactly, whatever the units are.
            size = np.linalg.norm(right[:, channel]) * scale
            exact = np.vstack([root, HEAVY * size / size.max()])
            target = np.append(right[:, channel] / np.linalg.norm(right[:, channel]), HEAVY * most / size.max())
            found[:, channel] = nnls(exact, target)[0] * size
            found[:, channel] *= min(1.0, most / found[:, channel].sum())
    return found
