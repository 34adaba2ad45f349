"""The page in a notebook, and as a file."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

from ..compression.material import SomManBrdf
from ..compression.smrl.file import encode
from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..system.errors import MaterialError
from ..system.files import atomic_write
from .page import page
from .versions import Source, asked, shown_size

HEIGHT = 720  # pixels
# The page runs its own scripts and saves files. It has no access to the notebook that it is in, nor to anything else.
FRAME = (
    '<iframe title="Sommerl" sandbox="allow-scripts allow-downloads" allow="clipboard-write" '
    'style="width: 100%; height: {height}px; border: 0" srcdoc="{page}"></iframe>'
)


class View:
    """A page with materials, which notebooks show. html: the whole page; in a file it works by itself."""

    def __init__(self, html: str, height: int) -> None:
        self.html = html
        self._height = height

    def save(self, path: str | Path) -> None:
        """Writes the page to a file. Raises OSError if it cannot be written."""
        with atomic_write(Path(path)) as out:
            out.write(self.html.encode())

    def __repr__(self) -> str:
        return f"<page of {len(self.html.encode())} bytes; save(PATH) writes it>"

    def _repr_html_(self) -> str:
        return FRAME.format(height=self._height, page=html.escape(self.html))


def view(
    *materials: Brdf | str | Path, sizes: Sequence[int] = (), clusters: Sequence[int] = (), height: int = HEIGHT
) -> View:
    """Shows materials: turned in the light, compared, and how they are stored.

    materials: BRDFs, or what `load` takes. sizes: also compress each by the preset compact to at most so many bytes,
    some seconds each. clusters: also compress each by the preset paper with so many entries.
    height: of the frame in a notebook, in pixels.

    Raises MaterialError if there are none, OptionError for sizes and clusters out of range, and what `load` raises.

    >>> shown = view("nickel")  # in a notebook, the last line of a cell shows it
    >>> shown.save("nickel.html")
    """
    if not materials:
        raise MaterialError("view: expected at least one material, found none")
    versions = asked(sizes, clusters)
    brdfs = [one if isinstance(one, Brdf) else load(one) for one in materials]
    named = ["" if isinstance(one, Brdf) else str(one) for one in materials]
    sources = [Source(brdf, label, name) for brdf, label, name in zip(brdfs, _labels(brdfs), named, strict=True)]
    return View(page([one for source in sources for one in (source.held(), *source.compressed(versions))]), height)


def _labels(brdfs: Sequence[Brdf]) -> list[str]:
    """Their names; where several have the same, with what else they are, and where that is the same, with a number."""
    found = [brdf.name for brdf in brdfs]
    for more in (list(map(_also, brdfs)), [str(number) for number, _ in enumerate(brdfs, start=1)]):
        found = [
            label if found.count(label) == 1 else f"{label}, {other}" for label, other in zip(found, more, strict=True)
        ]
    return found


def _also(brdf: Brdf) -> str:
    """How a material is stored, in a word or two."""
    if not isinstance(brdf, SomManBrdf):
        return brdf.lookup
    return f"M = {brdf.clusters}" if brdf.grid else shown_size(len(encode(brdf)))
