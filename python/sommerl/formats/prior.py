"""What is known of materials before anything is measured: it makes a whole one of few samples, and says how sure it is.

Measured materials are vectors of log(f_r cos θ_i cos θ_o + SMALL), relative to their median, at the cells of a lattice
(Nielsen et al. 2015), each channel one of its own. Their covariance is the prior of a Gaussian process: of the mean of
a material's channels, and of what each channel differs from that, so that colours, which vary less, are known sooner,
and any number of channels will do. To it is added what smoothly differs from all that was seen, a share UNSEEN of the
standard deviation, which lets many samples be interpolated. The estimate is the mean of the posterior; its standard
deviation is SURER times the posterior's.

The materials are 99 stand-ins (Zheng et al. 2021, MIT License), in a library's file.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compression.smrl import file
from ..compression.smrl.library_file import LibraryFile
from ..reflectance.arrays import split
from ..reflectance.brdf import Brdf
from ..reflectance.cells import HALF_PI, Lattice
from ..reflectance.half_diff import directions, half_diff
from ..reflectance.samples import Samples, polar_angles
from ..reflectance.table import BrdfTable
from ..system import door

FEWEST, MOST = 10, 1500  # samples
LATTICE = Lattice(90, 24, 36)  # of the materials
DEVIATIONS = Lattice(30, 12, 18)  # of standard deviations
STAND_INS = resources.files("sommerl.formats").joinpath("stand_ins", "np.smrlib")
SMALL = 1e-3  # of f_r times cosines: below, differences count less
LEAST_COSINES = 1e-4  # of the product of both
UNSEEN = 0.1
REACH = 5.0, 4.0, 5.0  # cells of θ_h, θ_d, φ_d, over which that varies
NOISE = 0.02  # a sample's standard deviation, of the logarithm
# Errors of the Gaussian process, in its own standard deviations, the root of the mean square over stand-ins that were
# not in its prior (benchmarks/few_samples.py).
SURER = 0.63
DIRECTIONS = 100  # in which materials vary most: samples are planned by these
STEEPEST = np.radians(80.0)  # of planned samples
NEAREST = np.radians(5.0)  # from light to viewer there: one would stand before the other
AT_ONCE = 8192  # cells: bounds memory

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]


class Estimate(BrdfTable):
    """What a prior makes of samples. deviation: the standard deviation of log(f_r cos θ_i cos θ_o + SMALL), the mean of
    the channels, at the cells of DEVIATIONS; NaN below the horizon."""

    kind = "measurement"

    def __init__(self, values: Floats, samples: Samples, deviation: Floats, name: str) -> None:
        super().__init__(values, LATTICE, name=name)
        self._samples, self.deviation = samples, deviation

    @property
    def samples(self) -> Samples:
        return self._samples

    def deviation_at(self, wi: Floats, wo: Floats) -> Floats:
        """The standard deviation at pairs of directions (n, 3) above the horizon, interpolated, (n)."""
        whole = DEVIATIONS.extended(self.deviation).reshape(-1)
        corners = DEVIATIONS.corners(*half_diff(split(wi), split(wo)))
        return np.sum([whole[cell] * weight for cell, weight in corners], axis=0)


class Prior:
    """The prior of materials. f_r: (materials, channels, cells), at the cells of LATTICE above the horizon.

    >>> lattice = np.random.default_rng(0).uniform(0.1, 1, (5, 3, int(LATTICE.above_horizon.sum())))
    >>> Prior(lattice).plan(2).shape
    (2, 4)
    """

    def __init__(self, f_r: NDArray[np.floating]) -> None:
        above = LATTICE.above_horizon
        theta_h, theta_d, phi_d = (angle[above] for angle in LATTICE.angles())
        self._place = theta_h, theta_d, phi_d
        self._cosines = np.maximum(np.prod(LATTICE.cosines(), axis=0)[above], LEAST_COSINES)
        usual = np.median(f_r.reshape(-1, f_r.shape[-1]), axis=0)
        self._usual = np.log(np.maximum(usual, 0) * self._cosines + SMALL)
        logs = np.log(np.maximum(f_r, 0) * self._cosines + SMALL) - self._usual
        each = logs.mean(axis=1, keepdims=True)
        self._mean: Floats = each.mean(axis=(0, 1))
        rows = len(f_r) * f_r.shape[1]
        # Channels vary as materials do: they are examples of brightness, too.
        self._brightness = _rows(logs - self._mean, rows)
        self._colour = _rows(logs - each, rows)
        number = np.full(LATTICE.size, -1)
        number[above.reshape(-1)] = np.arange(len(self._usual))
        self._number: Ints = number[LATTICE.extended(np.arange(LATTICE.size).reshape(LATTICE.shape)).reshape(-1)]

    def estimate(self, samples: Samples, *, name: str = "estimate") -> Estimate:
        """The mean of what materials with these samples are like, and its standard deviation."""
        x, y, z = half_diff(split(samples.wi), split(samples.wo))
        cosines = np.maximum(samples.wi[:, 2] * samples.wo[:, 2], LEAST_COSINES)
        measured = np.log(np.maximum(samples.f_r, 0) * cosines[:, None] + SMALL)
        measured -= self._between(self._usual[None], x, y, z).T
        mean = measured.mean(axis=1)
        found, deviation = self._posterior(
            self._brightness, (x, y, z), mean[:, None] - self._between(self._mean[None], x, y, z).T, deviations=True
        )
        colours, _ = self._posterior(self._colour, (x, y, z), measured - mean[:, None])
        logs = found + self._mean + colours + self._usual
        values = np.zeros((*LATTICE.shape, samples.f_r.shape[1]))
        values[LATTICE.above_horizon] = (np.maximum(np.exp(logs) - SMALL, 0) / self._cosines).T
        return Estimate(values, samples, SURER * deviation, name)

    def plan(self, count: int) -> Floats:
        """Where to measure, θ_i, φ_i, θ_o, φ_o [rad], (count, 4): one pair of directions after the other, each that
        which leaves the least variance of brightness, summed over all pairs by solid angles and cosines.

        Neither direction is beyond STEEPEST, nor are they nearer to each other than NEAREST.
        """
        _, vectors = np.linalg.eigh(self._brightness @ self._brightness.T)
        rows = (vectors[:, ::-1][:, :DIRECTIONS].T @ self._brightness).astype(np.float32)
        weight = (LATTICE.solid_angles()[LATTICE.above_horizon] * self._cosines).astype(np.float32)
        wi, wo = directions(*self._place)
        theta = np.maximum(*(polar_angles(np.stack(w, axis=-1))[0] for w in (wi, wo)))
        able = (theta <= STEEPEST) & (2 * self._place[1] >= NEAREST)
        wanted = (rows * (weight / weight.sum())) @ rows.T
        left: Any = rows.copy()
        variance: Any = (rows**2).sum(axis=0)
        own = (UNSEEN**2 * (self._brightness**2).sum(axis=0) + NOISE**2).astype(np.float32)
        chosen: list[int] = []
        for _ in range(count):
            gain = np.einsum("kp,kp->p", left, wanted @ left) / (variance + own)
            place = int(np.where(able, gain, -1.0).argmax())
            chosen.append(place)
            shared, total = rows.T @ left[:, place], variance[place] + own[place]
            left -= np.outer(left[:, place], shared / total)
            variance = np.maximum(variance - shared**2 / total, 0)
        (theta_i, phi_i), (theta_o, phi_o) = (polar_angles(np.stack(w, axis=-1)[chosen]) for w in (wi, wo))
        return np.stack([theta_i, 0 * theta_i, theta_o, (phi_o - phi_i) % (4 * HALF_PI)], axis=-1)

    def _between(self, rows: NDArray[np.floating], x: Floats, y: Floats, z: Floats) -> Floats:
        """Rows (k, cells) at θ_h, θ_d, φ_d, interpolated: (k, n)."""
        found = np.zeros((len(rows), len(x)))
        for cell, weight in LATTICE.corners(x, y, z):
            found += rows[:, self._number[cell]] * weight
        return found

    def _posterior(
        self, rows: Singles, places: tuple[Floats, Floats, Floats], measured: Floats, *, deviations: bool = False
    ) -> tuple[Floats, Floats]:
        """The mean at all cells, (channels, cells), and the standard deviations at those of DEVIATIONS, if wanted.

        rows: whose products are the covariance. measured: (n, channels), at θ_h, θ_d, φ_d.
        """
        at = self._between(rows, *places)
        size = np.sqrt((at**2).sum(axis=0)) * UNSEEN
        covariance = at.T @ at + np.outer(size, size) * _alike(places, places) + NOISE**2 * np.eye(len(size))
        factor = np.linalg.cholesky(covariance)
        weights = np.linalg.solve(covariance, measured)
        found = ((at @ weights).T.astype(np.float32) @ rows).astype(np.float64)
        sizes = np.sqrt((rows**2).sum(axis=0)) * UNSEEN
        for start in range(0, len(sizes), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            alike = _alike(tuple(angle[part] for angle in self._place), places)
            found[:, part] += sizes[part] * (alike @ (size[:, None] * weights)).T
        deviation = np.full(DEVIATIONS.shape, np.nan)
        if deviations:
            above = DEVIATIONS.above_horizon
            theta_h, theta_d, phi_d = (angle[above] for angle in DEVIATIONS.angles())
            there = theta_h, theta_d, phi_d
            wanted = self._between(rows, *there)
            own = np.sqrt((wanted**2).sum(axis=0)) * UNSEEN
            known = np.linalg.solve(factor, at.T @ wanted + np.outer(size, own) * _alike(places, there))
            variance = (wanted**2).sum(axis=0) + own**2 - (known**2).sum(axis=0)
            deviation[above] = np.sqrt(np.maximum(variance, 0))
        return found, deviation


def sampled(brdf: Brdf) -> Singles:
    """A material as `Prior` takes it, (channels, cells)."""
    wi, wo = directions(*(angle[LATTICE.above_horizon] for angle in LATTICE.angles()))
    return brdf.eval(np.stack(wi, axis=-1), np.stack(wo, axis=-1)).T.astype(np.float32)


def stand_ins() -> dict[str, Brdf]:
    """The materials of the prior that comes with the package, by their names."""
    with door.opened(str(STAND_INS)) as opened:
        library = LibraryFile(opened.part, opened.length)
        return {name: file.decode(library.data(name)) for name in library.index.names()}


@cache
def shipped() -> Prior:
    """The prior that comes with the package.

    >>> shipped().plan(16).shape
    (16, 4)
    """
    return Prior(np.stack([sampled(brdf) for brdf in stand_ins().values()]))


def _rows(logs: Floats, count: int) -> Singles:
    return (logs.reshape(count, -1) / np.sqrt(count)).astype(np.float32)


def _alike(some: tuple[Floats, ...], others: tuple[Floats, ...]) -> Floats:
    """How alike what was never seen is at places and at others, θ_h, θ_d, φ_d each: 1 where they are one (a Matérn
    kernel of order 3/2)."""
    one, other = _embedded(some), _embedded(others)
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * one @ other.T
    distance = np.sqrt(3 * np.maximum(squares, 0))
    return (1 + distance) * np.exp(-distance)


def _embedded(place: tuple[Floats, ...]) -> Floats:
    """Coordinates (n, 4) in which REACH is 1. Where θ_d is 0, φ_d means nothing."""
    x, y, z = place
    rows, columns, turns = LATTICE.shape
    turn = turns / (4 * HALF_PI) / REACH[2] * np.sqrt(np.sin(y))
    across = np.sqrt(x / HALF_PI) * (rows / REACH[0])
    return np.stack([across, y * (columns / HALF_PI / REACH[1]), turn * np.cos(2 * z), turn * np.sin(2 * z)], axis=-1)
