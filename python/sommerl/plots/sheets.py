"""Puts several pictures on one page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..compression.material import SomManBrdf
from ..reflectance.brdf import Brdf
from ..reflectance.cells import Lattice
from ..system.errors import OptionError
from .curves import lobes, theta_h_slices
from .image_slice import slices
from .lattice_hits import hits
from .page import Material, Materials, matplotlib, named, text
from .palettes import palette, usage
from .style import plain_style
from .tone import Tone

PANEL = 4.6, 3.9  # inches
COLUMNS = 3


@dataclass(frozen=True)
class Kind:
    """A kind of picture.

    draw: draws it into axes. shows: what it shows, for help texts. together: whether one picture shows several
    materials. projection: of the axes. applies: whether it is drawn of a material when all kinds are asked for.
    """

    draw: Callable[[Any, Any], object]
    shows: str
    together: bool = False
    projection: str | None = None
    applies: Callable[[Brdf], bool] = lambda brdf: True


def _has_palette(brdf: Brdf) -> bool:
    return isinstance(brdf, SomManBrdf)


def _has_cells(brdf: Brdf) -> bool:
    return brdf.grid is not None


KINDS = {
    "lobes": Kind(lobes, "f_r in the plane of incidence, for several θ_i", together=True, projection="polar"),
    "theta-h": Kind(theta_h_slices, "f_r over θ_h, for several θ_d, at φ_d = 90°", together=True),
    "slices": Kind(slices, "an image of f_r over θ_h and θ_d, at φ_d = 90°"),
    "palette": Kind(palette, "the entries of a compressed material, as colours", applies=_has_palette),
    "usage": Kind(usage, "how many cells, or nodes, have each entry", applies=_has_palette),
    "hits": Kind(hits, "how often cells are hit by directions at equal steps (the paper's Fig. 2)", applies=_has_cells),
}

Panel = tuple[str, str, Any]  # kind, name of the material, material or materials


def sheet(brdf: Materials, kind: str = "all") -> tuple[Any, list[str]]:
    """A figure with one kind of picture, or with all kinds that apply, and the names of these kinds.

    brdf: one, or up to five by name; their image slices all use the tones of the first one. kind: a key of KINDS, or
    "all". Raises MaterialError for a material of which that kind cannot be drawn, OptionError for an unknown kind,
    MissingDependencyError without matplotlib.
    """
    if kind not in (*KINDS, "all"):
        raise OptionError(f"kind: expected {', '.join(KINDS)} or all, found {kind}")
    materials = named(brdf)
    asked = [name for name in KINDS if kind in ("all", name)]
    shared: list[Panel] = [(name, "", dict(materials)) for name in asked if KINDS[name].together]
    if "hits" in asked:
        shared += [("hits", "", one) for _, one in _lattices(materials) if kind == "hits" or _has_cells(one)]
    own = [name for name in asked if not KINDS[name].together and name != "hits"]
    rows = [[(n, label, one) for n in own if kind == n or KINDS[n].applies(one)] for label, one in materials]
    with plain_style():
        figure = _drawn(_arranged(shared, rows), named_in_titles=len(materials) > 1)
        if len(materials) == 1:
            figure.suptitle(text(materials[0][0]), fontsize=11)
    return figure, [name for name in KINDS if any(name == panel[0] for row in [shared, *rows] for panel in row)]


def _lattices(materials: list[Material]) -> list[Material]:
    """One material for each lattice: hits are the same for all materials on one lattice."""
    found: dict[Lattice | None, Material] = {}
    for label, one in materials:
        found.setdefault(one.grid, (label, one))
    return list(found.values())


def _arranged(shared: list[Panel], rows: list[list[Panel]]) -> list[list[Panel]]:
    """Panels in rows. Of several materials, each gets a row if one of them has more than one panel."""
    if len(rows) > 1 and max(map(len, rows)) > 1:
        return _flowing(shared) + rows
    return _flowing(shared + [panel for row in rows for panel in row])


def _flowing(panels: list[Panel]) -> list[list[Panel]]:
    columns = 2 if len(panels) == 4 else COLUMNS
    return [panels[start : start + columns] for start in range(0, len(panels), columns)]


def _drawn(rows: list[list[Panel]], named_in_titles: bool) -> Any:
    columns = max(map(len, rows))
    figure = matplotlib().Figure(figsize=(PANEL[0] * columns, PANEL[1] * len(rows)), layout="constrained")
    tone: Tone | None = None
    for row, panels in enumerate(rows):
        for column, (name, label, brdf) in enumerate(panels):
            ax = figure.add_subplot(len(rows), columns, row * columns + column + 1, projection=KINDS[name].projection)
            if name == "slices":
                tone = slices(ax, brdf, tone=tone)
            else:
                KINDS[name].draw(ax, brdf)
            ax.title.set_fontsize(9)
            if label and named_in_titles:
                ax.set_title(f"{text(label)}\n{ax.get_title()}", fontsize=9)
    return figure
