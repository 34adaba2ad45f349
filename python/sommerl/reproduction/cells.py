"""Cells: the measurements that the report is made of. Each is made, kept and made anew on its own."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar, Unpack

from .. import __version__
from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..compression.paper.train import train
from ..factored.fit import FactorOptions, factor
from ..factored.material import FactoredBrdf
from ..reflectance.table import BrdfTable
from ..system.files import atomic_write
from .data import RULES, Data, Learnt, digest_of

T = TypeVar("T")

MARK = "sommerl_cell"  # the key by which a cell's file is known
FEW_CLUSTERS = 64  # at most, where few of everything are asked for
REVISION = 1  # of what cells measure: a change of it makes all anew
KINDS = {b"\x89PNG": "png", b"<svg": "svg", b"RIFF": "webp"}  # of pictures, by how they begin


@dataclass(frozen=True)
class Extent:
    """How thoroughly to measure.

    size, spp: of pictures, in pixels and in samples a pixel. samples, starts: of fits. rounds, time_spp: of Table 2's
    interleaved renders. rates: the first learning rates that are tried with Eq. 2 as printed. clusters: the M at which
    noise is tested. epochs: the most that are learnt. terms: lobes and terms of Lawrence et al.'s factors. few: leave
    out materials and methods beyond the first ones.
    """

    name: str
    size: int
    spp: int
    samples: int
    starts: int
    rounds: int
    time_spp: int
    rates: tuple[float, ...]
    clusters: tuple[int, ...]
    epochs: int = 1000
    terms: tuple[int, int] = (16, 4)
    few: bool = False


FULL = Extent(
    "full", 256, 256, 1_500_000, 20, 24, 32, (0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.1, 0.02), (16, 64, 256, 1000, 4000)
)
QUICK = Extent("quick", 40, 8, 2000, 2, 3, 2, (0.5,), (16,), epochs=2, terms=(2, 1), few=True)


@dataclass(frozen=True)
class Setting:
    """What a report is made from. mesh: the figure of Fig. 1; the built-in one if None."""

    data: Data
    extent: Extent = FULL
    mesh: Path | None = None

    def some(self, all_of: Iterable[T], count: int = 1) -> list[T]:
        """All, or where few are asked for, the first ones."""
        return list(all_of)[: count if self.extent.few else None]

    def learnt(self, table: BrdfTable, clusters: int, epochs: int = 30, **rule: Unpack[Learnt]) -> SomManBrdf:
        """A table, compressed with the preset `paper` and nearest lookup. rule: one of RULES."""
        if self.extent.few:
            clusters = min(clusters, FEW_CLUSTERS)
        return train(table, TrainOptions(clusters=clusters, epochs=min(epochs, self.extent.epochs), **rule))[0]

    def both(self, table: BrdfTable, clusters: int, epochs: int = 30) -> dict[str, SomManBrdf]:
        """The same in both ways, by RULES."""
        return {title: self.learnt(table, clusters, epochs, **rule) for title, rule in RULES.items()}

    def factored(self, table: BrdfTable) -> FactoredBrdf:
        """A table, factored as Lawrence et al. do."""
        return factor(table, FactorOptions(*self.extent.terms))


@dataclass(frozen=True)
class Outcome:
    """What a cell measured: plain values for JSON, and pictures, as the bytes of their files. seconds: that it took."""

    values: Mapping[str, Any]
    pictures: Mapping[str, bytes] = field(default_factory=dict[str, bytes])
    seconds: float = 0.0


@dataclass(frozen=True)
class Cell:
    """One measurement.

    name: of its file, and its place in the report, like "table1/purple-paint/ward". work: a function of a module, of
    the setting and of `arguments`, which are plain values. reads: the materials that it needs. cost: about how many
    seconds it takes in full, so that progress tells the time that is left. alone: whether nothing else may run
    meanwhile. figure: whether it needs the setting's mesh.
    """

    name: str
    work: Callable[..., Outcome]
    arguments: Mapping[str, Any] = field(default_factory=dict[str, Any])
    reads: tuple[str, ...] = ()
    cost: float = 1.0
    alone: bool = False
    figure: bool = False

    def key(self, setting: Setting) -> str:
        """What its outcome depends on, as a hash: one of another key is stale."""
        of_what = {
            "version": [__version__, REVISION],
            "work": f"{self.work.__module__}.{self.work.__qualname__}",
            "arguments": dict(self.arguments),
            "extent": asdict(setting.extent),
            "sources": {name: setting.data.digest(name) for name in self.reads},
            "mesh": digest_of(setting.mesh) if self.figure and setting.mesh else None,
        }
        return hashlib.sha256(json.dumps(of_what, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Store:
    """The outcomes of cells, a file of JSON each with its pictures beside it, below a folder."""

    folder: Path

    def load(self, cell: Cell, key: str) -> Outcome | None:
        """A cell's outcome, if there is one of that key that is whole."""
        try:
            found = json.loads(self._path(cell).read_bytes())
            if found[MARK] != key:
                return None
            pictures = {name: self._picture(cell, name, kind).read_bytes() for name, kind in found["pictures"].items()}
            return Outcome(found["values"], pictures, found["seconds"])
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def save(self, cell: Cell, key: str, outcome: Outcome) -> None:
        """Writes an outcome; its JSON last, without which it is not there."""
        path = self._path(cell)
        path.parent.mkdir(parents=True, exist_ok=True)
        kinds = {name: kind_of(data) for name, data in outcome.pictures.items()}
        for name, data in outcome.pictures.items():
            with atomic_write(self._picture(cell, name, kinds[name])) as out:
                out.write(data)
        content = {MARK: key, "seconds": outcome.seconds, "values": outcome.values, "pictures": kinds}
        with atomic_write(path) as out:
            out.write(json.dumps(content, indent=1).encode())

    def _path(self, cell: Cell) -> Path:
        return self.folder / f"{cell.name}.json"

    def _picture(self, cell: Cell, name: str, kind: str) -> Path:
        return self.folder / f"{cell.name}.{name}.{kind}"


def kind_of(picture: bytes) -> str:
    """The extension of a picture's file."""
    return next(kind for head, kind in KINDS.items() if picture.startswith(head))


def plain(value: Any) -> Any:
    """A value as JSON has it, with six significant digits; null for what is not finite, as the PSNR of identical
    images."""
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value
