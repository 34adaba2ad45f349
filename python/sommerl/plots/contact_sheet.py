"""Arranges pictures of one size in rows, with captions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system.optional import optional
from ..system.visible import visible
from .style import plain_style


def tiled(pictures: Sequence[NDArray[Any]], columns: int) -> NDArray[Any]:
    """One picture of several of the same size in rows; black where the last row is not full."""
    rows = -(-len(pictures) // columns)
    height, width, *rest = pictures[0].shape
    sheet = np.zeros((rows, height, columns, width, *rest), pictures[0].dtype)
    for number, picture in enumerate(pictures):
        sheet[number // columns, :, number % columns] = picture
    return sheet.reshape(rows * height, columns * width, *rest)


def captioned(
    pictures: Sequence[tuple[str, NDArray[np.uint8]]], columns: int, notes: Sequence[str] = ()
) -> NDArray[np.uint8]:
    """One picture, on white, of several of the same size in rows, not resampled.

    pictures: captions, which are set below the pictures, and 8-bit pixels (height, width, 3). notes: text below all.
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
    return np.minimum(_lettered(sheet.shape[:2], words, text), sheet)  # text is darker than its background


def _lines(notes: Sequence[str], most: int) -> list[str]:
    """Notes, several in a line of at most `most` characters. A longer note has a line of its own."""
    lines: list[str] = []
    for note in notes:
        together = f"{lines[-1]}    {note}" if lines else note
        if lines and len(together) <= most:
            lines[-1] = together
        else:
            lines.append(note)
    return lines


def _lettered(shape: tuple[int, ...], words: Sequence[tuple[float, float, str, int]], height: int) -> NDArray[np.uint8]:
    """Texts on white. words: for each the x and y of its middle [pixels], the text, and its greatest width [pixels]."""
    figures = optional("matplotlib.figure", "matplotlib", "labels", "render")
    agg = optional("matplotlib.backends.backend_agg", "matplotlib", "labels", "render")
    size = 0.72 * height  # of the font
    with plain_style():
        figure = figures.Figure(figsize=((shape[1] + 0.5) / 100, (shape[0] + 0.5) / 100), dpi=100)
        canvas = agg.FigureCanvasAgg(figure)
        for x, y, word, room in words:
            # Formulas are off, so that a dollar sign or an underscore in a name is shown as it is.
            place = x / shape[1], 1 - y / shape[0]
            drawn = figure.text(*place, word, fontsize=size, ha="center", va="center", parse_math=False)
            taken = drawn.get_window_extent(canvas.get_renderer()).width
            if taken > room - 2:
                drawn.set_fontsize(size * (room - 2) / taken)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[: shape[0], : shape[1], :3]


def shortened(text: str, most: int) -> str:
    """A text of at most `most` characters; of a longer one, the middle is replaced by "…"."""
    if len(text) <= most:
        return text
    keep = max(most - 1, 2)
    return f"{text[: -(-keep // 2)]}…{text[len(text) - keep // 2 :]}"
