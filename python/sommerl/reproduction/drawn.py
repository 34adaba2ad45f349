"""Fig. 2 and Fig. 3: what does not depend on a material. How often cells are hit, and the architecture."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

from ..plots.lattice_hits import hit_counts
from ..plots.page import matplotlib
from ..plots.style import plain_style
from ..reflectance.cells import MERL
from .cells import Cell, Outcome, Setting
from .printed import printed
from .section import Item, Ours, Outcomes, Picture, Section

ACCENT, INK, PALE = "#0b6bcb", "#222222", "#e8f1fb"
UNITS = 5  # of the SOM that are drawn
STORED = 3  # the paper's k
DPI = 120


def hits(setting: Setting) -> Outcome:
    """How often each cell is hit."""
    counts = hit_counts(MERL)
    with plain_style():
        figure = matplotlib().Figure(figsize=(9, 2.6), layout="constrained")
        ax = figure.subplots()
        rows = counts.sum(axis=2).reshape(-1)
        ax.stairs(rows / 1e3, [n * MERL.phi_d for n in range(len(rows) + 1)], fill=True, color=ACCENT)
        ax.set(
            xlim=(0, MERL.size),
            ylim=(0, None),
            xlabel="number of the cell",
            ylabel=f"thousands of hits in {MERL.phi_d} cells",
        )
        ax.xaxis.set_major_formatter("{x:,.0f}")
        ax.spines[["top", "right"]].set_visible(False)
        picture = drawn(figure)
    above = int(MERL.above_horizon.sum())
    return Outcome(
        {"cells": MERL.size, "hit": int((counts > 0).sum()), "pairs": int(counts.sum()), "above": above},
        {"hits": picture},
    )


def drawn(figure: Any) -> bytes:
    """The bytes of a figure as PNG."""
    out = io.BytesIO()
    with plain_style():
        figure.savefig(out, format="png", dpi=DPI, metadata={"Software": "Sommerl"})
    return out.getvalue()


def architecture(setting: Setting) -> Outcome:
    """The paper's Fig. 3: input, SOM and MAN layers, and what they give."""
    return Outcome({}, {"architecture": _svg().encode()})


def _svg() -> str:
    parts = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 860 330" font-family="system-ui, sans-serif" '
        'font-size="13" role="img" aria-label="Three inputs lead to every unit of the SOM; each unit stores three '
        'originals in the MAN; the nearest of them becomes an entry of the LUT.">',
        "<!-- Written by Sommerl -->",
        '<rect width="860" height="330" fill="white"/>',
    ]
    inputs = [
        (110, y, name, colour) for y, name, colour in ((105, "r", "#d33"), (165, "g", "#2a2"), (225, "b", "#36c"))
    ]
    units = [(320, 60 + 52.5 * n) for n in range(UNITS)]
    for x, y, _, _ in inputs:
        parts += [f'<path d="M{x + 16} {y} L{a - 17} {b}" stroke="{INK}" stroke-opacity=".28"/>' for a, b in units]
    for n, (a, b) in enumerate(units):
        hidden = n == UNITS - 2
        for k in range(STORED):
            x = a + 150 + 40 * k
            if not hidden:
                parts.append(
                    f'<rect x="{x - 13}" y="{b - 13}" width="26" height="26" rx="5" fill="{PALE}" stroke="{ACCENT}"/>'
                )
        if hidden:
            parts += [
                f'<text x="{x}" y="{b + 5}" text-anchor="middle" fill="{INK}">⋮</text>' for x in (a, a + 190, a + 390)
            ]
            continue
        number = "M" if n == UNITS - 1 else str(n + 1)
        parts += [
            f'<path d="M{a + 17} {b} H{a + 136}" stroke="{ACCENT}" stroke-width="1.4"/>',
            f'<circle cx="{a}" cy="{b}" r="16" fill="white" stroke="{INK}"/>',
            f'<text x="{a}" y="{b + 5}" text-anchor="middle" fill="{INK}">{number}</text>',
            f'<path d="M{a + 244} {b} H{a + 366}" stroke="{ACCENT}" stroke-width="1.4" stroke-dasharray="4 3"/>',
            f'<rect x="{a + 366}" y="{b - 11}" width="48" height="22" rx="4" fill="{ACCENT}"/>',
            f'<text x="{a + 390}" y="{b + 5}" text-anchor="middle" fill="white">{number}</text>',
        ]
    for x, y, name, colour in inputs:
        parts += [
            f'<circle cx="{x}" cy="{y}" r="16" fill="white" stroke="{colour}" stroke-width="2"/>',
            f'<text x="{x}" y="{y + 5}" text-anchor="middle" fill="{INK}">{name}</text>',
        ]
    heads = ((110, "input: the colour"), (320, "SOM: M units,"), (510, "MAN: three stored"), (710, "LUT: of each, the"))
    below = ((110, "of a cell"), (320, "weights c"), (510, "originals s a unit"), (710, "nearest original"))
    parts += [
        f'<text x="{x}" y="{y}" text-anchor="middle" fill="{INK}">{t}</text>'
        for y, row in ((304, heads), (321, below))
        for x, t in row
    ]
    parts += [
        f'<text x="{x}" y="24" text-anchor="middle" fill="{ACCENT}">{text}</text>'
        for x, text in ((215, "Eq. 1, 2: the winner learns"), (425, "Eq. 3–6: it remembers"), (630, "phase 3"))
    ]
    return "\n".join([*parts, "</svg>"])


def _show2(setting: Setting, outcomes: Outcomes) -> Section:
    outcome = outcomes["fig2/hits"]
    found = outcome.values
    sentence = (
        f"Of {found['cells']:,} cells, {found['hit'] / found['cells']:.1%} are hit by the {found['pairs']:,} pairs of "
        f"directions; {found['above'] / found['cells']:.1%} have both directions above the horizon at their centre."
    )
    picture = Picture("How often cells are hit; each bar is one θ_h and θ_d", outcome.pictures["hits"], wide=True)
    ours = {key: Ours("hits", found["cells"]) for key in printed("fig2")}
    return Section(ours, (), [picture], [sentence])


def _show3(setting: Setting, outcomes: Outcomes) -> Section:
    picture = Picture("The architecture", outcomes["fig3/architecture"].pictures["architecture"], wide=True)
    return Section({}, (), [picture])


def _plan2(setting: Setting) -> Sequence[Cell]:
    return [Cell("fig2/hits", hits, cost=3.0)]


FIG2 = Item(
    "Fig. 2: how often cells are hit",
    "Directions at equal steps, 90 × 180 × 90 × 180 of them. It depends on the lattice alone.",
    _plan2,
    _show2,
)
FIG3 = Item(
    "Fig. 3: the architecture",
    "Three inputs, M units, and three memories a unit. After training each unit is replaced by one of its memories.",
    lambda setting: [Cell("fig3/architecture", architecture)],
    _show3,
)
