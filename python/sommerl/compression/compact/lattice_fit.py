"""Fits a lattice of nodes to a material: `lattice_choice` chooses where the nodes go, `source` what they hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...reflectance.brdf import Brdf
from ...system.errors import MaterialError
from ..smrl.shared import Shared
from .effort import USUAL, Effort
from .fitted_table import FittedTable
from .lattice_choice import LatticeChoice
from .quantise import Problem
from .source import FittedSource, folds_of

SAMPLED_LINES = 32  # that errors are measured on where the nodes are many


class Fitter:
    """Prepares a material once, and then fits lattices of any size to it.

    seed: of the lines and directions that are drawn. effort: how many there are. Raises MaterialError for a black
    material.
    """

    def __init__(self, brdf: Brdf, *, seed: int = 0, effort: Effort = USUAL) -> None:
        random = np.random.Generator(np.random.PCG64(seed))
        self._source = FittedSource(brdf, folds_of(brdf), random)
        self._choice = LatticeChoice([self._source], random, effort.lines)
        self._source.draw(effort.directions)

    @property
    def scale(self) -> float:
        """The usual size of f_r · `damped`, by which the values of nodes are divided."""
        return self._source.scale

    @property
    def folds(self) -> dict[str, bool]:
        """How the lattices fold φ_d, as `NodeLattice` takes it."""
        return self._source.folds

    def fit(self, nodes: int) -> FittedTable:
        """The material, not quantised, on a lattice of at most `nodes` nodes (and at least LEAST_SHARE of them).

        Raises MaterialError as `problem` does.
        """
        problem, brdf = self.problem(nodes), self._source.brdf
        return FittedTable(problem.lattice, problem.best, self.scale, signed=brdf.signed, name=brdf.name)

    def problem(self, nodes: int) -> Problem:
        """The least-squares problem on such a lattice, with its solution. Raises MaterialError if `nodes` is not from
        SMALLEST to LARGEST."""
        return self._source.problem(self._choice.lattice(nodes))


def fitted_to_samples(brdf: Brdf, nodes: int) -> FittedTable:
    """A material that was fitted to samples (`Brdf.samples`), on a lattice of its own of at most `nodes` nodes, not
    quantised: the samples are fitted by least squares, and `brdf` says what is between them.

    Raises MaterialError for a black material, and for one without samples.
    """
    random = np.random.Generator(np.random.PCG64(0))
    source = FittedSource(brdf, {"reciprocal": brdf.reciprocal, "mirrored": brdf.mirrored}, random)
    lattice = LatticeChoice([source], random, SAMPLED_LINES).lattice(nodes)
    return FittedTable(lattice, source.at_samples(lattice), source.scale, signed=brdf.signed, name=brdf.name)


class SharedFitter:
    """Fits the shared lattices of a library's file to a material: the one of the least error is taken.

    scale: as of `Fitter`. Raises MaterialError for a black material, and for one that no shared lattice can hold, since
    they fold φ_d as it does not allow.
    """

    def __init__(self, brdf: Brdf, shared: Shared, *, seed: int = 0, effort: Effort = USUAL) -> None:
        allowed = folds_of(brdf)
        fitting = [each for each in shared.lattices if all(allowed[name] or not on for name, on in each.folds.items())]
        if not fitting:
            raise MaterialError(f"{brdf.name}: none of the shared lattices can hold it, since they fold φ_d")
        # Lattices that fold φ_d alike are fitted to the same directions.
        sources: dict[tuple[bool, ...], FittedSource] = {}
        found: list[tuple[Problem, float]] = []
        for lattice in fitting:
            folds = tuple(lattice.folds.values())
            if folds not in sources:
                sources[folds] = FittedSource(brdf, lattice.folds, np.random.Generator(np.random.PCG64(seed)))
                sources[folds].prepare(effort.directions)
            found.append((sources[folds].problem(lattice), sources[folds].scale))
        problem, self.scale = min(found, key=lambda each: each[0].error)
        self._problem = replace(problem, prior=shared.prior)

    def problem(self, _: int) -> Problem:
        """The least-squares problem on that lattice, with its solution, whatever the number of nodes asked for."""
        return self._problem
