"""Trains what the materials of a library share: lattices of nodes, and what the model of their streams begins with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...reflectance.brdf import Brdf
from ...reflectance.nodes import NodeLattice
from ..smrl.node_parts import Prior
from ..smrl.shared import Shared
from .effort import USUAL, Effort
from .lattice_choice import LatticeChoice
from .quantise import quantise
from .search import entries_for, usual_nodes
from .source import FittedSource, folds_of

LATTICES = 6  # for materials that fold φ_d alike, from dull to glossy
EXAMPLES = 12  # materials that a lattice is chosen for
SAVED = 170  # bytes that a part saves of a whole file: its lattice, name, notes, and what the model learns at first


@dataclass(frozen=True)
class Example:
    """A material to learn from. load: reads it. gloss: from 0 to 1; materials of like gloss share a lattice."""

    load: Callable[[], Brdf]
    gloss: float
    reciprocal: bool
    mirrored: bool


def train(
    examples: Sequence[Example],
    size: int,
    *,
    effort: Effort = USUAL,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Shared:
    """Lattices for parts of `size` bytes, and the prior: the median of what models learnt from the examples.

    progress: called with examples done and in all.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    groups = _groups(examples)
    total, done = sum(map(len, groups)), 0
    lattices, learnt = list[NodeLattice](), list[Prior]()
    for group in groups:
        brdfs = [example.load() for example in group]
        allowed = [folds_of(brdf) for brdf in brdfs]
        folds = {name: all(each[name] for each in allowed) for name in ("reciprocal", "mirrored")}
        sources = [FittedSource(brdf, folds, random) for brdf in brdfs]
        nodes = usual_nodes(size + SAVED)
        lattice = LatticeChoice(sources, random, effort.lines * len(sources) // 2).lattice(nodes)
        if lattice not in lattices:
            lattices.append(lattice)
        for source in sources:
            source.draw(effort.directions)
            problem = source.problem(lattice)
            found, _ = quantise(problem, *entries_for(lattice.size), size + SAVED // 2, seed=seed, effort=effort)
            learnt.append(found.palette(lattice).learnt(found.gain_index, found.shape_index))
            done += 1
            if progress:
                progress(done, total)
    weights = np.median([each for each, _ in learnt], axis=0).astype(np.float32)  # as a file holds them
    levels = np.median([each for _, each in learnt], axis=0).astype(np.float32)
    return Shared(tuple(lattices), (weights.tolist(), levels.tolist()))


def examples_used(examples: Sequence[Example]) -> int:
    """How many of the examples `train` learns from."""
    return sum(map(len, _groups(examples)))


def _groups(examples: Sequence[Example]) -> list[list[Example]]:
    """Examples that fold φ_d alike and are of like gloss, evenly chosen, EXAMPLES at most in each."""
    found: list[list[Example]] = []
    for folds in sorted({(each.reciprocal, each.mirrored) for each in examples}):
        alike = sorted((e for e in examples if (e.reciprocal, e.mirrored) == folds), key=lambda each: each.gloss)
        for part in np.array_split(np.arange(len(alike)), min(LATTICES, len(alike))):
            chosen = part[np.linspace(0, len(part) - 1, min(EXAMPLES, len(part))).round().astype(int)]
            found.append([alike[number] for number in chosen.tolist()])
    return found
