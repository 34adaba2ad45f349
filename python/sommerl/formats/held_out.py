"""Samples that are left out tell how far what is made of the others can be trusted: single ones, and whole lines of
incidence, all samples of one θ_i."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reflectance.distance import LOG_FLOOR
from ..reflectance.samples import Samples, polar_angles
from .regression import CHARTS, NEIGHBOURS, Chart, Regression, drawn

HELD_OUT = 10  # one sample in so many tests the others
MOST_HELD_OUT = 1000
MOST_TRIED = 100_000  # samples that are tried on; of more, some drawn at random
LINE = np.radians(0.25)  # samples whose θ_i differ by less are of one line of incidence
LEAST_OF_LINE = 8  # samples; fewer are no line
LEAST_GAP = 3  # times LINE, usually, from one line to the next
ON_LINES = 0.9  # of all samples, at least; others were not measured along lines
ONE_SIDED = 0.8  # of the error that is left otherwise: a lattice of both orders takes twice as many nodes
EVERY_LINE = 3  # one line in so many of those between the first and the last

Masks = NDArray[np.bool_]
BothSides = Callable[[Samples], tuple[Samples, bool]]


def points(samples: Samples) -> Masks:
    """Which samples are every tenth one, in a random order, (n)."""
    order = np.argsort(np.random.PCG64(0).random_raw(len(samples.wi)))
    found = np.zeros(len(order), bool)
    found[order[::HELD_OUT]] = True
    return found


def lines(samples: Samples) -> Masks:
    """Which samples are on every third line of incidence that lies between two others, (n); none if there are fewer
    than three lines."""
    theta_i, _ = polar_angles(samples.wi)
    line = np.rint(theta_i / LINE).astype(np.int64)
    known, count = np.unique(line, return_counts=True)
    many = count >= LEAST_OF_LINE
    known, share = known[many], count[many].sum() / count.sum()
    if len(known) < 3 or share < ON_LINES or np.median(np.diff(known)) < LEAST_GAP:
        return np.zeros(len(line), bool)
    return np.isin(line, known[1:-1:EVERY_LINE])


@dataclass(frozen=True)
class Choice:
    """How samples are interpolated: see `regression`. report: the errors at held-out samples."""

    chart: Chart
    one_sided: bool
    report: dict[str, float]


def chosen(samples: Samples, both_sides: BothSides) -> Choice:
    """Of CHARTS, and of one-sided planes or reciprocal ones, the choice of the least error at held-out samples: of the
    mean |log| with cosines, single ones and lines together. One-sided ones have to be better by ONE_SIDED.

    The report: held_out_…, of single samples; held_out_lines_…, of lines of incidence, where there are three.
    log_error_cosine: the RMS error of the logarithm, with cosines; median_relative_error: over the samples.
    """
    samples = drawn(samples, MOST_TRIED)
    masks = {"held_out": points(samples), "held_out_lines": lines(samples)}
    tests = {name: mask for name, mask in masks.items() if mask.any() and (~mask).sum() >= 2 * NEIGHBOURS}
    found: list[tuple[float, Choice]] = []
    for one_sided in (False, True):
        for chart in CHARTS:
            total, report = 0.0, dict[str, float]()
            for name, mask in tests.items():
                known, mirrored = both_sides(samples.some(~mask))
                tested = samples.some(np.flatnonzero(mask)[:: -(-int(mask.sum()) // MOST_HELD_OUT)])
                material = Regression(known, chart, one_sided=one_sided, mirrored=mirrored, name="held out")
                mean, root, median = _errors(tested, material.eval(tested.wi, tested.wo))
                total += mean if not one_sided else mean / ONE_SIDED
                report |= {f"{name}_log_error_cosine": root, f"{name}_median_relative_error": median}
            found.append((total, Choice(chart, one_sided, report)))
    return min(found, key=lambda each: each[0])[1]


def sizes(f_r: NDArray[np.float64]) -> NDArray[np.float64]:
    """What relative errors are over, (n): the channels added, and at least LOG_FLOOR in each, or the median of all
    samples where that is less: dark materials have relative errors, too."""
    found = np.abs(f_r).sum(axis=1)
    usual = np.median(found[found > 0]) if found.any() else np.inf
    return np.maximum(found, min(3 * LOG_FLOOR, float(usual)))


def _errors(samples: Samples, said: NDArray[np.float64]) -> tuple[float, float, float]:
    """The mean and the RMS error of the logarithm, with cosines; and the median relative error."""
    found, true = np.maximum(said, 0), np.maximum(samples.f_r, 0)
    weight = (samples.wi[:, 2] * samples.wo[:, 2])[:, None]
    logs = np.log(found + LOG_FLOOR) - np.log(true + LOG_FLOOR)
    relative = np.abs(found - true).sum(axis=1) / sizes(true)
    mean, square = ((weight * each).sum() / (3 * weight.sum()) for each in (np.abs(logs), logs**2))
    return float(mean), float(np.sqrt(square)), float(np.median(relative))
