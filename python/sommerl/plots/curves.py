"""Draws f_r as curves: lobes in the plane of incidence, and slices along θ_h."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.cells import HALF_PI, ON_HORIZON
from ..reflectance.half_diff import directions, spherical
from ..system.errors import MaterialError
from .page import STYLES, THETA_H_TICKS, Materials, colours, legend, matplotlib, named, upright

INCIDENCES = tuple(np.radians((0, 30, 60, 80)).tolist())
DIFFERENCES = tuple(np.radians((0, 30, 60, 75)).tolist())
STEPS = 720  # of a curve
DARKEST = 10  # percentile of the values that is the lower end of the logarithmic scale
DEEPEST = 1e-9  # … but that end is at least this share of the peak


def lobes(ax: Any, brdf: Materials, theta_i: Sequence[float] = INCIDENCES) -> None:
    """Draws polar lobes: f_r in the plane of incidence over θ_o, a curve for each incident elevation and material.

    ax: polar axes; the lines' data are θ_o [rad] and f_r [1/sr], the mean of the channels. brdf: one, or up to five by
    name, each of which has its own line style. theta_i: [rad], in [0, π/2).

    Light comes from the left (arrows). θ_o is positive to the right, where a dotted ray marks the mirror direction. The
    radius is logarithmic, since otherwise the diffuse part of a glossy material could not be seen; values below its
    lower end are drawn at the centre. Raises ValueError for other axes or angles, MaterialError for a black material.
    """
    if ax.name != "polar":
        raise ValueError(f"lobes: expected polar axes, found {ax.name}")
    angles = _checked("theta_i", theta_i)
    materials = named(brdf)
    curves = [[_lobe(one, angle) for angle in angles] for _, one in materials]
    low, peak = _extremes(np.concatenate([f_r for curve in curves for _, f_r in curve]))
    # The darkest values lie at a quarter of the radius, or a decade above the centre.
    floor = low / max((peak / low) ** (1 / 3), 10.0)
    top = peak * (peak / floor) ** 0.06
    upright(ax)
    for curve, style in zip(curves, STYLES, strict=False):
        for (theta_o, f_r), colour in zip(curve, colours(len(angles)), strict=True):
            ax.plot(theta_o, np.maximum(f_r, floor), color=colour, linestyle=style, linewidth=1.2)
    for angle, colour in zip(angles, colours(len(angles)), strict=True):
        ax.plot([angle, angle], [floor, top], ":", color=colour, linewidth=0.8)
        _arrow(ax, -angle, floor, top, colour)
    ax.set(thetamin=-90, thetamax=90)
    ax.set_title("$f_r$ [1/sr] in the plane of incidence", y=0.88)  # a half disc fills only the middle half of its axes
    ax.set_rlim(floor, top)
    ax.set_thetagrids(range(-90, 91, 30))
    _decades(ax, floor, top)
    legend(
        ax,
        materials,
        [f"$\\theta_i$ = {np.degrees(a):.3g}°" for a in angles],
        loc="upper center",
        bbox_to_anchor=(0.5, 0.17),
        ncols=2,
    )


def theta_h_slices(ax: Any, brdf: Materials, theta_d: Sequence[float] = DIFFERENCES, phi_d: float = HALF_PI) -> None:
    """Draws f_r over θ_h, a curve for each θ_d and material. It shows the shape of the highlight, and how it grows
    towards grazing angles.

    The lines' data are θ_h [degrees], on an axis that is linear in √θ_h as MERL's tables are, and f_r [1/sr], the mean
    of the channels, on a logarithmic axis; f_r is NaN below the horizon. brdf: one, or up to five by name, each of
    which has its own line style. theta_d: [rad], in [0, π/2). phi_d: [rad]; at π/2, θ_i and θ_o are equal.

    Raises ValueError for angles out of range, MaterialError for a black material.
    """
    angles = _checked("theta_d", theta_d)
    materials = named(brdf)
    theta_h = np.linspace(0, 1, STEPS + 1)[:-1] ** 2 * HALF_PI
    every: list[NDArray[np.float64]] = []
    for (_, one), style in zip(materials, STYLES, strict=False):
        for angle, colour in zip(angles, colours(len(angles)), strict=True):
            wi, wo = directions(*np.broadcast_arrays(theta_h, angle, phi_d))
            f_r = one.eval(np.stack(wi, -1), np.stack(wo, -1)).mean(axis=-1)
            above = np.minimum(wi[2], wo[2]) > ON_HORIZON
            every.append(f_r[above])
            ax.plot(np.degrees(theta_h), np.where(above, f_r, np.nan), color=colour, linestyle=style, linewidth=1.2)
    low, peak = _extremes(np.concatenate(every))
    margin = max((peak / low) ** 0.08, 2.0)
    ax.set_xscale("function", functions=(lambda x: np.sqrt(np.maximum(x, 0)), np.square))  # pyright: ignore
    ax.set_yscale("log")
    ax.set(xlim=(0, 90), ylim=(low / margin, peak * margin), xlabel=r"$\theta_h$", ylabel="$f_r$ [1/sr]")
    ax.set_xticks(THETA_H_TICKS, [f"{tick}°" for tick in THETA_H_TICKS])
    ax.set_title(f"$f_r$ over $\\theta_h$ at $\\phi_d$ = {np.degrees(phi_d):.3g}°")
    ax.grid(color="0.9")
    legend(ax, materials, [f"$\\theta_d$ = {np.degrees(a):.3g}°" for a in angles], **_beside(len(materials)))


def _beside(materials: int) -> dict[str, Any]:
    """Where the legend goes: below the curves if it names several materials, since it would hide them."""
    return (
        {"loc": "upper right"}
        if materials == 1
        else {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16), "ncols": 2}
    )


def _checked(name: str, angles: Sequence[float]) -> list[float]:
    """The angles. Raises ValueError if there are none, or any outside [0, π/2)."""
    found = [float(angle) for angle in angles]
    if not found or not all(0 <= angle < HALF_PI for angle in found):
        raise ValueError(f"{name}: expected angles from 0 to less than π/2, found {found}")
    return found


def _lobe(brdf: Brdf, theta_i: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """θ_o and f_r of a lobe. Steps are small near the mirror direction: a highlight may be only 0.01° wide."""
    near = np.geomspace(1e-5, 0.2, 60)
    steps = np.linspace(-HALF_PI, HALF_PI, STEPS + 1)
    theta_o = np.unique(np.concatenate([steps, theta_i - near, [theta_i], theta_i + near]))
    theta_o = theta_o[np.cos(theta_o) > ON_HORIZON]
    wi, wo = spherical(-theta_i, 0.0), spherical(theta_o, np.zeros_like(theta_o))
    return theta_o, brdf.eval(np.array(wi), np.stack(wo, -1)).mean(axis=-1)


def _extremes(f_r: NDArray[np.float64]) -> tuple[float, float]:
    """The range that a logarithmic axis has to show: the DARKEST percentile of the values, and the largest one."""
    shown = f_r[(f_r > 0) & np.isfinite(f_r)]
    if not shown.size:
        raise MaterialError("picture: the material is black, so there is nothing to draw")
    peak = float(shown.max())
    return max(float(np.percentile(shown, DARKEST)), DEEPEST * peak), peak


def _arrow(ax: Any, theta: float, floor: float, top: float, colour: Any) -> None:
    """An arrow from the rim inwards, over an eighth of the radius: light that comes in at `theta`."""
    end = top * (floor / top) ** 0.13
    ax.annotate(
        "",
        xy=(theta, end),
        xytext=(theta, top),
        arrowprops={"arrowstyle": "-|>", "color": colour},
        annotation_clip=False,
    )


def _decades(ax: Any, floor: float, top: float) -> None:
    """Circles at powers of ten, at most four, so that their labels do not overlap."""
    first, last = int(np.ceil(np.log10(floor))), int(np.floor(np.log10(top)))
    step = -(-(last - first + 1) // 4)
    ticks = list(range(first, last + 1, max(step, 1)))
    ax.set_rgrids([10.0**tick for tick in ticks], [f"$10^{{{tick}}}$" for tick in ticks], fontsize=7)
    ax.yaxis.set_minor_locator(matplotlib("matplotlib.ticker").NullLocator())
