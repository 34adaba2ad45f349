"""GridBrdf: values at a grid of angles of light and viewer, as instruments measure them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..system.errors import MaterialError
from .arrays import Array, Triple, gather3, ops
from .brdf import LARGEST, Brdf, Buffers
from .distance import asymmetry, negative_share
from .half_diff import TWO_PI
from .info import Counts
from .lattice import blended
from .origin import Source

HALF_TURN, QUARTER = TWO_PI / 2, TWO_PI / 4
SAME = 1e-4  # [rad] angles nearer to each other than that are the same
MOST_STEPS = 2**16  # of the table in which the place between two angles is looked up; more than a full turn has of SAME

Values = NDArray[np.float64]


class GridBrdf(Brdf):
    """An isotropic measurement on a grid of three angles: continuous, not a table of half/difference angles.

    theta_i: (n,), of the light; theta_o: (m,), of the viewer; phi: (k,), the azimuth from the light to the viewer;
        all [rad], increasing. values: f_r [1/sr], linear RGB, (n, m, k, 3); a channel may be negative.
    about_mirror: theta_o and phi are polar coordinates about the mirror direction of the light instead of the normal,
        φ from the side where the normal is, as Zemax' files have them.
    facts: what the reader of a file reports. clamped: how many of the values were changed before, for `counts`.

    A φ that ends at π or before stands for both sides of the plane of incidence; one that goes further is a full turn,
    and periodic. Between the angles f_r is linear in each of the three; beyond the first and the last it is constant.
    A direction at the normal, where φ means nothing, has the mean over φ of the smallest angle.

    Raises MaterialError for axes that do not increase by at least SAME, for other shapes, for angles out of range, for
    values that are not finite or beyond single precision, and if none is positive.
    """

    kind = "measurement"

    def __init__(
        self,
        theta_i: ArrayLike,
        theta_o: ArrayLike,
        phi: ArrayLike,
        values: ArrayLike,
        *,
        about_mirror: bool = False,
        name: str = "grid",
        source_sha256: str = "",
        facts: Mapping[str, Any] = MappingProxyType({}),
        clamped: int = 0,
    ) -> None:
        self.name = name
        self.source = Source(source_sha256)
        self.axes = tuple(np.asarray(axis, np.float64) for axis in (theta_i, theta_o, phi))
        self.values = np.asarray(values, np.float64)
        self.about_mirror = about_mirror
        self._reported = dict(facts)
        self._clamped = clamped
        _check(self.axes, self.values, HALF_TURN if about_mirror else QUARTER)
        axes, extended = self._extended()
        self._points = [len(axis) for axis in axes]
        self._buffers: dict[str, NDArray[Any]] = {"values": extended.reshape(-1)}
        for axis_name, axis in zip(("theta_i", "theta_o", "phi"), axes, strict=True):
            self._buffers |= {axis_name: axis, f"{axis_name}_steps": _steps(axis)}

    @property
    def reciprocal(self) -> bool:
        return False

    @cached_property
    def signed(self) -> bool:  # pyright: ignore[reportIncompatibleMethodOverride] # a property, too
        return bool((self.values < 0).any())

    @property
    def mirrored(self) -> bool:
        return bool(self.axes[2][-1] <= HALF_TURN + SAME)

    @property
    def lookup(self) -> str:
        return "measurement"

    @property
    def facts(self) -> dict[str, Any]:
        """The angles of the grid; how far from reciprocal it is (`distance.asymmetry`); the share of its energy that is
        negative (`distance.negative_share`); and what the file's reader reports."""
        points = " × ".join(str(len(axis)) for axis in self.axes)
        measured = {"grid": points, "asymmetry": asymmetry(self._here), "energy_negative": negative_share(self._here)}
        return measured | self._reported

    @property
    def counts(self) -> Counts:
        return Counts(cells_clamped=self._clamped)

    def _here(self, wi: Triple, wo: Triple) -> Triple:
        return self.f_r(wi, wo, self._buffers)

    def buffers(self) -> dict[str, NDArray[Any]]:
        return self._buffers

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        f = ops(wi[0])
        theta_i = f.atan2(f.sqrt(wi[0] * wi[0] + wi[1] * wi[1]), wi[2])
        across = wi[0] * wo[1] - wi[1] * wo[0]
        along = wi[0] * wo[0] + wi[1] * wo[1]
        if self.about_mirror:
            theta_o, along = _from_mirror(f, wi, wo, along)
        else:
            theta_o = f.atan2(f.sqrt(wo[0] * wo[0] + wo[1] * wo[1]), wo[2])
        phi = f.atan2(abs(across) if self.mirrored else across, along)
        if not self.mirrored:
            phi = f.where(phi < 0.0, phi + TWO_PI, phi)
        n_i, n_o, n_phi = self._points
        (i, s), (j, t), (k, u) = (
            _place(f, angle, points, buffers[name], buffers[f"{name}_steps"])
            for name, angle, points in (("theta_i", theta_i, n_i), ("theta_o", theta_o, n_o), ("phi", phi, n_phi))
        )
        corners = [
            (((i + a * (n_i > 1)) * n_o + j + b * (n_o > 1)) * n_phi + k + c * (n_phi > 1), p * q * r)
            for a, p in enumerate((1.0 - s, s))
            for b, q in enumerate((1.0 - t, t))
            for c, r in enumerate((1.0 - u, u))
        ]
        return blended(corners, lambda at: gather3(buffers["values"], at))

    def _extended(self) -> tuple[list[Values], Values]:
        """Axes and values with the normal, and with both ends of a full turn."""
        theta_i, theta_o, phi = self.axes
        values = self.values
        weights = np.diff(phi, prepend=phi[0]) + np.diff(phi, append=phi[-1]) if self.mirrored else _turn(phi)
        weights = weights / weights.sum() if weights.any() else np.full(len(phi), 1 / len(phi))
        theta_o, values = _with_normal(theta_o, values, weights, axis=1)
        theta_i, values = _with_normal(theta_i, values, weights, axis=0)
        if not self.mirrored:
            phi = np.concatenate([phi[-1:] - TWO_PI, phi, phi[:1] + TWO_PI])
            values = np.concatenate([values[:, :, -1:], values, values[:, :, :1]], axis=2)
        return [theta_i, theta_o, phi], values


def _check(axes: tuple[Values, ...], values: Values, largest: float) -> None:
    """Raises MaterialError for what `GridBrdf` cannot be made of."""
    if values.shape != (*(axis.size for axis in axes), 3) or any(axis.ndim != 1 or not axis.size for axis in axes):
        wanted = (*(axis.size for axis in axes), 3)
        raise MaterialError(f"expected values of shape {wanted}, found {values.shape}")
    highest = (QUARTER, largest, TWO_PI - 2 * SAME + max(float(axes[2][0]), 0.0))
    for name, axis, high in zip(("theta_i", "theta_o", "phi"), axes, highest, strict=True):
        if not (np.diff(axis) >= SAME).all() or not -SAME <= axis[0] <= axis[-1] <= high + SAME:
            raise MaterialError(f"{name}: expected angles that increase from 0 to {high:.5g} rad, found others")
    if not (np.abs(values) <= LARGEST).all():  # nor of NaN
        raise MaterialError("expected finite values that single precision can hold, found others")
    if not (values > 0).any():
        raise MaterialError("expected a positive reflectance, found none")


def _with_normal(theta: Values, values: Values, weights: Values, axis: int) -> tuple[Values, Values]:
    """With an angle of 0 that has the mean over φ of the smallest angle."""
    first = np.take(values, [0], axis=axis)
    mean = np.broadcast_to(np.einsum("abkc,k->abc", first, weights)[:, :, None], first.shape)
    if theta[0] < SAME:
        theta, values = theta[1:], np.delete(values, 0, axis=axis)
    return np.concatenate([[0.0], theta]), np.concatenate([mean, values], axis=axis)


def _turn(phi: Values) -> Values:
    """The shares of a full turn that azimuths stand for."""
    gaps = np.diff(phi, append=phi[0] + TWO_PI)
    return gaps + np.roll(gaps, 1)


def _steps(axis: Values) -> NDArray[np.uint32]:
    """For equal steps between the ends of an axis, so small that at most one angle lies in each: the number of the last
    angle at or before each step's beginning."""
    if len(axis) == 1:
        return np.zeros(1, np.uint32)
    smallest = float(np.diff(axis).min())
    count = min(int((axis[-1] - axis[0]) / smallest) + 2, MOST_STEPS)
    begins = float(axis[0]) + np.arange(count) * (float(axis[-1] - axis[0]) / count)
    last: NDArray[np.intp] = np.searchsorted(axis, begins, side="right") - 1
    return np.clip(last, 0, len(axis) - 2).astype(np.uint32)


def _place(f: Any, angle: Array, points: int, axis: Any, steps: Any) -> tuple[Array, Array]:
    """The last angle of an axis at or before the given one, and the share of the way to the next, from 0 to 1."""
    if points == 1:
        return f.bin(0.0 * angle, 1), 0.0 * angle
    count = len(steps)
    first, last = f.gather(axis, f.bin(0.0 * angle, 1)), f.gather(axis, f.bin(0.0 * angle + (points - 1), points))
    lower = f.gather(steps, f.bin((angle - first) * count / (last - first), count))
    past = (angle >= f.gather(axis, lower + 1)) & (lower < points - 2)
    lower = f.where(past, lower + 1, lower)
    a, b = f.gather(axis, lower), f.gather(axis, lower + 1)
    return lower, f.minimum(f.maximum((angle - a) / (b - a), 0.0), 1.0)


def _from_mirror(f: Any, wi: Triple, wo: Triple, along: Array) -> tuple[Array, Array]:
    """The angle between viewer and mirror direction; and the viewer's part along the direction from there to the
    normal, where `across` is the part at right angles, both times the same factor."""
    x, y, z = wo[0] + wi[0], wo[1] + wi[1], wo[2] - wi[2]
    u, v, w = wo[0] - wi[0], wo[1] - wi[1], wo[2] + wi[2]
    apart, together = f.sqrt(x * x + y * y + z * z), f.sqrt(u * u + v * v + w * w)
    cosine = wi[2] * wo[2] - along
    return 2.0 * f.atan2(apart, together), wo[2] - wi[2] * cosine
