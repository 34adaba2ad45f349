"""The command `convert`: a material in any known format to one that somebody else reads."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..formats import registry, rgl, rgl_export, smrl
from ..formats.format import Format
from ..formats.load import load
from ..formats.scattered import ScatteredTable
from ..models.builtin import NAMES, builtin_table
from ..plots import coverage
from ..reflectance.brdf import Brdf
from ..reflectance.info import Counts
from ..reflectance.table import BrdfTable
from ..system.errors import OptionError
from . import console
from .checks import check_output
from .compress import compress_one, trained
from .parser import command
from .rows import clamped_text, fact_rows

MOSTLY = 0.5


def convert(options: Namespace) -> dict[str, Any]:
    kind = _checked(options)
    brdf = load(options.input) if options.noise is None else builtin_table(options.input, noise=options.noise)
    output: Path = options.output
    report = {} if kind.names_source else _report(brdf, output)
    if kind is smrl.FORMAT and not isinstance(brdf, SomManBrdf):
        result = compress_one(BrdfTable.of(brdf), output, TrainOptions(), options.json)
    else:
        written = _write(brdf, kind, options)
        size = output.stat().st_size if output.is_file() else None  # of what went through a pipe
        counts = Counts() if kind.names_source else written.counts
        result = {"output": str(output), "bytes_disk": size, **asdict(counts)}
        if not options.json:
            told = f", cells clamped to 0: {clamped_text(counts)}" if counts.cells_clamped else ""
            written_as = "through a pipe" if size is None else console.size(size)
            console.say(f"{written.name} → {output} ({written_as}{told})")
    if not options.json:
        _print_report(report | {"facts": {}} if "epochs" in result else report)
    return result | report


def _checked(options: Namespace) -> Format:
    """The format to write. Raises OptionError for what cannot be asked for."""
    if options.noise is not None and (options.input not in NAMES or Path(options.input).exists()):
        raise OptionError(f"noise: expected a built-in material, found {options.input}")
    if options.noise is not None and options.noise < 0:
        raise OptionError(f"noise: expected a seed of at least 0, found {options.noise}")
    kind = registry.by_extension(registry.writable(), options.output)
    if options.spectral and kind is not rgl.FORMAT:
        raise OptionError(f"spectral: expected an output that ends in .bsdf, found {options.output}")
    if kind and kind.names_source and options.noise is not None:
        raise OptionError("noise: expected an output that holds the material, found a scene snippet")
    check_output(options.output, registry.extensions(registry.writable()), options.input)
    assert kind  # or the check has said which ones there are
    return kind


def _write(brdf: Brdf, kind: Format, options: Namespace) -> Brdf:
    """Writes a material; returns what the file holds, or names."""
    assert kind.write
    output: Path = options.output
    if kind.names_source:
        kind.write(options.input, output)
        return brdf
    if options.spectral:
        rgl_export.write(brdf, output, spectral=True)
        return brdf
    if kind.compressed and not isinstance(brdf, SomManBrdf):
        brdf = trained(BrdfTable.of(brdf), TrainOptions())[0]
    return kind.write(brdf, output)


def _report(brdf: Brdf, output: Path) -> dict[str, Any]:
    """What the data lacks; and, written before anything else, a picture of where samples were missing."""
    facts = brdf.facts
    result: dict[str, Any] = {"facts": facts} if facts else {}
    if isinstance(brdf, ScatteredTable):
        result["coverage"] = facts["coverage"]
        picture = output.with_name(f"{output.stem}.coverage.png")
        check_output(picture, (".png",))
        coverage(brdf, picture)
        result["coverage_image"] = str(picture)
    return result


def _print_report(report: dict[str, Any]) -> None:
    for name, value in fact_rows(report.get("facts", {})).items():
        console.say(f"  {name}: {value}")
    if report.get("coverage", 1) < MOSTLY:
        console.say("  warning: most of this material is extrapolated")
    if "coverage_image" in report:
        console.say(f"  where samples were missing: {report['coverage_image']}")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Converts a material into the format that the output's extension names."
    example = "sommerl convert samples.csv samples.binary\n  sommerl convert nickel.smrl nickel.h"
    parser = command(add, "convert", convert, summary, example)
    written = registry.writable()
    compressed = " ".join(registry.extensions(each for each in written if each.compressed))
    parser.epilog = (
        f"Formats of OUT, by its extension:\n{registry.listed(written)}\n"
        f"For {compressed}, IN is compressed with the defaults of `compress` if it is not yet.\n\n{parser.epilog}"
    )
    parser.add_argument("input", metavar="IN", help="a material: path or built-in name")
    parser.add_argument("output", type=Path, metavar="OUT", help="a name with one of the extensions below")
    parser.add_argument(
        "--spectral", action="store_true", help=".bsdf: spectra for pbrt-v4 and Mitsuba's spectral variants, not RGB"
    )
    parser.add_argument(
        "--noise", type=int, metavar="SEED", help="add the measurement error of MERL's data to a built-in material"
    )
