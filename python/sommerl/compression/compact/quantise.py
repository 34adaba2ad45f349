"""The compact preset's palette and indices: from values at the nodes of a fitted lattice to gains, shapes and entries.

A node's value is gain · shape, the shape's mean 1. The SOM trains both palettes, and the MAN puts values of the source
into them. From there the palettes are refined by turns: each node takes the entries that cost the least in error and
bits, seeing what its neighbours left over; then each entry takes the value that is best for the nodes that use it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.nodes import NodeLattice
from ...system.errors import MaterialError
from ...system.optional import optional
from ..paper.reference import EMPTY
from ..smrl.codes import Codes, Floats, coordinates, gain_codes, gain_values, shape_codes, shape_values

SOM_EPOCHS, SOM_ALPHA = 20, 0.3
PRESENTATIONS = 20  # of each unit in an epoch, at least
PRIOR = 1e-3  # how firmly an entry holds to its value, of the curvature of its error
STEER = 2.5  # how strongly the price of a bit follows the size
TURNS, LAST_TURNS = 10, 8

Start = Literal["som", "k-means"]


@dataclass(frozen=True)
class Problem:
    """The error of values z at a lattice's nodes, for each channel zᵀ H z − 2 bᵀ z + constant, and where it is least.

    system: H, a sparse matrix by rows. right: b, (nodes, 3). best: (nodes, 3). error: that of `best`.
    """

    lattice: NodeLattice
    system: Any
    right: Floats
    best: Floats
    error: float

    def excess(self, values: Floats) -> float:
        """How much more the error of other values is."""
        away = values - self.best
        return float((away * (self.system @ away)).sum())


@dataclass(frozen=True)
class Quantised:
    """Codes of gains (increasing) and shapes (n, 2), and the entry of each node."""

    gains: Codes
    shapes: Codes
    gain_index: NDArray[np.uint16]
    shape_index: NDArray[np.uint16]

    def values(self) -> Floats:
        """What the nodes hold, (nodes, 3)."""
        return gain_values(self.gains)[self.gain_index][:, None] * shape_values(self.shapes)[self.shape_index]

    def palette(self, lattice: NodeLattice) -> Any:
        return _core.NodePalette(*lattice.axes(), self.gains.tolist(), self.shapes.tolist())

    def ordered(self) -> Quantised:
        """The same without entries that no node uses, or that are the same, in the order in which they are written."""
        gains, gain_index = np.unique(self.gains[self.gain_index], return_inverse=True)
        shapes, shape_index = np.unique(self.shapes[self.shape_index], axis=0, return_inverse=True)
        return Quantised(gains, shapes, gain_index.astype(np.uint16), shape_index.reshape(-1).astype(np.uint16))


def quantise(
    problem: Problem, gains: int, shapes: int, target: int, *, seed: int = 0, start: Start = "som", refine: bool = True
) -> tuple[Quantised, bytes]:
    """The entries whose error is least in a stream of at most `target` bytes, and the stream.

    gains, shapes: the most entries of the palettes. refine: False keeps the MAN's values, those of the source.
    The stream may be longer than `target` if nothing shorter is found.
    """
    quantised = _first(problem, gains, shapes, seed, start)
    price = 0.3 * problem.error / len(problem.best)
    found: list[tuple[float, Quantised, bytes]] = []
    shortest = quantised, b"\0" * 2**24
    for turn in range(TURNS + LAST_TURNS):
        if refine and turn:
            quantised = _refined(problem, quantised)
        quantised = _swept(problem, quantised.ordered(), price)
        ordered = quantised.ordered()
        palette = ordered.palette(problem.lattice)
        if turn < TURNS:
            size = sum(palette.measure(ordered.gain_index, ordered.shape_index)) / 8
        else:
            try:
                stream = palette.encode(ordered.gain_index, ordered.shape_index)
            except ValueError as error:  # it would keep readers busy for too long
                raise MaterialError(str(error)) from error
            size = len(stream)
            if size <= target:
                found.append((problem.excess(ordered.values()), ordered, stream))
            if size < len(shortest[1]):
                shortest = ordered, stream
        price *= float(np.clip((size / (0.997 * target)) ** STEER, 0.3, 3.0)) if turn else 1.0
    return min(found, key=lambda each: each[0])[1:] if found else shortest


def _first(problem: Problem, gains: int, shapes: int, seed: int, start: Start) -> Quantised:
    """Palettes trained on the best values of the nodes, and the nearest entries."""
    values = np.maximum(problem.best, 0.0) + 1e-4
    gain = values.mean(axis=1)
    shape = values / gain[:, None]
    octaves = gain_codes(gain)[:, None] / (gain_codes(gain).max() + 1.0)
    places = coordinates(shape)
    low = places.min(axis=0)
    width = float((places - low).max()) + 1e-9
    weight = np.sqrt(problem.system.diagonal() * gain**2)
    train = _som if start == "som" else _k_means
    nodes = len(values)
    gain_cells = train(octaves, np.ones(nodes), min(gains, nodes // 4), seed)
    shape_cells = train((places - low) / width, weight / weight.mean() + 1e-3, min(shapes, nodes // 8), seed)
    gain_lut, shape_lut = gain_codes(gain[gain_cells]), shape_codes(places[shape_cells])
    gain_index = _nearest(gain_codes(gain)[:, None], gain_lut[:, None])
    shape_index = _nearest(shape_codes(places), shape_lut)
    return Quantised(gain_lut, shape_lut, gain_index.astype(np.uint16), shape_index.astype(np.uint16))


def _som(x: Floats, weight: Floats, units: int, seed: int) -> NDArray[np.int64]:
    """For each unit of a SOM, the cell that its MAN remembers nearest to its weight. x: (n, 1 or 2), in [0, 1]."""
    units = max(1, units)
    random = np.random.PCG64(seed)
    count = max(len(x), PRESENTATIONS * units)
    triples = np.zeros((len(x), 3), np.float32)
    triples[:, : x.shape[1]] = x
    # Cells are drawn as often as they weigh: the learner counts all presentations alike.
    places = (np.sort(random.random_raw(count)) >> 11) * 2.0**-53
    drawn = np.searchsorted(np.cumsum(weight) / weight.sum(), places, side="right").clip(0, len(x) - 1)
    drawn = drawn[np.argsort(random.random_raw(count), kind="stable")]
    distinct = np.unique(triples[drawn], axis=0)
    first = distinct[np.argsort(random.random_raw(len(distinct)), kind="stable")[:units]]
    learner = _core.Learner(triples[drawn], drawn.astype(np.uint32), first, "kohonen", len(first))
    alpha, falloff = SOM_ALPHA, np.ones(1, np.float32)
    for _ in range(SOM_EPOCHS):
        learner.present(0, count, alpha, falloff)
        alpha *= 0.7
    stored, weights = learner.stored_cells().astype(np.int64), learner.weights()
    won = stored[:, 0] != EMPTY
    stored, weights = stored[won], weights[won]
    filled = stored != EMPTY
    distance = ((triples[np.where(filled, stored, 0)] - weights[:, None]) ** 2).sum(axis=-1)
    return stored[np.arange(len(stored)), np.where(filled, distance, np.inf).argmin(axis=1)]


def _k_means(x: Floats, weight: Floats, units: int, seed: int) -> NDArray[np.int64]:
    """The same by Lloyd's algorithm with k-means++ (for comparison): the cell nearest to each centre."""
    drawn = np.random.default_rng(seed).choice(len(x), 4 * len(x), p=weight / weight.sum())
    kept = optional("scipy.cluster.vq", "SciPy", "k-means", "formats")
    centres: Floats = kept.kmeans2(x[drawn], max(1, units), SOM_EPOCHS, minit="++", rng=seed)[0]
    return _nearest(centres, x).astype(np.int64)


def _nearest(x: NDArray[Any], lut: NDArray[Any]) -> NDArray[np.intp]:
    tree = optional("scipy.spatial", "SciPy", "nearest entries", "formats").KDTree(lut)
    found: NDArray[np.intp] = tree.query(x)[1]
    return found


def _swept(problem: Problem, quantised: Quantised, price: float) -> Quantised:
    gain_index, shape_index = quantised.gain_index.copy(), quantised.shape_index.copy()
    system = problem.system
    quantised.palette(problem.lattice).sweep(
        gain_index,
        shape_index,
        gain_values(quantised.gains),
        shape_values(quantised.shapes),
        system.indptr.astype(np.int32),
        system.indices.astype(np.int32),
        system.data,
        problem.right,
        price,
    )
    return Quantised(quantised.gains, quantised.shapes, gain_index, shape_index)


def _refined(problem: Problem, quantised: Quantised) -> Quantised:
    """Least squares: all gains for the shapes that they come with, then all shapes."""
    q = quantised.ordered()
    system, right = problem.system, problem.right
    shapes = shape_values(q.shapes)[q.shape_index]
    normal, wanted = np.zeros((len(q.gains), len(q.gains))), np.zeros(len(q.gains))
    for c in range(3):
        used = _incidence(q.gain_index, shapes[:, c], len(q.gains), system)
        normal = normal + (used.T @ system @ used).toarray()
        wanted = wanted + used.T @ right[:, c]
    gains = gain_codes(np.maximum(_solved(normal, wanted[:, None], gain_values(q.gains)[:, None])[:, 0], 0.0))
    used = _incidence(q.shape_index, gain_values(gains)[q.gain_index], len(q.shapes), system)
    # The three channels share a system, and both coordinates and the mean are orthogonal: each coordinate's equations
    # are the channels' own, combined as the coordinate is.
    places = _solved(
        (used.T @ system @ used).toarray(), coordinates(used.T @ right), coordinates(shape_values(q.shapes))
    )
    return Quantised(gains, shape_codes(np.clip(places, -3.0, 3.0)), q.gain_index, q.shape_index)


def _incidence(index: NDArray[Any], values: Floats, entries: int, like: Any) -> Any:
    """A sparse matrix (nodes, entries) with each node's value at its entry."""
    return type(like)((values, index.astype(np.int32), np.arange(len(index) + 1)), shape=(len(index), entries))


def _solved(normal: Floats, wanted: Floats, before: Floats) -> Floats:
    """normal⁻¹ wanted, held to the values before where nodes leave it open."""
    diagonal = np.diag(normal)
    ridge = PRIOR * diagonal + 1e-8 * diagonal.max()
    return np.asarray(np.linalg.solve(normal + np.diag(ridge), wanted + ridge[:, None] * before), np.float64)
