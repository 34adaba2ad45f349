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
from ..optional import optional
from ..style import plain_style
from ..visible import visible
from .llvm import mitsuba

DIFFERENCE_GAIN = 8
GREY = (128, 128, 128)
BRIGHTER, DARKER = (205, 45, 35, 255, 225, 120), (40, 75, 200, 130, 235, 255)  # halfway, and at the end


def encode(pixels: NDArray[Any]) -> bytes:
    """8-bit sRGB pixels (height, width, 3) as PNG, linear float32 ones as OpenEXR."""
    mi = mitsuba()
    stream = mi.MemoryStream()
    kind = mi.Bitmap.FileFormat.PNG if pixels.dtype == np.uint8 else mi.Bitmap.FileFormat.OpenEXR
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels))
    bitmap.set_srgb_gamma(pixels.dtype == np.uint8)
    bitmap.metadata()["Software"] = "Sommerl"  # a mark: see `files`
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


def signed_difference(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """How much brighter b is than a, in the mean of the channels, eight times enlarged: grey where they agree, through
    red to yellow where b is brighter, through blue to cyan where it is darker."""
    change = (b.astype(np.float64) - a).mean(axis=-1)[..., None]
    size = np.minimum(DIFFERENCE_GAIN * np.abs(change) / 255, 1)
    steps = np.where(change > 0, BRIGHTER, DARKER)
    half = size < 0.5
    low, high = np.where(half, GREY, steps[..., :3]), np.where(half, steps[..., :3], steps[..., 3:])
    colour: NDArray[np.float64] = low + (2 * size - np.where(half, 0, 1)) * (high - low)
    return np.round(colour).astype(np.uint8)


def tiled(pictures: Sequence[NDArray[Any]], columns: int) -> NDArray[Any]:
    """Pictures of one size in rows, black where the last row ends early."""
    rows = -(-len(pictures) // columns)
    height, width, *rest = pictures[0].shape
    sheet = np.zeros((rows, height, columns, width, *rest), pictures[0].dtype)
    for number, picture in enumerate(pictures):
        sheet[number // columns, :, number % columns] = picture
    return sheet.reshape(rows * height, columns * width, *rest)


def captioned(
    pictures: Sequence[tuple[str, NDArray[np.uint8]]], columns: int, notes: Sequence[str] = ()
) -> NDArray[np.uint8]:
    """Pictures of one size in rows, pixel for pixel, on white, each with a caption below, and notes below all.

    Raises MissingDependencyError without matplotlib.
    """
    height, width = pictures[0][1].shape[:2]
    text = max(9, width // 22)  # the height of letters, in pixels
    band = 2 * text
    step = height + band
    rows = -(-len(pictures) // columns)
    wide = columns * width
    lines = _lines([visible(note) for note in notes], int(1.5 * wide / text))
    sheet = np.full((rows * step + band * len(lines), wide, 3), 255, np.uint8)
    words: list[tuple[float, float, str, int]] = []
    for number, (caption, picture) in enumerate(pictures):
        x, y = number % columns * width, number // columns * step
        sheet[y : y + height, x : x + width] = picture
        words.append(
            (x + width / 2, y + height + band / 2, shortened(visible(caption), int(1.5 * width / text)), width)
        )
    for number, line in enumerate(lines):
        words.append((wide / 2, rows * step + (number + 0.5) * band, line, wide))
    return np.minimum(_lettered(sheet.shape[:2], words, text), sheet)  # letters are darker than what they stand on


def _lines(notes: Sequence[str], most: int) -> list[str]:
    """Notes in lines of at most so many letters; one that is longer has its own."""
    lines: list[str] = []
    for note in notes:
        together = f"{lines[-1]}    {note}" if lines else note
        if lines and len(together) <= most:
            lines[-1] = together
        else:
            lines.append(note)
    return lines


def _lettered(shape: tuple[int, ...], words: Sequence[tuple[float, float, str, int]], height: int) -> NDArray[np.uint8]:
    """Words on white: where their middle is, what they are, and how many pixels they may take."""
    figures = optional("matplotlib.figure", "matplotlib", "labels", "render")
    agg = optional("matplotlib.backends.backend_agg", "matplotlib", "labels", "render")
    size = 0.72 * height  # of the font
    with plain_style():
        figure = figures.Figure(figsize=((shape[1] + 0.5) / 100, (shape[0] + 0.5) / 100), dpi=100)
        canvas = agg.FigureCanvasAgg(figure)
        for x, y, word, room in words:
            # No mathematics: a dollar or an underscore in a name is one.
            place = x / shape[1], 1 - y / shape[0]
            drawn = figure.text(*place, word, fontsize=size, ha="center", va="center", parse_math=False)
            taken = drawn.get_window_extent(canvas.get_renderer()).width
            if taken > room - 2:
                drawn.set_fontsize(size * (room - 2) / taken)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[: shape[0], : shape[1], :3]


def shortened(text: str, most: int) -> str:
    """A text of at most so many letters, its middle left out."""
    if len(text) <= most:
        return text
    keep = max(most - 1, 2)
    return f"{text[: -(-keep // 2)]}…{text[len(text) - keep // 2 :]}"


def side_by_side(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures of equal height in one."""
    return np.concatenate(pictures, axis=1)


def write_page(
    path: Path, title: str, pictures: Sequence[tuple[str, NDArray[np.uint8]]], rows: Mapping[str, str], note: str
) -> None:
    """One HTML file, complete in itself: captioned pictures side by side, a table of rows, and a note."""
    figures = "".join(
        f'<figure><img src="data:image/png;base64,{base64.b64encode(encode(pixels)).decode()}" '
        f'alt="{_html(caption)}"><figcaption>{_html(caption)}</figcaption></figure>'
        for caption, pixels in pictures
    )
    cells = "".join(f"<tr><th>{_html(key)}</th><td>{_html(value)}</td></tr>" for key, value in rows.items())
    page = PAGE.format(title=_html(title), figures=figures, cells=cells, note=_html(note))
    with atomic_write(path) as out:
        out.write(page.encode())


def _html(text: str) -> str:
    return html.escape(visible(text))


PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="generator" content="Sommerl">
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
