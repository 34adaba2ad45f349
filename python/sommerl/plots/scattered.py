"""Draws which directions samples cover."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..formats.scattered import COVERAGE, REACH, ScatteredBrdf
from ..reflectance.arrays import split
from ..reflectance.half_diff import half_diff, spherical
from .page import matplotlib, save, text
from .style import plain_style

INCIDENCES = (10, 45, 75)  # degrees


def coverage(brdf: ScatteredBrdf, path: Path) -> None:
    """Writes a PNG that shows which directions were measured: for each θ_h and θ_d the share of φ_d that is near a
    sample, and the hemisphere of `wo` for three elevations of `wi`. Raises MissingDependencyError without
    matplotlib."""
    with plain_style():
        figure = matplotlib().Figure(figsize=(13, 3.6), layout="constrained")
        share = f"{brdf.facts['coverage']:.1%} of all pairs of directions (by solid angles and cosines)"
        named = f"{text(brdf.name)}: {len(brdf.samples.wi)} samples"
        figure.suptitle(
            f"{named}; {share} within {np.degrees(REACH):.0f}° of one (yellow)",
            fontsize=11,
        )
        _slices(figure.add_subplot(1, 4, 1), brdf)
        for k, incidence in enumerate(INCIDENCES):
            _hemisphere(figure.add_subplot(1, 4, k + 2, projection="polar"), brdf, incidence)
        save(figure, path)


def _slices(ax: Any, brdf: ScatteredBrdf) -> None:
    above = COVERAGE.above_horizon
    with np.errstate(invalid="ignore"):
        share = (brdf.measured & above).sum(axis=2) / above.sum(
            axis=2
        )  # NaN below the horizon, where nothing is drawn
    image = ax.imshow(share, origin="lower", extent=(0, 90, 0, 1), aspect="auto", cmap="viridis", vmin=0, vmax=1)
    theta_h, theta_d, _ = half_diff(split(brdf.samples.wi), split(brdf.samples.wo))
    ax.plot(np.degrees(theta_d), np.sqrt(theta_h * 2 / np.pi), ".", color="white", markersize=1.5, alpha=0.5)
    ticks = np.array([0, 1, 5, 15, 30, 50, 90])
    ax.set_yticks(np.sqrt(ticks / 90), [f"{tick}°" for tick in ticks])
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
