"""Judges how near a BRDF is to another one without a renderer, and so without noise.

Two pictures of a sphere, seen from far away, are summed over lamps at fixed directions: in soft light, the lamps stand
for the sky and the five lights of the built-in environment; and under one lamp, the smallest of these. Beside them, the
errors of log(f_r + 0.001) at random pairs of directions, everywhere and where light and viewer are near grazing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.distance import LOG_FLOOR
from ..reflectance.half_diff import spherical
from ..reflectance.metric import Metric, decibels, measured
from ..sampling.half_vector import albedo
from .environment import HORIZON, LIGHTS, ZENITH
from .frame import Image
from .metrics import exposure, psnr, to_srgb8

SIDE = 72  # pixels of a picture
SKY, OF_A_LIGHT = 160, 24  # lamps
KEY = 3  # the number of the light that is the one lamp: as small as a bulb
AT_ONCE = 32  # lamps: bounds memory
PAIRS, GRAZING_PAIRS = 30_000, 10_000
GRAZING = np.radians((80.0, 88.5))
ANGLES = np.radians((0.0, 30.0, 60.0, 75.0, 80.0, 85.0, 88.0, 89.5))  # of viewers, whose albedo is compared
POINTS = 4  # along each side of a sampler's cell, of the albedos' quadrature
GOLDEN = np.pi * (3 - 5**0.5)  # the golden angle
DARK = 1e-3  # an albedo below counts as that much in a ratio
MOST = 99.0  # dB, in a mean with others, of pictures that are identical

Vectors = NDArray[np.float64]
Values = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """What a judge sees of a BRDF: linear pictures (pixels, 3); f_r of pairs (n, 3); and albedos (angles, 3)."""

    soft: Values
    lamp: Values
    pairs: Values
    grazing: Values
    albedo: Values


class Judge:
    """Holds BRDFs against a reference, which is looked at once."""

    def __init__(self, reference: Brdf) -> None:
        self._reference = reference

    def metrics(self, candidate: Brdf) -> dict[str, float]:
        """How far a candidate is from the reference, by the keys of JUDGED.

        Raises MaterialError if the reference is black.
        """
        return measured(JUDGED, self._seen, seen(candidate))

    @cached_property
    def _seen(self) -> Seen:
        return seen(self._reference)


def score(metrics: dict[str, float]) -> float:
    """One figure of quality for the choice between candidates [dB]: the mean of both PSNRs and of the log errors in
    decibels, so that none of the three is bought with another one."""
    errors = [metrics[key] + 1e-9 for key in ("log_error", "log_error_grazing")]
    pictures = [min(metrics[key], MOST) for key in ("psnr_soft_db", "psnr_lamp_db")]
    return float(np.mean([*pictures, -10 * np.log10(errors[0] * errors[1])]))


def seen(brdf: Brdf) -> Seen:
    """Looks at a BRDF."""
    _, normals = _normals(SIDE)
    return Seen(
        _lit(brdf, normals, *_lamps()),
        _lit(brdf, normals, *_key_lamp()),
        brdf.eval(*(_cosine(PAIRS, seed) for seed in (0, 1))),
        brdf.eval(*(_grazing(GRAZING_PAIRS, seed) for seed in (2, 3))),
        albedo(brdf, ANGLES, POINTS),
    )


def under_one_lamp(brdf: Brdf, side: int) -> Image:
    """The picture of the sphere under the one lamp, side × side pixels; 0 around the sphere."""
    inside, normals = _normals(side)
    found = np.zeros((side * side, 3), np.float32)
    found[inside] = _lit(brdf, normals, *_key_lamp())
    return Image(found.reshape(side, side, 3), inside.reshape(side, side))


def softly_lit(brdf: Brdf, normals: Vectors, sky: int, of_a_light: int) -> Values:
    """The radiance of a sphere's pixels in soft light of that many lamps, (n, 3): quicker, and more speckled where a
    material mirrors. normals: of the pixels, (n, 3), x to the right, y up, z towards the viewer."""
    return _lit(brdf, normals, *_lamps(sky, of_a_light))


def _lit(brdf: Brdf, normals: Vectors, lamps: Vectors, power: Values) -> Values:
    """The radiance of pixels, (n, 3). normals: theirs, (n, 3). lamps: directions (k, 3). power: of the lamps, radiance
    times solid angle (k, 3)."""
    frame, viewer = _frames(normals)
    total = np.zeros((len(viewer), 3))
    for start in range(0, len(lamps), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        light = np.ascontiguousarray((frame.reshape(-1, 3) @ lamps[part].T).reshape(len(frame), 3, -1).swapaxes(1, 2))
        f_r = brdf.eval(light, viewer[:, None])
        total += np.einsum("nkc,nk,kc->nc", f_r, np.maximum(light[..., 2], 0.0), power[part])
    return total


def _normals(side: int) -> tuple[NDArray[np.bool_], Vectors]:
    """Which of side² pixels show the sphere, and their normals (n, 3): x to the right, y up, z towards the viewer."""
    at = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = (c.reshape(-1) for c in np.meshgrid(at, -at))
    inside = x * x + y * y < 1 - 1 / side
    return inside, np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0.0))], axis=-1)[inside]


def _frames(normal: Vectors) -> tuple[NDArray[np.float64], Vectors]:
    """The surface frames (n, 3, 3) at normals (n, 3), rows being tangent, bitangent and normal, and the viewer's
    directions in them (n, 3)."""
    tangent = np.cross([0.0, 1.0, 0.0], normal)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame: Values = np.stack([tangent, np.cross(normal, tangent), normal], axis=1).astype(np.float64)
    return frame, frame[:, :, 2]


def _lamps(sky: int = SKY, of_a_light: int = OF_A_LIGHT) -> tuple[Vectors, Values]:
    """Lamps for the sky and for each light of the built-in environment: directions and radiance times solid angle."""
    z, phi = 1.0 - (np.arange(sky) + 0.5) / sky * 2, _turns(sky)
    towards = np.stack([np.sqrt(1 - z * z) * np.cos(phi), z, np.sqrt(1 - z * z) * np.sin(phi)], axis=-1)
    up = np.clip(z, 0, 1)[:, None]
    radiance = np.where(z[:, None] > 0, np.array(HORIZON) + (np.array(ZENITH) - HORIZON) * up, 0.0)
    found = [(towards, radiance * (4 * np.pi / sky))]
    for elevation, azimuth, sigma, colour in LIGHTS:
        width = np.radians(sigma)
        # Equal shares of a Gaussian about the light's centre.
        angle = width * np.sqrt(-2 * np.log(1 - (np.arange(of_a_light) + 0.5) / of_a_light))
        about = np.stack(spherical(angle, _turns(of_a_light)), axis=-1)
        power = np.array(colour) * (2 * np.pi * width**2 / of_a_light)
        found.append((about @ _towards(elevation, azimuth), np.tile(power, (of_a_light, 1))))
    directions, powers = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(powers)


def _key_lamp() -> tuple[Vectors, Values]:
    elevation, azimuth, _, colour = LIGHTS[KEY]
    return _towards(elevation, azimuth)[2:], np.array([colour])


def _towards(elevation: float, azimuth: float) -> NDArray[np.float64]:
    """A frame whose last row is the direction to a light of the environment, given in degrees."""
    up, around = np.radians((elevation, azimuth))
    z = np.array([-np.sin(around) * np.cos(up), np.sin(up), np.cos(around) * np.cos(up)])
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z]).astype(np.float64)


def _turns(count: int) -> Values:
    """Azimuths of points on a spiral, a golden angle from one to the next."""
    return np.arange(count, dtype=np.float64) * GOLDEN


def _cosine(count: int, seed: int) -> Vectors:
    """Directions whose density follows the cosine."""
    u, v = np.random.Generator(np.random.PCG64(seed)).random((2, count))
    return np.stack(spherical(np.arcsin(np.sqrt(u)), 2 * np.pi * v), axis=-1)


def _grazing(count: int, seed: int) -> Vectors:
    u, v = np.random.Generator(np.random.PCG64(seed)).random((2, count))
    return np.stack(spherical(GRAZING[0] + u * (GRAZING[1] - GRAZING[0]), 2 * np.pi * v), axis=-1)


def _psnr(reference: Values, candidate: Values) -> float:
    """PSNR of 8-bit sRGB pixels at the reference's exposure."""
    a, b = (pixels.astype(np.float32) for pixels in (reference, candidate))
    scale = exposure(a, np.ones(len(a), bool))
    return psnr(to_srgb8(a * scale), to_srgb8(b * scale))


def _log_error(reference: Values, candidate: Values) -> float:
    """The root of the mean squared difference of log(f_r + LOG_FLOOR), negative values taken for 0."""
    logs = (np.log(np.maximum(values, 0.0) + LOG_FLOOR) for values in (reference, candidate))
    return float(np.sqrt(np.mean(np.square(np.subtract(*logs)))))


def _albedo_ratio(reference: Values, candidate: Values) -> float:
    """The largest ratio over the angles, each time of the brightest channel."""
    a, b = (np.maximum(albedo.max(axis=-1), DARK) for albedo in (reference, candidate))
    return float((b / a).max())


def _of(part: str, distance: Callable[[Values, Values], float]) -> Callable[[Seen, Seen], float]:
    """A distance between the same part of what was seen of two BRDFs."""

    def between(reference: Seen, candidate: Seen) -> float:
        return distance(getattr(reference, part), getattr(candidate, part))

    return between


# What a `Judge` measures. A value takes what was `Seen` of reference and candidate.
JUDGED: list[Metric] = [
    Metric("psnr_soft_db", "PSNR in soft light", _of("soft", _psnr), decibels),
    Metric("psnr_lamp_db", "PSNR under one lamp", _of("lamp", _psnr), decibels),
    Metric("log_error", "log error at random pairs", _of("pairs", _log_error), "{:.3f}".format),
    Metric("log_error_grazing", "log error, both at 80° to 88.5°", _of("grazing", _log_error), "{:.3f}".format),
    Metric("albedo_ratio", "largest ratio of albedos", _of("albedo", _albedo_ratio), "{:.3f}".format),
]
