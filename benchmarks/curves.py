"""The picture of `rate_distortion.py`: PSNR over bytes, in soft light and under one lamp."""

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
PANELS = {"psnr_soft_db": "In soft light", "psnr_lamp_db": "Under one lamp"}
Row = dict[str, Any]


def draw(rows: Sequence[Row], means: Sequence[Row], path: Path) -> None:
    """Writes a PNG: thick lines and large marks are means over materials, thin ones a material each.

    Hollow marks are lookups of the nearest cell; a dotted line is the mean of what nothing is stored of, the raw data
    with both orders averaged. Identical images, which have no PSNR, are left out.
    """
    figure = Figure(figsize=(12, 5.5), layout="constrained")
    for ax, (key, title) in zip(figure.subplots(1, 2, sharey=True), PANELS.items(), strict=True):
        _panel(ax, key, rows, means)
        ax.set_title(title, loc="left")
        ax.set(xscale="log", xlabel="bytes stored")
        ax.xaxis.set_major_formatter(FuncFormatter(_bytes))
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.grid(color="0.9", linewidth=0.7)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("PSNR against the raw source, 8 bits [dB]")
    figure.axes[0].legend(loc="lower right", frameon=False, fontsize="small")
    figure.savefig(path, dpi=130)


def _panel(ax: Any, key: str, rows: Sequence[Row], means: Sequence[Row]) -> None:
    materials = list(dict.fromkeys(row["material"] for row in rows))
    for row in means:
        if row["bytes"] is None:
            ax.axhline(row[key], color="0.3", linestyle=":", label=row["label"])
    for family in dict.fromkeys(row["family"] for row in means if row["bytes"] is not None):
        method, _, lookup = family.partition(", ")
        colour = COLOURS[method]
        marks = {"color": colour, "marker": "o", "markerfacecolor": "white" if lookup == "nearest" else colour}
        for material in materials:
            x, y = _points(key, (row for row in rows if (row["material"], row["family"]) == (material, family)))
            ax.plot(x, y, **marks, linewidth=0.7, alpha=0.4, markersize=3, markeredgewidth=0.7)
        x, y = _points(key, (row for row in means if row["family"] == family))
        line = "-" if len(x) > 1 else "none"
        ax.plot(x, y, **marks, linestyle=line, linewidth=2.2, markersize=8, markeredgewidth=1.6, label=family, zorder=3)


def _bytes(value: float, _: int) -> str:
    return size(int(value)).replace(".00", "").replace(".0", "")


def _points(key: str, rows: Any) -> tuple[list[float], list[float]]:
    """Bytes and PSNRs, by bytes."""
    found = sorted((row["bytes"], row[key]) for row in rows if math.isfinite(row[key]))
    return [x for x, _ in found], [y for _, y in found]
