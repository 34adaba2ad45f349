"""RGL .bsdf files (Dupuy & Jakob 2018, "An adaptive parameterization for efficient material acquisition and
rendering"): isotropic measurements, in RGB or spectral.

For each incident elevation θ_i of a few, a file has a density of visible normals, which warps the unit square to half
vectors, and the reflectance times cosine, relative to that density, on a grid over the square:

    f_r(ω_i, ω_o) cos θ_o = rgb(s; θ_i) D(m) / (4 σ(θ_i)),   s = warp⁻¹(m; θ_i),   m ∝ ω_i + ω_o.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, Triple, gather3, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.cells import MERL
from ..reflectance.distance import asymmetry, negative_share
from ..reflectance.half_diff import TWO_PI, directions, spherical
from ..reflectance.origin import Source
from ..system import door
from ..system.errors import FormatError
from ..system.visible import visible
from . import tensor
from .format import Format
from .spectra import srgb_weights

LARGEST_SIDE = 4096  # of any grid in a file
LARGEST = 1e30  # renderers calculate in single precision
SMALLEST_COSINE = 0.01  # that a stored f_r cos θ_o is divided by
NORMAL = 1e-14  # viewers with a smaller sin² θ are at the normal, and have no azimuth
NORMAL_POINTS, AZIMUTHS = 512, 64  # lights for which the reflectance to the normal is tabulated, and averaged
NORMAL_END = 2**0.5  # 1 / u_θ of the half vector between the normal and the horizon


class RglBrdf(Brdf):
    """A measured material as RGL's format defines it: continuous, not a table.

    theta_i: (n,) incident elevations [rad]. vndf: (n, h, w), the density of visible normals over (u_φ, u_θ) in
    [0, 1]². rgb: (n, 3, k, k), linear. ndf, sigma: (·, ·) over (u_φ, u_θ). jacobian: whether `rgb` is relative to
    D / 4σ.

    f_r is what the file holds: signed, and one-sided, with the file's incident direction as `wo`, the direction that a
    renderer comes from (Mitsuba and pbrt-v4 read the files so). `reflectance.reciprocal` averages both orders.

    The cosine that data is divided by is taken for at least SMALLEST_COSINE: beyond, at 89.4°, measurements hold noise
    that the division would turn into peaks without bound. A viewer exactly at the normal has no azimuth, on which the
    file's data depends even there: it sees the mean over all azimuths.
    """

    kind = "measurement"

    def __init__(
        self,
        theta_i: NDArray[Any],
        vndf: NDArray[Any],
        rgb: NDArray[Any],
        ndf: NDArray[Any],
        sigma: NDArray[Any],
        *,
        jacobian: bool = True,
        name: str = "rgl",
        source_sha256: str = "",
    ) -> None:
        self.name = name
        self.source = Source(source_sha256)
        self._theta_i = np.asarray(theta_i, np.float64)
        self._shapes = {"vndf": vndf.shape[1:], "rgb": rgb.shape[2:], "ndf": ndf.shape, "sigma": sigma.shape}
        self._jacobian = jacobian
        density, rows, columns = cumulated(np.asarray(vndf, np.float64))
        self._buffers = {
            "vndf": density.reshape(-1),
            "rows": rows.reshape(-1),
            "columns": columns.reshape(-1),
            "rgb": np.asarray(rgb, np.float64).reshape(-1),
            "ndf": np.asarray(ndf, np.float64).reshape(-1),
            "sigma": np.asarray(sigma, np.float64).reshape(-1),
            "theta_i": self._theta_i,
        }
        self._buffers["at_normal"] = self._mean_at_normal().reshape(-1)

    @property
    def reciprocal(self) -> bool:
        return False

    @property
    def signed(self) -> bool:
        return bool((self._buffers["rgb"] < 0).any())

    @property
    def lookup(self) -> str:
        return "measurement"

    @property
    def facts(self) -> dict[str, Any]:
        """How far from reciprocal the measurement is (`distance.asymmetry`); the share of its energy that is negative
        (`distance.negative_share`); and how many of MERL's cells that are not 0 the bound on the cosine makes smaller.
        """
        cos_i, _ = MERL.cosines()
        near = MERL.above_horizon & (cos_i < SMALLEST_COSINE)
        touched = np.any(self.f_r(*directions(*(angle[near] for angle in MERL.angles())), self._buffers), axis=0)
        one_sided, negative = asymmetry(self._here), negative_share(self._here)
        return {"asymmetry": one_sided, "energy_negative": negative, "cells_near_grazing": int(touched.sum())}

    def _here(self, wi: Triple, wo: Triple) -> Triple:
        return self.f_r(wi, wo, self._buffers)

    def buffers(self) -> dict[str, NDArray[Any]]:
        return self._buffers

    def fields(self) -> dict[str, NDArray[Any]]:
        """The arrays of an RGL file that holds the same, by name; in RGB, whatever it was read from."""
        count, shapes, held = len(self._theta_i), self._shapes, self._buffers
        arrays = {
            "phi_i": np.zeros(1),
            "theta_i": self._theta_i,
            "sigma": held["sigma"].reshape(shapes["sigma"]),
            "ndf": held["ndf"].reshape(shapes["ndf"]),
            "vndf": held["vndf"].reshape(1, count, *shapes["vndf"]),
            "rgb": held["rgb"].reshape(1, count, 3, *shapes["rgb"]),
        }
        single = {name: np.ascontiguousarray(array, "<f4") for name, array in arrays.items()}
        return {"jacobian": np.full(1, self._jacobian, np.uint8), **single}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        f = ops(wi[0])
        upright = wo[0] * wo[0] + wo[1] * wo[1] < NORMAL
        around, mean = self._raw(wo, wi, buffers), self._at_normal(wi, buffers)
        r, g, b = (f.where(upright, y, x) for x, y in zip(around, mean, strict=True))
        return r, g, b

    def _at_normal(self, wi: Triple, buffers: Buffers) -> Triple:
        """f_r for a viewer at the normal, interpolated between lights at equal steps of u_θ of the half vector."""
        f = ops(wi[0])
        theta = f.atan2(f.sqrt(wi[0] * wi[0] + wi[1] * wi[1]), wi[2])
        i, t = _cell(f, _unit(f, 0.5 * theta) * NORMAL_END, NORMAL_POINTS)
        here, next_ = (gather3(buffers["at_normal"], number) for number in (i, i + 1))
        r, g, b = (a + t * (c - a) for a, c in zip(here, next_, strict=True))
        factor = 1.0 / f.maximum(wi[2], SMALLEST_COSINE)
        return r * factor, g * factor, b * factor

    def _mean_at_normal(self) -> NDArray[np.float64]:
        """f_r cos θ_i for a viewer at the normal, the mean over azimuths; (NORMAL_POINTS, 3)."""
        u = np.arange(NORMAL_POINTS) / (NORMAL_POINTS - 1) / NORMAL_END
        theta_h, phi = np.meshgrid(u * u * (TWO_PI / 4), (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS * TWO_PI, indexing="ij")
        light, viewer = spherical(2 * theta_h, phi), spherical(np.full_like(phi, 1e-9), np.zeros_like(phi))
        cosine = np.maximum(light[2], SMALLEST_COSINE)
        return np.stack([(c * cosine).mean(axis=1) for c in self._raw(viewer, light, self._buffers)], axis=-1)

    def _raw(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        """f_r with `wi` as the file's incident direction."""
        f = ops(wi[0])
        mx, my, mz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
        theta_i = f.atan2(f.sqrt(wi[0] * wi[0] + wi[1] * wi[1]), wi[2])
        u_theta = _unit(f, f.atan2(f.sqrt(mx * mx + my * my), mz))
        turns = f.atan2(wi[0] * my - wi[1] * mx, wi[0] * mx + wi[1] * my) * (1 / TWO_PI) + 0.5
        u_phi = turns - f.floor(turns)
        between = self._between(f, theta_i, buffers)
        sample = self._unwarped(f, u_theta, u_phi, between, buffers)
        corners = _corners(f, *sample, self._shapes["rgb"])
        side = self._shapes["rgb"][0] * self._shapes["rgb"][1]
        factor = 1.0 / f.maximum(wo[2], SMALLEST_COSINE)
        if self._jacobian:
            ndf = _blend(f, buffers["ndf"], 0, _corners(f, u_theta, u_phi, self._shapes["ndf"]))
            half = 0.0 * u_theta + 0.5  # σ of an isotropic material does not depend on φ
            sigma = _blend(f, buffers["sigma"], 0, _corners(f, _unit(f, theta_i), half, self._shapes["sigma"]))
            factor = factor * ndf / (4.0 * f.maximum(sigma, 1e-30))
        r, g, b = (
            factor * sum(w * _blend(f, buffers["rgb"], (3 * k + channel) * side, corners) for k, w in between)
            for channel in range(3)
        )
        return r, g, b

    def _between(self, f: Any, theta_i: Array, buffers: Buffers) -> list[tuple[Array, Array]]:
        """The incident elevations on either side of the given one, as indices, and their weights."""
        last = len(self._theta_i) - 1
        if last == 0:
            return [(f.bin(0.0 * theta_i, 1), 1.0)]
        lower = f.bin(sum(f.where(theta_i >= angle, 1.0, 0.0) for angle in self._theta_i[1:-1]) + 0.0 * theta_i, last)
        a, b = f.gather(buffers["theta_i"], lower), f.gather(buffers["theta_i"], lower + 1)
        t = f.minimum(f.maximum((theta_i - a) / (b - a), 0.0), 1.0)
        return [(lower, 1.0 - t), (lower + 1, t)]

    def _unwarped(
        self, f: Any, u: Array, v: Array, between: list[tuple[Array, Array]], buffers: Buffers
    ) -> tuple[Array, Array]:
        """The point of the unit square that the warp takes to (u, v): marginal and conditional distributions there."""
        height, width = self._shapes["vndf"]
        i, s = _cell(f, u, width)
        j, t = _cell(f, v, height)

        def mixed(name: str, offset: Array, size: int) -> Array:
            return sum(w * f.gather(buffers[name], k * size + offset) for k, w in between)

        at = j * width + i
        v00, v10 = mixed("vndf", at, height * width), mixed("vndf", at + 1, height * width)
        v01, v11 = mixed("vndf", at + width, height * width), mixed("vndf", at + width + 1, height * width)
        left, right = v00 + t * (v01 - v00), v10 + t * (v11 - v10)

        def row(column: Array) -> tuple[Array, Array]:
            return mixed("rows", j * width + column, height * width), mixed(
                "rows", (j + 1) * width + column, height * width
            )

        (x0, x1), (end0, end1) = row(i), row(0 * i + (width - 1))
        x = x0 + t * (x1 - x0) + _segment(s, left, right, width)
        x = x / f.maximum(end0 + t * (end1 - end0), 1e-30)
        y = mixed("columns", j, height) + _segment(t, end0, end1, height)
        return x, y


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes says that it is a tensor file."""
    return head.startswith(tensor.MAGIC)


def read(path: str | Path) -> RglBrdf:
    """The material in an RGL file. Raises FormatError if it is not one, or is anisotropic.

    A spectral file is converted to linear sRGB.
    """
    return parse(Path(path), door.read(path, tensor.LARGEST_FILE))


def parse(path: Path, data: bytes) -> RglBrdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    file = tensor.TensorFile(path, data)
    colours = "rgb" if "rgb" in file.fields else "spectra"
    _check(file, colours)
    theta_i, phi_i = file.array("theta_i"), file.array("phi_i")
    vndf, grid = file.array("vndf"), file.array(colours)
    if len(phi_i) == 2 and (np.array_equal(vndf[0], vndf[1]) and np.array_equal(grid[0], grid[1])):
        phi_i = phi_i[:1]  # the same measurement at both ends of a period
    if len(phi_i) != 1:
        raise FormatError(f"{path}: phi_i: expected an isotropic material (one angle), found {len(phi_i)} angles")
    if not ((np.diff(theta_i) > 0).all() and theta_i[0] >= 0 and theta_i[-1] < 1.6):
        raise FormatError(f"{path}: theta_i: expected angles that increase from 0 to π/2, found {theta_i}")
    ndf, sigma = file.array("ndf"), file.array("sigma")
    for name, values in (("vndf", vndf), ("ndf", ndf), ("sigma", sigma)):
        if (values < 0).any() or not values.any():
            raise FormatError(f"{path}: {name}: expected no negative values, and some above 0, found others")
    if not vndf[0].any(axis=(1, 2)).all():
        raise FormatError(f"{path}: vndf: expected a density for each theta_i, found zeros alone")
    if np.abs(grid).max() > LARGEST:
        found = f"{np.abs(grid).max():g}"
        raise FormatError(f"{path}: {colours}: expected values from -{LARGEST:g} to {LARGEST:g}, found {found}")
    rgb = grid[0] if colours == "rgb" else _converted(path, file.array("wavelengths"), grid[0])
    return RglBrdf(
        theta_i,
        vndf[0],
        rgb,
        ndf,
        sigma,
        jacobian=bool(file.array("jacobian")[0]),
        name=visible(path.stem),
        source_sha256=hashlib.sha256(data).hexdigest(),
    )


def _check(file: tensor.TensorFile, colours: str) -> None:
    """Types and shapes, before any data is read. Raises FormatError."""
    angles, azimuths = file.field("theta_i").shape, file.field("phi_i").shape
    depth = (3,) if colours == "rgb" else file.field("wavelengths").shape
    axes = {
        "theta_i": (None,),
        "phi_i": (None,),
        "ndf": (None, None),
        "sigma": (None, None),
        "vndf": (*azimuths, *angles, None, None),
        colours: (*azimuths, *angles, *depth, None, None),
    }
    if colours == "spectra":
        axes["wavelengths"] = (None,)
    for name, expected in axes.items():
        field = file.field(name)
        low = 1 if len(expected) == 1 else 2
        fits = len(field.shape) == len(expected) and all(
            low <= n <= LARGEST_SIDE if e is None else n == e for n, e in zip(field.shape, expected, strict=True)
        )
        if not fits or field.dtype != np.dtype("<f4"):
            wanted = " × ".join("n" if e is None else str(e) for e in expected)
            found = f"{field.dtype} of shape {field.shape}"
            raise FormatError(f"{file.path}: {name}: expected float32 of shape {wanted}, found {found}")
    if azimuths[0] > 2:
        found = f"{azimuths[0]} angles (anisotropic)"
        raise FormatError(f"{file.path}: phi_i: expected an isotropic material with one angle, found {found}")
    jacobian = file.field("jacobian")
    if jacobian.shape != (1,) or jacobian.dtype != np.uint8:
        raise FormatError(f"{file.path}: jacobian: expected one byte, found {jacobian.dtype} of shape {jacobian.shape}")


def _converted(path: Path, wavelengths: NDArray[Any], spectra: NDArray[Any]) -> NDArray[np.float64]:
    """Linear sRGB of spectra (n, wavelengths, k, k)."""
    if len(wavelengths) < 2 or not ((np.diff(wavelengths) > 0).all() and 200 < wavelengths[0] < 1000):
        raise FormatError(f"{path}: wavelengths: expected an increasing series in nanometres, found {wavelengths}")
    return np.einsum("nwij,wc->ncij", spectra.astype(np.float64), srgb_weights(wavelengths))


def cumulated(density: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """A density on (n, h, w) points of the unit square, made to integrate to 1 by bilinear interpolation; its integral
    along each row up to each point (n, h, w), and over the rows up to each row (n, h)."""
    _, height, width = density.shape
    rows = np.zeros_like(density)
    rows[:, :, 1:] = np.cumsum(density[:, :, 1:] + density[:, :, :-1], axis=2) * (0.5 / (width - 1))
    columns = np.zeros(density.shape[:2])
    columns[:, 1:] = np.cumsum(rows[:, 1:, -1] + rows[:, :-1, -1], axis=1) * (0.5 / (height - 1))
    whole = columns[:, -1]
    return density / whole[:, None, None], rows / whole[:, None, None], columns / whole[:, None]


def _unit(f: Any, theta: Array) -> Array:
    """An elevation [rad] as the square root of its share of π/2."""
    return f.sqrt(theta * (4 / TWO_PI))


def _segment(t: Array, a: Array, b: Array, points: int) -> Array:
    """The integral of a density that runs from a to b between two neighbours of `points` points, up to the share t."""
    return t * (a + 0.5 * t * (b - a)) * (1.0 / (points - 1))


def _cell(f: Any, x: Array, points: int) -> tuple[Array, Array]:
    """Of `points` points spread over [0, 1], the one at or below x, and the share of the way to the next."""
    x = f.minimum(f.maximum(x, 0.0), 1.0) * (points - 1)
    below = f.minimum(f.floor(x), points - 2.0)
    return f.bin(below, points - 1), x - below


def _corners(f: Any, x: Array, y: Array, shape: tuple[int, ...]) -> list[tuple[Array, Array]]:
    """The four points around (x, y) in the unit square of a grid (h, w), and their weights."""
    height, width = shape
    i, s = _cell(f, x, width)
    j, t = _cell(f, y, height)
    at = j * width + i
    return [
        (at, (1.0 - s) * (1.0 - t)),
        (at + 1, s * (1.0 - t)),
        (at + width, (1.0 - s) * t),
        (at + width + 1, s * t),
    ]


def _blend(f: Any, buffer: Any, offset: Any, corners: list[tuple[Array, Array]]) -> Array:
    return sum(weight * f.gather(buffer, offset + at) for at, weight in corners)


def _write(brdf: Brdf, path: Path) -> Brdf:
    from . import rgl_export  # which needs what is above

    rgl_export.write(brdf, path)
    return brdf


FORMAT = Format(
    "RGL",
    (".bsdf",),
    "an isotropic measurement, RGB or spectral; `measured` in Mitsuba and pbrt-v4",
    sniff=looks_like,
    read=parse,
    largest=tensor.LARGEST_FILE,
    write=_write,
)
