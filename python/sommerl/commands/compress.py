"""The command `compress`: materials into .smrl files, by the preset paper or compact."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, get_args

from ..compression.compact.search import DEFAULT_PSNR, LARGEST_SIZE, SMALLEST_SIZE, CompactOptions, CompactReport
from ..compression.material import SomManBrdf
from ..compression.paper.options import Order, Rule, Topology, TrainOptions
from ..compression.paper.train import TrainReport, train
from ..compression.smrl import file as smrl
from ..formats.load import load, load_table
from ..reflectance.brdf import Brdf
from ..reflectance.distance import table_metrics
from ..reflectance.info import Counts
from ..reflectance.metric import decibels
from ..reflectance.table import BrdfTable
from ..render.compress import compress as compressed
from ..system.errors import MaterialError, OptionError, SommerlError
from . import console
from .checks import check_output, stem
from .parser import command
from .rows import describe, fact_rows, origin_rows, table_rows

DEFAULTS = TrainOptions()


METRICS_DIGITS = 6  # so that the file does not hold the last bits of a machine's sums


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Compresses materials by the paper's method (SOM-MAN) into .smrl files."
    example = """sommerl compress nickel.binary -o nickel.smrl --clusters 1000
  sommerl compress measured.bsdf -o measured.smrl --preset compact --target-size 2700
  sommerl compress *.bsdf -o materials/ --preset compact --target-psnr 50"""
    parser = command(add, "compress", compress, summary, example)
    parser.add_argument("inputs", nargs="+", metavar="IN", help="a material: path or built-in name")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="a .smrl file; for several inputs, a folder that exists"
    )
    parser.add_argument(
        "--preset",
        choices=["paper", "compact"],
        help="paper: MERL's lattice, nearest lookup; compact: a lattice fitted to the material, interpolated, in a "
        "file of some kilobytes (paper; compact if there is a target)",
    )
    target = parser.add_mutually_exclusive_group()
    target.add_argument(
        "--target-size",
        type=int,
        metavar="BYTES",
        help=f"compact: the best file of at most that size ({SMALLEST_SIZE} to {LARGEST_SIZE})",
    )
    target.add_argument(
        "--target-psnr",
        type=float,
        metavar="DB",
        help=f"compact: the smallest file of at least that quality on a rendered sphere ({DEFAULT_PSNR:g})",
    )
    helps = {
        "clusters": "paper: M, the number of entries in the palette",
        "epochs": "paper: how often the table is presented",
        "seed": "of directions, first weights and order",
        "rule": "paper: Eq. 2 as printed (paper), or without its factor x (kohonen)",
        "alpha": "paper: first learning rate, above 0, at most 1",
        "order": "paper: of presentation",
        "radius": "paper: of the neighbourhood in the first epoch, in units; 0: the winner learns alone",
        "topology": "paper: how the units are arranged for that",
        "distinct": "paper: a unit stores a cell once at most, and not again in a later epoch",
    }
    allowed = {"rule": get_args(Rule), "order": get_args(Order), "topology": get_args(Topology)}
    for field in fields(TrainOptions):
        default = getattr(DEFAULTS, field.name)
        if isinstance(default, bool):
            parser.add_argument(f"--{field.name}", action="store_true", help=helps[field.name])
            continue
        parser.add_argument(
            f"--{field.name}",
            type=type(default),
            default=default,
            choices=allowed.get(field.name),
            metavar=None if field.name in allowed else field.name[0].upper(),
            help=f"{helps[field.name]} (%(default)s)",
        )


def compress(options: Namespace) -> dict[str, Any]:
    targets = options.target_size, options.target_psnr
    compact = (options.preset or ("paper" if targets == (None, None) else "compact")) == "compact"
    method = _compact_options(options) if compact else _train_options(options)
    outputs = _outputs(options.inputs, options.output)
    if len(options.inputs) > 1:
        for source in options.inputs:
            load(source)  # so that a bad one is found before hours are spent on the others
    results: list[dict[str, Any]] = []
    failed = 0
    for source, output in zip(options.inputs, outputs, strict=True):
        try:
            results.append(_compressed(source, output, method, options.json))
        except SommerlError as error:  # a target out of one material's reach is no reason to leave out the others
            if len(options.inputs) == 1:
                raise
            failed += 1
            console.tell(f"error: {error}")
    if failed:
        raise MaterialError(f"inputs: expected to compress {len(options.inputs)} materials, found {failed} that failed")
    return results[0] if len(results) == 1 else {"materials": results}


def _compressed(source: str, output: Path, method: CompactOptions | TrainOptions, quiet: bool) -> dict[str, Any]:
    if isinstance(method, CompactOptions):
        return compact_one(load(source), output, method, quiet)
    return compress_one(load_table(source), output, method, quiet)


def _compact_options(options: Namespace) -> CompactOptions:
    for name, default in asdict(TrainOptions()).items():
        if name != "seed" and getattr(options, name) != default:
            raise OptionError(f"{name}: expected --preset paper, found compact")
    return CompactOptions(options.target_size, options.target_psnr, options.seed)


def _train_options(options: Namespace) -> TrainOptions:
    for name in ("target_size", "target_psnr"):
        if getattr(options, name) is not None:
            raise OptionError(f"{name}: expected --preset compact, found paper")
    return TrainOptions(**{field.name: getattr(options, field.name) for field in fields(TrainOptions)})


def _outputs(inputs: list[str], output: Path) -> list[Path]:
    """Where each input goes."""
    if len(inputs) == 1 and not output.is_dir():
        outputs = [output]
    elif output.is_dir():
        outputs = [output / f"{stem(source)}.smrl" for source in inputs]
    else:
        raise OptionError(f"{output}: expected a folder that exists, for several inputs")
    if len(set(outputs)) < len(outputs):
        raise OptionError("inputs: expected different names, found two that would be written to one file")
    for source, path in zip(inputs, outputs, strict=True):
        check_output(path, (".smrl",), source)
    return outputs


def compress_one(table: BrdfTable, output: Path, options: TrainOptions, quiet: bool) -> dict[str, Any]:
    material, report = trained(table, options)
    written = smrl.save(material, output)
    result = describe(material, written) | asdict(report) | {"epochs": options.epochs, "output": str(output)}
    if not quiet:
        console.print_rows(f"{material.name} → {output}", compression_rows(material, written, report))
    return result


def compact_one(brdf: Brdf, output: Path, options: CompactOptions, quiet: bool) -> dict[str, Any]:
    with console.progress(f"compressing {brdf.name}") as advance:
        material, report = compressed(brdf, **asdict(options), progress=advance)
    written = smrl.save(material, output)
    result = describe(material, written) | {"options": asdict(options), "psnr_object_db": report.psnr_db}
    counts = brdf.counts
    result |= {"seconds": report.seconds, "output": str(output), **asdict(counts)}
    result |= dict.fromkeys(("epochs", "quantisation_error", "units_dropped"))
    if not quiet:
        console.print_rows(f"{material.name} → {output}", compact_rows(material, written, report, counts))
    return result


def trained(table: BrdfTable, options: TrainOptions) -> tuple[SomManBrdf, TrainReport]:
    """Trains under a progress bar, and measures the result."""
    with console.progress(f"training {table.name}") as advance:
        material, report = train(table, options, progress=advance)
    metrics = table_metrics(table.values, material.values, table.lattice)
    measured = metrics | {"quantisation_error": report.quantisation_error[-1]}
    material.metrics = {name: _rounded(value) for name, value in measured.items()}
    facts = table.facts | (asdict(table.counts) if table.cells_clamped else {})
    if facts:
        material.options["source_facts"] = {name: _rounded(value) for name, value in facts.items()}
    return material, report


def _rounded(value: Any) -> Any:
    return float(f"{value:.{METRICS_DIGITS}g}") if isinstance(value, float) else value


def compression_rows(material: SomManBrdf, bytes_disk: int, report: TrainReport) -> dict[str, str]:
    """What was reached, and at which size."""
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
    """The same of the preset compact. counts: of the source."""
    rows = {
        "nodes": str(material.lattice.size),
        "palette": f"{material.clusters - len(material.lut)} gains, {len(material.lut)} shapes",
        "PSNR, object, on a sphere": decibels(report.psnr_db) if report.psnr_db is not None else "not measured",
        "size in memory": console.size(material.bytes_memory),
        "size on disk": console.size(bytes_disk),
    }
    if counts.cells_clamped:
        rows |= fact_rows(asdict(counts))
    return rows | origin_rows(material) | {"time": f"{report.seconds:.1f} s"}
