"""Any isotropic BRDF as an RGL .bsdf file (see `rgl`), for the `measured` materials of Mitsuba and pbrt-v4.

Mitsuba's RGB variants read the field `rgb`, and refuse files with `wavelengths` and `spectra`, which pbrt-v4 and
Mitsuba's spectral variants read: so there are two kinds of files, as in RGL's database.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.gamut import LUMINANCE
from ..reflectance.half_diff import directions, spherical
from ..system.errors import MaterialError
from ..system.files import atomic_write
from ..system.optional import optional
from . import tensor
from .rgl import cumulated
from .spectra import srgb_weights

ELEVATIONS = 48  # incident angles
STEEPEST = np.radians(89.5)
NORMALS = (32, 192)  # points of the densities of normals, in φ and in θ
SIDE = 96  # of the grids of reflectances
WAVELENGTHS = np.arange(380.0, 781.0, 20.0)
LEAST = 0.3  # of the median density of normals, so that every half vector gets its share of the grids
LOWEST = 1e-3  # the cosine of outgoing directions that come out below it


def write(brdf: Brdf, path: str | Path, *, spectral: bool = False) -> None:
    """Writes a material as an RGL file: in RGB, or as spectra that are these colours under D65.

    Raises MaterialError if values are too large for single precision, MissingDependencyError if spectra are asked for
    and colour-science is not there.
    """
    primaries = _primaries() if spectral else None
    with np.errstate(over="ignore"):  # what does not fit into single precision is told below
        fields = _fields(brdf)
    if not all(np.isfinite(array).all() for array in fields.values()):
        raise MaterialError(f"{brdf.name}: expected values that single precision can hold, found larger ones")
    if primaries is not None:
        rgb = fields.pop("rgb").astype(np.float64)
        fields["wavelengths"] = WAVELENGTHS.astype("<f4")
        fields["spectra"] = np.einsum("pncij,wc->pnwij", rgb, primaries).astype("<f4")
    with atomic_write(Path(path)) as out:
        tensor.write(out, fields)


def _fields(brdf: Brdf) -> dict[str, NDArray[Any]]:
    u = np.linspace(0, 1, NORMALS[1])
    ndf = _normals(brdf, u)
    theta_i = np.linspace(0, 1, ELEVATIONS) * float(STEEPEST)
    sigma = _projected_area(ndf, u, u**2 * np.pi / 2)
    vndf = _visible(ndf, u, theta_i)
    area = np.interp(np.sqrt(theta_i * (2 / np.pi)), u, sigma)
    at = np.linspace(0, 1, SIDE)
    rgb = np.zeros((ELEVATIONS, 3, SIDE, SIDE))
    for k, density in enumerate(vndf):
        u_theta, u_phi = _warped(density, *np.meshgrid(at, at))
        normals: NDArray[np.float64] = np.interp(u_theta, u, ndf)
        relative = normals / (4 * area[k])
        rgb[k] = np.moveaxis(_reflected(brdf, theta_i[k], u_theta, u_phi) / relative[..., None], -1, 0)
    luminance = np.einsum("ncij,c->nij", rgb, LUMINANCE)
    luminance = np.maximum(luminance, 1e-4 * luminance.mean(axis=(1, 2), keepdims=True) + 1e-9 * luminance.max())
    single = {
        "phi_i": np.zeros(1),
        "theta_i": theta_i,
        "sigma": np.stack([sigma, sigma]),
        "ndf": np.stack([ndf, ndf]),
        "vndf": vndf[None],
        "luminance": luminance[None],
        "rgb": rgb[None],
    }
    text = np.frombuffer(f"{brdf.name} (written by Sommerl)".encode(), np.uint8)
    return {
        "description": text,
        "version": np.array([1, 0], np.uint8),
        "jacobian": np.ones(1, np.uint8),
        **{name: np.ascontiguousarray(array, "<f4") for name, array in single.items()},
    }


def _normals(brdf: Brdf, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """A density of normals D over u = √(θ_h / 90°): the mean of f_r cos θ_i cos θ_o over difference vectors, to which a
    microfacet model's D is proportional.

    Any positive density gives a file that means the same; one like the material's makes smooth what is interpolated.
    """
    theta_h = np.minimum(u**2 * np.pi / 2, STEEPEST)
    theta_d, phi_d = (np.arange(32) + 0.5) / 32 * np.pi / 2, (np.arange(12) + 0.5) / 12 * np.pi
    angles = np.broadcast_arrays(theta_h[:, None, None], theta_d[:, None], phi_d)
    wi, wo = (np.stack(w, axis=-1) for w in directions(*angles))
    weight = np.sin(2 * angles[1]) * ((wi[..., 2] > 0) & (wo[..., 2] > 0))
    value = (brdf.eval(wi, wo) @ LUMINANCE) * np.abs(wi[..., 2] * wo[..., 2])
    density = (weight * value).sum(axis=(1, 2)) / np.maximum(weight.sum(axis=(1, 2)), 1e-9)
    density = np.maximum(density, LEAST * np.median(density) + 1e-9 * density.max())
    return density / (2 * np.pi * (density * np.cos(theta_h) * np.sin(theta_h) * np.gradient(theta_h)).sum())


def _projected_area(
    ndf: NDArray[np.float64], u: NDArray[np.float64], theta_i: NDArray[np.float64]
) -> NDArray[np.float64]:
    """σ(θ_i) = ∫ D(m) max(0, ω_i·m) dm."""
    theta = u**2 * np.pi / 2
    phi = (np.arange(64) + 0.5) / 64 * np.pi
    cosines = _cosines(theta_i[:, None, None], theta[:, None], phi)
    return np.maximum(cosines, 0).mean(axis=2) @ (2 * np.pi * ndf * np.sin(theta) * np.gradient(theta))


def _visible(ndf: NDArray[np.float64], u: NDArray[np.float64], theta_i: NDArray[np.float64]) -> NDArray[np.float64]:
    """The density of visible normals over (u_φ, u_θ) for each θ_i, up to a factor."""
    theta = u**2 * np.pi / 2
    phi = np.linspace(-np.pi, np.pi, NORMALS[0])
    cosines = _cosines(theta_i[:, None, None], theta, phi[:, None])
    return np.maximum(cosines, 0) * (ndf * np.sin(theta) * u)


def _cosines(theta_i: NDArray[Any], theta: NDArray[Any], phi: NDArray[Any]) -> NDArray[Any]:
    """ω_i·m."""
    return np.cos(theta_i) * np.cos(theta) + np.sin(theta_i) * np.sin(theta) * np.cos(phi)


def _warped(
    density: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a density (h, w) takes points of the unit square: the inverse of what a reader computes."""
    (values,), (rows,), (columns,) = cumulated(density[None])
    height, width = values.shape
    j = np.clip(np.searchsorted(columns, y, side="right") - 1, 0, height - 2)
    ends = rows[:, -1]
    t = _share(y - columns[j], ends[j], ends[j + 1], height)
    wanted = x * (ends[j] + t * (ends[j + 1] - ends[j]))
    between = rows[j] + t[..., None] * (rows[j + 1] - rows[j])
    i = np.clip((between <= wanted[..., None]).sum(axis=-1) - 1, 0, width - 2)
    start = np.take_along_axis(between, i[..., None], -1)[..., 0]
    left, right = ((1 - t) * values[j, k] + t * values[j + 1, k] for k in (i, i + 1))
    s = _share(wanted - start, left, right, width)
    return (i + s) / (width - 1), (j + t) / (height - 1)


def _share(area: NDArray[Any], a: NDArray[Any], b: NDArray[Any], points: int) -> NDArray[Any]:
    """Where, as a share of the way between two neighbours of `points` points, a density that runs from a to b has
    gathered an area: the inverse of `rgl._segment`."""
    area = np.maximum(area, 0) * (points - 1)
    return np.clip(2 * area / np.maximum(a + np.sqrt(np.maximum(a * a + 2 * (b - a) * area, 0)), 1e-300), 0, 1)


def _reflected(
    brdf: Brdf, theta_i: float, u_theta: NDArray[np.float64], u_phi: NDArray[np.float64]
) -> NDArray[np.float64]:
    """f_r cos θ_o for half vectors (u_θ, u_φ). Renderers come from the file's incident direction, which is wo here."""
    viewer = np.stack(spherical(np.array(theta_i), np.array(0.0)), axis=-1)
    half = np.stack(spherical(u_theta**2 * np.pi / 2, (2 * u_phi - 1) * np.pi), axis=-1)
    light = 2 * (half @ viewer)[..., None] * half - viewer
    light[..., 2] = np.maximum(light[..., 2], LOWEST)
    light /= np.linalg.norm(light, axis=-1, keepdims=True)
    return brdf.eval(light, viewer) * light[..., 2:]


def _primaries() -> NDArray[np.float64]:
    """Reflectance spectra (wavelengths, 3) of the primaries of linear sRGB (Mallett & Yuksel 2019), at WAVELENGTHS.

    Resampled, they are corrected so that under D65 each gives exactly its primary.
    """
    recovery = optional("colour.recovery", "colour-science", "spectra", "render")
    basis: Any = recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    channels: list[NDArray[np.float64]] = [np.interp(WAVELENGTHS, basis.wavelengths, c) for c in basis.values.T]
    spectra = np.stack(channels, axis=-1)
    correction = np.asarray(np.linalg.inv(srgb_weights(WAVELENGTHS).T @ spectra), np.float64)
    return spectra @ correction
