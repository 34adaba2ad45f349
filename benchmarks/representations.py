"""The ways of storing a material that `rate_distortion.py` compares, each with its size in bytes."""

from __future__ import annotations

import tempfile
import time
import zipfile
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import kmeans

import sommerl
from sommerl import Brdf, BrdfTable
from sommerl.compression.compact.search import Compressor
from sommerl.formats import merl, nbrdf
from sommerl.models.nbrdf import WEIGHTS
from sommerl.reflectance.reciprocal import reciprocal
from sommerl.render.judge import Judge, score
from sommerl.reproduction.model_fits import GGX_PARAMETERS, SGD_PARAMETERS, fitted_ggx, fitted_sgd

PALETTES = (256, 1000)  # of k-means
NUMBER = 4  # bytes: float32
COLOURS = ("_rgb", "_spec")  # how RGL's files are called


@dataclass(frozen=True)
class Representation:
    """A material as it is stored.

    family: the curve that it is a point of. label: what it is in tables. size: bytes stored. seconds: of encoding, and
    bytes_memory: while it is looked up. None where there is no such thing.
    """

    family: str
    label: str
    brdf: Brdf
    size: int | None
    seconds: float | None = None
    bytes_memory: int | None = None


def representations(
    source: Brdf, judge: Judge, stem: str, sizes: Sequence[int], networks: Path | None
) -> list[Representation]:
    """All of a material. judge: of it. stem: of its file, under which `networks` (.npz) has it. sizes: of compact
    files, in bytes."""
    found = [] if source.reciprocal else [Representation("reciprocal", "raw → reciprocal", reciprocal(source), None)]
    found += compact(source, judge, sizes)
    table = BrdfTable.of(source)
    found += preset(table)
    found += [palette(table, clusters) for clusters in PALETTES]
    found += network(stem, networks)
    found += models(source)
    return [*found, *merl_table(table)]


def compact(source: Brdf, judge: Judge, sizes: Sequence[int]) -> Generator[Representation]:
    """Sommerl's compact files of at most so many bytes, as they are read back; seconds with the preparation."""
    if not sizes:
        return
    started = time.perf_counter()
    compressor = Compressor(source, quality=lambda material: score(judge.metrics(material)))
    prepared = time.perf_counter() - started
    for size in sizes:
        started = time.perf_counter()
        _, material = compressor.of_size(size)
        seconds = prepared + time.perf_counter() - started
        brdf, written = stored(material)
        label = f"compact, at most {size:,} B"
        yield Representation("compact", label, brdf, written, seconds, material.bytes_memory)


def preset(table: BrdfTable) -> Generator[Representation]:
    """The paper's representation with the defaults, looked up in both ways."""
    options = sommerl.TrainOptions()
    material, report = sommerl.train(table, options)
    brdf, written = stored(material)
    for interpolation in ("nearest", "trilinear"):
        label = f"paper, M = {options.clusters}, {interpolation}"
        looked_up = brdf.with_interpolation(interpolation)
        yield Representation(f"paper, {interpolation}", label, looked_up, written, report.seconds, brdf.bytes_memory)


def palette(table: BrdfTable, clusters: int) -> Representation:
    """k-means, looked up by the nearest cell."""
    started = time.perf_counter()
    material, size = kmeans.compressed(table, clusters)
    seconds = time.perf_counter() - started
    label = f"k-means, M = {clusters}, nearest"
    return Representation("k-means, nearest", label, material, size, seconds, material.bytes_memory)


def network(stem: str, archive: Path | None) -> Generator[Representation]:
    """The neural BRDF of that name, if the archive has it."""
    name = short_name(stem)
    if archive and f"{name}.npy" in zipfile.ZipFile(archive).namelist():
        size = NUMBER * WEIGHTS
        yield Representation("NBRDF", "NBRDF", nbrdf.read(archive, name), size, bytes_memory=size)


def models(source: Brdf) -> Generator[Representation]:
    """Analytic models, fitted."""
    for name, fit, parameters in (("SGD", fitted_sgd, SGD_PARAMETERS), ("GGX", fitted_ggx, GGX_PARAMETERS)):
        started = time.perf_counter()
        brdf = fit(source)
        seconds = time.perf_counter() - started
        size = NUMBER * parameters
        yield Representation(name, f"{name}, fitted", brdf, size, seconds, size)


def merl_table(table: BrdfTable) -> Generator[Representation]:
    """The table itself."""
    size = merl.bytes_on_disk(table.lattice)
    for interpolation in ("nearest", "trilinear"):
        label = f"MERL table, {interpolation}"
        looked_up = table.with_interpolation(interpolation)
        yield Representation(label, label, looked_up, size, bytes_memory=table.values.nbytes)


def stored(material: Any) -> tuple[Any, int]:
    """A material, written to a file and read again, and the bytes of that file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "material.smrl"
        sommerl.save(material, path)
        return sommerl.load(path), path.stat().st_size


def short_name(stem: str) -> str:
    """A material's name without what says how its colours are stored."""
    return next((stem.removesuffix(end) for end in COLOURS if stem.endswith(end)), stem)
