"""Plain k-means of a table's RGB triples: what a self-organising map has to be better than."""

from __future__ import annotations

import lzma
from typing import Any

import faiss
import numpy as np

from sommerl import BrdfTable
from sommerl.compression.material import SomManBrdf

ITERATIONS = 20
# Of xz, as fits indices best: no alignment, no context of neighbouring bytes.
FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "lc": 0, "lp": 0, "pb": 0}]


def trained(x: Any, clusters: int) -> Any:
    """faiss's k-means of triples (n, 3), float32: all points, ITERATIONS rounds."""
    trainer = faiss.Kmeans(x.shape[1], clusters, niter=ITERATIONS, max_points_per_centroid=len(x), seed=0)
    trainer.train(x)
    return trainer


def compressed(table: BrdfTable, clusters: int) -> tuple[SomManBrdf, int]:
    """The material whose palette is the means, looked up by the nearest cell, and its bytes.

    The bytes are those of an .xz stream of the palette in float32 and the indices above the horizon. The palette is
    sorted by brightness, as ours is, which makes the indices smoother.
    """
    above = table.lattice.above_horizon
    rgb = table.values[above]
    scale = rgb.max()
    trainer = trained((rgb / scale).astype(np.float32), clusters)
    order = np.argsort(trainer.centroids.sum(axis=1), kind="stable")
    number = np.empty(clusters, np.uint8 if clusters <= 256 else np.uint16)
    number[order] = np.arange(clusters)
    _, nearest = trainer.index.search((rgb / scale).astype(np.float32), 1)
    lut = (np.maximum(trainer.centroids[order], 0) * scale).astype(np.float32)
    index = np.zeros(table.lattice.shape, number.dtype)
    index[above] = number[nearest[:, 0]]
    material = SomManBrdf(lut, index, table.lattice, name=f"{table.name} (k-means)")
    payload = lut.tobytes() + index[above].tobytes()
    return material, len(lzma.compress(payload, lzma.FORMAT_XZ, filters=FILTERS))
