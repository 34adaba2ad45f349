"""From samples at any directions to a table.

Local linear regression (Cleveland 1979): at each cell, a plane fitted to the nearest samples with tricube weights, in
coordinates in which a reciprocal, isotropic BRDF is one smooth function, (√θ_h, θ_d, s cos 2φ_d, s sin 2φ_d) with
s = sin θ_h sin θ_d, of the value ∛f_r.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Triple, split
from ..reflectance.brdf import LARGEST
from ..reflectance.cells import MERL, Lattice
from ..reflectance.distance import LOG_FLOOR, energy_share
from ..reflectance.half_diff import directions, half_diff
from ..reflectance.info import Counts
from ..reflectance.samples import Samples
from ..reflectance.table import BrdfTable, representable
from ..system.errors import FormatError, MaterialError
from ..system.interrupt import hold_interrupts
from ..system.optional import optional
from ..system.threads import limit

NEIGHBOURS = 16
RIDGE = 1e-3  # keeps the planes flat where neighbours leave their slope open
HORIZON = 1e-6  # cosines up to that are at the horizon
REACH = np.radians(10.0)  # of a sample: cells farther from all of them count as not measured
COARSE = Lattice(36, 30, 60)  # where planes are fitted; MERL's cells are interpolated from there
AT_ONCE = 2**14  # planes: bounds memory
HELD_OUT = 10  # one sample in so many tests the others
MOST_HELD_OUT = 5000
SAME = 1e-4  # samples whose coordinates agree to that are one, measured several times
IN_PLANE = np.radians(0.5)  # azimuths between 0 and this, or this and π, lie on neither side of the plane of incidence
MOST_SAMPLES = 2_000_000


class ScatteredTable(BrdfTable):
    """A table made from `samples`. measured: whether one lies near each cell, of the lattice's shape. changed: in
    values that were fitted to the samples, before the table was interpolated from these."""

    measured: NDArray[np.bool_]
    samples: Samples
    changed: Counts

    @property
    def counts(self) -> Counts:
        return self.changed


def to_table(samples: Samples, *, name: str, source_sha256: str | None = None, lattice: Lattice = MERL) -> BrdfTable:
    """The table that is fitted to samples. Those at the horizon itself, where nothing can be measured, are left out.

    A fitted plane may be negative, where samples are or between them. Such values are changed as `BrdfTable` does, and
    `cells_clamped` counts the table's cells that are interpolated from one.

    Its facts: samples, those at different directions; samples_at_the_horizon, those left out; samples_negative, those
    with a channel below 0, which the planes are fitted to as they are; mirrored, whether they
    lay on one side of the plane of incidence, and stand for the other, too; coverage, the share of the lattice above
    the horizon, by solid angle and cosines, that is measured; held_out_…, how far the tenth part of the samples, left
    out, was from what the others say there.

    Raises FormatError for samples below the horizon or fewer than 2·NEIGHBOURS, and MissingDependencyError without
    SciPy.
    """
    if not 2 * NEIGHBOURS <= len(samples.wi) <= MOST_SAMPLES:
        raise FormatError(f"expected {2 * NEIGHBOURS} to {MOST_SAMPLES} samples, found {len(samples.wi)}")
    if not (np.isfinite(samples.f_r).all() and np.isfinite(samples.wi).all() and np.isfinite(samples.wo).all()):
        raise FormatError("expected finite numbers in every sample, found NaN or infinity")
    if np.abs(samples.f_r).max() > LARGEST:  # and not set to 0, as in tables: its neighbours would be lost with it
        found = f"{np.abs(samples.f_r).max():g}"
        raise FormatError(f"expected values that single precision can hold in every sample, found one of {found}")
    lowest = np.minimum(samples.wi[:, 2], samples.wo[:, 2])
    if lowest.min() < -HORIZON:
        raise FormatError("expected directions above the horizon, found some below it")
    negative = int((samples.f_r[lowest > HORIZON] < 0).any(axis=1).sum())
    samples = _merged(samples.some(lowest > HORIZON))
    if len(samples.wi) < 2 * NEIGHBOURS:
        raise FormatError(f"expected samples at {2 * NEIGHBOURS} different directions, found {len(samples.wi)}")
    both, mirrored = _both_sides(samples)
    coarse = COARSE if lattice.reciprocal else Lattice(COARSE.theta_h, COARSE.theta_d, 2 * COARSE.phi_d, False)
    above = coarse.above_horizon
    wi, wo = directions(*(angle[above] for angle in coarse.angles()))
    values = np.zeros((*coarse.shape, 3))
    values[above] = _regression(both, wi, wo)
    try:
        fitted = BrdfTable(representable(values)[0], coarse, name=name)
    except MaterialError as error:
        raise FormatError("expected a positive reflectance in some sample, found none") from error
    fine = BrdfTable.sampled(fitted, lattice)
    table = ScatteredTable(fine.values, lattice, name=name, source_sha256=source_sha256)
    table.changed = _changed(coarse, values, table)
    near = np.zeros(coarse.shape, bool)
    near[above] = _near(both, wi, wo)
    table.samples = samples
    table.measured = coarse.extended(near).reshape(-1)[coarse.cell(*lattice.angles())] & lattice.above_horizon
    weight = lattice.solid_angles() * np.prod(lattice.cosines(), axis=0) * lattice.above_horizon
    table.source_facts = {
        "samples": len(samples.wi),
        "samples_at_the_horizon": int((lowest <= HORIZON).sum()),
        "samples_negative": negative,
        "mirrored": mirrored,
        "coverage": float((weight * table.measured).sum() / weight.sum()),
        "cells_not_measured": int((lattice.above_horizon & ~table.measured).sum()),
        **_held_out(samples),
    }
    return table


def _changed(coarse: Lattice, values: NDArray[np.float64], table: BrdfTable) -> Counts:
    """How many cells of a table above the horizon are interpolated from values, of a coarse lattice, that no table can
    hold; and the share of the energy by which these were changed."""
    values = coarse.extended(values)
    held, changed = representable(values)
    if not changed.any():
        return Counts(0, 0.0, 0.0)
    size = np.minimum(np.abs(np.where(np.isfinite(values), values - held, 0.0)), LARGEST)
    touched, moved = (
        BrdfTable.sampled(BrdfTable(each, coarse), table.lattice).values if each.any() else np.zeros_like(table.values)
        for each in (np.repeat(changed[..., None], 3, axis=-1).astype(np.float64), size)
    )
    cells = (touched > 0).any(axis=-1) & table.lattice.above_horizon
    return Counts(int(cells.sum()), energy_share(moved, table.values + moved, table.lattice), 0.0)


def _merged(samples: Samples) -> Samples:
    """Samples at different directions: repeated ones are replaced by their mean.

    Two are the same if they differ by a turn about the normal or by the order of the directions, which make no
    difference to a reciprocal, isotropic material.
    """
    places = np.rint(_coordinates(split(samples.wi), split(samples.wo)) / SAME).astype(np.int64)
    _, first, group, count = np.unique(
        places @ (1 << np.array([0, 15, 30, 45])), return_index=True, return_inverse=True, return_counts=True
    )
    if len(first) == len(group):
        return samples
    sums = np.stack([np.bincount(group, weights=channel) for channel in samples.f_r.T], axis=-1)
    return Samples(samples.wi[first], samples.wo[first], sums / count[:, None])


def _both_sides(samples: Samples) -> tuple[Samples, bool]:
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


def _held_out(samples: Samples) -> dict[str, float]:
    """Errors at every tenth sample, in a random order, of a regression without them."""
    order = np.argsort(np.random.PCG64(0).random_raw(len(samples.wi)))
    test, train = order[::HELD_OUT][:MOST_HELD_OUT], np.delete(order, np.s_[::HELD_OUT])
    known, _ = _both_sides(samples.some(train))
    wi, wo = samples.wi[test], samples.wo[test]
    found, true = np.maximum(_regression(known, split(wi), split(wo)), 0), np.maximum(samples.f_r[test], 0)
    weight = (wi[:, 2] * wo[:, 2])[:, None]
    logs = np.log(found + LOG_FLOOR) - np.log(true + LOG_FLOOR)
    relative = np.abs(found - true).sum(axis=1) / np.maximum(true.sum(axis=1), LOG_FLOOR)
    return {
        "held_out_log_error_cosine": float(np.sqrt((weight * logs**2).sum() / (3 * weight.sum()))),
        "held_out_median_relative_error": float(np.median(relative)),
    }


def _regression(samples: Samples, wi: Triple, wo: Triple) -> NDArray[np.float64]:
    """f_r (n, 3) at pairs of directions."""
    domain = np.cbrt(samples.f_r)
    known, wanted = _coordinates(split(samples.wi), split(samples.wo)), _coordinates(wi, wo)
    tree = _tree(known)
    parts = [_planes(tree, known, domain, part) for part in np.array_split(wanted, -(-len(wanted) // AT_ONCE))]
    with np.errstate(over="ignore"):  # a table sets what is too large to 0, and counts it
        return np.concatenate(parts) ** 3


def _planes(
    tree: Any, known: NDArray[np.float64], domain: NDArray[np.float64], wanted: NDArray[np.float64]
) -> NDArray[np.float64]:
    """At each wanted point, the height of the plane fitted to its neighbours."""
    with hold_interrupts():  # SciPy would leave its threads behind, at work on arrays that are gone
        found: tuple[NDArray[np.float64], NDArray[np.intp]] = tree.query(wanted, NEIGHBOURS, workers=limit() or -1)
    distance, nearest = found
    reach = distance[:, -1:] * (1 + 1e-6) + 1e-12
    weight = (1 - (distance / reach) ** 3) ** 3
    offsets = (known[nearest] - wanted[:, None]) / reach[..., None]
    plane = np.concatenate([np.ones((*distance.shape, 1)), offsets], axis=-1)
    weighted = plane * weight[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ plane
    flat = np.diag([0.0] + [RIDGE * NEIGHBOURS] * (plane.shape[-1] - 1))
    moments: NDArray[np.float64] = np.swapaxes(weighted, 1, 2) @ domain[nearest]
    return np.linalg.solve(normal + flat, moments)[:, 0].astype(np.float64)


def _near(samples: Samples, wi: Triple, wo: Triple) -> NDArray[np.bool_]:
    """Whether a sample lies within REACH of each pair, in half/difference angles."""
    known = _coordinates(split(samples.wi), split(samples.wo), root=False)
    tree, wanted = _tree(known), _coordinates(wi, wo, root=False)
    with hold_interrupts():
        distance, _ = tree.query(wanted, distance_upper_bound=REACH, workers=limit() or -1)
    return np.isfinite(distance)


def _coordinates(wi: Triple, wo: Triple, *, root: bool = True) -> NDArray[np.float64]:
    theta_h, theta_d, phi_d = half_diff(wi, wo)
    s = np.sin(theta_h) * np.sin(theta_d)
    along, across = s * np.cos(2 * phi_d), s * np.sin(2 * phi_d)
    return np.stack([np.sqrt(theta_h) if root else theta_h, theta_d, along, across], axis=-1)


def _tree(points: NDArray[np.float64]) -> Any:
    return optional("scipy.spatial", "SciPy", "scattered samples", "formats").KDTree(points)
