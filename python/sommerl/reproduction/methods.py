"""Every way of storing a material that the report compares, with its size in bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..compression.compact.search import Compressor
from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..compression.paper.train import train
from ..compression.smrl.file import decode, encode
from ..factored import file as factored_file
from ..factored.fit import factor
from ..formats import merl, nbrdf, numpy_files
from ..models.nbrdf import WEIGHTS
from ..reflectance.brdf import Brdf
from ..reflectance.lattice import Interpolation
from ..reflectance.table import BrdfTable
from ..render.judge import Judge, score
from ..system import door
from .data import PRINTED, RULES, Data
from .model_fits import GGX_PARAMETERS, SGD_PARAMETERS, fitted_ggx, fitted_sgd

NUMBER = 4  # bytes: float32
CLUSTERS = 256
ROUNDS = 20  # of k-means
RADIUS = 0.5  # of a neighbourhood, in units: small, since larger ones cost more (docs/method.md)
COLOURS = ("_rgb", "_spec")  # how names of RGL's files end


@dataclass(frozen=True)
class Source:
    """A material that is to be stored. name: of its file."""

    name: str
    data: Data

    @cached_property
    def brdf(self) -> Brdf:
        return self.data.brdf(self.name)

    @cached_property
    def table(self) -> BrdfTable:
        return BrdfTable.of(self.brdf).with_interpolation("trilinear")

    @cached_property
    def judge(self) -> Judge:
        return Judge(self.brdf)


@dataclass(frozen=True)
class Stored:
    """A material as it is stored. size: bytes of its file."""

    brdf: Brdf
    size: int


@dataclass(frozen=True)
class Method:
    """label: in tables. family: the curve that it is a point of. make: stores a material; None where it has no such
    form, like a material without a network. cost: seconds, about."""

    label: str
    family: str
    make: Callable[[Source], Stored | None]
    cost: float = 4.0


def compact(source: Source, size: int) -> Stored:
    """Sommerl's compact file of at most so many bytes, as it is read back."""
    compressor = Compressor(source.brdf, quality=lambda material: score(source.judge.metrics(material)))
    return _written(compressor.of_size(size)[1])


def paper(source: Source, options: TrainOptions, interpolation: Interpolation = "nearest") -> Stored:
    """The paper's representation."""
    stored = _written(train(source.table, options)[0])
    return replace(stored, brdf=stored.brdf.with_interpolation(interpolation))


def weights(source: Source) -> Stored:
    """The SOM without the MAN's last word: its entries are the weights, which are no original colours."""
    kept = _Kept()
    rgb, above = _seen(source.table)
    train(source.table, TrainOptions(clusters=CLUSTERS), kernels=kept)
    won = kept.learner.stored_cells()[:, 0] != _core.EMPTY
    return _of_entries(source.table, kept.learner.weights()[won], rgb, above)


def k_means(source: Source, clusters: int) -> Stored:
    """Plain k-means (Lloyd's) of the table's colours from random ones of them: what a SOM has to be better than."""
    rgb, above = _seen(source.table)
    x = (rgb / rgb.max()).astype(np.float32)
    random = np.random.Generator(np.random.PCG64(0))
    centres = np.unique(x[random.permutation(len(x))[: 8 * clusters]], axis=0)
    centres = centres[random.permutation(len(centres))[:clusters]]
    for _ in range(ROUNDS):
        nearest = _core.Quantiser(centres).query(x)
        count = np.bincount(nearest, minlength=len(centres))
        sums = np.stack([np.bincount(nearest, x[:, c], len(centres)) for c in range(3)], axis=-1)
        centres = np.where(count[:, None] > 0, sums / np.maximum(count, 1)[:, None], centres).astype(np.float32)
    return _of_entries(source.table, centres, rgb, above)


def lawrence(source: Source) -> Stored:
    """Lawrence et al.'s factors, as they are read back."""
    data = factored_file.encode(factor(source.brdf))
    return Stored(factored_file.decode(data), len(data))


def network(source: Source) -> Stored | None:
    """The neural BRDF of that name, if an archive beside the material has it."""
    name = short_name(source.name)
    for archive in source.data.networks():
        if f"{name}.npy" in numpy_files.names(archive, door.read(archive, numpy_files.LARGEST_FILE)):
            return Stored(nbrdf.read(archive, name), NUMBER * WEIGHTS)
    return None


def model(source: Source, fitted: Callable[[Brdf], Brdf], parameters: int) -> Stored:
    """A formula."""
    return Stored(fitted(source.brdf), NUMBER * parameters)


def merl_table(source: Source, interpolation: Interpolation) -> Stored:
    """A table of MERL's format."""
    table = merl.resampled(source.brdf)
    return Stored(table.with_interpolation(interpolation), merl.bytes_on_disk(table.lattice))


def own_file(source: Source) -> Stored | None:
    """The measurement's own file, if it is not of MERL's format: nothing is lost."""
    path = Path(source.data.place(source.name))
    return (
        None if isinstance(source.brdf, BrdfTable) or not path.is_file() else Stored(source.brdf, path.stat().st_size)
    )


METHODS: dict[str, Method] = {
    **{
        f"compact-{size}": Method(f"compact, at most {size:,} B", "compact", partial(compact, size=size), cost)
        for size, cost in ((1000, 5.0), (2700, 6.0), (3200, 6.0), (8000, 9.0), (9000, 10.0), (16_000, 15.0))
    },
    "paper": Method(f"paper, M = {CLUSTERS}", "paper", partial(paper, options=TrainOptions())),
    "paper-trilinear": Method(
        f"paper, M = {CLUSTERS}, trilinear",
        "paper, trilinear",
        partial(paper, options=TrainOptions(), interpolation="trilinear"),
    ),
    "paper-printed": Method(
        f"paper, M = {CLUSTERS}, {PRINTED}", f"paper, {PRINTED}", partial(paper, options=TrainOptions(**RULES[PRINTED]))
    ),
    "paper-1000": Method("paper, M = 1000", "paper", partial(paper, options=TrainOptions(clusters=1000)), 7.0),
    "som": Method(f"SOM without MAN, M = {CLUSTERS}", "SOM without MAN", weights),
    "distinct": Method(
        f"MAN with distinct memories, M = {CLUSTERS}", "distinct", partial(paper, options=TrainOptions(distinct=True))
    ),
    "neighbours": Method(
        f"with a neighbourhood, radius {RADIUS}", "neighbours", partial(paper, options=TrainOptions(radius=RADIUS)), 9.0
    ),
    **{
        f"k-means-{m}": Method(f"k-means, M = {m}", "k-means", partial(k_means, clusters=m), cost)
        for m, cost in ((CLUSTERS, 8.0), (1000, 14.0))
    },
    "lawrence": Method("Lawrence, 16 × 4", "Lawrence", lawrence, 15.0),
    "network": Method("NBRDF", "NBRDF", network),
    "sgd": Method("SGD, fitted", "SGD", partial(model, fitted=fitted_sgd, parameters=SGD_PARAMETERS), 25.0),
    "ggx": Method("GGX, fitted", "GGX", partial(model, fitted=fitted_ggx, parameters=GGX_PARAMETERS), 10.0),
    **{
        f"table-{lookup}": Method(f"MERL table, {lookup}", "MERL table", partial(merl_table, interpolation=lookup))
        for lookup in ("nearest", "trilinear")
    },
    "own": Method("the measurement's own file", "own file", own_file),
}


def short_name(name: str) -> str:
    """A material's name without what says how its colours are stored."""
    return next((name.removesuffix(end) for end in COLOURS if name.endswith(end)), name)


class _Kept:
    """The core, whose last learner is kept."""

    Quantiser = _core.Quantiser
    learner: Any

    def Learner(self, *arguments: Any, **options: Any) -> Any:
        self.learner = _core.Learner(*arguments, **options)
        return self.learner


def _seen(table: BrdfTable) -> tuple[Any, Any]:
    """The colours above the horizon, and which cells these are."""
    above = table.lattice.above_horizon
    return table.values[above], above


def _of_entries(table: BrdfTable, entries: Any, rgb: Any, above: Any) -> Stored:
    """The material with these entries, in [0, 1]. They are sorted by brightness, which makes the file small."""
    entries = np.maximum(entries[np.argsort(entries.sum(axis=1), kind="stable")], 0)
    index = np.zeros(table.lattice.shape, np.uint8 if len(entries) <= 256 else np.uint16)
    index[above] = _core.Quantiser(entries).query((rgb / rgb.max()).astype(np.float32))
    return _written(SomManBrdf(entries.astype(np.float64) * rgb.max(), index, table.lattice, name=table.name))


def _written(material: SomManBrdf) -> Stored:
    """A material as its file is read back."""
    data = encode(material)
    return Stored(decode(data), len(data))


def speed(brdf: Brdf, pairs: int) -> float:
    """Evaluations a second, of that many random pairs of directions; the best of three times."""
    random = np.random.Generator(np.random.PCG64(0))
    wi, wo = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in np.abs(random.standard_normal((2, pairs, 3))))
    best = np.inf
    for _ in range(3):
        started = time.perf_counter()
        brdf.eval(wi, wo)
        best = min(best, time.perf_counter() - started)
    return pairs / best
