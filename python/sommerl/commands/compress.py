"""The command `compress`: materials into .smrl files, by the preset paper or compact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..compression.compact.search import CompactOptions, CompactReport
from ..compression.material import SomManBrdf
from ..compression.paper import measured
from ..compression.paper.options import TrainOptions
from ..compression.paper.train import TrainReport
from ..compression.smrl import file as smrl
from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.info import Counts
from ..reflectance.reciprocal import reciprocal as averaged
from ..reflectance.table import BrdfTable
from ..render.compress import compress as compressed
from ..render.judge import Judge
from ..system.errors import OptionError, SommerlError
from . import answers, console
from .arguments import Material, ReadingArguments, option, positional
from .checks import check_output
from .folders import make_folder
from .inputs import expanded, is_several, readable, stem
from .laboratory import ReportArguments, check_samples, reported, warn_of_samples
from .method_arguments import MethodArguments, chosen_method
from .outcome import PartlyDone
from .parser import add_command
from .rows import changed_rows, fact_rows, judged_rows, origin_rows, table_rows


@dataclass(frozen=True, kw_only=True)
class CompressArguments(ReportArguments, ReadingArguments, MethodArguments):
    """What `compress` is asked for."""

    inputs: tuple[Material, ...] = positional(
        "IN", help="a material: a file, a built-in name, a folder of materials, or a pattern in quotes"
    )
    output: Path = option(
        "-o", metavar="OUT", help="a .smrl file; or, for any number of inputs, a folder, which is made if there is none"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Compresses materials into .smrl files: to a size or a quality, or by the paper's method (SOM-MAN)."
    example = """sommerl compress measured.bsdf -o measured.smrl --target-size 2.7kB
  sommerl compress nickel.binary -o nickel.smrl --clusters 1000
  sommerl compress measured/ -o compressed/ --preset compact --target-psnr 50"""
    add_command(add, "compress", compress, CompressArguments, summary, example)


def compress(options: CompressArguments) -> dict[str, Any]:
    """Compresses each material. Raises PartlyDone if some of several fail."""
    method = chosen_method(options)
    sources = expanded(options.inputs)
    several = len(sources) > 1 or any(is_several(source) for source in options.inputs)
    outputs = _outputs(sources, options.output, several=several)
    if len(sources) > 1:
        kept = readable(sources, options.inputs)
        outputs = [output for source, output in zip(sources, outputs, strict=True) if source in kept]
        sources = kept
    if options.residuals is not None and len(sources) > 1:
        raise OptionError(f"--residuals: expected one material, found {len(sources)}")
    results: list[dict[str, Any]] = []
    failed = 0
    for source, output in zip(sources, outputs, strict=True):
        try:
            results.append(_compressed(source, output, method, options))
        except SommerlError as error:  # a target out of one material's reach is no reason to leave out the others
            if len(sources) == 1:
                raise
            failed += 1
            results.append({"input": source, "error": str(error)})
            console.tell(f"error: {error}")
    answer = answers.of_materials(results)
    if failed:
        raise PartlyDone(f"IN: expected to compress {len(sources)} materials, found {failed} that failed", answer)
    return answer


def _compressed(
    source: str, output: Path, method: CompactOptions | TrainOptions, options: CompressArguments
) -> dict[str, Any]:
    brdf = load(source)
    check_samples(options, brdf, source, output)
    warn_of_samples(brdf, source)

    def made(other: Brdf) -> Brdf:
        if isinstance(method, CompactOptions):
            return compressed(other, **asdict(method), reciprocal=options.reciprocal)[0]
        return measured.train(BrdfTable.of(other), method)[0]

    if isinstance(method, CompactOptions):
        result = compact_one(source, brdf, output, method, options.json, reciprocal=options.reciprocal)
    else:
        result = compress_one(source, brdf, output, method, options.json)
    return result | reported(source, brdf, output, made, options)


def _outputs(sources: Sequence[str], output: Path, *, several: bool) -> list[Path]:
    """The file for each material: in a folder if there are `several`, or if the output is one or has no extension."""
    if output.suffix.lower() == ".smrl" and not output.is_dir():
        if len(sources) > 1:
            raise OptionError(f"{output}: expected a folder for {len(sources)} inputs, found the name of a file")
        outputs = [output]
    elif several or output.is_dir() or not output.suffix:
        make_folder(output)
        outputs = [output / f"{stem(source)}.smrl" for source in sources]
    else:
        outputs = [output]
    for source, path in zip(sources, outputs, strict=True):
        check_output(path, (".smrl",), source)
        if outputs.count(path) > 1:
            raise OptionError(f"IN: expected different names, found two that would be written to one file, {path}")
    return outputs


def compress_one(source: str, brdf: Brdf, output: Path, options: TrainOptions, quiet: bool) -> dict[str, Any]:
    """Compresses a material as a table by the preset paper into a file, and shows what came of it unless `quiet`.

    source: where the material is from, as it was given.
    """
    material, report = trained(BrdfTable.of(brdf), options)
    written = smrl.save(material, output)
    metrics = Judge(brdf).metrics(material)
    result = answers.described(source, material, written) | asdict(report) | metrics
    if not quiet:
        console.print_rows(
            f"{material.name} → {output}", judged_rows(metrics) | compression_rows(material, written, report)
        )
    return result | {"epochs": options.epochs, "output": str(output)}


def compact_one(
    source: str, brdf: Brdf, output: Path, options: CompactOptions, quiet: bool, *, reciprocal: bool = False
) -> dict[str, Any]:
    """The same by the preset compact. reciprocal: see `render.compress`."""
    material, report = fitted(brdf, options, reciprocal=reciprocal)
    written = smrl.save(material, output)
    result = answers.described(source, material, written)
    result |= {"options": asdict(options), **report.metrics, "psnr_object_db": report.metrics["psnr_soft_db"]}
    counts = averaged(brdf).counts if reciprocal else brdf.counts
    result |= {"seconds": report.seconds, "output": str(output), **asdict(counts)}
    result |= dict.fromkeys(("epochs", "quantisation_error", "units_dropped"))
    if not quiet:
        console.print_rows(f"{material.name} → {output}", compact_rows(material, written, report, counts))
    return result


def fitted(brdf: Brdf, options: CompactOptions, *, reciprocal: bool = False) -> tuple[SomManBrdf, CompactReport]:
    """Compresses by the preset compact under a progress bar. reciprocal: see `render.compress`."""
    with console.progress(f"compressing {brdf.name}") as advance:
        return compressed(brdf, **asdict(options), reciprocal=reciprocal, progress=advance)


def trained(table: BrdfTable, options: TrainOptions) -> tuple[SomManBrdf, TrainReport]:
    """Trains under a progress bar, and measures the result."""
    with console.progress(f"training {table.name}") as advance:
        return measured.train(table, options, progress=advance)


def compression_rows(material: SomManBrdf, bytes_disk: int, report: TrainReport) -> dict[str, str]:
    """The figures of a material of the preset paper, for people."""
    dropped = f" ({report.units_dropped} units dropped)" if report.units_dropped else ""
    rows = {
        "clusters": f"{material.clusters}{dropped}",
        "epochs": str(len(report.quantisation_error)),
        "quantisation error, last epoch, of the largest value": f"{report.quantisation_error[-1]:.3g}",
        **table_rows(material.metrics),
        "size as the paper counts it": console.size(material.bytes_paper),
        "size in memory": console.size(material.bytes_memory),
        "size on disk": console.size(bytes_disk),
    }
    return rows | origin_rows(material) | fact_rows(material.facts) | {"training": f"{report.seconds:.1f} s"}


def compact_rows(material: SomManBrdf, bytes_disk: int, report: CompactReport, counts: Counts) -> dict[str, str]:
    """The figures of a material of the preset compact, for people. counts: of the source."""
    rows = {
        "nodes": str(material.lattice.size),
        "palette": f"{material.clusters - len(material.lut)} gains, {len(material.lut)} shapes",
        **judged_rows(report.metrics),
        "size in memory": console.size(material.bytes_memory),
        "size on disk": console.size(bytes_disk),
    }
    return rows | changed_rows(counts) | origin_rows(material) | {"time": f"{report.seconds:.1f} s"}
