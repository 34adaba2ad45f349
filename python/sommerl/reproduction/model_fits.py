"""Analytic models fitted to a material: GGX over a Lambertian base (8 numbers), as `sommerl fit --loss cube-root` does
it, and SGD (30 numbers), of which the rest of this page tells.

Directions: PAIRS random pairs above the horizon. Half of them are two cosine-weighted directions; the other half are
uniform in √θ_h, θ_d and φ_d, as MERL's cells are, so that a narrow highlight is seen, too.

Loss: the sum of squared differences of ∛(f_r cos θ_i cos θ_o). A cube root is much like a logarithm, but takes zeros,
and does not let the highlight's few large values decide alone.

Search: SciPy's `least_squares` ("trf", with bounds), channel by channel. All starts go a short way on a tenth of the
pairs; the best of them goes on with all. κ is 1: it and ρ_s are one factor. c is (θ₁ − θ₀)^−k: shadowing begins at θ₀
and is under way at θ₁.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fitting import FitOptions, fit
from ..models.sgd import PARAMETERS, Angles, ShiftedGamma, channel
from ..reflectance.arrays import split
from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import directions
from ..system.optional import optional

Array = NDArray[np.float64]
Residuals = Callable[[Array, int], Array]  #: for parameters, at every so manieth pair

PAIRS, FEW = 20_000, 10  # the starts are compared at every tenth pair
SHORT_EVALUATIONS, LONG_EVALUATIONS = 40, 100
GGX_PARAMETERS, SGD_PARAMETERS = 8, 30
GGX_SAMPLES = 200_000
SGD_STARTS = ((2e-4, 0.3), (2e-4, 1.0), (0.01, 0.5), (0.05, 1.0), (0.3, 0.5))  # α, p
# ρ_d, log ρ_s, log α, p, f0, f1, λ, θ₁ − θ₀, k, θ₀: the range of what Bagher et al. publish, and more.
SGD_LOW = (0.0, -25.0, -12.0, 0.0, 0.0, -1.0, 0.0, 0.3, 0.5, -0.8)
SGD_HIGH = (2.0, 20.0, 1.0, 6.0, 2.0, 2.0, 50.0, 3.0, 400.0, 1.3)


def fitted_ggx(brdf: Brdf) -> Brdf:
    """The Lambertian base and GGX lobe nearest to a material."""
    return fit(brdf, "ggx", FitOptions(loss="cube-root", samples=GGX_SAMPLES)).brdf


def fitted_sgd(brdf: Brdf) -> ShiftedGamma:
    """The Shifted Gamma Distribution nearest to a material, channel by channel."""
    wi, wo = pairs()
    f_r = brdf.eval(wi, wo)
    seen = {step: Angles.of(split(wi[::step]), split(wo[::step])) for step in (1, FEW)}
    found = [_sgd_channel(f_r[:, c], seen) for c in range(3)]
    return ShiftedGamma(f"{brdf.name} (SGD fit)", {key: [q[key] for q in found] for key in PARAMETERS})


def _sgd_channel(f_r: Array, seen: dict[int, Angles]) -> dict[str, float]:
    whole = seen[1]
    measured = np.cbrt(f_r * whole.cosines)

    def residuals(x: Array, step: int) -> Array:
        modelled = channel(_sgd(x), seen[step]) * seen[step].cosines
        return np.cbrt(modelled) - measured[::step]

    starts: list[Sequence[float]] = []
    for alpha, p in SGD_STARTS:
        start = [0.0, 0.0, np.log(alpha), p, 0.3, 0.0, 3.0, 1.0, 20.0, 0.3]
        lobe = np.cbrt(channel(_sgd(np.array(start)), whole) * whole.cosines)
        start[0] = np.clip(np.pi * np.median(f_r), 1e-3, 1.0)
        start[1] = 3 * np.log(0.5 * measured.sum() / lobe.sum())  # half of the loss's sum is the lobe's
        starts.append(start)
    return _sgd(_best(residuals, starts, SGD_LOW, SGD_HIGH))


def _sgd(x: Array) -> dict[str, float]:
    rho_d, log_rho_s, log_alpha, p, f0, f1, shadow, width, k, theta0 = map(float, x)
    values = rho_d, np.exp(log_rho_s), np.exp(log_alpha), p, f0, f1, 1.0, shadow, width**-k, k, theta0
    return dict(zip(PARAMETERS, map(float, values), strict=True))


def _best(
    residuals: Residuals, starts: Sequence[Sequence[float]], low: Sequence[float], high: Sequence[float]
) -> Array:
    """The parameters with the least loss that a search from one of the starts finds."""

    def search(start: Any, step: int, evaluations: int) -> Any:
        inside = np.clip(start, np.array(low) + 1e-9, np.array(high) - 1e-9)
        return optional("scipy.optimize", "SciPy", "fits", "fit").least_squares(
            residuals,
            inside,
            bounds=(low, high),
            method="trf",
            x_scale="jac",
            ftol=1e-6,
            max_nfev=evaluations,
            args=(step,),
        )

    short = [search(start, FEW, SHORT_EVALUATIONS) for start in starts]
    return search(min(short, key=lambda result: result.cost).x, 1, LONG_EVALUATIONS).x


def pairs(seed: int = 0) -> tuple[Array, Array]:
    """PAIRS random pairs of directions (n, 3), mixed."""
    random = np.random.default_rng(seed)
    half = PAIRS // 2

    def cosine_weighted() -> Array:
        u, phi = random.random(half), 2 * np.pi * random.random(half)
        return np.stack([np.sqrt(u) * np.cos(phi), np.sqrt(u) * np.sin(phi), np.sqrt(1 - u)], axis=-1)

    one, other = cosine_weighted(), cosine_weighted()
    theta_h, theta_d, phi_d = np.pi / 2 * random.random(4 * half) ** 2, *random.random((2, 4 * half)) * np.pi
    wi, wo = (np.stack(w, axis=-1) for w in directions(theta_h, theta_d / 2, phi_d))
    above = np.flatnonzero((wi[:, 2] > 0) & (wo[:, 2] > 0))[:half]
    mixed = random.permutation(2 * half)
    return np.concatenate([one, wi[above]])[mixed], np.concatenate([other, wo[above]])[mixed]
