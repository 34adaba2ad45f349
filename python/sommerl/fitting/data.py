"""What a model is fitted to: a material's reflectance along many pairs of directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import directions
from ..reflectance.samples import Samples
from ..system.errors import MaterialError
from .options import FitOptions

DARKEST, BRIGHTEST = 1e-15, 1e15  # [1/sr], of what is largest: squares keep their digits between these
DIAMETER = 230  # of a sphere, in pixels: nine tenths of a picture of 256


def samples_of(brdf: Brdf, options: FitOptions) -> Samples:
    """A material's. Raises MaterialError if a value is negative or not a number, or all are 0 or nearly so."""
    wi, wo = sphere(options.samples, options.seed) if options.sampling == "sphere" else lattice(brdf)
    f_r = brdf.eval(wi, wo)
    unusable = int((~(np.isfinite(f_r) & (f_r >= 0))).any(axis=-1).sum())
    if unusable:
        raise MaterialError(
            f"{brdf.name}: expected finite reflectance of at least 0, found others in {unusable} of {len(wi)} "
            "directions"
        )
    if not f_r.any():
        raise MaterialError(f"{brdf.name}: expected a positive reflectance in some direction, found none")
    if not DARKEST <= f_r.max() <= BRIGHTEST:
        raise MaterialError(
            f"{brdf.name}: expected a largest reflectance of {DARKEST:g} to {BRIGHTEST:g}, found {f_r.max():g}"
        )
    return Samples(wi, wo, f_r)


def sphere(count: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pairs of directions as a rendered sphere sees them, (n, 3) each, in random order.

    The viewer is far away, and looks at the centres of those pixels that show nothing but the sphere, which end at
    θ_o = 84.7°: what is nearer to the edge grows without bound in many a model and material, and is seen in no picture.
    At each pixel, light comes from a direction drawn by the cosine.
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
    """The pairs of directions of all cell centres above the horizon, (n, 3) each, in an order that has no pattern."""
    cells = brdf.table_lattice
    chosen = np.flatnonzero(cells.above_horizon)
    order = np.random.Generator(np.random.PCG64(0)).permutation(chosen)
    wi, wo = directions(*(np.broadcast_to(angle, cells.shape).reshape(-1)[order] for angle in cells.angles()))
    return np.stack(wi, axis=-1), np.stack(wo, axis=-1)
