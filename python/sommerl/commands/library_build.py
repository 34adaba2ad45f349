"""The command `library build`: every material in a folder into a library."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..library import engines
from ..library.build import Hooks, Report, build
from ..library.lock import WHOLE, Shard
from ..library.record import Record
from ..library.work import Method
from ..render.judge import JUDGED
from ..system import threads
from ..system.errors import OptionError
from ..system.first_few import first_few
from . import answers, console
from .arguments import named_as_typed, option, positional
from .checks import check_range
from .folders import make_folder
from .library_rows import quality
from .method_arguments import MethodArguments, chosen_method
from .outcome import PartlyDone
from .parser import add_command

MOST_JOBS = 1024


@dataclass(frozen=True, kw_only=True)
class BuildArguments(MethodArguments):
    """What `library build` is asked for."""

    input: Path = positional("IN", help="a folder; every material file in it and below becomes a .smrl")
    output: Path = option("-o", metavar="OUT", help="the library's folder, which is made if there is none")
    jobs: int | None = option(
        default=None,
        metavar="N",
        instead_of="engine",
        help="processes, each with one thread (as many as there are processors)",
    )
    cluster: str | None = option(
        default=None,
        metavar="ADDRESS",
        instead_of="engine",
        help="of Dask's distributed scheduler, whose workers do the work, like tcp://10.0.0.1:8786",
    )
    shard: str | None = option(
        default=None,
        metavar="I/N",
        help="only the I-th of N parts, of which any may be built at the same time, on any machine",
    )
    prune: bool = option(default=False, help="remove materials from the library whose sources are gone")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Compresses all materials below a folder into a library, and goes on where it was stopped."
    example = """sommerl library build measured/ -o library/ --target-size 2.7kB
  sommerl library build measured/ -o library/ --target-size 2.7kB --shard 1/4"""
    add_command(add, "build", run, BuildArguments, summary, example)


def run(options: BuildArguments) -> dict[str, Any]:
    """Builds a library, or goes on. Raises PartlyDone if some materials fail."""
    method = Method(chosen_method(options), options.reciprocal)
    shard = _shard(options.shard) if options.shard is not None else WHOLE
    if options.prune and shard != WHOLE:
        raise OptionError(f"--prune: expected a build of all, found --shard {shard}")
    engine, sources = _engine(options), options.input
    if options.cluster is not None:
        sources = sources.absolute()  # workers are in other folders
    make_folder(options.output)
    started = time.monotonic()
    hooks = Hooks(console.warn, lambda sentence: console.tell(f"error: {sentence}"), console.progress)
    with named_as_typed():
        report = build(sources, options.output, method, engine, hooks, shard=shard, prune=options.prune)
    if report.gone:
        few = first_few(report.gone)
        console.warn(
            f"{options.output}: expected a source of each material, found none of {few}; --prune removes these"
        )
    answer = _answer(options.output, report) | {"seconds": time.monotonic() - started}
    if not options.json:
        console.print_rows(f"{options.input} → {options.output}", _rows(answer))
    if report.failed:
        total = len(report.made) + len(report.kept) + len(report.failed)
        raise PartlyDone(f"IN: expected to compress {total} materials, found {len(report.failed)} that failed", answer)
    return answer


def _shard(text: str) -> Shard:
    numbers = re.fullmatch(r"(\d{1,7})/(\d{1,7})", text, re.ASCII)
    if not numbers:
        raise OptionError(f"--shard: expected I/N, like 1/4, found {text}")
    with named_as_typed():
        return Shard(int(numbers[1]), int(numbers[2]))


def _engine(options: BuildArguments) -> engines.Engine:
    if options.cluster is not None:
        return engines.cluster(options.cluster, console.warn)
    jobs = options.jobs
    if jobs is None:
        jobs = min(engines.processors(), threads.limit() or MOST_JOBS, MOST_JOBS)
    check_range("--jobs", jobs, 1, MOST_JOBS)
    return engines.processes(jobs)


def _answer(folder: Path, report: Report) -> dict[str, Any]:
    done = [*((record, True) for record in report.made), *((record, False) for record in report.kept)]
    materials = [_described(folder, *each) for each in sorted(done, key=lambda each: each[0].name)]
    materials += [{"input": source, "error": sentence} for source, sentence in report.failed]
    records = [record for record, _ in done]
    # A file that holds many is counted once.
    sources = {(each.source_sha256, each.source.partition(":")[0]): each.source_bytes for each in records}
    before, after = sum(sources.values()), sum(each.bytes for each in records)
    totals: dict[str, Any] = {"output": str(folder), "made": len(report.made), "kept": len(report.kept)}
    totals |= {"failed": len(report.failed), "gone": report.gone, "removed": report.removed}
    totals |= {"bytes_before": before, "bytes_after": after, "ratio": before / after if after else None}
    return answers.of_materials(materials, **totals, quality=quality({each.name: each.metrics for each in records}))


def _described(folder: Path, record: Record, made: bool) -> dict[str, Any]:
    about: dict[str, Any] = {
        "input": record.source,
        "name": record.name,
        "output": str(folder / record.file),
        "made": made,
    }
    about |= {"bytes_disk": record.bytes, "bytes_source": record.source_bytes, "source_sha256": record.source_sha256}
    return about | {"options": dict(record.options)} | dict(record.metrics)


def _rows(answer: dict[str, Any]) -> dict[str, str]:
    """What a build did, for people."""
    counts = {"made": "made", "kept": "there already", "failed": "failed"}
    rows = {"materials": ", ".join(f"{answer[key]:,} {text}" for key, text in counts.items() if answer[key])}
    if answer["removed"]:
        rows["removed, their sources being gone"] = f"{len(answer['removed']):,}"
    if answer["bytes_after"]:
        before, after = console.size(answer["bytes_before"]), console.size(answer["bytes_after"])
        rows["size"] = f"{before} → {after}"
        rows["ratio"] = f"{answer['ratio']:.1f} : 1"
    labels = {metric.key: metric.label for metric in JUDGED}
    for key, found in answer["quality"].items():
        rows[f"{labels[key]}, mean"] = f"{found['mean']:.2f} dB"
        rows[f"{labels[key]}, worst"] = f"{found['worst']:.2f} dB ({found['worst_name']})"
    return rows | {"time": f"{answer['seconds']:.1f} s"}
