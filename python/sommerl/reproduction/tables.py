"""Table 1, Fig. 5 and Fig. 6: analytic models against measured data and against the paper's representation.

Each function returns rows, one for each number that the paper prints, with that number beside ours; where the paper has
a picture, it writes one. The loss is that of Ngan, Durand & Matusik 2005, which the paper says it uses; docs/method.md
discusses the evidence for that. Models are fitted to tables with trilinear lookup, since they cannot follow the steps
between cells. Rendered tables have nearest lookup, as in the paper. Compare the paper's PSNRs with ours over the frame.
The paper's representation is learnt twice: by our default rule, and by Eq. 2 as printed (`data.RULES`).
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
from .data import RULES, compressed, described, expected, material

Progress = Callable[[int, int], None]  #: steps done, steps in all
SOM_MAN = "som-man"  # the paper's representation, as expected.toml has it


@dataclass(frozen=True)
class FitRow:
    """The error of a fit to the table, and of a fit to its compressed form (`_som_man`, and `_printed` where that is
    learnt by Eq. 2 as printed): ours and the paper's. Each is measured against what the model was fitted to."""

    material: str
    model: str
    error: float
    error_som_man: float
    error_printed: float
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
        table = _named(data, name)
        rows += [row for _, row in _fitted(table, _forms(table), values, options or FitOptions(), part)]
    return rows


def figure5(
    data: Path | None = None,
    picture: Path | None = None,
    options: FitOptions | None = None,
    *,
    progress: Progress | None = None,
) -> list[ImageRow]:
    """Fig. 5: spheres of blue-metallic-paint, compressed with M = 256, and of eight two-lobe fits to the table. The
    paper's one number for its representation stands beside both of ours."""
    printed = expected("fig5")
    table = _named(data, "blue-metallic-paint")
    models = [name for name in printed if name != SOM_MAN]
    shown: list[tuple[str, Brdf]] = [
        (f"{SOM_MAN}, {title}", compressed(table, 256, 50, **rule)) for title, rule in RULES.items()
    ]
    found = {fit.model: fit.brdf for fit in fit_models(table, models, options, progress=_part(progress, 0, 2))}
    shown += [(name, found[name]) for name in models]
    comparisons = _compared(data, table, shown, picture, _part(progress, 1, 2))
    return [
        ImageRow(title, each.metrics["psnr_frame_db"], each.metrics["psnr_object_db"], printed[title.split(",")[0]])
        for (title, _), each in zip(shown, comparisons, strict=True)
    ]


def figure6(
    data: Path | None = None,
    picture: Path | None = None,
    options: FitOptions | None = None,
    *,
    progress: Progress | None = None,
) -> list[FitRow]:
    """Fig. 6: three-lobe fits to green-metallic-paint, and to its compressed forms with M = 1000. The picture compares
    all of them with the table."""
    options = replace(options or FitOptions(), lobes=3)
    table = _named(data, "green-metallic-paint")
    forms = _forms(table)
    fitted = _fitted(table, forms, expected("fig6"), options, _part(progress, 0, 2))
    if picture:
        shown: list[tuple[str, Brdf]] = [(f"M = 1000, {title}", brdf) for title, brdf in forms.items()]
        for number, to in enumerate(("the table", *(title for title, _ in shown))):
            shown += [(f"{fits[number].model}, to {to}", fits[number].brdf) for fits, _ in fitted]
        _compared(data, table, shown, picture, _part(progress, 1, 2))
    return [row for _, row in fitted]


def _named(data: Path | None, name: str) -> BrdfTable:
    """A material, without "stand-in" in its name: captions say what it is."""
    table = material(data, name)
    table.name = name
    return table


def _forms(table: BrdfTable) -> dict[str, SomManBrdf]:
    """A table's compressed forms with M = 1000, by RULES."""
    return {title: compressed(table, 1000, **rule) for title, rule in RULES.items()}


def _fitted(
    table: BrdfTable,
    forms: dict[str, SomManBrdf],
    printed: dict[str, Sequence[float]],
    options: FitOptions,
    progress: Progress | None,
) -> list[tuple[tuple[Fit, ...], FitRow]]:
    """Fits the models that the paper has for a material to its table, and to its compressed forms."""
    sources = [table, *(form.with_interpolation("trilinear") for form in forms.values())]
    found = [
        fit_models(brdf, list(printed), options, progress=_part(progress, number, len(sources)))
        for number, brdf in enumerate(sources)
    ]
    return [
        (fits, FitRow(table.name, fits[0].model, *(fit.error for fit in fits), *printed[fits[0].model]))
        for fits in zip(*found, strict=True)
    ]


def _compared(
    data: Path | None,
    table: BrdfTable,
    shown: Sequence[tuple[str, Brdf]],
    picture: Path | None,
    progress: Progress | None,
) -> list[Comparison]:
    """Compares materials, given with titles, with the table on a sphere; writes a picture if a path is given."""
    reference, materials = table.with_interpolation("nearest"), [brdf for _, brdf in shown]
    comparisons = compare_on_sphere(reference, materials, default_environment(), progress=progress)
    if picture:
        plots.fits(f"{table.name}, of {described(data)}", [title for title, _ in shown], comparisons, picture)
    return comparisons


def _part(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """The progress function for one of several equal parts of the work."""
    if progress is None:
        return None
    return lambda done, total: progress(number * total + done, parts * total)
