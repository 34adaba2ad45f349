"""Draws a slice of f_r over θ_h and θ_d as an image."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..reflectance.brdf import Brdf
from ..reflectance.cells import HALF_PI, ON_HORIZON
from ..reflectance.half_diff import directions
from .page import THETA_H_TICKS, number
from .tone import Tone

SIDE = 180  # pixels: two for each bin of MERL's tables


def slices(ax: Any, brdf: Brdf, phi_d: float = HALF_PI, tone: Tone | None = None) -> Tone:
    """Draws f_r over θ_h and θ_d at one φ_d as a colour image: the image slice of Disney's BRDF Explorer (Burley 2012,
    "Physically-based shading at Disney").

    The highlight is on the left, the rise due to Fresnel reflection at the top, retroreflection at the bottom. The axis
    is linear in √θ_h, as MERL's tables are, since a sharp highlight would be narrower than a pixel in θ_h. phi_d:
    [rad]. tone: the curve from f_r to colours; if not given, one that fits this image. Returns the curve, so that other
    images can be drawn with the same one.

    The image has shape (180, 180, 4): RGBA in 8 bits, of f_r at the pixels' centres, transparent below the horizon. Its
    coordinates are √(θ_h / 90°) in [0, 1] and θ_d in degrees.
    """
    place = (np.arange(SIDE) + 0.5) / SIDE
    wi, wo = directions(*np.broadcast_arrays(place**2 * HALF_PI, place[:, None] * HALF_PI, phi_d))
    above = np.minimum(wi[2], wo[2]) > ON_HORIZON
    f_r = brdf.eval(np.stack(wi, -1), np.stack(wo, -1))
    tone = tone or Tone.of(f_r[above])
    pixels = np.zeros((SIDE, SIDE, 4), np.uint8)
    pixels[..., :3] = tone.srgb8(f_r)
    pixels[..., 3] = np.where(above, 255, 0)
    ax.imshow(pixels, origin="lower", extent=(0, 1, 0, 90), aspect="auto", interpolation="nearest")
    ax.set_xticks(np.sqrt(np.array(THETA_H_TICKS) / 90), [f"{tick}°" for tick in THETA_H_TICKS])
    ax.set_yticks(range(0, 91, 15), [f"{tick}°" for tick in range(0, 91, 15)])
    ax.set(xlabel=r"$\theta_h$", ylabel=r"$\theta_d$")
    ax.set_title(f"image slice, $\\phi_d$ = {np.degrees(phi_d):.3g}°, white: {number(tone.white)}/sr")
    return tone
