"""A contact sheet: one self-contained page with all materials of a library, each of which opens in the viewer.

The materials' files are in it, and the viewer's page once, deflated; a click puts the two together in a new tab. As in
the viewer's page, nothing is fetched, and the policy allows the scripts that are in the page and no request.
"""

from __future__ import annotations

import base64
import html
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from ..library.finding import QUALITY, digits, hue
from ..library.record import Record
from ..system.visible import visible
from .bundle import module
from .page import as_json, filled, policy, template, within

LONGEST_TITLE = 80
MOST = 99.0  # dB, of what is identical with its source


@dataclass(frozen=True)
class Shown:
    """A material of the sheet. name: what a command takes for it. data: its .smrl. picture: a WebP file."""

    record: Record
    name: str
    data: bytes
    picture: bytes

    def packed(self) -> dict[str, object]:
        """For the page's JSON."""
        record, quality = self.record, self.record.metrics.get(QUALITY)
        looks = {"colour": digits(record.colour), "hue": hue(record.colour), "gloss": record.gloss}
        looks |= {"metalness": record.metalness}
        size = {"bytes": record.bytes, "quality": None if quality is None else float(np.fmin(quality, MOST))}
        contents = {"picture": _base64(self.picture), "data": _base64(self.data)}
        return {"name": self.name, "label": visible(record.name), **size, **looks, **contents}


def sheet(title: str, materials: Sequence[Shown]) -> str:
    """The page, as HTML."""
    viewer = zlib.compress(template().encode(), 9, wbits=-15)
    values = {
        "policy": policy((_script(),), (_style(),)),
        "title": html.escape(visible(title, LONGEST_TITLE)),
        "style": _style(),
        "materials": as_json([one.packed() for one in materials]),
        "viewer": _base64(viewer),
        "script": _script(),
    }
    return filled(_file("sheet.html"), values)


@cache
def _script() -> str:
    return within("script", _file("sheet.js"))


@cache
def _style() -> str:
    return within("style", module("base.css") + _file("sheet.css"))


def _file(name: str) -> str:
    return (files("sommerl") / "viewer/sheet" / name).read_text("utf-8")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()
