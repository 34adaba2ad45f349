"""The command `compare`: two materials on a sphere, and how far they are apart."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.distance import table_metrics
from ..reflectance.lattice import INTERPOLATIONS
from ..reflectance.table import BrdfTable
from ..render.compare import compare_on_sphere
from ..render.images import side_by_side, write_image
from . import console
from .checks import check_output, check_rendering, environment_of
from .parser import command, rendering_options
from .rows import image_rows, label, table_rows


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Renders two materials on a sphere and says how far they are apart, there and cell by cell."
    example = "sommerl compare nickel.binary nickel.smrl -o both.png"
    parser = command(add, "compare", compare, summary, example)
    parser.add_argument("reference", metavar="A")
    parser.add_argument("candidate", metavar="B")
    parser.add_argument("-o", "--output", type=Path, help="a .png with A, B and their difference (×8) side by side")
    parser.add_argument(
        "--lookup",
        choices=INTERPOLATIONS,
        help="how both are looked up; if not given: a compressed material as it is, a table as the compressed one on "
        "its lattice, so that the figures measure the compression alone, else trilinear",
    )
    rendering_options(parser)


def compare(options: Namespace) -> dict[str, Any]:
    if options.output:
        check_output(options.output, (".png",), options.reference, options.candidate, options.envmap)
    reference, candidate = alike(load(options.reference), load(options.candidate), options.lookup)
    check_rendering(options)
    warnings = console.Warnings()
    environment = environment_of(options, warnings)
    with console.progress("rendering") as advance:
        comparison = compare_on_sphere(
            reference,
            [candidate],
            environment,
            size=options.size,
            spp=options.spp,
            seed=options.seed,
            progress=advance,
        )[0]
    if options.output:
        write_image(options.output, side_by_side(comparison.pictures()))
    metrics = table_distance(reference, candidate)
    result = comparison.metrics | {f"table_{name}": value for name, value in metrics.items()}
    result |= {"reference": label(reference), "candidate": label(candidate), "warnings": warnings.told}
    if options.output:
        result["image"] = str(options.output)
    if not options.json:
        lookups = dict.fromkeys((reference.lookup, candidate.lookup))
        rows = {"lookup": " against ".join(lookups)} | image_rows(comparison.metrics) | table_rows(metrics)
        console.print_rows(f"{options.reference} against {options.candidate}", rows)
    return result


def alike(reference: Brdf, candidate: Brdf, asked: Any) -> tuple[Brdf, Brdf]:
    """Both, looked up as asked; else a table as the SOM-MAN material on its lattice, so that like meets like."""

    def adapted(brdf: Brdf, other: Brdf) -> Brdf:
        if asked:
            return brdf.with_interpolation(asked)
        on_same_cells = brdf.grid is not None and brdf.grid == other.grid
        return brdf.with_interpolation(other.lookup) if other.compressed and on_same_cells else brdf

    return adapted(reference, candidate), adapted(candidate, reference)


def table_distance(reference: Brdf, candidate: Brdf) -> dict[str, float]:
    """How far two are apart at the cell centres of one lattice: the reference's, the candidate's or MERL's."""
    lattices = [brdf.grid for brdf in (reference, candidate) if brdf.grid]
    first, second = (BrdfTable.sampled(brdf, *lattices[:1]) for brdf in (reference, candidate))
    return table_metrics(first.values, second.values, first.lattice)
