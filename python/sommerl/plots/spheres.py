"""Draws rendered spheres of a material and of its fits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..render.compare import Comparison
from ..system.optional import optional
from .page import save, text
from .style import plain_style

COLUMNS = 6  # of a sheet of spheres


def fits(name: str, models: Sequence[str], comparisons: Sequence[Comparison], path: Path) -> None:
    """Writes a PNG of spheres: the material, then each fit with its PSNR over the object, and below each fit the
    difference from the material, times 8.

    comparisons: from `compare_on_sphere`, one for each model. Raises MissingDependencyError without matplotlib.
    """
    figures = optional("matplotlib.figure", "matplotlib", "plots", "fit")
    with plain_style():
        cells = [(name, [comparisons[0].pictures()[0]])]
        for model, comparison in zip(models, comparisons, strict=True):
            cells.append((f"{model}: {comparison.metrics['psnr_object_db']:.1f} dB", comparison.pictures()[1:]))
        columns = min(COLUMNS, len(cells))
        lines = -(-len(cells) // columns)
        figure = figures.Figure(figsize=(2.2 * columns, 4.7 * lines), layout="constrained")
        axes = figure.subplots(2 * lines, columns, squeeze=False)
        for ax in axes.flat:
            ax.axis("off")
        for number, (title, pictures) in enumerate(cells):
            line, column = divmod(number, columns)
            axes[2 * line, column].set_title(text(title), fontsize=8, wrap=True)
            for below, pixels in enumerate(pictures):
                axes[2 * line + below, column].imshow(pixels)
        save(figure, path)
