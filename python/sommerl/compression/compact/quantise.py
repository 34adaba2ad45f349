"""Makes the palette and the indices of the preset `compact` from the values at the nodes of a fitted lattice.

A node's value is gain · shape, where the mean of the shape's channels is 1. One SOM (self-organising map) learns the
gains and another one the shapes; the MAN (mass attraction network) of each then replaces what was learnt by the nearest
original values. After that, two steps alternate: each node takes the gain and the shape with the least sum of error and
price · bits, given the present values of its neighbours; and each entry takes the value that is best for the nodes that
use it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.nodes import NodeLattice
from ...system.errors import MaterialError
from ...system.optional import optional
from ..paper.reference import EMPTY
from ..smrl.codes import Codes, Floats, coordinates, gain_codes, gain_values, shape_codes, shape_values
from ..smrl.node_parts import Prior
from .effort import USUAL, Effort

# The measurements below are changes of the final error of nickel (SGD) and irid_flake_paint1 (RGL) in 2,700 bytes.

# The first palettes. Later steps replace them: 0.3 to 4 times these numbers change the error by less than 0.5 dB.
SOM_EPOCHS, SOM_ALPHA, SOM_DECAY = 20, 0.3, 0.7  # at the end α is 0.0003, and units hardly move
PRESENTATIONS = 20  # in an epoch, for each unit, at least: small lattices alone would show too few values
K_MEANS_DRAWS = 4  # for each node: SciPy's k-means takes no weights, so nodes are drawn by weight
# A gain takes about a byte of a file, a shape about two; an entry for fewer nodes than this saves less. Only lattices
# of fewer than 185 and 433 nodes are affected.
NODES_A_GAIN, NODES_A_SHAPE = 4, 8
LEAST_SHOWN = 1e-3  # of the mean weight: so that nodes of almost no weight are presented at all
DARKEST = 1e-4  # added to sizes so that black nodes have a shape, too; the smallest gain above 0 is 1/256
# At most of a shape's channels, at first: a colour whose channels nearly cancel gets a gain that is too large rather
# than a shape that has no code.
STEEPEST = 8.0
TINY = 1e-9  # added to a divisor that is 0 if all nodes have the same shape

# The alternation
FIRST_PRICE = 0.3  # of a bit, in units of the mean error of a node; 0.1 and 1: 0.2 dB
AIM = 0.997  # of the target size, since sizes vary a little from turn to turn; 0.99 and 1: 0.01 dB
STEER = 2.5  # the price is multiplied by (size / aim) to this power; 1.5 and 4: 0.02 dB
PRICE_CHANGE = 0.3, 3.0  # but by no less and no more than these: one bad estimate must not spoil the price
RIDGE = 1e-3  # of an entry's curvature: keeps its value where its nodes leave it open; 1e-4 and 1e-2: 0.02 dB
LEAST_RIDGE = 1e-8  # of the largest curvature: so that entries whose nodes have no weight can be solved for

Start = Literal["som", "k-means"]


@dataclass(frozen=True)
class Problem:
    """The error of values z at a lattice's nodes, zᵀ H z − 2 bᵀ z + constant for each channel, and its minimum.

    equations: H z = b. best: the values z of least error, (nodes, 3). error: the error of `best`, summed over the
    channels. prior: what the model of the stream begins with, if streams are to leave out the lattice.
    """

    lattice: NodeLattice
    equations: _core.NormalEquations
    best: Floats
    error: float
    prior: Prior | None = None

    def scaled(self, factors: Floats) -> Problem:
        """The problem whose values of least error are these times a factor for each node, (nodes)."""
        best = self.best * factors[:, None]
        return replace(self, equations=self.equations.with_right(self.equations.product(best)), best=best)

    def excess(self, values: Floats) -> float:
        """By how much the error of other values (nodes, 3) exceeds the least error."""
        away = values - self.best
        return float((away * self.equations.product(away)).sum())


@dataclass(frozen=True)
class Quantised:
    """Palettes as codes: gains (G,), increasing, and shapes (S, 2); and the numbers of each node's two entries."""

    gains: Codes
    gain_index: NDArray[np.uint16]
    shapes: Codes
    shape_index: NDArray[np.uint16]

    def values(self) -> Floats:
        """The values of the nodes, gain · shape, (nodes, 3)."""
        return gain_values(self.gains)[self.gain_index][:, None] * shape_values(self.shapes)[self.shape_index]

    def palette(self, lattice: NodeLattice, prior: Prior | None = None) -> _core.NodePalette:
        """The core's object for these palettes on a lattice, which measures and writes streams."""
        codes = self.gains.tolist(), self.shapes.tolist()
        return _core.NodePalette(*lattice.axes(), *codes, **lattice.folds, prior=prior)

    def stream(self, lattice: NodeLattice, prior: Prior | None = None) -> bytes:
        """The stream of a file. The entries have to be `ordered`.

        Raises MaterialError if it would take readers too long (docs/format.md, *A reader's work*).
        """
        try:
            return self.palette(lattice, prior).encode(self.gain_index, self.shape_index)
        except ValueError as error:
            raise MaterialError(str(error)) from error

    def ordered(self) -> Quantised:
        """The same, without unused and repeated entries, and sorted in the order in which a file stores them."""
        return Quantised(*_ordered(self.gains, self.gain_index), *_ordered(self.shapes, self.shape_index))


def _ordered(codes: Codes, index: NDArray[np.uint16]) -> tuple[Codes, NDArray[np.uint16]]:
    """Codes without unused and repeated ones, sorted, and the index that belongs to them."""
    distinct, number = np.unique(codes, axis=0, return_inverse=True)
    found = number.reshape(-1)[index]
    used = np.zeros(len(distinct), bool)
    used[found] = True
    return distinct[used], (np.cumsum(used) - 1)[found].astype(np.uint16)


def quantise(
    problem: Problem,
    gains: int,
    shapes: int,
    target: int,
    *,
    seed: int = 0,
    effort: Effort = USUAL,
    start: Start = "som",
    refine: bool = True,
) -> tuple[Quantised, bytes]:
    """The quantised values of least error whose stream has at most `target` bytes, and the stream.

    If all streams that were tried are longer, returns the shortest. gains, shapes: the largest numbers of entries.
    effort: how many turns there are. start: what the first palettes are learnt by. refine: False keeps the original
    values that the MAN chose.
    Raises MaterialError if a stream would take readers too long (docs/format.md, *A reader's work*).
    """
    quantised = _first(problem, gains, shapes, seed, start)
    price = FIRST_PRICE * problem.error / len(problem.best)
    found: list[tuple[float, Quantised, bytes]] = []
    for turn in range(effort.turns + effort.last_turns):
        if refine and turn:
            quantised = _refined(problem, quantised)
        quantised = _swept(problem, quantised.ordered(), price)
        ordered = quantised.ordered()
        if turn < effort.turns:
            size = (
                sum(ordered.palette(problem.lattice, problem.prior).measure(ordered.gain_index, ordered.shape_index))
                / 8
            )
        else:
            stream = ordered.stream(problem.lattice, problem.prior)
            size = len(stream)
            found.append((problem.excess(ordered.values()), ordered, stream))
        if turn:
            price *= float(np.clip((size / (AIM * target)) ** STEER, *PRICE_CHANGE))
    fitting = [each for each in found if len(each[2]) <= target]
    best = min(fitting, key=lambda each: each[0]) if fitting else min(found, key=lambda each: len(each[2]))
    return best[1:]


def _first(problem: Problem, gains: int, shapes: int, seed: int, start: Start) -> Quantised:
    """Palettes learnt from the best values of the nodes, and for each node the nearest entries."""
    values = problem.best
    gain: Floats = values.mean(axis=1)
    least: Floats = np.abs(values).max(axis=1) / STEEPEST + DARKEST
    gain = np.where(np.abs(gain) < least, np.where(gain < 0, -least, least), gain)
    octaves, places = gain_codes(gain).astype(np.float64)[:, None], coordinates(values / gain[:, None])
    weight = np.sqrt(problem.equations.diagonal() * gain**2)
    train = _som if start == "som" else _k_means
    nodes = len(values)
    gain_nodes = train(_scaled(octaves), np.ones(nodes), min(gains, nodes // NODES_A_GAIN), seed)
    shown = weight / weight.mean() + LEAST_SHOWN
    shape_nodes = train(_scaled(places), shown, min(shapes, nodes // NODES_A_SHAPE), seed)
    gain_lut, shape_lut = gain_codes(gain[gain_nodes]), shape_codes(places[shape_nodes])
    gain_index = _nearest(octaves, gain_lut[:, None])
    shape_index = _nearest(shape_codes(places), shape_lut)
    return Quantised(gain_lut, gain_index.astype(np.uint16), shape_lut, shape_index.astype(np.uint16))


def _scaled(places: Floats) -> Floats:
    """Places (nodes, n), moved and scaled to [0, 1] by the same factor on each axis."""
    away = places - places.min(axis=0)
    return away / (float(away.max()) + TINY)


def _som(x: Floats, weight: Floats, units: int, seed: int) -> NDArray[np.int64]:
    """Trains a SOM on the values x; returns for each unit that ever won the node that its MAN stores nearest to it.

    x: (nodes, 1 or 2), in [0, 1]. weight: how often each node is presented, relatively. units: the number of units.
    """
    units = max(1, units)
    random = np.random.PCG64(seed)
    count = max(len(x), PRESENTATIONS * units)
    triples = _triples(x)
    # The learner treats all presentations alike, so nodes of more weight are presented more often.
    places = (np.sort(random.random_raw(count)) >> 11) * 2.0**-53
    drawn = np.searchsorted(np.cumsum(weight) / weight.sum(), places, side="right").clip(0, len(x) - 1)
    drawn = drawn[np.argsort(random.random_raw(count), kind="stable")]
    first = _apart(*np.unique(triples[drawn], axis=0, return_counts=True), units, random)
    learner = _core.Learner(triples[drawn], drawn.astype(np.uint32), first, "kohonen", len(first))
    alpha, falloff = SOM_ALPHA, np.ones(1, np.float32)
    for _ in range(SOM_EPOCHS):
        learner.present(0, count, alpha, falloff)
        alpha *= SOM_DECAY
    stored, weights = learner.stored_cells().astype(np.int64), learner.weights()
    won = stored[:, 0] != EMPTY
    stored, weights = stored[won], weights[won]
    filled = stored != EMPTY
    distance = ((triples[np.where(filled, stored, 0)] - weights[:, None]) ** 2).sum(axis=-1)
    return stored[np.arange(len(stored)), np.where(filled, distance, np.inf).argmin(axis=1)]


def _apart(
    values: NDArray[np.float32], counts: NDArray[np.int64], units: int, random: np.random.PCG64
) -> NDArray[np.float32]:
    """The first weights of at most that many units: some of the distinct values (n, 3), presented so many times (n).

    Each is drawn with a probability in proportion to its count and to its squared distance from the nearest one drawn
    before (Arthur & Vassilvitskii, k-means++, 2007). Values drawn by count alone crowd where nodes do, and few units
    reach the rare ones: the error of smooth materials was up to twice as large (purple-paint, 1,000 bytes).
    """
    first = [int(random.random_raw()) % len(values)]
    away = np.full(len(values), np.inf, np.float32)
    while len(first) < min(units, len(values)):
        away = np.minimum(away, ((values - values[first[-1]]) ** 2).sum(axis=1))
        sums: Floats = np.cumsum(away * counts, dtype=np.float64)
        place = (int(random.random_raw()) >> 11) * 2.0**-53 * float(sums[-1])
        first.append(min(int(np.searchsorted(sums, place, side="right")), len(values) - 1))
    return values[first]


def _k_means(x: Floats, weight: Floats, units: int, seed: int) -> NDArray[np.int64]:
    """As `_som`, by k-means (Lloyd, k-means++), for comparison: the node nearest to each centre."""
    drawn = np.random.default_rng(seed).choice(len(x), K_MEANS_DRAWS * len(x), p=weight / weight.sum())
    kept = optional("scipy.cluster.vq", "SciPy", "k-means", "lab")
    centres: Floats = kept.kmeans2(x[drawn], max(1, units), SOM_EPOCHS, minit="++", rng=seed)[0]
    return _nearest(centres, x).astype(np.int64)


def _nearest(x: NDArray[Any], lut: NDArray[Any]) -> NDArray[np.uint32]:
    """For each row of x (n, 1 or 2), the number of the nearest row of `lut`."""
    return _core.Quantiser(_triples(lut)).query(_triples(x))


def _triples(x: NDArray[Any]) -> NDArray[np.float32]:
    """Rows of one or two numbers as rows of three, the others 0."""
    triples = np.zeros((len(x), 3), np.float32)
    triples[:, : x.shape[1]] = x
    return triples


def _swept(problem: Problem, quantised: Quantised, price: float) -> Quantised:
    """One pass over all nodes, each of which takes the entries with the least error plus price · bits."""
    gain_index, shape_index = quantised.gain_index.copy(), quantised.shape_index.copy()
    values = gain_values(quantised.gains), shape_values(quantised.shapes)
    quantised.palette(problem.lattice, problem.prior).sweep(gain_index, shape_index, *values, problem.equations, price)
    return Quantised(quantised.gains, gain_index, quantised.shapes, shape_index)


def _refined(problem: Problem, quantised: Quantised) -> Quantised:
    """The least-squares values of all gains with the shapes fixed, and then of all shapes with the gains fixed."""
    q, equations = quantised.ordered(), problem.equations
    right, factors = equations.right, shape_values(q.shapes)[q.shape_index]
    normal = equations.between_entries(q.gain_index, factors, len(q.gains))
    wanted = _summed(q.gain_index, (factors * right).sum(axis=1)[:, None], len(q.gains))
    gains = gain_codes(_solved(normal, wanted, gain_values(q.gains)[:, None])[:, 0])
    factors = gain_values(gains)[q.gain_index][:, None]
    # The three channels have the same matrix, and a shape's two coordinates and its mean are orthogonal combinations of
    # the channels. So the equations of a coordinate are the same combination of the channels' equations.
    normal = equations.between_entries(q.shape_index, factors, len(q.shapes))
    wanted = coordinates(_summed(q.shape_index, factors * right, len(q.shapes)))
    shapes = shape_codes(_solved(normal, wanted, coordinates(shape_values(q.shapes))))
    return Quantised(gains, q.gain_index, shapes, q.shape_index)


def _summed(index: NDArray[Any], values: Floats, entries: int) -> Floats:
    """The sums of values (nodes, k) over the nodes of each entry, (entries, k)."""
    sums: Floats = np.zeros((entries, values.shape[1]))
    np.add.at(sums, index, values)
    return sums


def _solved(normal: Floats, wanted: Floats, before: Floats) -> Floats:
    """Solves normal · x = wanted, with a ridge that keeps x at `before` where the equations leave it undetermined."""
    diagonal = np.diag(normal)
    ridge = RIDGE * diagonal + LEAST_RIDGE * diagonal.max()
    return np.asarray(np.linalg.solve(normal + np.diag(ridge), wanted + ridge[:, None] * before), np.float64)
