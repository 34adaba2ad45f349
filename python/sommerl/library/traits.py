"""How a material looks, in a few numbers by which it is found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..reflectance.brdf import Brdf
from ..reflectance.gamut import LUMINANCE

VIEWER = np.radians(45.0)


@dataclass(frozen=True)
class Traits:
    """colour: linear RGB, the reflectance that is seen. gloss, metalness: from 0 to 1."""

    colour: tuple[float, float, float]
    gloss: float
    metalness: float


def traits(brdf: Brdf) -> Traits:
    """The traits of a BRDF."""
    albedo = np.maximum(brdf.albedo(VIEWER), 0.0)
    wi, wo = [np.sin(VIEWER), 0.0, np.cos(VIEWER)], [-np.sin(VIEWER), 0.0, np.cos(VIEWER)]
    mirror, behind = (np.maximum(brdf.eval(direction, wo), 0.0) for direction in (wi, wo))
    peak = float(np.dot(LUMINANCE, mirror)) + 1e-6
    saturation = float(np.ptp(mirror) / (mirror.max() + 1e-6))
    red, green, blue = albedo.tolist()
    return Traits((red, green, blue), 1.0 - min(1.0, float(np.dot(LUMINANCE, behind)) / peak), saturation)
