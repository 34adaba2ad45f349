"""The preset `compact`: searches for the best material of a given size, or the smallest of a given quality.

Quality is measured by a function that the caller passes (`render.judge` has one). Without one, candidates of the same
size are compared by their least-squares error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from ...reflectance.brdf import Brdf
from ...reflectance.origin import source_of
from ...system.errors import MaterialError, OptionError
from ...system.whole import make_whole
from ..material import SomManBrdf
from ..palette import GainsAndShapes
from ..smrl import file
from ..smrl.codes import gain_values, shape_values
from ..smrl.shared import PART, Shared
from . import effort as efforts
from .energy import EnergyBound, at_nodes
from .lattice_choice import LARGEST, SMALLEST
from .lattice_fit import Fitter, SharedFitter
from .quantise import Problem, Quantised, quantise

Quality = Callable[[SomManBrdf], float]  #: of a candidate, in decibels
Progress = Callable[[int, int], None]  #: steps done, steps in all

DEFAULT_PSNR = 48.0  # dB: a little more than the preset `paper` reaches on RGL's materials (docs/compact.md)
SMALLEST_SIZE, LARGEST_SIZE = 300, 64_000  # bytes: readers have to accept what is written (docs/format.md)
LOWEST_PSNR, HIGHEST_PSNR = 20.0, 80.0  # dB: at 80, one 8-bit value in 1,500 differs by 1

# The search for a quality
FIRST_SIZE = 2000.0  # bytes: of RGL's seven materials, four reach DEFAULT_PSNR with 1,000 bytes, six with 2,700
SLOPE = 2.4  # dB for each doubling of the size, to guess the next one; more than usual, so that steps are small
MARGIN = 0.1  # dB: the guess aims at this much more than what is wanted
INNER = 0.2, 0.8  # the guess stays between these places in the range that is left, so each candidate narrows it
MOST_TRIES = 7
CLOSE = 1.04  # the ratio of sizes at which the search ends: what seven bisections of the whole range lead to

# The search for the best material of a size
ROOMY, MOST_SPREAD = 0.85, 1.5  # a file that is that much smaller than asked for has room for more nodes, up to so many
SPARE = (0.8, 0.6)  # of the usual number of nodes, which are tried where a file came out too large
# Bytes, and the numbers of nodes that are usually best for them. With 0.6 times as many in 2,700 bytes, RGL's
# irid_flake_paint1 loses 1.5 dB.
USUAL = (
    (300, 350),
    (500, 700),
    (1000, 1450),
    (2700, 3600),
    (8000, 12_500),
    (16_000, 23_000),
    (32_000, 42_000),
    (64_000, 75_000),
)

# Entries of a palette, in units of the square root of the number of nodes. In 2,700 bytes, 0.7 times as many cost 0.1
# to 1.5 dB, and 1.4 times as many gain at most 0.2 dB (nickel, irid_flake_paint1).
GAINS, SHAPES = 3.4, 2.6
MOST_ENTRIES = 1024  # of a palette in a file (docs/format.md)
DARKENINGS = 3  # of nodes, before a material that reflects too much is made darker as a whole


@dataclass(frozen=True)
class CompactOptions:
    """What to search for: the best material of at most `target_size` bytes, or the smallest of at least `target_psnr`
    dB. If neither is given, target_psnr is DEFAULT_PSNR.

    effort: how much work goes into it, from 1 to 9 (`effort`). seed: of the random directions, and of the SOM's first
    weights and order of presentation. Raises OptionError for values out of range, and if both targets are given.
    """

    target_size: int | None = None
    target_psnr: float | None = None
    effort: int = efforts.DEFAULT
    seed: int = 0

    def __post_init__(self) -> None:
        if self.target_size is not None and self.target_psnr is not None:
            raise OptionError("target: a size and a PSNR cannot both be asked for; give one of them")
        make_whole(self, "target_size", "effort", "seed")
        if self.target_size is not None and not SMALLEST_SIZE <= self.target_size <= LARGEST_SIZE:
            raise OptionError(f"target_size: expected {SMALLEST_SIZE} to {LARGEST_SIZE}, found {self.target_size}")
        psnr = self.target_psnr
        if psnr is not None and not (isfinite(psnr) and LOWEST_PSNR <= psnr <= HIGHEST_PSNR):
            raise OptionError(f"target_psnr: expected {LOWEST_PSNR:g} to {HIGHEST_PSNR:g}, found {psnr}")
        if self.target_size is None and psnr is None:
            object.__setattr__(self, "target_psnr", DEFAULT_PSNR)
        efforts.of(self.effort)
        if not 0 <= self.seed <= 2**64 - 1:
            raise OptionError(f"seed: expected 0 to {2**64 - 1}, found {self.seed}")


@dataclass(frozen=True)
class CompactReport:
    """How the search went.

    quality: of the result [dB]; None if no quality function was passed. seconds: wall-clock time. tried: for each
    candidate its bytes, its nodes, and its quality (or minus its error). metrics: how far the result is from the
    source, by the keys of `render.judge.JUDGED`, where that was measured.
    """

    quality: float | None
    seconds: float
    tried: list[tuple[int, int, float]]
    metrics: Mapping[str, float] = field(default_factory=dict[str, float])


class Compressor:
    """Prepares a source once, and then makes compact materials of any size or quality from it.

    quality: gives a candidate's quality [dB]; if None, minus the least-squares error is used.
    step: called after the preparation and after each candidate.
    shared: lattices; sizes are then those of parts (`smrl.shared`), without what is shared.

    Raises OptionError for an effort that is not from 1 to 9, MaterialError for a black BRDF, and for one that no shared
    lattice can hold.
    """

    def __init__(
        self,
        brdf: Brdf,
        *,
        effort: int = efforts.DEFAULT,
        seed: int = 0,
        quality: Quality | None = None,
        step: Callable[[], None] | None = None,
        shared: Shared | None = None,
    ) -> None:
        self.tried: list[tuple[int, int, float]] = []
        self._brdf, self._seed, self._quality = brdf, seed, quality
        self._effort = efforts.of(effort)
        self._step = step or (lambda: None)
        self._source = source_of(brdf)
        self._fitter: Fitter | SharedFitter
        if shared is None:
            self._fitter = Fitter(brdf, seed=seed, effort=self._effort)
            self._head = file.head_bytes(brdf.name, self._source)
        else:
            self._fitter = SharedFitter(brdf, shared, seed=seed, effort=self._effort)
            self._head = PART.size
        self._bound = EnergyBound(brdf)
        self._step()

    def of_size(self, size: int) -> tuple[float, SomManBrdf]:
        """The best material of at most `size` bytes among one for each of the effort's `spread`, and its quality.

        Where the only one is ROOMY, another one has more nodes.

        Raises MaterialError if none of them is small enough, nor those of SPARE.
        """
        best = max((self._candidate(size, spread) for spread in self._effort.spread), key=lambda each: each[0])
        written = self.tried[-1][0]
        if self._quality and len(self._effort.spread) == 1 and written < ROOMY * size:  # as of grey materials
            more = self._candidate(size, min(size / written, MOST_SPREAD))
            best = max(best, more, key=lambda each: each[0])
        for spread in SPARE:
            if best[0] == -math.inf and spread not in self._effort.spread:
                best = self._candidate(size, spread)
        if best[0] == -math.inf:
            least = min(tried[0] for tried in self.tried)
            raise MaterialError(
                f"{self._brdf.name}: it cannot be compressed to {size} bytes; the smallest file found has {least} bytes"
            )
        return best

    def of_quality(self, wanted: float) -> tuple[float, SomManBrdf]:
        """The smallest material of at least the quality `wanted` [dB] that MOST_TRIES candidates find, and its quality.

        Raises MaterialError if none of them is good enough.
        """
        # Below, `_candidate` refuses: less than half of the file would be left for the material.
        low, high = float(max(SMALLEST_SIZE, 2 * self._head)), float(LARGEST_SIZE)
        size, best, reached = max(FIRST_SIZE, low), None, -math.inf
        for tries_left in reversed(range(MOST_TRIES)):
            quality, material = self._candidate(int(size), 1.0)
            reached = max(reached, quality)
            if quality >= wanted:
                high, best = size, (quality, material)
            else:
                low = size
            if high / low < CLOSE:
                break
            guess = size * 2 ** ((wanted - quality + MARGIN) / SLOPE)
            inner_low, inner_high = (low * (high / low) ** share for share in INNER)
            size = min(max(guess, inner_low), inner_high)
            if best is None and (guess >= LARGEST_SIZE or tries_left == 1):
                size = float(LARGEST_SIZE)
        if best is None:
            raise MaterialError(
                f"{self._brdf.name}: it cannot be compressed with {wanted:g} dB; the best file found has "
                f"{reached:.1f} dB with {LARGEST_SIZE} bytes"
            )
        return best

    def _candidate(self, size: int, spread: float) -> tuple[float, SomManBrdf]:
        """A material for a size, with `spread` times the usual number of nodes, and its quality.

        The quality is -inf if the material came out larger than `size` bytes.
        """
        nodes = int(np.clip(spread * usual_nodes(size), SMALLEST, LARGEST))
        problem, head = self._fitter.problem(nodes), self._head
        gains, shapes = entries_for(nodes if problem.prior is None else problem.lattice.size)
        if size < 2 * head:  # less than half of the file would be left for the material
            raise MaterialError(
                f"{self._brdf.name}: its name and source take {head} bytes of the {size} asked for; ask for at least "
                f"{2 * head} bytes"
            )
        material, stream = self._bounded(problem, gains, shapes, size - head)
        error = problem.error + problem.excess(material.node_values)
        # Rounded, so that rounding errors, which differ between machines, do not decide between candidates.
        quality = round(self._quality(material), 3) if self._quality else -error
        written = head + len(stream)
        self.tried.append((written, problem.lattice.size, quality))
        self._step()
        return (quality if written <= size else -math.inf), material

    def _bounded(self, problem: Problem, gains: int, shapes: int, room: int) -> tuple[SomManBrdf, bytes]:
        """The quantised material that does not reflect too much, and its stream, of `room` bytes if possible.

        As long as it does, the values at the nodes that are seen from there are made darker, and quantised again. What
        is then still too bright is made darker as a whole.
        """
        found, stream = quantise(problem, gains, shapes, room, seed=self._seed, effort=self._effort)
        material = self._material(problem, found, self._fitter.scale)
        factors = self._bound.factors(material)
        for _ in range(DARKENINGS):
            if factors.min() == 1.0:
                return material, stream
            # Squared, since neighbours that are not as bright keep up what is seen between them.
            problem = problem.scaled(np.cbrt(at_nodes(factors**2, problem.lattice)))
            found, stream = quantise(problem, gains, shapes, room, seed=self._seed, effort=self._effort)
            material = self._material(problem, found, self._fitter.scale)
            factors = self._bound.factors(material)
        return self._material(problem, found, self._fitter.scale * float(factors.min())), stream

    def _material(self, problem: Problem, found: Quantised, scale: float) -> SomManBrdf:
        return SomManBrdf(
            GainsAndShapes(gain_values(found.gains), shape_values(found.shapes), scale, self._brdf.signed, smooth=True),
            np.stack([found.gain_index, found.shape_index]),
            problem.lattice,
            name=self._brdf.name,
            source_sha256=self._source.sha256,
            made_from=self._source.made_from,
        )


def compress(
    brdf: Brdf,
    options: CompactOptions | None = None,
    *,
    quality: Quality | None = None,
    progress: Progress | None = None,
) -> tuple[SomManBrdf, CompactReport]:
    """Compresses any BRDF into a compact material; returns it with a report.

    quality: gives a candidate's quality [dB], which `target_psnr` refers to, and by which candidates of the same size
    are compared. progress: called with the steps done and the steps in all.
    Raises OptionError if a PSNR is asked for without `quality`, and MaterialError if the target cannot be met.
    """
    options = options or CompactOptions()
    if options.target_psnr is not None and quality is None:
        raise OptionError("target_psnr: a function that measures the quality is needed; pass one as `quality`")
    started = time.perf_counter()
    spread = efforts.of(options.effort).spread
    steps, done = 1 + (len(spread) if options.target_size is not None else MOST_TRIES), 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(min(done, steps), steps)

    compressor = Compressor(brdf, effort=options.effort, seed=options.seed, quality=quality, step=step)
    if options.target_psnr is not None:
        found, material = compressor.of_quality(options.target_psnr)
    else:
        found, material = compressor.of_size(options.target_size or LARGEST_SIZE)
    if progress:
        progress(steps, steps)
    seconds = time.perf_counter() - started
    return material, CompactReport(found if quality else None, seconds, compressor.tried)


def entries_for(nodes: int) -> tuple[int, int]:
    """The largest numbers of gains and of shapes for so many nodes."""
    gains, shapes = (min(MOST_ENTRIES, round(share * math.sqrt(nodes))) for share in (GAINS, SHAPES))
    return gains, shapes


def usual_nodes(size: int) -> int:
    """The number of nodes that is usually best for a file of `size` bytes: USUAL, interpolated in logarithms."""
    bytes_, nodes = (np.log(np.array(column, np.float64)) for column in zip(*USUAL, strict=True))
    return round(float(np.exp(np.interp(math.log(size), bytes_, nodes))))
