"""The samples that a model is fitted to: a material's reflectance for many pairs of directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.gamut import without_negatives
from ..reflectance.half_diff import directions
from ..reflectance.samples import Samples
from ..system.errors import MaterialError
from .options import FitOptions

DARKEST, BRIGHTEST = 1e-15, 1e15  # [1/sr], of the largest sample: beyond these, squares would lose precision
DIAMETER = 230  # of the sphere in pixels: nine tenths of a picture of 256 pixels


def samples_of(brdf: Brdf, options: FitOptions) -> Samples:
    """The samples of a material in the directions that the options ask for, as a model can hold them
    (`gamut.without_negatives`).

    Raises MaterialError if a value is not finite, if all are 0, or if the largest is not from DARKEST to
    BRIGHTEST.
    """
    wi, wo = sphere(options.samples, options.seed) if options.sampling == "sphere" else lattice(brdf)
    f_r = without_negatives(brdf.eval(wi, wo))
    unusable = int((~np.isfinite(f_r)).any(axis=-1).sum())
    if unusable:
        raise MaterialError(
            f"{brdf.name}: no model can be fitted to it, since its reflectance is not finite in "
            f"{unusable} of {len(wi)} directions"
        )
    if not f_r.any():
        raise MaterialError(f"{brdf.name}: no model can be fitted to it, since it is black")
    if not DARKEST <= f_r.max() <= BRIGHTEST:
        raise MaterialError(
            f"{brdf.name}: no model can be fitted to it, since its largest reflectance is {f_r.max():g}, not from "
            f"{DARKEST:g} to {BRIGHTEST:g}"
        )
    return Samples(wi, wo, f_r)


def sphere(count: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pairs of directions as they occur on a rendered sphere, (count, 3) each, in random order.

    The viewer is far away, and sees the centres of all pixels that lie completely on the sphere. These end at
    θ_o = 84.7°; pixels nearer to the edge are left out, since many models and materials grow without bound there, and
    no picture shows it. For each pixel, the direction to the light is drawn with a density in proportion to its cosine.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    places = (np.arange(DIAMETER) + 0.5) / DIAMETER * 2 - 1
    radius = np.hypot(*np.meshgrid(places, places))
    sine_o = random.choice(radius[radius <= 1 - 1 / DIAMETER], count)
    sine_i, phi = np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    wo = np.stack([sine_o, np.zeros(count), np.sqrt(1 - sine_o**2)], axis=-1)
    wi = np.stack([sine_i * np.cos(phi), sine_i * np.sin(phi), np.sqrt(1 - sine_i**2)], axis=-1)
    return wi, wo


def lattice(brdf: Brdf) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The pairs of directions at the centres of all cells above the horizon, (n, 3) each, in random order."""
    cells = brdf.table_lattice
    chosen = np.flatnonzero(cells.above_horizon)
    order = np.random.Generator(np.random.PCG64(0)).permutation(chosen)
    wi, wo = directions(*(np.broadcast_to(angle, cells.shape).reshape(-1)[order] for angle in cells.angles()))
    return np.stack(wi, axis=-1), np.stack(wo, axis=-1)
