"""From samples to a material.

Samples on a regular grid become that grid (`gridded`). Of others, `regression` says what lies between the samples. A
lattice of nodes is chosen where that bends and where samples are dense, as the preset compact chooses its own, only
finer, and its nodes are fitted to the samples by least squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..compression.compact.fitted_table import FittedTable
from ..compression.compact.lattice_fit import fitted_to_samples
from ..reflectance.arrays import Triple, split
from ..reflectance.brdf import LARGEST, Brdf, Native, Vectors, vectors
from ..reflectance.cells import Lattice
from ..reflectance.grid import GridBrdf
from ..reflectance.half_diff import directions, half_diff
from ..reflectance.info import Counts
from ..reflectance.origin import Source
from ..reflectance.samples import Samples
from ..system.errors import FormatError, MaterialError
from ..system.interrupt import hold_interrupts
from ..system.threads import limit
from .gridded import grid_of
from .grids import IN_PLANE
from .held_out import Choice, chosen
from .meant import as_f_r
from .prior import DEVIATIONS, FEWEST, MOST, Estimate, shipped
from .reading import asked
from .regression import NEIGHBOURS, Regression, tree

HORIZON = 1e-6  # cosines up to that are at the horizon
REACH_DEGREES = 10.0
REACH = np.radians(REACH_DEGREES)  # of a sample: pairs farther from all of them count as not measured
COVERAGE = Lattice(36, 30, 60)  # where that is looked at
COARSEST = np.radians(5.0)  # of a grid's usual steps in θ_i; of coarser ones, highlights would be seen twice
NODES_A_SAMPLE, FEWEST_NODES, MOST_NODES = 20, 15_000, 60_000  # of the lattice
SAME = 1e-4  # samples whose coordinates agree to that are one, measured several times
MOST_SAMPLES = 2_000_000
PRIOR = "99 NP stand-ins of MERL's materials"
BANDS = 10, 6  # of θ_h and θ_d, for which facts tell the deviations


class ScatteredBrdf(FittedTable):
    """A material that was fitted to samples. samples: these, at different directions. measured: whether one lies near
    each cell of COVERAGE, of its shape. choice: how samples were interpolated. estimate: in place of that, what a prior
    made of them."""

    kind = "measurement"
    measured: NDArray[np.bool_]
    choice: Choice | None = None
    estimate: Estimate | None = None

    def __init__(self, fitted: FittedTable, samples: Samples, facts: Mapping[str, Any], source: Source) -> None:
        super().__init__(fitted.lattice, fitted.node_values, fitted.scale, signed=fitted.signed, name=fitted.name)
        self._samples, self._facts, self.source = samples, dict(facts), source
        self._of_node = np.zeros(fitted.lattice.size, np.uint16), np.arange(fitted.lattice.size, dtype=np.uint16)

    @property
    def samples(self) -> Samples:
        return self._samples

    @property
    def facts(self) -> dict[str, Any]:
        return dict(self._facts)

    @property
    def counts(self) -> Counts:
        return Counts(0, 0.0, 0.0)

    @property
    def lookup(self) -> str:
        return "measurement"

    def eval(self, wi: ArrayLike, wo: ArrayLike) -> Vectors:
        light, viewer = vectors("eval", wi, wo)
        pairs = (np.ascontiguousarray(w).reshape(-1, 3) for w in (light, viewer))
        return self._native.eval(*pairs).reshape(light.shape)

    @cached_property
    def _native(self) -> Native:
        lattice, one = self.lattice, np.ones(1)
        entries = one, self.node_values, *self._of_node, self.scale
        return _core.NodeLookup(*lattice.axes(), *entries, **lattice.folds, signed=self.signed, smooth=True)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in ("_native", "sampler")}


def from_samples(
    samples: Samples, *, name: str, source_sha256: str = "", facts: Mapping[str, Any] = MappingProxyType({})
) -> GridBrdf | ScatteredBrdf:
    """The material of samples, whose numbers are meant as `reading.asked` says: that of a regular grid
    (`gridded.grid_of`), or one that is fitted to them (`fitted_to`). Those at the horizon itself, where nothing can be
    measured, are left out. facts: what the file's reader reports.

    Where `reading.asked` says so, the material is that of the prior and of the samples, whether on a grid or not.
    Raises FormatError for samples below the horizon, fewer than `fewest` or too many, and MissingDependencyError
    without SciPy if they are on no grid.
    """
    _check(samples, asked().prior)
    samples = as_f_r(samples, asked())
    above = np.minimum(samples.wi[:, 2], samples.wo[:, 2]) > HORIZON
    kept = samples if above.all() else samples.some(above)
    if asked().prior:
        return fitted_to(samples, name=name, source_sha256=source_sha256, facts=facts, prior=True)
    grid = grid_of(kept, name=name, source_sha256=source_sha256, facts=facts)
    if grid and np.median(np.diff(grid.axes[0])) <= COARSEST:
        return grid
    return fitted_to(samples, name=name, source_sha256=source_sha256, facts=facts)


def fitted_to(
    samples: Samples,
    *,
    name: str,
    source_sha256: str = "",
    facts: Mapping[str, Any] = MappingProxyType({}),
    choice: Choice | None = None,
    prior: bool = False,
) -> ScatteredBrdf:
    """The material that is fitted to samples, whether they are on a grid or not. facts: what the file's reader reports.
    choice: how samples are interpolated, if that is known already. prior: whether what was not measured is estimated
    from other materials (`prior`), in place of that.

    It keeps negative values where samples have some.

    Its facts: samples, those at different directions; samples_merged, how many repeated others; samples_at_the_horizon,
    those left out; samples_negative, those with a channel below 0; mirrored, whether they lay on one side of the plane
    of incidence, and stand for the other, too; coverage, the share of all pairs of directions, by solid angles and
    cosines, that is within REACH of a sample; one_sided, whether both orders of the directions are kept apart; and what
    `held_out.chosen` reports. With a prior, in place of the last two: prior, which one; deviation_median, by solid
    angles and cosines, and deviation, means for bands of θ_h (rows, equal in √θ_h) and of θ_d: of the standard
    deviation of log f_r, all of which `estimate` holds.

    Raises FormatError and MissingDependencyError as `from_samples`.
    """
    _check(samples, prior)
    above = np.minimum(samples.wi[:, 2], samples.wo[:, 2]) > HORIZON
    negative = int((samples.f_r[above] < 0).any(axis=1).sum())
    kept = merged(samples.some(above))
    if len(kept.wi) < fewest(prior):
        raise FormatError(f"expected samples at {fewest(prior)} different directions, found {len(kept.wi)}")
    if not (kept.f_r > 0).any():
        raise FormatError("expected a positive reflectance in some sample, found none")
    both, mirrored = both_sides(kept)
    estimate = shipped().estimate(kept, name=name) if prior else None
    if estimate is not None:
        found, report, mirrored, nodes = estimate, _uncertainty(estimate), False, MOST_NODES
    else:
        choice = choice or chosen(kept, both_sides)
        found = Regression(both, choice.chart, one_sided=choice.one_sided, mirrored=mirrored, name=name)
        report = {"one_sided": choice.one_sided, **choice.report}
        nodes = int(np.clip(NODES_A_SAMPLE * len(kept.wi), FEWEST_NODES, MOST_NODES))
    try:
        fitted = fitted_to_samples(found, nodes)
    except MaterialError as error:
        raise FormatError(str(error)) from error
    measured = near(both, *directions(*(angle[COVERAGE.above_horizon] for angle in COVERAGE.angles())))
    weight = (COVERAGE.solid_angles() * np.prod(COVERAGE.cosines(), axis=0))[COVERAGE.above_horizon]
    found_facts: dict[str, Any] = {
        "samples": len(kept.wi),
        "samples_merged": int(above.sum()) - len(kept.wi),
        "samples_at_the_horizon": int((~above).sum()),
        "samples_negative": negative,
        "mirrored": mirrored,
        "coverage": float((weight * measured).sum() / weight.sum()),
        **report,
        **facts,
    }
    brdf = ScatteredBrdf(fitted, kept, found_facts, Source(source_sha256))
    brdf.choice, brdf.estimate = choice, estimate
    brdf.measured = np.zeros(COVERAGE.shape, bool)
    brdf.measured[COVERAGE.above_horizon] = measured
    return brdf


def fewest(prior: bool) -> int:
    """The number of samples, at different directions, that a material can be made of."""
    return FEWEST if prior else 2 * NEIGHBOURS


def _uncertainty(estimate: Estimate) -> dict[str, Any]:
    """What the facts of a material tell of an estimate."""
    above, deviation = DEVIATIONS.above_horizon, estimate.deviation
    weight = DEVIATIONS.solid_angles() * np.prod(DEVIATIONS.cosines(), axis=0) * above
    order = np.argsort(deviation[above])
    sums = np.cumsum(weight[above][order])
    bands = (BANDS[0], DEVIATIONS.shape[0] // BANDS[0], BANDS[1], DEVIATIONS.shape[1] // BANDS[1], -1)
    totals, counts = (
        each.reshape(bands).sum(axis=(1, 3, 4)) for each in (np.where(above, deviation, 0.0), above.astype(float))
    )
    means = np.where(counts > 0, totals / np.maximum(counts, 1), 0.0)
    return {
        "prior": PRIOR,
        "deviation_median": float(deviation[above][order][np.searchsorted(sums, sums[-1] / 2)]),
        "deviation": np.round(means, 3).tolist(),
    }


def _check(samples: Samples, prior: bool) -> None:
    """Raises FormatError for what no material can be fitted to."""
    most = MOST if prior else MOST_SAMPLES
    if not fewest(prior) <= len(samples.wi) <= most:
        count = len(samples.wi)
        other = f" (--prior estimates a material of {FEWEST} to {MOST})" if FEWEST <= count < fewest(prior) else ""
        with_prior = " with --prior" if prior else ""
        raise FormatError(f"expected {fewest(prior)} to {most} samples{with_prior}, found {count}{other}")
    if not (np.isfinite(samples.f_r).all() and np.isfinite(samples.wi).all() and np.isfinite(samples.wo).all()):
        raise FormatError("expected finite numbers in every sample, found NaN or infinity")
    if np.abs(samples.f_r).max() > LARGEST:  # and not set to 0, as in tables: its neighbours would be lost with it
        found = f"{np.abs(samples.f_r).max():g}"
        raise FormatError(f"expected values that single precision can hold in every sample, found one of {found}")
    if min(samples.wi[:, 2].min(), samples.wo[:, 2].min()) < -HORIZON:
        raise FormatError("expected directions above the horizon, found some below it")


def merged(samples: Samples) -> Samples:
    """Samples at different directions: repeated ones are replaced by their mean.

    Two are the same if they differ by a turn about the normal or by the order of the directions, which make no
    difference to a reciprocal, isotropic material.
    """
    theta_h, theta_d, phi_d = half_diff(split(samples.wi), split(samples.wo))
    s = np.sin(theta_h) * np.sin(theta_d)
    places = np.stack([np.sqrt(theta_h), theta_d, s * np.cos(2 * phi_d), s * np.sin(2 * phi_d)], axis=-1)
    _, first, group, count = np.unique(
        np.rint(places / SAME).astype(np.int64) @ (1 << np.array([0, 15, 30, 45])),
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    if len(first) == len(group):
        return samples
    means = np.stack([np.bincount(group, weights=channel) for channel in samples.f_r.T], axis=-1) / count[:, None]
    order = np.argsort(first)  # that of the file
    return Samples(samples.wi[first[order]], samples.wo[first[order]], means[order])


def both_sides(samples: Samples) -> tuple[Samples, bool]:
    """Samples on both sides of the plane of incidence, and whether mirror images were added for that.

    Instruments that rely on the mirror symmetry of isotropic materials measure one side alone; to such samples their
    mirror images are added.
    """
    (x, y), (u, v) = samples.wi[:, :2].T, samples.wo[:, :2].T
    azimuth = np.arctan2(x * v - y * u, x * u + y * v)
    aside = (np.abs(np.sin(azimuth)) > IN_PLANE) & (np.minimum(np.hypot(x, y), np.hypot(u, v)) > IN_PLANE)
    if (azimuth[aside] > 0).any() and (azimuth[aside] < 0).any():
        return samples, False
    wi, wo = (np.concatenate([w, w * [1, -1, 1]]) for w in (samples.wi, samples.wo))
    return Samples(wi, wo, np.concatenate([samples.f_r, samples.f_r])), True


def near(samples: Samples, wi: Triple, wo: Triple) -> NDArray[np.bool_]:
    """Whether a sample lies within REACH of each pair, in half/difference angles."""

    def places(wi: Triple, wo: Triple) -> NDArray[np.float64]:
        theta_h, theta_d, phi_d = half_diff(wi, wo)
        s = np.sin(theta_h) * np.sin(theta_d)
        return np.stack([theta_h, theta_d, s * np.cos(2 * phi_d), s * np.sin(2 * phi_d)], axis=-1)

    known = tree(places(split(samples.wi), split(samples.wo)))
    with hold_interrupts():
        distance, _ = known.query(places(wi, wo), distance_upper_bound=REACH, workers=limit() or -1)
    return np.isfinite(distance)


def extrapolated(brdf: Brdf) -> float | None:
    """The share of all pairs of directions, by solid angles and cosines, that is beyond REACH of every sample; None of
    what was not fitted to samples."""
    coverage = brdf.facts.get("coverage")
    return None if coverage is None else 1.0 - coverage
