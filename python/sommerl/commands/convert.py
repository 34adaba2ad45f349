"""The command `convert`: a material in any known format to one that somebody else reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..compression.compact.search import CompactOptions
from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..compression.smrl import file as smrl
from ..formats import merl, rgl_export, scene
from ..formats.load import load
from ..formats.scattered import ScatteredTable
from ..formats.shader import source as shader
from ..models.builtin import NAMES, builtin_table
from ..plots import coverage
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..system.errors import OptionError
from . import answers, console
from .arguments import Material, WritingArguments, byte_count, named_as_typed, option, positional
from .checks import check_output
from .compress import compact_one, compress_one, fitted, trained
from .parser import add_command
from .rows import UNKNOWN, clamped, clamped_text, fact_rows

EXTENSIONS = {
    ".smrl": "Sommerl, compressed with the defaults of compress if need be",
    ".binary": "MERL",
    ".bsdf": "RGL, for the `measured` materials of Mitsuba and pbrt-v4",
    **dict.fromkeys(shader.LANGUAGES, "source code with an eval, compressed first if need be"),
    ".xml": "Mitsuba scene snippet that loads IN",
    ".json": "the same for load_dict",
}

SNIPPETS = (".xml", ".json")
COMPRESSED = (".smrl", *shader.LANGUAGES)
MOSTLY = 0.5


@dataclass(frozen=True, kw_only=True)
class ConvertArguments(WritingArguments):
    """What `convert` is asked for."""

    input: Material = positional("IN", help="the material to convert: a file or a built-in name")
    output: Path = positional("OUT", help="a name with one of the extensions below")
    target_size: int | None = option(
        default=None,
        metavar="BYTES",
        read=byte_count,
        help="compress by the preset compact, into at most that size as .smrl, like 8kB; for an OUT that is compressed",
    )
    spectral: bool = option(default=False, help=".bsdf: spectra for pbrt-v4 and Mitsuba's spectral variants, not RGB")
    noise: int | None = option(
        default=None, metavar="SEED", help="add the measurement error of MERL's data to a built-in material"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Converts a material into the format that the output's extension names."
    example = """sommerl convert samples.csv samples.binary
  sommerl convert measured.bsdf measured.smrl --target-size 8kB
  sommerl convert nickel.smrl nickel.h"""
    add_command(add, "convert", convert, ConvertArguments, summary, example, explained=[_listed(EXTENSIONS)])


def convert(options: ConvertArguments) -> dict[str, Any]:
    _check(options)
    brdf = load(options.input) if options.noise is None else builtin_table(options.input, noise=options.noise)
    output: Path = options.output
    extension = output.suffix.lower()
    report = {} if extension in SNIPPETS else _report(brdf, output)
    if report.get("coverage", 1) < MOSTLY:
        console.warn(f"{options.input}: most of this material is extrapolated")
    if extension == ".smrl" and options.target_size is not None:
        result = compact_one(options.input, brdf, output, _compact(options), options.json)
    elif extension == ".smrl" and not isinstance(brdf, SomManBrdf):
        result = compress_one(options.input, BrdfTable.of(brdf), output, TrainOptions(), options.json)
    else:
        written = _write(brdf, options, extension)
        size = output.stat().st_size if output.is_file() else None  # of what went through a pipe
        counted = UNKNOWN if extension in SNIPPETS else clamped(written)
        result = {"input": options.input, "name": written.name, "output": str(output), "bytes_disk": size, **counted}
        if not options.json:
            told = f", cells clamped to 0: {clamped_text(counted)}" if counted["cells_clamped"] else ""
            written_as = "through a pipe" if size is None else console.size(size)
            console.say(f"{written.name} → {output} ({written_as}{told})")
    if not options.json:
        _print_report(report | {"facts": {}} if "epochs" in result else report)
    return answers.of_materials([result | report])


def _compact(options: ConvertArguments) -> CompactOptions:
    with named_as_typed():
        return CompactOptions(target_size=options.target_size)


def _check(options: ConvertArguments) -> None:
    """Raises OptionError for what cannot be asked for."""
    if options.noise is not None and (options.input not in NAMES or Path(options.input).exists()):
        raise OptionError(f"--noise: expected a built-in material, found {options.input}")
    if options.noise is not None and options.noise < 0:
        raise OptionError(f"--noise: expected a seed of at least 0, found {options.noise}")
    extension = options.output.suffix.lower()
    if options.spectral and extension != ".bsdf":
        raise OptionError(f"--spectral: expected an output that ends in .bsdf, found {options.output}")
    if extension in SNIPPETS and options.noise is not None:
        raise OptionError("--noise: expected an output that holds the material, found a scene snippet")
    if options.target_size is not None:
        _compact(options)
        if extension not in COMPRESSED:
            raise OptionError(f"--target-size: expected an output that is compressed, found {options.output}")
    check_output(options.output, tuple(EXTENSIONS), options.input)


def _write(brdf: Brdf, options: ConvertArguments, extension: str) -> Brdf:
    """Writes a material; returns it as it was written: resampled, compressed, or as it was."""
    output: Path = options.output
    if isinstance(brdf, SomManBrdf) and extension == ".smrl":
        smrl.save(brdf, output)
        return brdf
    if extension == ".binary":
        table = merl.resampled(brdf)
        merl.write(table, output)
        return table
    if extension == ".bsdf":
        rgl_export.write(brdf, output, spectral=options.spectral)
        return brdf
    if extension in shader.LANGUAGES:
        material = _compressed(brdf, options)
        shader.write(material, output)
        return material
    scene.write(options.input, output)
    return brdf


def _compressed(brdf: Brdf, options: ConvertArguments) -> SomManBrdf:
    """The material compressed: to the size that is asked for; else as it is, or with the defaults of `compress`."""
    if options.target_size is not None:
        return fitted(brdf, _compact(options))[0]
    return brdf if isinstance(brdf, SomManBrdf) else trained(BrdfTable.of(brdf), TrainOptions())[0]


def _report(brdf: Brdf, output: Path) -> dict[str, Any]:
    """What the reader reports of the data; of samples, a picture of where none were measured is written, too."""
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
    if "coverage_image" in report:
        console.say(f"  where samples were missing: {report['coverage_image']}")


def _listed(extensions: Mapping[str, str]) -> str:
    """Extensions, and what is written for each; those with one meaning together."""
    meanings = {text: " ".join(key for key in extensions if extensions[key] == text) for text in extensions.values()}
    return "Extensions of OUT:\n" + "\n".join(f"  {keys:24}{text}" for text, keys in meanings.items())
