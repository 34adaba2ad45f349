"""The command `compare`: two materials on a sphere, and how far they are apart."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.distance import table_metrics
from ..reflectance.lattice import Interpolation
from ..reflectance.table import BrdfTable
from ..render.compare import compare_on_sphere
from ..render.images import side_by_side, write_image
from ..render.judge import Judge
from . import answers, console
from .arguments import Material, option, positional
from .checks import check_output
from .inputs import labels
from .parser import add_command
from .rendering import RenderingArguments, Sampling, check_environment, environment_of
from .rows import image_rows, judged_rows, table_rows


@dataclass(frozen=True, kw_only=True)
class CompareArguments(RenderingArguments):
    """What `compare` is asked for."""

    reference: Material = positional("A", help="the reference: a file or a built-in name")
    candidate: Material = positional("B", help="what is held against it: a file or a built-in name")
    output: Path | None = option(
        "-o", default=None, metavar="FILE", help="a .png with A, B and their difference (×8) side by side"
    )
    lookup: Interpolation | None = option(
        default=None,
        help="how both are looked up; if not given: a compressed material as it is, a table as the compressed one on "
        "its lattice, so that the figures measure the compression alone, else trilinear",
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = (
        "Renders a reference and another material on a sphere, and says how far apart they are, there and in cells."
    )
    example = "sommerl compare nickel.binary nickel.smrl -o both.png"
    add_command(add, "compare", compare, CompareArguments, summary, example)


def compare(options: CompareArguments) -> dict[str, Any]:
    if options.output:
        check_output(options.output, (".png",), options.reference, options.candidate, options.envmap)
    sources = options.reference, options.candidate
    brdfs = looked_up_alike(load(sources[0]), load(sources[1]), options.lookup)
    sampling = Sampling.of(options)
    check_environment(options.envmap)
    environment = environment_of(options.envmap)
    with console.progress("rendering") as advance:
        comparison = compare_on_sphere(brdfs[0], [brdfs[1]], environment, **asdict(sampling), progress=advance)[0]
    if options.output:
        write_image(options.output, side_by_side(comparison.pictures()))
    distances, distance_rows = distances_of(*brdfs)
    reference, candidate = (
        f"{label} ({brdf.lookup})"
        for label, brdf in zip(labels(sources, [brdf.name for brdf in brdfs]), brdfs, strict=True)
    )
    result: dict[str, Any] = comparison.metrics | distances | {"reference": reference, "candidate": candidate}
    if options.output:
        result["image"] = str(options.output)
    if not options.json:
        lookups = dict.fromkeys((brdfs[1].lookup, brdfs[0].lookup))
        rows = {"lookup": " against ".join(lookups)} | image_rows(comparison.metrics) | distance_rows
        console.print_rows(f"{options.candidate} against {options.reference}", rows)
        if options.output:
            console.wrote([options.output])
    materials = [
        {"input": source, "name": brdf.name, "lookup": brdf.lookup} for source, brdf in zip(sources, brdfs, strict=True)
    ]
    return answers.of_materials(materials, **result)


def looked_up_alike(reference: Brdf, candidate: Brdf, asked: Interpolation | None) -> tuple[Brdf, Brdf]:
    """Two materials with one lookup, so that a comparison measures what they hold and not how they are looked up.

    asked: the lookup for both. If None, a table is looked up as the compressed material that it is compared with, if
    both have one lattice; everything else as it is. Raises MaterialError for a formula that is asked to be looked up.
    """

    def adapted(brdf: Brdf, other: Brdf) -> Brdf:
        if asked:
            return brdf.with_interpolation(asked)
        on_same_cells = brdf.grid is not None and brdf.grid == other.grid
        return brdf.with_interpolation(other.lookup) if other.compressed and on_same_cells else brdf

    return adapted(reference, candidate), adapted(candidate, reference)


def distances_of(reference: Brdf, candidate: Brdf) -> tuple[dict[str, float], dict[str, str]]:
    """How far two are apart without a picture, for JSON and for people: as a `Judge` sees it, and at cell centres."""
    with console.progress("judging"):
        judged = Judge(reference).metrics(candidate)
    tables = _table_distance(reference, candidate)
    found = judged | {f"table_{name}": value for name, value in tables.items()}
    return found, judged_rows(judged) | table_rows(tables)


def _table_distance(reference: Brdf, candidate: Brdf) -> dict[str, float]:
    """How far two are apart at the cell centres of one lattice: the reference's, the candidate's or MERL's."""
    lattices = [brdf.grid for brdf in (reference, candidate) if brdf.grid]
    first, second = (BrdfTable.sampled(brdf, *lattices[:1]) for brdf in (reference, candidate))
    return table_metrics(first.values, second.values, first.lattice)
