"""The picture of `rate_distortion.py`: PSNR over bytes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from sommerl.commands.console import size

COLOURS = {
    "compact": "#0059b3",
    "paper": "#d95f02",
    "k-means": "#1b9e77",
    "NBRDF": "#c2185b",
    "SGD": "#7b52ab",
    "GGX": "#8c6239",
    "MERL table": "#444444",
}
Row = dict[str, Any]


def draw(rows: Sequence[Row], means: Sequence[Row], path: Path) -> None:
    """Writes a PNG: thick lines and large marks are means over materials, thin ones a material each.

    Hollow marks are lookups of the nearest cell. Identical images, which have no PSNR, are left out.
    """
    figure = Figure(figsize=(9.5, 6), layout="constrained")
    ax = figure.add_subplot()
    materials = list(dict.fromkeys(row["material"] for row in rows))
    for family in dict.fromkeys(row["family"] for row in means):
        method, _, lookup = family.partition(", ")
        colour = COLOURS[method]
        marks = {"color": colour, "marker": "o", "markerfacecolor": "white" if lookup == "nearest" else colour}
        for material in materials:
            x, y = _points(row for row in rows if (row["material"], row["family"]) == (material, family))
            ax.plot(x, y, **marks, linewidth=0.7, alpha=0.4, markersize=3, markeredgewidth=0.7)
        x, y = _points(row for row in means if row["family"] == family)
        line = "-" if len(x) > 1 else "none"
        ax.plot(x, y, **marks, linestyle=line, linewidth=2.2, markersize=8, markeredgewidth=1.6, label=family, zorder=3)
    ax.set(xscale="log", xlabel="bytes stored", ylabel="PSNR over the object, 8 bits [dB]")
    ax.set_title(f"Means over {len(materials)} materials, and each of them (thin)", loc="left")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: size(int(value)).replace(".00", "").replace(".0", "")))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.grid(color="0.9", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="lower right", frameon=False)
    figure.savefig(path, dpi=130)


def _points(rows: Any) -> tuple[list[float], list[float]]:
    """Bytes and PSNRs, by bytes."""
    found = sorted((row["bytes"], row["psnr_object_db"]) for row in rows if math.isfinite(row["psnr_object_db"]))
    return [x for x, _ in found], [y for _, y in found]
