"""Table 1, Fig. 5 and Fig. 6: analytic models against measured data and against the paper's representation.

Each function returns rows, one for each number that the paper prints, with that number beside ours; where the paper has
a picture, it writes one. The loss is that of Ngan, Durand & Matusik 2005, which the paper says it uses; docs/method.md
discusses the evidence for that. Models are fitted to tables with trilinear lookup, since they cannot follow the steps
between cells. Rendered tables have nearest lookup, as in the paper. Compare the paper's PSNRs with ours over the frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from .. import plots
from ..compression.material import SomManBrdf
from ..fitting import Fit, FitOptions, fit_models
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..render.compare import Comparison, compare_on_sphere
from ..render.environment import default_environment
from .data import compressed, expected, material

Progress = Callable[[int, int], None]  #: steps done, steps in all


@dataclass(frozen=True)
class FitRow:
    """The error of a fit to the table, and of a fit to its compressed form (`_som_man`): ours and the paper's. Each is
    measured against what the model was fitted to."""

    material: str
    model: str
    error: float
    error_som_man: float
    paper: float
    paper_som_man: float


@dataclass(frozen=True)
class ImageRow:
    """The PSNR [dB] of a rendering against that of the table: ours over the frame and over the object, and the paper's,
    which is over "the image"."""

    model: str
    psnr_frame_db: float
    psnr_object_db: float
    paper_db: float


def table1(
    data: Path | None = None, options: FitOptions | None = None, *, progress: Progress | None = None
) -> list[FitRow]:
    """Table 1: two-lobe fits to four materials, and to their compressed forms with M = 1000."""
    rows: list[FitRow] = []
    printed = expected("table1")
    for number, (name, values) in enumerate(printed.items()):
        part = _part(progress, number, len(printed))
        fitted = _fitted(*_both(data, name), values, options or FitOptions(), part)
        rows += [row for _, _, row in fitted]
    return rows


def figure5(
    data: Path | None = None,
    picture: Path | None = None,
    options: FitOptions | None = None,
    *,
    progress: Progress | None = None,
) -> list[ImageRow]:
    """Fig. 5: spheres of blue-metallic-paint, compressed with M = 256, and of eight two-lobe fits to the table."""
    printed = expected("fig5")
    table = material(data, "blue-metallic-paint")
    models = [name for name in printed if name != "som-man"]
    candidates: dict[str, Brdf] = {"som-man": compressed(table, 256, 50)}
    candidates |= {
        found.model: found.brdf for found in fit_models(table, models, options, progress=_part(progress, 0, 2))
    }
    comparisons = _compared(table, [(name, candidates[name]) for name in printed], picture, _part(progress, 1, 2))
    return [
        ImageRow(name, found.metrics["psnr_frame_db"], found.metrics["psnr_object_db"], printed[name])
        for name, found in zip(printed, comparisons, strict=True)
    ]


def figure6(
    data: Path | None = None,
    picture: Path | None = None,
    options: FitOptions | None = None,
    *,
    progress: Progress | None = None,
) -> list[FitRow]:
    """Fig. 6: three-lobe fits to green-metallic-paint, and to its compressed form with M = 1000. The picture compares
    all of them with the table."""
    options = replace(options or FitOptions(), lobes=3)
    table, ours = _both(data, "green-metallic-paint")
    fitted = _fitted(table, ours, expected("fig6"), options, _part(progress, 0, 2))
    if picture:
        shown: list[tuple[str, Brdf]] = [(f"{to.model}, to the table", to.brdf) for to, _, _ in fitted]
        shown += [("M = 1000", ours)]
        shown += [(f"{to.model}, to M = 1000", to.brdf) for _, to, _ in fitted]
        _compared(table, shown, picture, _part(progress, 1, 2))
    return [row for _, _, row in fitted]


def _both(data: Path | None, name: str) -> tuple[BrdfTable, SomManBrdf]:
    """A material, without "stand-in" in its name, and its compressed form with M = 1000."""
    table = material(data, name)
    table.name = name
    return table, compressed(table, 1000)


def _fitted(
    table: BrdfTable,
    ours: SomManBrdf,
    printed: dict[str, Sequence[float]],
    options: FitOptions,
    progress: Progress | None,
) -> list[tuple[Fit, Fit, FitRow]]:
    """Fits the models that the paper has for a material to its table, and to its compressed form."""
    to_table, to_ours = (
        fit_models(brdf, list(printed), options, progress=_part(progress, number, 2))
        for number, brdf in enumerate((table, ours.with_interpolation("trilinear")))
    )
    return [
        (one, other, FitRow(table.name, one.model, one.error, other.error, *printed[one.model]))
        for one, other in zip(to_table, to_ours, strict=True)
    ]


def _compared(
    table: BrdfTable, shown: Sequence[tuple[str, Brdf]], picture: Path | None, progress: Progress | None
) -> list[Comparison]:
    """Compares materials, given with titles, with the table on a sphere; writes a picture if a path is given."""
    reference, materials = table.with_interpolation("nearest"), [brdf for _, brdf in shown]
    comparisons = compare_on_sphere(reference, materials, default_environment(), progress=progress)
    if picture:
        plots.fits(table.name, [title for title, _ in shown], comparisons, picture)
    return comparisons


def _part(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """The progress function for one of several equal parts of the work."""
    if progress is None:
        return None
    return lambda done, total: progress(number * total + done, parts * total)
