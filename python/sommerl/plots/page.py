"""What all pictures share: names, colours, line styles, the ticks of the √θ_h axis, and the writing of figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..reflectance.brdf import Brdf
from ..system.errors import MaterialError, OptionError
from ..system.files import atomic_write
from ..system.optional import optional
from ..system.visible import visible
from .style import plain_style

Material = tuple[str, Brdf]  #: a name, and the material
Materials = Brdf | Mapping[str, Brdf]  #: one material, or several by the names that the legend shows

DPI = 110
LONGEST_NAME = 60
THETA_H_TICKS = (0, 1, 5, 15, 30, 50, 90)  # degrees, on an axis of √θ_h
# Extensions, and the metadata of files: a mark (see `system.files`), and no date or version of matplotlib, so that the
# same picture gives the same bytes.
FORMATS: dict[str, dict[str, str | None]] = {
    ".png": {"Software": "Sommerl"},
    ".pdf": {"Creator": "Sommerl", "Producer": None, "CreationDate": None},
    ".svg": {"Creator": "Sommerl", "Date": None},
}
STYLES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 2, 1, 2)), (0, (9, 2)))  # of lines, one a material
MOST_MATERIALS = len(STYLES)


def matplotlib(module: str = "matplotlib.figure") -> Any:
    """A module of matplotlib. Raises MissingDependencyError without it."""
    return optional(module, "matplotlib", "plots", "lab")


def save(figure: Any, path: Path) -> None:
    """Writes a figure as PNG, PDF or SVG, by the extension; the same figure gives the same bytes.

    Raises OptionError for another extension, OSError if it cannot be written.
    """
    extension = path.suffix.lower()
    if extension not in FORMATS:
        raise OptionError(f"{path}: expected a name that ends in {' or '.join(FORMATS)}, found {path.suffix!r}")
    with plain_style(), atomic_write(path) as out:
        figure.savefig(out, format=extension[1:], dpi=DPI, metadata=FORMATS[extension])


def named(brdf: Materials) -> list[Material]:
    """Materials with their names. Raises MaterialError if there are none, or more than MOST_MATERIALS."""
    found = [(brdf.name, brdf)] if isinstance(brdf, Brdf) else list(brdf.items())
    if not 1 <= len(found) <= MOST_MATERIALS:
        raise MaterialError(f"materials: expected 1 to {MOST_MATERIALS} in a picture, found {len(found)}")
    return found


def text(name: str) -> str:
    """A name as text for matplotlib, which would take a dollar sign for a formula, and which leaves names that begin
    with an underscore out of legends."""
    short = visible(name, LONGEST_NAME)
    return ("\u200b" if short.startswith("_") else "") + short.replace("$", r"\$")


def number(value: float) -> str:
    """A number with three significant digits and without an exponent."""
    return np.format_float_positional(value, 3, unique=False, fractional=False, trim="-")


def upright(ax: Any) -> None:
    """Makes polar axes those of a lobe: the normal is at the top, angles grow clockwise, and radii are logarithmic."""
    ax.set_theta_zero_location("N")
    ax.set_theta_direction(-1)
    ax.set_rscale("log")
    ax.minorticks_off()  # of the radius: nobody sees them, and they take longer than all the rest


def colours(count: int) -> list[Any]:
    """Colours for increasing angles, from dark to light, all dark enough to be seen on white."""
    return list(matplotlib("matplotlib").colormaps["viridis"](np.linspace(0, 0.85, count)))


def legend(ax: Any, materials: list[Material], angles: list[str], **where: Any) -> None:
    """Adds a legend: the angle of each colour and, if there are several materials, the material of each line style."""
    line = matplotlib("matplotlib.lines").Line2D
    handles = [line([], [], color=c, label=label) for c, label in zip(colours(len(angles)), angles, strict=True)]
    if len(materials) > 1:
        for (name, _), style in zip(materials, STYLES, strict=False):
            handles.append(line([], [], color="black", linestyle=style, label=text(name)))
    ax.legend(handles=handles, fontsize=7, handlelength=2.8, **where)
