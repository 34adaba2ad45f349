"""What an item of the report shows: numbers beside the paper's, tables, pictures, sentences."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..render.compare import Comparison, compare_on_sphere
from ..render.environment import default_environment
from ..system.optional import optional
from .cells import Cell, Outcome, Setting

Outcomes = Mapping[str, Outcome]
SOFTWARE = 0x0131  # the tag of EXIF
QUALITY = 88  # of WebP pictures, which are a seventh of PNG's size


@dataclass(frozen=True)
class Ours:
    """Our number for one of the paper's: by Eq. 2 as printed, and by the default. Where the two ways of learning make
    no difference, the first is None. only: the cell that makes it. interval: of 95 % confidence, of the default's."""

    only: str
    default: float | None
    printed: float | None = None
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Table:
    """columns: headings. rows: of cells, numbers with their format or words."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Picture:
    """image: the bytes of a file. below: of a second one, which is shown below it: a difference."""

    caption: str
    image: bytes
    below: bytes | None = None
    wide: bool = False


@dataclass(frozen=True)
class Section:
    """ours: by the keys of the paper's numbers. sentences: what was found, each with a figure."""

    ours: Mapping[str, Ours] = field(default_factory=dict[str, Ours])
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    sentences: Sequence[str] = ()


@dataclass(frozen=True)
class Item:
    """A figure, a table or another part of the report.

    about: what the paper shows, and what is shown here. plan: the cells that it needs. show: what it makes of them.
    """

    title: str
    about: str
    plan: Callable[[Setting], Sequence[Cell]]
    show: Callable[[Setting, Outcomes], Section]


def webp(pixels: NDArray[np.uint8]) -> bytes:
    """The bytes of a WebP file for 8-bit pixels (height, width, 3)."""
    image = optional("PIL.Image", "Pillow", "pictures of the report", "render")
    exif = image.Exif()
    exif[SOFTWARE] = "Sommerl"  # the mark that lets commands replace it: see `system.files`
    out = io.BytesIO()
    image.fromarray(pixels).save(out, "WEBP", quality=QUALITY, exif=exif)
    return out.getvalue()


def compared(setting: Setting, reference: Brdf, candidates: Sequence[Brdf]) -> list[Comparison]:
    """Candidates on the sphere, in the built-in light."""
    extent = setting.extent
    return compare_on_sphere(reference, candidates, default_environment(), size=extent.size, spp=extent.spp)


def shown(comparisons: Mapping[str, Comparison]) -> dict[str, bytes]:
    """Pictures of comparisons: "reference", and of each by its name the candidate, and NAME.difference."""
    found: dict[str, bytes] = {}
    for name, each in comparisons.items():
        reference, candidate, difference = each.pictures()
        found.setdefault("reference", webp(reference))
        found |= {name: webp(candidate), f"{name}.difference": webp(difference)}
    return found


def pictured(outcome: Outcome, captions: Mapping[str, str]) -> list[Picture]:
    """A cell's pictures of `shown`, with captions by their names, those that there are."""
    images = outcome.pictures
    return [
        Picture(text, images[name], images.get(f"{name}.difference"))
        for name, text in captions.items()
        if name in images
    ]


def decibels(value: Any) -> str:
    return "∞" if value is None else f"{value:.2f} dB"
