"""Draws the picture of docs/concepts.md: a slice of a material, as it is, and as both presets keep it.

    uv run python benchmarks/concept_picture.py [MATERIAL] [-o docs/images/concepts.png]

The cells are larger than MERL's, so that they can be seen, and the entries fewer than usual.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import sommerl
from sommerl.plots.image_slice import slices
from sommerl.reflectance.half_diff import directions
from sommerl.reflectance.nodes import ABOVE as STEPS_ABOVE
from sommerl.reflectance.nodes import BELOW, FINE, KNEE, NodeLattice

CELLS, ENTRIES, SIZE = sommerl.Lattice(20, 20, 36), 16, 1000  # SIZE: bytes of the compact file


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("material", nargs="?", default="blue-metallic-paint")
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/images/concepts.png"))
    options = parser.parse_args()
    source = sommerl.load(options.material)
    wi, wo = (np.stack(np.broadcast_arrays(*each), -1) for each in directions(*CELLS.angles()))
    table = sommerl.BrdfTable(source.eval(wi, wo), CELLS, name=source.name).with_interpolation("nearest")
    paper, _ = sommerl.train(table, sommerl.TrainOptions(clusters=ENTRIES))
    compact, _ = sommerl.compress(source, target_size=SIZE)
    figure = Figure(figsize=(12, 4.2), layout="constrained", dpi=110)
    left, middle, right = figure.subplots(1, 3, sharey=True)
    tone = slices(left, source)
    slices(middle, paper, tone=tone)
    slices(right, compact, tone=tone)
    right.plot(*nodes(compact.lattice), ".", color="white", markersize=5, markeredgecolor="black", markeredgewidth=0.5)
    left.set_title("the material")
    middle.set_title(f"paper: cells, each with one of {len(paper.lut)} entries")
    right.set_title(f"compact: {compact.lattice.size} nodes in {SIZE:,} bytes")
    figure.savefig(options.out)


def nodes(lattice: Any) -> tuple[list[float], list[float]]:
    """Where the nodes of one slice are, as `slices` draws them: √(θ_h / 90°), and θ_d [°]."""
    assert isinstance(lattice, NodeLattice)
    places = [
        (row, step) for row, band in zip(lattice.theta_h, lattice.band, strict=True) for step in lattice.theta_d[band]
    ]
    across = [row / BELOW if row < KNEE else KNEE / BELOW + (row - KNEE) / STEPS_ABOVE for row, _ in places]
    return across, [step * 90 / FINE for _, step in places]


if __name__ == "__main__":
    main()
