"""Integrals over the hemisphere of a lobe's light, exact enough for narrow and wide lobes alike, up to grazing angles.

All are taken in polar coordinates about an axis. Along each meridian, the height of the light's direction is
R cos(θ − ψ), so that the horizon is met at θ = ψ + π/2 exactly: no integrand breaks off between two nodes.
"""

from functools import cache

import numpy as np

from sommerl.models.family import Angles
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import spherical

ROWS, COLUMNS = 96, 32


@cache
def gauss(count):
    """Nodes and weights of Gauss and Legendre on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def radius(u, limit, width):
    """From [0, 1] to [0, limit], and the derivative: as dense about 0 as a lobe of that width asks for, then ever
    sparser."""
    k = np.log1p(limit / width)
    return width * np.expm1(k * u), width * k * np.exp(k * u)


def radii(limit, width, rows):
    """Such nodes, and their weights."""
    u, weights = gauss(rows)
    theta, slope = radius(u, limit[..., None], width)
    return theta, slope * weights


def azimuth(v):
    """From [-1, 1] to [0, π], and the derivative: dense about π/2, where the horizon is near for a grazing axis."""
    return np.pi / 2 * (1 + v**3), np.pi / 2 * 3 * v**2


def meridians(columns):
    """Such azimuths, and their weights."""
    u, weights = gauss(columns)
    phi, slope = azimuth(np.concatenate([-u, u]))
    return phi, slope * np.concatenate([weights, weights])


def horizon(tilt, phi):
    """The polar angle at which a meridian about a tilted axis meets the horizon."""
    return np.arctan2(np.cos(phi) * np.sin(tilt), np.cos(tilt)) + np.pi / 2


def about(tilt, twice, width, rows, columns):
    """Polar angles, azimuths (from the normal) and solid angles, of both halves of the hemisphere, about an axis that
    is tilted away from the normal.

    twice: of half vectors, about the normal; the light turns by twice their angle.
    """
    phi, across = meridians(columns)
    limit = horizon(tilt, phi)
    theta, along = radii(limit / 2 if twice else limit, width, rows)
    phi = np.broadcast_to(phi[:, None], theta.shape)
    return theta, phi, 2 * np.sin(theta) * along * across[:, None]


def over_half_vectors(elevation, width, rows=ROWS, columns=COLUMNS):
    """Directions to the light, and their solid angles: for a lobe of that width in θ_h, seen from that elevation."""
    theta, phi, solid_angle = about(elevation, True, width, rows, columns)
    wi, scale = mirrored(theta, phi, elevation)
    return wi, scale * solid_angle


def mirrored(theta, phi, elevation):
    """The direction to the light by its half vector's angles, and dω_i / dω_h = 4 cos θ_d."""
    h, wo = np.stack(spherical(theta, phi), -1), np.array(spherical(elevation, 0.0))
    cos_d = h @ wo
    return 2 * cos_d[..., None] * h - wo, 4 * cos_d


def at_half_vectors(u, v, elevation, width):
    """Directions to the light with y ≥ 0 at places u in [0, 1], v in [-1, 1], and their solid angles per du dv."""
    phi, across = azimuth(v)
    theta, along = radius(u, horizon(elevation, phi) / 2, width)
    wi, scale = mirrored(theta, phi, elevation)
    return wi, scale * np.sin(theta) * along * across


def places(wi, elevation, width):
    """Where `at_half_vectors` puts directions, of either y."""
    x, y, z = np.moveaxis(wi + np.array(spherical(elevation, 0.0)), -1, 0)
    theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(abs(y), x)
    u = np.log1p(theta / width) / np.log1p(horizon(elevation, phi) / 2 / width)
    return u, np.cbrt(phi / (np.pi / 2) - 1)


def over_directions(axis, width, rows=ROWS, columns=COLUMNS):
    """The same for a lobe about an axis (x, 0, z)."""
    tilt, side = np.arctan2(abs(axis[0]), axis[2]), np.copysign(1.0, axis[0])
    theta, phi, solid_angle = about(tilt, False, width, rows, columns)
    x, y, z = spherical(theta, phi)
    turned = side * (z * np.sin(tilt) - x * np.cos(tilt)), y, z * np.cos(tilt) + x * np.sin(tilt)
    return np.stack(turned, -1), solid_angle


def albedo(family, shape, elevation, **resolution):
    """The share of the light from all directions that a lobe sends to a viewer at that elevation [rad]."""
    wi, solid_angle = _towards(family, shape, elevation, resolution)
    wo = np.broadcast_to(spherical(elevation, 0.0), wi.shape)
    return float((family.lobe(Angles(split(wi), split(wo)), *shape) * wi[..., 2] * solid_angle).sum())


def _towards(family, shape, elevation, resolution):
    """Nodes that are dense where that lobe is bright."""
    if family.diffuse:
        return over_directions((0.0, 0.0, 1.0), 1.0, **resolution)
    width = np.sqrt(2 / family.exponent(*shape))
    # Lobes about a direction are wider and narrower than about a half vector by more than the factor of 2 at grazing
    # angles; Lafortune's may be anywhere.
    lean = {"phong": -1.0, "lafortune": shape[0]}.get(family.name)
    if lean is None:
        wi, solid_angle = over_half_vectors(elevation, width, **resolution)
        return (wi * np.array([-1, -1, 1]) if family.name == "retro-ggx" else wi), solid_angle
    x, _, z = spherical(elevation, 0.0)
    return over_directions((lean * x, 0.0, z), 2 * width, **resolution)
