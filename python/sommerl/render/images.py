"""Image files, pictures of differences, and a page that shows them side by side."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import atomic_write
from .llvm import mitsuba

DIFFERENCE_GAIN = 8


def encode(pixels: NDArray[Any]) -> bytes:
    """8-bit sRGB pixels (height, width, 3) as PNG, linear float32 ones as OpenEXR."""
    mi = mitsuba()
    stream = mi.MemoryStream()
    kind = mi.Bitmap.FileFormat.PNG if pixels.dtype == np.uint8 else mi.Bitmap.FileFormat.OpenEXR
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels))
    bitmap.set_srgb_gamma(pixels.dtype == np.uint8)
    bitmap.write(stream, kind)
    return bytes(stream.raw_buffer())


def write_image(path: Path, pixels: NDArray[Any]) -> None:
    """Writes 8-bit pixels as PNG, float32 pixels as OpenEXR."""
    with atomic_write(path) as out:
        out.write(encode(pixels))


def difference(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The absolute difference of two 8-bit images, eight times enlarged: black where they agree."""
    magnified = DIFFERENCE_GAIN * np.abs(a.astype(np.int32) - b.astype(np.int32))
    return np.minimum(magnified, 255).astype(np.uint8)


def side_by_side(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures of equal height in one."""
    return np.concatenate(pictures, axis=1)


def write_page(
    path: Path, title: str, pictures: Sequence[tuple[str, NDArray[np.uint8]]], rows: Mapping[str, str], note: str
) -> None:
    """One HTML file, complete in itself: captioned pictures side by side, a table of rows, and a note."""
    figures = "".join(
        f'<figure><img src="data:image/png;base64,{base64.b64encode(encode(pixels)).decode()}" '
        f'alt="{html.escape(caption)}"><figcaption>{html.escape(caption)}</figcaption></figure>'
        for caption, pixels in pictures
    )
    cells = "".join(f"<tr><th>{html.escape(key)}</th><td>{html.escape(value)}</td></tr>" for key, value in rows.items())
    page = PAGE.format(title=html.escape(title), figures=figures, cells=cells, note=html.escape(note))
    with atomic_write(path) as out:
        out.write(page.encode())


PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
  body {{ font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 62rem; margin: 2rem auto;
    padding: 0 1rem; }}
  @media (prefers-color-scheme: dark) {{ body {{ color: #ddd; background: #181818; }} }}
  .pictures {{ display: flex; flex-wrap: wrap; gap: 1rem; }}
  figure {{ flex: 1 1 16rem; margin: 0; }}
  img {{ width: 100%; display: block; }}
  table {{ border-collapse: collapse; margin: 1.5rem 0; }}
  th {{ text-align: left; font-weight: normal; padding-right: 2rem; }}
  td {{ text-align: right; font-variant-numeric: tabular-nums; }}
</style>
<h1>{title}</h1>
<div class="pictures">{figures}</div>
<table>{cells}</table>
<p>{note}</p>
</html>
"""
