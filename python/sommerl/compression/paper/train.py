"""Training: from a table to a SOM-MAN material, as in the paper (Kurt & Cinsdikici 2008, §4)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.brdf import Brdf
from ...reflectance.table import BrdfTable
from ...system.errors import MaterialError
from ..material import SomManBrdf
from .options import TrainOptions
from .reference import EMPTY, squared_distance

ALPHA_DECAY = 0.6  # Eq. 7
COMPARISONS_A_CALL = 2**26  # so that a call into the core ends within a fraction of a second

Progress = Callable[[int, int], None]  #: cells presented so far, cells in all


@dataclass(frozen=True)
class TrainReport:
    """How training went.

    quantisation_error: for each epoch, the mean distance of the cells presented to their winners' weights, in units of
        the table's largest value.
    units_dropped: units that never won, and are not in the LUT.
    seconds: wall-clock time.
    cells_clamped, energy_clamped, energy_averaged: what the table had to change in the source (`info.Counts`).

    >>> _, report = sommerl.train(sommerl.load_table("nickel"), sommerl.TrainOptions(clusters=16, epochs=2))
    >>> len(report.quantisation_error), report.units_dropped
    (2, 0)
    """

    quantisation_error: list[float]
    units_dropped: int
    seconds: float
    cells_clamped: int | None
    energy_clamped: float | None
    energy_averaged: float | None


def train(
    source: Brdf, options: TrainOptions | None = None, *, progress: Progress | None = None, kernels: Any = _core
) -> tuple[SomManBrdf, TrainReport]:
    """Compresses a table, or any other BRDF as `BrdfTable.of` samples it: the material, and a report.

    The result depends on the table and the options alone. kernels: `sommerl._core`, or `compression.paper.reference`,
    which gives the same bits slowly. Raises MaterialError if the table has fewer distinct colours than
    `options.clusters`.

    >>> material, report = train(sommerl.load_table("nickel"), sommerl.TrainOptions(clusters=16, epochs=1))
    >>> material.eval([0, 0, 1], [0, 0, 1]).shape
    (3,)
    """
    options = options or TrainOptions()
    started = time.perf_counter()
    table = BrdfTable.of(source)
    above = table.lattice.above_horizon
    rgb = table.values[above]
    x = (rgb / rgb.max()).astype(np.float32)
    order, weights = _start(x, options, table.name)
    learner = kernels.Learner(x[order], order, weights, options.rule, _columns(options), distinct=options.distinct)
    errors = _learn(learner, len(x), options, progress)

    cells = _lut_cells(learner.weights(), learner.stored_cells(), x)
    # By brightness: like entries get like numbers, which makes the index smooth and its file small.
    cells = cells[np.argsort((rgb[cells, 0] + rgb[cells, 1]) + rgb[cells, 2], kind="stable")]
    index = np.zeros(table.lattice.shape, np.uint8 if len(cells) <= 256 else np.uint16)
    quantiser = kernels.Quantiser(x[cells])
    index[above] = np.concatenate([quantiser.query(x[start:stop]) for start, stop in _calls(len(x), len(cells))])
    material = SomManBrdf(
        rgb[cells],
        index,
        table.lattice,
        name=table.name,
        options=options.noted(),
        source_sha256=table.source.sha256,
        made_from=table.source.made_from,
    )
    dropped = options.clusters - len(cells)
    return material, TrainReport(errors, dropped, time.perf_counter() - started, **asdict(table.counts))


def _start(x: NDArray[np.float32], options: TrainOptions, name: str) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """The order of presentation, and M distinct triples as first weights.

    Both permutations sort raw output of a bit generator, whose stream, unlike NumPy's own shuffles, never changes.
    """
    raw = np.random.PCG64(options.seed).random_raw(2 * len(x))
    order = np.argsort(raw[: len(x)], kind="stable") if options.order == "seeded" else np.arange(len(x))
    taken = 4 * options.clusters
    while True:
        few = np.argpartition(raw[len(x) :], min(taken, len(x)) - 1)[:taken]
        drawn = x[few[np.argsort(raw[len(x) :][few], kind="stable")]]
        _, first = np.unique(drawn, axis=0, return_index=True)
        if len(first) >= options.clusters:
            return order.astype(np.uint32), drawn[np.sort(first)[: options.clusters]]
        if taken >= len(x):
            raise MaterialError(
                f"{name}: expected at least {options.clusters} distinct colours, one a cluster, found {len(first)}"
            )
        taken *= 4


def _columns(options: TrainOptions) -> int:
    return options.clusters if options.topology == "chain" else math.isqrt(options.clusters - 1) + 1


def _falloff(sigma: float) -> NDArray[np.float32]:
    """Gaussian weights by distance in units, down to 2^-16; [1] for sigma = 0.

    They are rounded to multiples of 2^-16, so that the last bit of a machine's exponential does not matter.
    """
    weights = [1.0]
    while sigma > 0 and (weight := round(math.exp(-0.5 * (len(weights) / sigma) ** 2) * 2**16) / 2**16) > 0:
        weights.append(weight)
    return np.array(weights, np.float32)


def _learn(learner: Any, cells: int, options: TrainOptions, progress: Progress | None) -> list[float]:
    """Presents all cells in every epoch, and returns the quantisation error of each epoch.

    Once an epoch changes nothing, neither would the later ones: training ends, and its error stands for theirs.
    """
    alpha = np.float32(options.alpha)
    errors: list[float] = []
    for epoch in range(options.epochs):
        falloff = _falloff(options.radius * ALPHA_DECAY**epoch)
        total = 0.0
        for start, stop in _calls(cells, options.clusters):
            total += learner.present(start, stop, float(alpha), falloff)
            if progress:
                progress(epoch * cells + stop, options.epochs * cells)
        errors.append(total / cells)
        if learner.settled():
            break
        alpha = alpha * np.float32(ALPHA_DECAY)
    return errors + errors[-1:] * (options.epochs - len(errors))


def _calls(cells: int, entries: int) -> list[tuple[int, int]]:
    """Ranges of cells, each small enough that comparing it with all entries cannot hold up an interruption."""
    chunk = max(1, COMPARISONS_A_CALL // entries)
    return [(start, min(start + chunk, cells)) for start in range(0, cells, chunk)]


def _lut_cells(weights: NDArray[np.float32], stored: NDArray[np.uint32], x: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The cell of each unit's stored original nearest to its weight, for units that ever won (§4.3)."""
    won = stored[:, 0] != EMPTY
    weights, stored = weights[won], stored[won]
    filled = stored != EMPTY
    originals = x[np.where(filled, stored, 0)]
    distance = np.where(filled, squared_distance(originals, weights[:, None]), np.float32(np.inf))
    return stored[np.arange(len(stored)), distance.argmin(axis=1)]
