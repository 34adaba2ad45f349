"""Draws which directions samples cover."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..formats.compared import relative_errors
from ..formats.gridded import angles_of
from ..formats.prior import Estimate
from ..formats.scattered import COVERAGE, REACH_DEGREES, ScatteredBrdf
from ..reflectance.arrays import split
from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import half_diff, spherical
from ..reflectance.samples import Samples
from .page import THETA_H_TICKS, matplotlib, save, text, upright
from .style import plain_style

INCIDENCES = (10, 45, 75)  # degrees
IN_CUT = np.radians(1.5)  # samples that are nearer than that to a cut are drawn
CUT_STEPS = 1441  # of its curve
DEEPEST = 1e-5  # of the largest value, that is drawn
MOST_LABELS = 2  # along the radius: more would meet


def coverage(brdf: ScatteredBrdf, path: Path, written: Brdf | None = None) -> None:
    """Writes a PNG that shows samples, and what was written of them (the material itself if None).

    Above, which directions were measured: for each θ_h and θ_d the share of φ_d that is near a sample, and the
    hemisphere of `wo` for three elevations of `wi`. Below, cuts in the plane of incidence, samples as dots over the
    curve of what was written, and how far it is from each sample. Raises MissingDependencyError without matplotlib.
    """
    shown = written or brdf
    with plain_style():
        figure = matplotlib().Figure(figsize=(13, 7.4), layout="constrained")
        share = f"{brdf.facts['coverage']:.1%} of all pairs of directions (by solid angles and cosines)"
        named = f"{text(brdf.name)}: {len(brdf.samples.wi)} samples"
        figure.suptitle(
            f"{named}; {share} within {REACH_DEGREES:.0f}° of one (yellow)",
            fontsize=11,
        )
        _slices(figure.add_subplot(2, 4, 1), brdf)
        for k, incidence in enumerate(INCIDENCES):
            _hemisphere(figure.add_subplot(2, 4, k + 2, projection="polar"), brdf, incidence)
        _residuals(figure.add_subplot(2, 4, 5), brdf.samples, shown)
        for k, angle in enumerate(_incidences(brdf.samples)):
            ax = figure.add_subplot(2, 4, k + 6, projection="polar")
            cut(ax, brdf.samples, shown, angle, brdf.estimate)
        save(figure, path)


def cut(ax: Any, samples: Samples, brdf: Brdf, theta_i: float, estimate: Estimate | None = None) -> None:
    """Draws a cut in the plane of incidence at θ_i [rad] into polar axes: f_r, the mean of the channels, of samples
    within IN_CUT of it as dots, and of a material as a curve. θ_o is negative on the side of the light; the radius is
    logarithmic. Of an estimate, a band is two standard deviations wide, one to each side of the curve."""
    angle_i, angle_o, phi = angles_of(samples)
    aside = np.sin(angle_o) * np.abs(np.sin(phi))
    those = (np.abs(angle_i - theta_i) < IN_CUT) & (aside < np.sin(IN_CUT))
    signed = np.where(np.cos(phi) > 0, -angle_o, angle_o)[those]
    theta = np.linspace(-1, 1, CUT_STEPS) * np.radians(88)
    wi = np.array(spherical(np.float64(theta_i), np.float64(np.pi)))
    wo = np.stack(spherical(theta, 0 * theta), axis=-1)
    curve, dots = brdf.eval(wi, wo).mean(axis=-1), samples.f_r[those].mean(axis=1)
    top = float(max(curve.max(), dots.max(initial=0.0), 1e-12)) * 1.2
    floor = max(float(np.percentile(curve[curve > 0], 2)) if (curve > 0).any() else 0.0, top * DEEPEST) / 3
    upright(ax)
    ax.plot(theta, np.maximum(curve, floor), linewidth=1.0)
    if estimate is not None:
        factor = np.exp(estimate.deviation_at(np.broadcast_to(wi, wo.shape), wo))
        band = (np.clip(each, floor, top) for each in (curve / factor, curve * factor))
        ax.fill_between(theta, *band, alpha=0.25, linewidth=0)
    ax.plot(signed, np.maximum(dots, floor), ".", color="black", markersize=2.5)
    ax.plot([-theta_i, -theta_i], [floor, top], ":", color="grey", linewidth=0.8)
    ax.set(thetamin=-90, thetamax=90, title=f"θ_i = {np.degrees(theta_i):.3g}°, {int(those.sum())} samples")
    ax.set_rlim(floor, top)
    high, low = np.floor(np.log10(top)), np.ceil(np.log10(floor))
    if high >= low:
        ax.set_rticks(10.0 ** np.arange(high, low - 1, -max(1, np.ceil((high - low + 1) / MOST_LABELS))))


def _incidences(samples: Samples) -> list[float]:
    """Three θ_i of samples [rad], evenly chosen; fewer if there are fewer."""
    theta_i, _, _ = angles_of(samples)
    known, count = np.unique(np.round(np.degrees(theta_i)), return_counts=True)
    usual = known[count >= np.median(count)]
    chosen = np.linspace(0, len(usual) - 1, min(len(usual), 3)).round().astype(int)
    return [float(np.radians(angle)) for angle in usual[chosen]]


def _residuals(ax: Any, samples: Samples, brdf: Brdf) -> None:
    errors = relative_errors(samples, brdf)
    ax.plot(np.abs(samples.f_r).mean(axis=1), np.maximum(errors, 1e-5), ".", markersize=_size(samples), alpha=0.4)
    ax.axhline(float(np.median(errors)), color="black", linewidth=0.8)
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="measured $f_r$ [1/sr]",
        ylabel="relative error",
        title="residuals, and their median",
    )


def _size(samples: Samples) -> float:
    """Of a dot [points]: few samples have larger ones, many do not hide each other."""
    return float(np.clip(40 / np.sqrt(len(samples.wi)), 1.5, 6))


def _slices(ax: Any, brdf: ScatteredBrdf) -> None:
    above = COVERAGE.above_horizon
    with np.errstate(invalid="ignore"):
        share = (brdf.measured & above).sum(axis=2) / above.sum(axis=2)  # NaN below the horizon, where nothing is drawn
    image = ax.imshow(share, origin="lower", extent=(0, 90, 0, 1), aspect="auto", cmap="viridis", vmin=0, vmax=1)
    theta_h, theta_d, _ = half_diff(split(brdf.samples.wi), split(brdf.samples.wo))
    ax.plot(
        np.degrees(theta_d), np.sqrt(theta_h * 2 / np.pi), ".", color="white", markersize=_size(brdf.samples), alpha=0.5
    )
    ax.set_yticks(np.sqrt(np.array(THETA_H_TICKS) / 90), [f"{tick}°" for tick in THETA_H_TICKS])
    ax.set(xlabel="θ_d [°]", ylabel="θ_h", title="share of φ_d", xlim=(0, 90), ylim=(0, 1))
    ax.figure.colorbar(image, ax=ax)


def _hemisphere(ax: Any, brdf: ScatteredBrdf, incidence: int) -> None:
    edges = np.linspace(0, np.pi / 2, 46), np.linspace(-np.pi, np.pi, 121)
    theta, phi = np.meshgrid(*((edge[1:] + edge[:-1]) / 2 for edge in edges), indexing="ij")
    angle = np.radians(incidence)
    wi, wo = spherical(np.full_like(theta, angle), np.zeros_like(phi)), spherical(theta, phi)
    cell = COVERAGE.cell(*half_diff(wi, wo))
    measured = brdf.measured.reshape(-1)[cell].astype(float)
    ax.pcolormesh(edges[1], edges[0], measured, cmap="viridis", vmin=0, vmax=1)
    ax.plot([0], [angle], "x", color="red")
    ax.set(title=f"θ_i = {incidence}° (×)", yticks=[], ylim=(0, np.pi / 2))
