"""Puts a library into one file whose materials share lattices: each is compressed again, from its source."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..compression.compact.search import LARGEST_SIZE, Compressor
from ..compression.compact.sharing import Example, examples_used, train
from ..compression.paper.measured import rounded
from ..compression.smrl import file, library_file
from ..compression.smrl.library_index import Entry
from ..compression.smrl.shared import Shared
from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.reciprocal import reciprocal
from ..render.judge import Judge
from ..system.errors import MaterialError, OptionError
from ..system.files import atomic_write
from . import sources
from .library import Library, entry_of
from .pack import check_packed
from .record import Record
from .sources import Material

SMALLEST_PART, LARGEST_PART = 200, LARGEST_SIZE  # bytes
Progress = Callable[[int, int], None]  #: steps done, steps in all


@dataclass(frozen=True)
class Packed:
    """bytes_disk: of the file. bytes_shared: of what is shared. metrics: of each material, against its source, by its
    name. whole: names of those that cannot share, with the reason, and are in the file as the library has them."""

    bytes_disk: int
    bytes_shared: int
    metrics: Mapping[str, Mapping[str, float]]
    whole: Mapping[str, str]


def pack_shared(
    library: Library, folder: Path, path: Path, size: int, *, seed: int = 0, progress: Progress | None = None
) -> Packed:
    """Writes a library as one file (.smrlib) in which a material takes at most `size` bytes besides its row of the
    index.

    folder: of the sources that the library was built from. Each material is compressed from its source again, onto the
    shared lattice that fits it best, and measured against it. Raises MaterialError for an empty library, for sources
    that are gone or have changed; OptionError for a size out of range; and as `pack.pack` does.
    """
    if not SMALLEST_PART <= size <= LARGEST_PART:
        raise OptionError(f"shared: expected {SMALLEST_PART} to {LARGEST_PART} bytes, found {size}")
    check_packed(library, path)

    def step(done: int, total: int) -> None:
        if progress:
            progress(done, total + len(records))

    found = {each.name: each for each in sources.find(folder, Path(library.path), lambda _: None).materials}
    records = library.records
    for record in records:
        _check_source(folder, record, found)
    examples = [_example(library, record, found[record.name]) for record in records]
    learnt = examples_used(examples)
    shared = train(examples, size, seed=seed, progress=step)
    data, entries = dict[str, bytes](), list[Entry]()
    whole, metrics = dict[str, str](), dict[str, Mapping[str, float]]()
    for number, record in enumerate(records):
        entry = entry_of(record)
        try:
            brdf = _source(record, found[record.name])
            data[record.name], metrics[record.name] = compressed(brdf, shared, size, seed)
            options = {"preset": "compact", "target_size": size, "shared": True, "reciprocal": _averaged(record)}
            entry = replace(entry, options=options, metrics=metrics[record.name])
        except MaterialError as error:
            data[record.name], whole[record.name] = library.data(record.name), str(error)
        entries.append(entry)
        step(learnt + number + 1, learnt)
    with atomic_write(path) as out:
        written = library_file.write(out, entries, data.__getitem__, shared)
    return Packed(written, len(shared.encode()), metrics, whole)


def compressed(brdf: Brdf, shared: Shared, size: int, seed: int = 0) -> tuple[bytes, Mapping[str, float]]:
    """The .smrl of a material on a shared lattice, whose part takes at most `size` bytes, and how far it is from the
    source. Raises MaterialError if no shared lattice can hold it, or no palette of that size."""
    _, material = Compressor(brdf, seed=seed, shared=shared).of_size(size)
    seen = {key: rounded(value) for key, value in Judge(brdf).metrics(material).items()}
    return file.encode(material), seen


def _check_source(folder: Path, record: Record, found: Mapping[str, Material]) -> None:
    material = found.get(record.name)
    if material is None:
        raise MaterialError(f"{folder}: expected {record.source} in it, of which the library was built, found none")
    if sources.content(material.parts)[1] != record.source_sha256:
        raise MaterialError(
            f"{material.path}: expected the file that the library was built from, found another content"
        )


def _example(library: Library, record: Record, source: Material) -> Example:
    material = library[record.name]
    return Example(lambda: _source(record, source), record.gloss, material.reciprocal, material.mirrored)


def _averaged(record: Record) -> bool:
    """Whether the mean of both orders of directions was compressed, and not the source as it is."""
    return bool(record.options.get("reciprocal"))


def _source(record: Record, source: Material) -> Brdf:
    brdf = load(source.path)
    return reciprocal(brdf) if _averaged(record) else brdf
