"""What a process of a build does: it makes one material, and writes nothing.

The bytes go back to the process that began the build and holds the library's lock, which alone writes them: a process
that outlives a build that was killed can do no harm, and machines of a cluster need to see the sources only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ..compression.compact.search import CompactOptions
from ..compression.material import SomManBrdf
from ..compression.paper import measured
from ..compression.paper.options import TrainOptions
from ..compression.smrl import file, notes
from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..render.compress import compress
from ..render.judge import Judge
from ..system import threads
from ..system.errors import FormatError
from .sources import content
from .traits import Traits, traits


@dataclass(frozen=True)
class Method:
    """How materials are compressed: by the options of a preset. reciprocal: see `render.compress`."""

    options: CompactOptions | TrainOptions
    reciprocal: bool = False

    def noted(self) -> dict[str, Any]:
        """As a `Record` has it."""
        preset = "compact" if isinstance(self.options, CompactOptions) else "paper"
        return {"preset": preset, **asdict(self.options), "reciprocal": self.reciprocal}


@dataclass(frozen=True)
class Job:
    """A material to be made. path, parts: as in `sources.Material`."""

    path: str
    parts: tuple[str, ...]
    method: Method


@dataclass(frozen=True)
class Made:
    """What came of it. data: the bytes of the .smrl file. The rest is as in `Record`."""

    data: bytes
    source_bytes: int
    source_sha256: str
    metrics: Mapping[str, float]
    traits: Traits


def work(job: Job) -> Made:
    """Makes a material. Raises SommerlError for a source that cannot be read or compressed."""
    if threads.limit() is None:
        threads.use(1)  # processes work side by side: more threads would be in each other's way
    try:
        before = content(job.parts)
        made, metrics = _compressed(load(job.path), job.method)
        if content(job.parts) != before:
            raise FormatError(f"{job.path}: expected a file that stays as it is, found it changed while it was read")
    except OSError as error:
        raise FormatError(f"{error.filename or job.path}: {error.strerror or error}") from error
    except MemoryError as error:
        raise FormatError(f"{job.path}: expected enough memory, found too little") from error
    notes.check(made.options, made.metrics)
    data = file.encode(made)
    seen = traits(file.decode(data))
    return Made(
        data,
        *before,
        {key: measured.rounded(value) for key, value in metrics.items()},
        Traits(*(_rounded(seen.colour), *_rounded((seen.gloss, seen.metalness)))),
    )


def _rounded(values: tuple[float, ...]) -> Any:
    return tuple(measured.rounded(float(value)) for value in values)


def _compressed(brdf: Brdf, method: Method) -> tuple[SomManBrdf, Mapping[str, float]]:
    """A material, and how far it is from the source as it was read."""
    if isinstance(method.options, CompactOptions):
        material, report = compress(brdf, **asdict(method.options), reciprocal=method.reciprocal)
        return material, report.metrics
    material, _ = measured.train(BrdfTable.of(brdf), method.options)
    return material, Judge(brdf).metrics(material)
