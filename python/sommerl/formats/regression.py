"""What scattered samples say between them: interpolating moving least squares.

At each pair of directions, a plane is fitted to the nearest samples (Cleveland 1979), with weights that grow towards
each sample until the plane all but passes through it (Lancaster & Salkauskas 1981), so that no peak that was measured
is averaged away. Planes are of ∛f_r over coordinates in which a reciprocal, isotropic BRDF is one smooth function,
(√θ_h, y, s cos 2φ_d, s sin 2φ_d). What y and s are, one of CHARTS says: √θ_d is fine where retro-reflection is, at
θ_d = 0, as √θ_h is where highlights are; θ_d is better for smooth materials. Held-out samples decide (`held_out`).

Samples whose directions were swapped need not agree, as where an instrument is a little out of line. One-sided planes
keep both orders apart, in (√θ_h, y, 2 s cos φ_d, 2 s sin φ_d); where nothing was measured in one order, the other one
stands for it, as if it were SWAPPED away.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..reflectance.arrays import Triple, split
from ..reflectance.brdf import Brdf, Buffers, Vectors, evaluated, vectors
from ..reflectance.half_diff import half_diff
from ..reflectance.samples import Samples
from ..system.interrupt import hold_interrupts
from ..system.optional import optional
from ..system.threads import limit

NEIGHBOURS = 16  # 8 and 32 are worse at Cornell's samples, or at their lines of incidence (docs/laboratory.md)
RIDGE = 1e-3  # keeps the planes flat where neighbours leave their slope open
NEARNESS = 0.01  # a sample's weight at its own place is 1/NEARNESS times as much as without its growth
SWAPPED = 0.1
MOST_KNOWN = 300_000  # samples that planes are fitted to; of more, some drawn at random
AT_ONCE = 2**14  # planes: bounds memory

Floats = NDArray[np.float64]
Chart = Callable[[Floats, Floats], tuple[Floats, Floats]]  #: y and s of θ_h and θ_d


def _smooth(theta_h: Floats, theta_d: Floats) -> tuple[Floats, Floats]:
    return theta_d, np.sin(theta_h) * np.sin(theta_d)


def _retro(theta_h: Floats, theta_d: Floats) -> tuple[Floats, Floats]:
    return np.sqrt(theta_d), np.sin(theta_h) * np.sin(theta_d)


def _turning(theta_h: Floats, theta_d: Floats) -> tuple[Floats, Floats]:
    return np.sqrt(theta_d), np.sqrt(np.minimum(theta_h, theta_d))


def _wide(theta_h: Floats, theta_d: Floats) -> tuple[Floats, Floats]:
    y, s = _turning(theta_h, theta_d)
    return y, 2 * s


CHARTS: tuple[Chart, ...] = (_smooth, _retro, _turning, _wide)


class Regression(Brdf):
    """The BRDF that samples stand for, evaluated in NumPy alone: slow, and made to be sampled.

    samples: at different directions, on both sides of the plane of incidence; see `scattered`. one_sided: whether both
    orders of the directions are kept apart.
    """

    kind = "measurement"

    def __init__(self, samples: Samples, chart: Chart, *, one_sided: bool, mirrored: bool, name: str) -> None:
        self.name, self._samples = name, samples
        self._chart, self._one_sided, self._mirrored = chart, one_sided, mirrored
        known = drawn(samples, MOST_KNOWN)
        wi, wo = split(known.wi), split(known.wo)
        self._known, self._domain = self._coordinates(wi, wo), np.cbrt(known.f_r)
        if one_sided:
            swapped = self._coordinates(wo, wi)
            swapped[:, -1] = SWAPPED
            self._known = np.concatenate([self._known, swapped])
            self._domain = np.concatenate([self._domain, self._domain])
        self._tree = tree(self._known)

    @property
    def samples(self) -> Samples:
        return self._samples

    @property
    def reciprocal(self) -> bool:
        return not self._one_sided

    @property
    def mirrored(self) -> bool:
        return self._mirrored

    @property
    def signed(self) -> bool:
        return bool((self._samples.f_r < 0).any())

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        wanted = self._coordinates(wi, wo)
        parts = [
            planes(self._tree, self._known, self._domain, part)
            for part in np.array_split(wanted, max(1, -(-len(wanted) // AT_ONCE)))
        ]
        found = np.concatenate(parts) ** 3
        return split(found if self.signed else np.maximum(found, 0.0))

    def eval(self, wi: ArrayLike, wo: ArrayLike) -> Vectors:
        light, viewer = vectors("eval", wi, wo)
        return evaluated(light, viewer, lambda wi, wo, _: self.f_r(wi, wo, {}))

    def _coordinates(self, wi: Triple, wo: Triple) -> Floats:
        theta_h, theta_d, phi_d = half_diff(wi, wo, self.reciprocal)
        y, s = self._chart(theta_h, theta_d)
        if self._one_sided:
            return np.stack([np.sqrt(theta_h), y, 2 * s * np.cos(phi_d), 2 * s * np.sin(phi_d), 0 * s], axis=-1)
        return np.stack([np.sqrt(theta_h), y, s * np.cos(2 * phi_d), s * np.sin(2 * phi_d)], axis=-1)


def planes(tree: Any, known: Floats, domain: Floats, wanted: Floats) -> Floats:
    """At each wanted point, the height of the plane fitted to its neighbours."""
    with hold_interrupts():  # SciPy would leave its threads behind, at work on arrays that are gone
        found: tuple[Floats, NDArray[np.intp]] = tree.query(wanted, NEIGHBOURS, workers=limit() or -1)
    distance, nearest = found
    reach = distance[:, -1:] * (1 + 1e-6) + 1e-12
    share = distance / reach
    weight = (1 - share**3) ** 3 / (share**2 + NEARNESS)
    offsets = (known[nearest] - wanted[:, None]) / reach[..., None]
    plane = np.concatenate([np.ones((*distance.shape, 1)), offsets], axis=-1)
    weighted = plane * weight[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ plane
    flat = np.diag([0.0] + [RIDGE * NEIGHBOURS] * (plane.shape[-1] - 1))
    values = domain[nearest]
    moments: Floats = np.swapaxes(weighted, 1, 2) @ values
    height = np.linalg.solve(normal + flat, moments)[:, 0].astype(np.float64)
    return np.clip(height, values.min(axis=1), values.max(axis=1))  # a slope that goes on beyond them invents peaks


def drawn(samples: Samples, most: int) -> Samples:
    """The samples, or if there are more than `most`, that many of them, drawn at random."""
    if len(samples.wi) <= most:
        return samples
    chosen = np.argsort(np.random.PCG64(1).random_raw(len(samples.wi)))[:most]
    return samples.some(np.sort(chosen))


def tree(points: Floats) -> Any:
    """SciPy's tree of points. Raises MissingDependencyError without SciPy."""
    return optional("scipy.spatial", "SciPy", "scattered samples", "lab").KDTree(points)
