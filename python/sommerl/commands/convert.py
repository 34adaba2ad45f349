"""The command `convert`: a material in any known format to one that somebody else reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from shlex import join
from tempfile import TemporaryDirectory
from typing import Any

from ..compression.compact.search import CompactOptions
from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..formats import registry, rgl, rgl_export, smrl, source_code, texture
from ..formats.format import Format
from ..formats.load import load
from ..formats.names import split_member
from ..formats.scattered import ScatteredBrdf
from ..models.builtin import NAMES, builtin_table
from ..plots import coverage
from ..reflectance.brdf import Brdf
from ..reflectance.info import Counts
from ..reflectance.reciprocal import reciprocal
from ..reflectance.table import BrdfTable
from ..render.judge import Judge
from ..system.errors import OptionError
from . import answers, console
from .arguments import (
    Material,
    ReadingArguments,
    WritingArguments,
    byte_count,
    flag,
    named_as_typed,
    option,
    positional,
)
from .checks import check_apart, check_output
from .compress import compact_one, compress_one, fitted, trained
from .inputs import expanded, is_several, load_written, read_all
from .laboratory import ReportArguments, check_samples, reported, warn_of_samples
from .parser import add_command
from .rows import changed_rows, fact_rows, judged_rows

# The options that what is written depends on.
OF_CONTENT = (
    "columns",
    "max_dropped",
    "values",
    "phi_from",
    "prior",
    "target_size",
    "reciprocal",
    "noise",
    "no_sampler",
)


@dataclass(frozen=True, kw_only=True)
class ConvertArguments(ReportArguments, ReadingArguments, WritingArguments):
    """What `convert` is asked for."""

    inputs: tuple[Material, ...] = positional(
        "IN",
        help="the material to convert: a file or a built-in name; for source code, compact ones, folders and patterns, "
        "too, whose materials become one text",
    )
    output: Path = positional("OUT", help="a name with one of the extensions below")
    target_size: int | None = option(
        default=None,
        metavar="BYTES",
        read=byte_count,
        help="compress by the preset compact, into at most that size as .smrl, like 8kB; for an OUT that is compressed",
    )
    reciprocal: bool = option(
        default=False, help="the mean of both orders of the directions, as tables hold it in any case"
    )
    spectral: bool = option(default=False, help=".bsdf: spectra for pbrt-v4 and Mitsuba's spectral variants, not RGB")
    no_sampler: bool = option(
        default=False, help="source code: leave out sample and pdf, and their table of 7,680 bytes"
    )
    noise: int | None = option(
        default=None, metavar="SEED", help="add the measurement error of MERL's data to a built-in material"
    )

    @property
    def input(self) -> Material:
        """The only material."""
        return self.inputs[0]


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Converts a material into the format that the output's extension names."
    example = """sommerl convert samples.csv samples.binary
  sommerl convert measured.bsdf measured.smrl --target-size 8kB
  sommerl convert nickel.smrl nickel.h
  sommerl convert nickel.smrl chrome.smrl FOLDER materials.glsl"""
    add_command(add, "convert", convert, ConvertArguments, summary, example, explained=[_formats()])


def convert(options: ConvertArguments) -> dict[str, Any]:
    kind = checked(options)
    if len(options.inputs) > 1 or is_several(options.input):
        return _convert_several(options, kind)
    brdf = load(options.input) if options.noise is None else builtin_table(options.input, noise=options.noise)
    return converted(brdf, kind, options)


def converted(brdf: Brdf, kind: Format, options: ConvertArguments, command: str = "") -> dict[str, Any]:
    """Writes a material in a format, and says what came of it; `input` is how it is called.

    command: what was typed (`typed`), for the head of source code; `convert` itself if it is empty.
    """
    output: Path = options.output
    kept = reciprocal(brdf) if options.reciprocal else brdf
    report = {} if kind.names_source else _report(brdf, output)
    check_samples(options, brdf, options.input, output)
    warn_of_samples(brdf, options.input)
    if kind is smrl.FORMAT and options.target_size is not None:
        result = compact_one(
            options.input, brdf, output, _compact(options), options.json, reciprocal=options.reciprocal
        )
    elif kind is smrl.FORMAT and not isinstance(brdf, SomManBrdf):
        result = compress_one(options.input, kept, output, TrainOptions(), options.json)
    else:
        written = _write(kept, kind, options, command or _command(options))
        size = output.stat().st_size if output.is_file() else None  # of what went through a pipe
        counts = Counts() if kind.names_source else written.counts
        result = {"input": options.input, "name": written.name, "output": str(output), "bytes_disk": size}
        result |= asdict(counts)
        metrics = Judge(brdf).metrics(written) if kind is texture.FORMAT else {}
        result |= {"metrics": metrics} if metrics else {}
        if not options.json:
            written_as = "through a pipe" if size is None else console.size(size)
            console.say(f"{written.name} → {output} ({written_as})")
            for name, value in changed_rows(counts).items():
                console.say(f"  {name}: {value}")
            for name, value in judged_rows(metrics).items() if metrics else ():
                console.say(f"  {name}: {value}")
    if not options.json:
        _print_report(report | {"facts": {}} if "epochs" in result else report)
    if kind.read and not kind.names_source:
        report |= reported(options.input, brdf, output, lambda other: _again(other, kind, options), options)
    if isinstance(brdf, ScatteredBrdf) and "coverage_image" in report:
        coverage(brdf, Path(report["coverage_image"]), load_written(output) if kind.read and output.is_file() else brdf)
    return answers.of_materials([result | report])


def _again(brdf: Brdf, kind: Format, options: ConvertArguments) -> Brdf:
    """What a file in the format would hold of a material."""
    kept = reciprocal(brdf) if options.reciprocal else brdf
    if kind.compressed:
        return _compressed(kept, options)
    with TemporaryDirectory() as folder:
        path = Path(folder) / options.output.name
        return load_written(path) if _write(kept, kind, replace(options, output=path)) else brdf


def _convert_several(options: ConvertArguments, kind: Format) -> dict[str, Any]:
    """Converts any number of materials into one file."""
    write, output = kind.write_several, options.output
    if not write:
        able = ", ".join(registry.extensions(each for each in registry.writable() if each.write_several))
        raise OptionError(f"{output}: expected a name that ends in one of {able} for several materials, found another")
    sources = expanded(options.inputs)

    def read(source: str) -> tuple[str, Brdf]:
        brdf = load(source)
        kept = reciprocal(brdf) if options.reciprocal else brdf
        return source, kept if options.target_size is None else _compressed(kept, options)

    check_apart(output, *sources)
    found = read_all(sources, options.inputs, read)
    materials = [brdf for _, brdf in found]
    if kind is source_code.FORMAT:
        source_code.write_several(materials, output, sampler=not options.no_sampler, command=_command(options))
    else:
        write(materials, output)
    size = output.stat().st_size if output.is_file() else None
    if not options.json:
        written_as = "through a pipe" if size is None else console.size(size)
        console.say(f"{len(found)} materials → {output} ({written_as})")
    rows = [{"input": source, "name": brdf.name} for source, brdf in found]
    return answers.of_materials(rows, output=str(output), bytes_disk=size)


def _compact(options: ConvertArguments) -> CompactOptions:
    with named_as_typed():
        return CompactOptions(target_size=options.target_size)


def checked(options: ConvertArguments) -> Format:
    """The format to write. Raises OptionError for what cannot be asked for."""
    if options.noise is not None and len(options.inputs) > 1:
        raise OptionError(f"--noise: expected one built-in material, found {len(options.inputs)} inputs")
    if options.noise is not None and (options.input not in NAMES or Path(options.input).exists()):
        raise OptionError(f"--noise: expected a built-in material, found {options.input}")
    if options.noise is not None and options.noise < 0:
        raise OptionError(f"--noise: expected a seed of at least 0, found {options.noise}")
    kind = registry.by_extension(registry.writable(), options.output)
    if options.spectral and kind is not rgl.FORMAT:
        raise OptionError(f"--spectral: expected an output that ends in .bsdf, found {options.output}")
    if options.no_sampler and kind is not source_code.FORMAT:
        raise OptionError(f"--no-sampler: expected an output of source code, found {options.output}")
    if kind and kind.names_source and options.noise is not None:
        raise OptionError("--noise: expected an output that holds the material, found a scene snippet")
    if options.reciprocal and kind and kind.names_source:
        raise OptionError("--reciprocal: expected an output that holds the material, found a scene snippet")
    if options.residuals is not None and (len(options.inputs) > 1 or is_several(options.input)):
        raise OptionError("--residuals: expected one material, found several")
    if options.residuals is not None and kind and (kind.names_source or not kind.read):
        raise OptionError(f"--residuals: expected an output that can be read again, found {options.output}")
    if options.target_size is not None:
        _compact(options)
        if not (kind and kind.compressed):
            raise OptionError(f"--target-size: expected an output that is compressed, found {options.output}")
    check_output(options.output, registry.extensions(registry.writable()), *options.inputs)
    for path in kind.beside(options.output) if kind and kind.beside else ():
        check_output(path, (path.suffix,), *options.inputs)
    assert kind  # or the check has said which ones there are
    return kind


def _write(brdf: Brdf, kind: Format, options: ConvertArguments, command: str = "") -> Brdf:
    """Writes a material; returns what the file holds, or names. command: for the head of source code."""
    assert kind.write
    if kind.names_source:
        kind.write(options.input, options.output)
        return brdf
    if options.spectral:
        rgl_export.write(brdf, options.output, spectral=True)
        return brdf
    if kind is source_code.FORMAT:
        compressed, sampler = _compressed(brdf, options), not options.no_sampler
        return source_code.write(compressed, options.output, sampler=sampler, command=command)
    return kind.write(_compressed(brdf, options) if kind.compressed else brdf, options.output)


def _command(options: ConvertArguments) -> str:
    return typed(["convert", *options.inputs, str(options.output)], options)


def typed(words: Sequence[str], options: ConvertArguments) -> str:
    """The command that was typed, with names of files in place of paths, which are nobody's business elsewhere.

    words: those after `sommerl`. To them, the options that what is written depends on are added.
    """
    words = ["sommerl", *map(_without_folder, words)]
    for each in fields(options):
        value = getattr(options, each.name)
        if each.name in OF_CONTENT and value != each.default:
            text = ",".join(options.columns or ()) if each.name == "columns" else str(value)
            words += [flag(each.name)] if value is True else [flag(each.name), text]
    return join(words)


def _without_folder(word: str) -> str:
    """A word that may name a file, or a material in one, whose own name may have slashes."""
    path, member = split_member(word)
    return f"{path.name}:{member}" if member else path.name or word


def _compressed(brdf: Brdf, options: ConvertArguments) -> SomManBrdf:
    """The material compressed: to the size that is asked for; else as it is, or with the defaults of `compress`."""
    if options.target_size is not None:
        material, report = fitted(brdf, _compact(options))
        material.metrics.update(report.metrics)  # for the head of source code
        return material
    return brdf if isinstance(brdf, SomManBrdf) else trained(BrdfTable.of(brdf), TrainOptions())[0]


def _report(brdf: Brdf, output: Path) -> dict[str, Any]:
    """What the reader reports of the data; of samples, it is checked that a picture of them can be written, too."""
    facts = brdf.facts
    result: dict[str, Any] = {"facts": facts} if facts else {}
    if isinstance(brdf, ScatteredBrdf):
        result["coverage"] = facts["coverage"]
        picture = output.with_name(f"{output.stem}.coverage.png")
        check_output(picture, (".png",))
        result["coverage_image"] = str(picture)
    return result


def _print_report(report: dict[str, Any]) -> None:
    for name, value in fact_rows(report.get("facts", {})).items():
        console.say(f"  {name}: {value}")
    if "coverage_image" in report:
        console.say(f"  samples, and what was written: {report['coverage_image']}")


def _formats() -> str:
    """What can be written, for help."""
    written = registry.writable()
    compressed = " ".join(registry.extensions(each for each in written if each.compressed))
    return (
        f"Formats of OUT, by its extension:\n{registry.listed(written)}\n"
        f"For {compressed}, IN is compressed with the defaults of `compress` if it is not yet."
    )
