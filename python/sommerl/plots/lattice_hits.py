"""Counts how often directions at equal steps of θ and φ hit each cell of a lattice: the paper's Fig. 2."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.cells import HALF_PI, Lattice
from ..reflectance.half_diff import TWO_PI, half_diff, spherical
from ..system.errors import MaterialError

THETA_STEPS, PHI_STEPS = 90, 180  # of each direction: steps of 1° and of 2°


def hit_counts(lattice: Lattice) -> NDArray[np.int64]:
    """How many of the paper's 90 × 180 × 90 × 180 pairs (θ_i, φ_i, θ_o, φ_o) fall into each cell.

    Returns counts of the lattice's shape, which add up to 262,440,000. The paper does not say where in its steps of 1°
    in θ and 2° in φ the directions lie. Here θ is in the middle of its step, since at θ = 0 all φ are the same
    direction. For isotropic materials only φ_o − φ_i matters, and each value of it occurs 180 times, so one φ_i is
    counted 180 times.
    """
    theta = (np.arange(THETA_STEPS) + 0.5) * (HALF_PI / THETA_STEPS)
    phi = np.arange(PHI_STEPS) * (TWO_PI / PHI_STEPS)
    found = np.zeros(lattice.size, np.int64)
    for theta_i in theta:
        theta_o, phi_o = np.meshgrid(theta, phi, indexing="ij")
        wi = spherical(np.full_like(theta_o, theta_i), np.zeros_like(phi_o))
        cell = lattice.cell(*half_diff(wi, spherical(theta_o, phi_o), lattice.reciprocal))
        found += np.bincount(cell.reshape(-1), minlength=lattice.size)
    return PHI_STEPS * found.reshape(lattice.shape)


def hits(ax: Any, material: Brdf) -> None:
    """Draws the paper's Fig. 2 (Kurt & Cinsdikici 2008): over the number of the cell, how often cells are hit by
    directions at equal steps of θ and φ. Many are never hit, which is one reason to compress.

    It depends on the lattice, not on the material. Each bar counts the hits of all cells of equal θ_h and θ_d (in
    MERL's lattice 180, in φ_d); the bars add up to all pairs. See `hit_counts`. Raises MaterialError for a material
    that is not on a lattice of cells.
    """
    lattice = material.grid
    if lattice is None:
        raise MaterialError(f"{material.name}: hits are drawn only of materials on a lattice of cells, which it is not")
    counts = hit_counts(lattice)
    rows = counts.sum(axis=2).reshape(-1)
    ax.stairs(rows, np.arange(len(rows) + 1) * lattice.phi_d, fill=True, color="C0")
    ax.set(xlim=(0, lattice.size), ylim=(0, None), xlabel="number of the cell", ylabel=f"hits in {lattice.phi_d} cells")
    ax.locator_params(axis="x", nbins=5)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter("{x:,.0f}")
    ax.set_title(
        f"{' × '.join(map(str, lattice.shape))} cells, {(counts > 0).mean():.1%} are hit (as the paper's Fig. 2)"
    )
