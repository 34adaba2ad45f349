"""How a material looks, in a few numbers by which it is found.

colour: the albedo for a viewer at 45° in even light, linear RGB: what is reflected of white light from everywhere.

gloss: how deep and how narrow the lobe about the mirror direction is: of the cube root of the luminance, as the half
vector leaves the normal, the depth of its fall from the mirror direction to the lowest (as a part of what it was
there), times 1 − √(θ_h / 75°), where half of that fall is done. 0 for what does not fall, like chalk; towards 1 for a
mirror.

metalness: the share of the reflected light that neither a matte body nor a clear coat explains. The body is, channel by
channel, the lowest f_r on the way above, as if that were reflected everywhere; a coat reflects at most 5 % of the
light, of all channels alike. Metals have neither: what they reflect about the mirror direction is more, or coloured.

All are rounded to four decimals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.gamut import LUMINANCE
from ..reflectance.half_diff import directions
from ..sampling.half_vector import albedo

VIEWER = np.radians(45.0)
POINTS = 6  # along each side of a sampler's cell, of the albedo's quadrature
THETA_D = np.radians(25.0)  # light and viewer to the half vector: away from retro-reflection, and from grazing
SIDES = np.radians((90.0, 270.0))  # φ_d: the half vector leaves the plane of light and viewer, which stay above
WIDEST = np.radians(75.0)  # θ_h
STEPS = 300
COAT = 0.05  # what a clear coat reflects
DIGITS = 4
BRIGHTEST = 6.5  # a channel of a colour: the index of a .smrlib holds a little more

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Traits:
    """colour: linear RGB, from 0. gloss, metalness: from 0 to 1."""

    colour: tuple[float, float, float]
    gloss: float
    metalness: float


def traits(brdf: Brdf) -> Traits:
    """The traits of a BRDF: it is evaluated for 12,000 pairs of directions, which takes some 10 to 50 ms."""
    reflected = np.clip(albedo(brdf, VIEWER, POINTS), 0.0, BRIGHTEST)
    theta_h = WIDEST * (np.arange(STEPS + 1) / STEPS) ** 2
    light, viewer = directions(theta_h[:, None], np.full((1, 1), THETA_D), SIDES)
    pairs = (np.stack(np.broadcast_arrays(*w), axis=-1) for w in (light, viewer))
    f_r = np.maximum(brdf.eval(*pairs).mean(axis=1), 0.0)
    red, green, blue = (round(channel, DIGITS) for channel in reflected.tolist())
    gloss, metalness = _gloss(theta_h, np.cbrt(f_r @ LUMINANCE)), _metalness(reflected, np.pi * f_r.min(axis=0))
    return Traits((red, green, blue), round(gloss, DIGITS), round(metalness, DIGITS))


def _gloss(theta_h: Values, root: Values) -> float:
    """root: the cube root of the luminance at each θ_h."""
    peak, lowest = float(root[0]), float(root.min())
    if not peak > lowest:
        return 0.0
    middle = (peak + lowest) / 2
    after = int(np.argmax(root <= middle))
    share = (root[after - 1] - middle) / (root[after - 1] - root[after])
    half = theta_h[after - 1] + share * (theta_h[after] - theta_h[after - 1])
    return float((1 - lowest / peak) * (1 - np.sqrt(half / WIDEST)))


def _metalness(reflected: Values, body: Values) -> float:
    """reflected: the albedo, (3,). body: the matte part of it, (3,)."""
    lobe = np.maximum(reflected - body, 0.0)
    beyond = float((lobe - min(COAT, float(lobe.min()))).sum())
    return beyond / (beyond + float(body.sum())) if beyond else 0.0
