"""What physics says of samples: mistakes in what their numbers mean, found before they are believed.

A material is reciprocal, reflects no more than it receives, and most shine in the mirror's direction.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import spherical
from ..reflectance.samples import Samples
from .gridded import angles_of
from .reading import AS_IT_IS, Reading
from .regression import drawn, tree

Floats = NDArray[np.float64]
NEAR_PAIR = np.radians(1.0)  # samples nearer than that to another one's swapped pair are compared with it
APART = np.radians(10.0)  # angles of light and viewer that differ by less say nothing of a cosine
MOST_PAIRS = 20_000
LEAST_PAIRS = 20
NOTABLE = 0.05  # asymmetries below are noise
BETTER = 0.5  # a mistake is told if the asymmetry without it is less than this share
MOST_REFLECTED = 1.05  # hemispherical reflectances above are no measurement's noise
ABOUT = np.radians(6.0)  # of a direction, in which a peak is said to be
OBLIQUE = np.radians(15.0)  # θ_i from which mirror's and light's directions are told apart
LINES = 12  # θ_i whose reflectance is looked at
STEPS = 90, 180  # in θ_o and φ, of its quadrature
MANY = 0.5  # of the lines of incidence, so that something is said of all


def checked(samples: Samples, brdf: Brdf, meant: Reading | None = AS_IT_IS) -> dict[str, Any]:
    """What physics says of samples and of the material made from them.

    swapped_pairs: how many samples have a partner with swapped directions, within 1°; swapped_asymmetry: Σ |a − b| over
    the mean of Σ a and Σ b, of these; swapped_asymmetry_without_cosine: the same after division by the cosine of the
    viewer's angle. reflectance: the largest hemispherical reflectance of a channel for each of up to LINES θ_i,
    [[degrees, reflectance], …]. brightest: on most lines of incidence from 15° on, "specular", "retro" or "other", or
    "" if none is oblique. mistakes: sentences, each with the option that mends it; without it, if `meant` is None, as
    of files to which these options do not apply.
    """
    pairs, plain, without = _swapped(samples)
    reflectance = [[float(np.degrees(theta)), _reflectance(brdf, theta)] for theta in _lines(samples)]
    brightest = _brightest(samples)
    found: dict[str, Any] = {
        "swapped_pairs": pairs,
        "swapped_asymmetry": plain,
        "swapped_asymmetry_without_cosine": without,
        "reflectance": reflectance,
        "brightest": brightest,
    }
    return found | {"mistakes": _mistakes(found, meant)}


def _mistakes(found: dict[str, Any], meant: Reading | None) -> list[str]:
    mistakes: list[tuple[str, str]] = []  # what is seen, and what mends it
    values, phi_from = (meant.values, meant.phi_from) if meant else ("f_r", "retro")
    plain, without = found["swapped_asymmetry"], found["swapped_asymmetry_without_cosine"]
    if plain is not None and plain > NOTABLE and without < BETTER * plain and values == "f_r":
        seen = f"swapped pairs differ by {plain:.0%}, and by {without:.0%} once values are divided by cos θ_o: "
        mistakes.append((f"{seen}they seem to be f_r times the cosine", "; --values f_r-cos divides by it"))
    most = max((value for _, value in found["reflectance"]), default=0.0)
    if most > MOST_REFLECTED:
        remedy = ""
        if values != "reflectance-factor" and most / np.pi <= MOST_REFLECTED:
            remedy = ": values may be reflectance factors, π f_r; --values reflectance-factor divides by π"
        elif values != "reflectance-factor" and most / (100 * np.pi) <= MOST_REFLECTED:
            remedy = ": values seem to be in percent; --values reflectance-factor divides by 100 π"
        mistakes.append((f"up to {most:.3g} times the light is reflected, which is more than there is", remedy))
    if found["brightest"] == "retro" and meant:
        other = "retro" if phi_from == "specular" else "specular"
        seen = "it is brightest where light comes from: a retro-reflector, or φ is measured from the mirror's direction"
        mistakes.append((seen, f"; for that, --phi-from {other}"))
    return [seen + (remedy if meant else "") for seen, remedy in mistakes]


def _swapped(samples: Samples) -> tuple[int, float | None, float | None]:
    """How many pairs there are, their asymmetry, and that without a cosine; None if they are fewer than LEAST_PAIRS."""
    theta_i, theta_o, phi = angles_of(samples)

    def places(first: Floats, second: Floats) -> Floats:
        x, y, z = spherical(second, np.minimum(phi, 2 * np.pi - phi))  # either side of the plane of incidence
        return np.stack([first, x, y, z], axis=-1)

    apart = np.flatnonzero(np.abs(theta_i - theta_o) > APART)
    if not len(apart):
        return 0, None, None
    apart = apart[:: -(-len(apart) // MOST_PAIRS)]
    distance, partner = tree(places(theta_i, theta_o)).query(
        places(theta_o, theta_i)[apart], distance_upper_bound=NEAR_PAIR
    )
    close = np.isfinite(distance)
    if close.sum() < LEAST_PAIRS:
        return int(close.sum()), None, None
    one, other = apart[close], partner[close]
    value = samples.f_r.mean(axis=1)
    cosine = np.maximum(samples.wo[:, 2], 0.02)
    asymmetries = [
        float(np.abs(v[one] - v[other]).sum() / max((np.abs(v[one]) + np.abs(v[other])).sum() / 2, 1e-300))
        for v in (value, value / cosine)
    ]
    return int(close.sum()), asymmetries[0], asymmetries[1]


def _lines(samples: Samples) -> Floats:
    """Up to LINES angles of incidence of the samples, evenly chosen [rad]."""
    theta_i, _, _ = angles_of(drawn(samples, MOST_PAIRS))
    known = np.unique(np.round(np.degrees(theta_i), 1))
    chosen = known[np.unique(np.linspace(0, len(known) - 1, LINES).round().astype(int))]
    return np.radians(chosen)


def _reflectance(brdf: Brdf, theta_i: float) -> float:
    """∫ f_r cos θ_o dω_o of the channel that reflects most, by quadrature."""
    cosine, phi = ((np.arange(count) + 0.5) / count for count in STEPS)
    sine = np.sqrt(cosine)  # equal steps in sin² θ_o: all directions count alike
    theta, phi = np.meshgrid(np.arcsin(sine), 2 * np.pi * phi, indexing="ij")
    wo = np.stack(spherical(theta, phi), axis=-1)
    wi = np.array(spherical(np.float64(theta_i), np.float64(0.0)))
    return float(np.pi * brdf.eval(np.broadcast_to(wi, wo.shape), wo).mean(axis=(0, 1)).max())


def _brightest(samples: Samples) -> str:
    """Where most lines of incidence that are oblique are brightest; "" if there are none."""
    theta_i, _, _ = angles_of(samples)
    line = np.round(np.degrees(theta_i), 1)
    said: list[str] = []
    for degrees in np.unique(line[theta_i > OBLIQUE]).tolist():
        those = np.flatnonzero(line == degrees)
        wi, wo = (w[those[samples.f_r[those].sum(axis=1).argmax()]] for w in (samples.wi, samples.wo))
        from_light, from_mirror = (np.linalg.norm(wo - w) for w in (wi, wi * [-1, -1, 1]))
        nearer = min(from_light, from_mirror)
        said.append("other" if nearer > ABOUT else "retro" if from_light < from_mirror else "specular")
    if not said:
        return ""
    return next((each for each in ("specular", "retro") if said.count(each) > MANY * len(said)), "other")
