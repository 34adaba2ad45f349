"""Builds a library: of every material in a folder a compressed one in another, by many processes, and going on where a
build was stopped.

A material is done when its file and its record are there, whole. It is done again if its source has changed, by
content, or the options, or if its file is not what the record says. Whatever a killed build leaves is either done, or
as if it had never begun.
"""

from __future__ import annotations

import errno
import hashlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from ..compression.smrl import file as smrl
from ..system import door
from ..system.errors import FormatError, MaterialError, SommerlError, unexpected
from ..system.files import atomic_write, remove_all_left_over
from . import index
from .engines import Engine, results
from .lock import WHOLE, Shard, locked
from .record import Record
from .sources import Material, Sources, content, find
from .work import Job, Made, Method, work

Say = Callable[[str], None]
Progress = Callable[[int, int], None]  #: materials done so far, and in all

# After these, nothing else can be written either: the disk is full or gone.
HOPELESS = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
KILLED = "KilledWorker"  # Dask's error for what several of its processes died of; Dask may not be installed


@dataclass
class Report:
    """What a build did, of its shard: records of materials that were made, and that were there already.

    failed: of what could not be made, or read: the source, and a sentence. gone: names of materials in the library
    that have no source any more. removed: those of them that were removed.
    """

    made: list[Record] = field(default_factory=list[Record])
    kept: list[Record] = field(default_factory=list[Record])
    failed: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])
    gone: list[str] = field(default_factory=list[str])
    removed: list[str] = field(default_factory=list[str])


@dataclass(frozen=True)
class Hooks:
    """What a build calls meanwhile. warn: with what is not as expected. failed: with a sentence on each material that
    could not be made. progress: with what takes long; in its block, what it gives is called with how far that is."""

    warn: Say
    failed: Say
    progress: Callable[[str], AbstractContextManager[Progress | None]] = lambda _: nullcontext()


def build(
    sources: Path,
    folder: Path,
    method: Method,
    engine: Engine,
    hooks: Hooks,
    *,
    shard: Shard = WHOLE,
    prune: bool = False,
) -> Report:
    """Makes a library in `folder` of all materials below `sources`, or of a shard of them.

    prune: remove materials whose sources are gone.
    Raises MaterialError if there are no materials, two would have one name, or somebody else is building there;
    OSError if nothing more can be written, with all that is done kept.
    """
    found = _found(sources, folder, hooks.warn)
    (folder / index.INSIDE).mkdir(parents=True, exist_ok=True)
    with locked(folder, shard, hooks.warn) as lock:
        remove_all_left_over(folder)
        known = index.records(folder)
        report = Report(failed=list(found.faults))
        for _, sentence in found.faults:
            hooks.failed(sentence)
        ours = part(found.materials, shard)
        wanted = _wanted(folder, ours, known, method, report, hooks)
        _make(folder, wanted, method, engine, report, hooks)
        report.gone = _gone(found, known)
        if prune:
            _remove(folder, report.gone, known)
            report.gone, report.removed = [], report.gone
        if lock.widened():
            index.write_index(folder, _without(index.records(folder), report.removed))
    report.made.sort(key=lambda record: record.name)
    return report


def part(materials: Sequence[Material], shard: Shard) -> list[Material]:
    """A shard's materials, sorted by their names.

    They are drawn in the order of a hash of their names, so that neighbours, which take about as long, are dealt out
    evenly; and shards differ by one in number at most.
    """
    drawn = sorted(materials, key=lambda each: hashlib.sha256(each.name.encode("utf-8", "surrogatepass")).digest())
    places = shard.part(len(drawn))
    return sorted(drawn[places.start : places.stop], key=lambda each: each.name)


def intact(folder: Path, record: Record) -> bool:
    """Whether a material's file is there as its record says."""
    try:
        data = door.read(folder / record.file, smrl.LONGEST_FILE)
    except FormatError:
        return False
    return len(data) == record.bytes and hashlib.sha256(data).hexdigest() == record.sha256


def _found(sources: Path, folder: Path, warn: Say) -> Sources:
    if not sources.is_dir():
        raise MaterialError(f"{sources}: expected a folder of materials, found none")
    real, into = sources.resolve(), folder.resolve()
    if real == into or into in real.parents:
        raise MaterialError(f"{folder}: expected a folder that does not hold the sources, {sources}; choose another")
    found = find(sources, folder, warn)
    if not found.materials and not found.faults:
        raise MaterialError(f"{sources}: expected a folder with materials, found none in it")
    return found


def _wanted(
    folder: Path,
    materials: Sequence[Material],
    known: Mapping[str, Record],
    method: Method,
    report: Report,
    hooks: Hooks,
) -> list[Material]:
    """The materials that are to be made; those that are there are added to the report."""
    options, once = method.noted(), cache(content)  # of many in a file, that is read once
    wanted: list[Material] = []
    with hooks.progress(f"checking {folder}") as advance:
        for done, each in enumerate(materials):
            record = known.get(each.name)
            same = record is not None and (record.file, record.options) == (each.file, options)
            try:
                if record and same and once(each.parts)[1] == record.source_sha256 and intact(folder, record):
                    report.kept.append(record)
                else:
                    wanted.append(each)
            except FormatError:  # which is told when it is made
                wanted.append(each)
            if advance:
                advance(done + 1, len(materials))
    return wanted


def _make(
    folder: Path, wanted: Sequence[Material], method: Method, engine: Engine, report: Report, hooks: Hooks
) -> None:
    of_job = {Job(each.path, each.parts, method): each for each in wanted}
    with hooks.progress(f"building {folder}") as advance, closing(results(work, list(of_job), engine)) as found:
        for done, (job, result) in enumerate(found):
            material = of_job[job]
            sentence = _sentence(material.path, result) if isinstance(result, BaseException) else ""
            if isinstance(result, Made):
                try:
                    report.made.append(_written(folder, material, method, result))
                except (OSError, SommerlError) as error:
                    if isinstance(error, OSError) and error.errno in HOPELESS:
                        raise
                    sentence = _sentence(material.path, error)
            if sentence:
                report.failed.append((material.path, sentence))
                hooks.failed(sentence)
            if advance:
                advance(done + 1, len(wanted))


def _sentence(source: str, error: BaseException) -> str:
    if isinstance(error, BrokenExecutor) or type(error).__name__ == KILLED:
        return f"{source}: expected a process to compress it, found it killed, again and again; is there enough memory?"
    if isinstance(error, OSError):
        return f"{error.filename}: {error.strerror}"
    return str(error) if isinstance(error, SommerlError) else f"{source}: {unexpected(error)}"


def _written(folder: Path, material: Material, method: Method, made: Made) -> Record:
    """Writes a material's file, and then its record, without which it is not there."""
    path = folder / material.file
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as out:
        out.write(made.data)
    record = Record(
        name=material.name,
        file=material.file,
        bytes=len(made.data),
        sha256=hashlib.sha256(made.data).hexdigest(),
        source=material.source,
        source_bytes=made.source_bytes,
        source_sha256=made.source_sha256,
        options=method.noted(),
        metrics=made.metrics,
        colour=made.traits.colour,
        gloss=made.traits.gloss,
        metalness=made.traits.metalness,
    )
    index.write_record(folder, record)
    return record


def _gone(found: Sources, known: Mapping[str, Record]) -> list[str]:
    """The materials whose sources are gone; none of what may be in a file or folder that cannot be read."""
    if found.faults:
        return []
    return sorted(known.keys() - {each.name for each in found.materials})


def _remove(folder: Path, names: Sequence[str], known: Mapping[str, Record]) -> None:
    """Removes materials: first the file, so that what is left of one is no file without a record."""
    for name in names:
        path = folder / known[name].file
        path.unlink(missing_ok=True)
        index.record_path(folder, known[name].file).unlink(missing_ok=True)
        index.remove_empty([path.parent], folder)


def _without(records: Mapping[str, Record], names: Sequence[str]) -> dict[str, Record]:
    return {name: record for name, record in records.items() if name not in set(names)}
