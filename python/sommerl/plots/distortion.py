"""PSNR over bytes stored, in soft light and under one lamp; and render time against error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .page import matplotlib
from .style import plain_style

Row = Mapping[str, Any]

COLOURS = {
    "compact": "#0059b3",
    "paper": "#d95f02",
    "SOM without MAN": "#e0a030",
    "distinct": "#a05a00",
    "neighbours": "#b8860b",
    "k-means": "#1b9e77",
    "Lawrence": "#5b8c2a",
    "NBRDF": "#c2185b",
    "SGD": "#7b52ab",
    "GGX": "#8c6239",
    "MERL table": "#444444",
    "own file": "#000000",
    "reciprocal": "#444444",
}
PANELS = {"psnr_soft_db": "In soft light", "psnr_lamp_db": "Under one lamp"}
MARKS = ("o", "s", "D", "^")  # of families that share a colour


def drawn(rows: Sequence[Row], means: Sequence[Row]) -> Any:
    """A figure: large marks are means over materials, joined where they are of one family; small ones a material each.

    rows: with the keys material, family, bytes and those of PANELS; identical ones, which have no PSNR, are left out.
    means: the same without material; one without bytes is a dotted line.
    """
    with plain_style():
        figure = matplotlib().Figure(figsize=(11.5, 5.2), layout="constrained")
        axes = figure.subplots(1, 2, sharey=True)
        for ax, (key, title) in zip(axes, PANELS.items(), strict=True):
            _panel(ax, key, rows, means)
            ax.set_title(title, loc="left")
            ax.set(xscale="log", xlabel="bytes stored")
            ax.grid(color="0.9", linewidth=0.7)
            ax.set_axisbelow(True)
            ax.spines[["top", "right"]].set_visible(False)
        axes[0].set_ylabel("PSNR against the source, 8 bits [dB]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize="small")
    return figure


def _panel(ax: Any, key: str, rows: Sequence[Row], means: Sequence[Row]) -> None:
    seen: dict[str, int] = {}
    for family in dict.fromkeys(row["family"] for row in means):
        method = family.partition(", ")[0]
        group = [row for row in means if row["family"] == family]
        if group[0]["bytes"] is None:
            ax.axhline(group[0][key], color="0.3", linestyle=":", label=group[0]["label"])
            continue
        colour, mark = COLOURS[method], MARKS[seen.get(method, 0)]
        seen[method] = seen.get(method, 0) + 1
        x, y = _points(key, (row for row in rows if row["family"] == family))
        ax.plot(x, y, mark, color=colour, alpha=0.3, markersize=3, markeredgewidth=0)
        x, y = _points(key, group)
        if x:
            ax.plot(x, y, color=colour, marker=mark, markersize=7, linewidth=2, label=family, zorder=3)


def _points(key: str, rows: Iterable[Row]) -> tuple[list[float], list[float]]:
    """Bytes and PSNRs, by bytes."""
    found = sorted((row["bytes"], row[key]) for row in rows if row[key] is not None)
    return [x for x, _ in found], [y for _, y in found]


def time_over_error(points: Mapping[str, tuple[float, float]]) -> Any:
    """A figure: of each representation, by its name, the root mean squared error of an image and the time that it took,
    relative to the first one's."""
    with plain_style():
        figure = matplotlib().Figure(figsize=(8.5, 4.4), layout="constrained")
        ax = figure.subplots()
        for number, (name, (error, seconds)) in enumerate(points.items()):
            ax.plot([error], [seconds], "o", color="#d95f02" if number == 0 else "#0059b3", markersize=7)
            ax.annotate(name, (error, seconds), (5, 4), textcoords="offset points", fontsize=7.5)
        ax.set(
            xlabel="root mean squared error to the table's image", ylabel="time, relative to the paper's representation"
        )
        ax.set(xscale="log")
        ax.grid(color="0.9", linewidth=0.7)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    return figure
