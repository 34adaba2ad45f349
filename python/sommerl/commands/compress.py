"""The command `compress`: materials into .smrl files, by the preset paper or compact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal

from ..compression.compact.effort import DEFAULT as EFFORT
from ..compression.compact.search import DEFAULT_PSNR, LARGEST_SIZE, SMALLEST_SIZE, CompactOptions, CompactReport
from ..compression.material import SomManBrdf
from ..compression.paper.options import Order, Rule, Topology, TrainOptions
from ..compression.paper.train import TrainReport, train
from ..compression.smrl import file as smrl
from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.distance import table_metrics
from ..reflectance.info import Counts
from ..reflectance.reciprocal import reciprocal as averaged
from ..reflectance.table import BrdfTable
from ..render.compress import compress as compressed
from ..render.judge import Judge
from ..system.errors import OptionError, SommerlError
from . import answers, console
from .arguments import Material, WritingArguments, byte_count, flag, library_options, option, positional
from .checks import check_output
from .folders import make_folder
from .inputs import expanded, is_several, readable, stem
from .outcome import PartlyDone
from .parser import add_command
from .rows import changed_rows, fact_rows, judged_rows, origin_rows, table_rows

DEFAULTS = TrainOptions()
METRICS_DIGITS = 6  # so that the file does not hold the last bits of a machine's sums

Preset = Literal["paper", "compact"]


@dataclass(frozen=True, kw_only=True)
class CompressArguments(WritingArguments):
    """What `compress` is asked for."""

    inputs: tuple[Material, ...] = positional(
        "IN", help="a material: a file, a built-in name, a folder of materials, or a pattern in quotes"
    )
    output: Path = option(
        "-o", metavar="OUT", help="a .smrl file; or, for any number of inputs, a folder, which is made if there is none"
    )
    preset: Preset | None = option(
        default=None,
        help="paper: MERL's lattice, nearest lookup; compact: a lattice fitted to the material, interpolated, in a "
        "file of some kilobytes (paper; compact if there is a target)",
    )
    target_size: int | None = option(
        default=None,
        metavar="BYTES",
        read=byte_count,
        instead_of="target",
        help=f"compact: the best file of at most that size, {SMALLEST_SIZE} to {LARGEST_SIZE} bytes, also as 8kB",
    )
    target_psnr: float | None = option(
        default=None,
        metavar="DB",
        instead_of="target",
        help=f"compact: the smallest file of at least that PSNR on a sphere in soft light ({DEFAULT_PSNR:g})",
    )
    effort: int = option(
        default=EFFORT,
        metavar="N",
        help="compact: how much work goes into a file, from 1 (quick) to 9 (thorough) (%(default)s)",
    )
    reciprocal: bool = option(
        default=False, help="compact: the mean of both orders of the directions, which a file holds with fewer nodes"
    )
    clusters: int = option(
        default=DEFAULTS.clusters, metavar="M", help="paper: the number of entries in the palette (%(default)s)"
    )
    epochs: int = option(
        default=DEFAULTS.epochs, metavar="E", help="paper: how often the table is presented (%(default)s)"
    )
    seed: int = option(default=DEFAULTS.seed, metavar="S", help="of directions, first weights and order (%(default)s)")
    rule: Rule = option(
        default=DEFAULTS.rule,
        help="paper: Eq. 2 as printed (paper), or without its factor x (kohonen) (%(default)s)",
    )
    alpha: float = option(
        default=DEFAULTS.alpha, metavar="A", help="paper: first learning rate, above 0, at most 1 (%(default)s)"
    )
    order: Order = option(default=DEFAULTS.order, help="paper: of presentation (%(default)s)")
    radius: float = option(
        default=DEFAULTS.radius,
        metavar="R",
        help="paper: of the neighbourhood in the first epoch, in units; 0: the winner learns alone (%(default)s)",
    )
    topology: Topology = option(
        default=DEFAULTS.topology, help="paper: how the units are arranged for that (%(default)s)"
    )
    distinct: bool = option(
        default=DEFAULTS.distinct, help="paper: a unit stores a cell once at most, and not again in a later epoch"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Compresses materials by the paper's method (SOM-MAN) into .smrl files."
    example = """sommerl compress nickel.binary -o nickel.smrl --clusters 1000
  sommerl compress measured.bsdf -o measured.smrl --target-size 2.7kB
  sommerl compress measured/ -o compressed/ --preset compact --target-psnr 50"""
    add_command(add, "compress", compress, CompressArguments, summary, example)


def compress(options: CompressArguments) -> dict[str, Any]:
    """Compresses each material. Raises PartlyDone if some of several fail."""
    method = _method(options)
    sources = expanded(options.inputs)
    several = len(sources) > 1 or any(is_several(source) for source in options.inputs)
    outputs = _outputs(sources, options.output, several=several)
    if len(sources) > 1:
        kept = readable(sources, options.inputs)
        outputs = [output for source, output in zip(sources, outputs, strict=True) if source in kept]
        sources = kept
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
    if isinstance(method, CompactOptions):
        return compact_one(source, load(source), output, method, options.json, reciprocal=options.reciprocal)
    return compress_one(source, load(source), output, method, options.json)


def _method(options: CompressArguments) -> CompactOptions | TrainOptions:
    """The options of the preset that is asked for. Raises OptionError for those of the other one."""
    targets = options.target_size, options.target_psnr
    preset = options.preset or ("paper" if targets == (None, None) else "compact")
    if preset == "compact":
        for each in fields(TrainOptions):
            if each.name != "seed" and getattr(options, each.name) != getattr(DEFAULTS, each.name):
                raise OptionError(f"{flag(each.name)}: expected --preset paper, found compact")
        return library_options(CompactOptions, options)
    for name in ("target_size", "target_psnr", "effort", "reciprocal"):
        if getattr(options, name) not in (None, False, EFFORT):
            raise OptionError(f"{flag(name)}: expected --preset compact, found paper")
    return library_options(TrainOptions, options)


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
        material, report = train(table, options, progress=advance)
    metrics = table_metrics(table.values, material.values, table.lattice)
    measured = metrics | {"quantisation_error": report.quantisation_error[-1]}
    material.metrics = {name: _rounded(value) for name, value in measured.items()}
    facts = table.facts | {name: value for name, value in asdict(table.counts).items() if value}
    if facts:
        material.options["source_facts"] = {name: _rounded(value) for name, value in facts.items()}
    return material, report


def _rounded(value: Any) -> Any:
    return float(f"{value:.{METRICS_DIGITS}g}") if isinstance(value, float) else value


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
