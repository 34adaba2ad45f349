"""How fast is training, against what? Ratios of times, peer : ours, one thread, from interleaved runs.

    uv run --group bench python benchmarks/training.py FOLDER [--clusters 1000] [--epochs 30] [--rounds 3] [--json FILE]

FOLDER holds MERL tables of the three materials. Peers: our own SIMD search among all units; the same one by one
(timed for one epoch, which costs as much as any other); faiss k-means, 20 iterations on all points; MiniSom, a sample.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from itertools import product
from pathlib import Path
from typing import Any

import faiss
import kmeans
import numpy as np
from minisom import MiniSom
from timing import interleaved, ratio, text

from sommerl import TrainOptions, _core, load_table
from sommerl.compression.paper import train

MATERIALS = ("blue-metallic-paint", "nickel", "yellow-matte-plastic")
CASES = tuple(product(("kohonen", "paper"), ("seeded", "table")))
MINISOM_SAMPLES = 2000


def learn(start: Any, options: TrainOptions, search: str) -> None:
    """Phases 1 and 2, as `train` runs them; the peers never stop early."""
    x, order, weights = start
    learner = _core.Learner(x, order, weights, options.rule, options.clusters, search)
    if search != "boxes":

        class Peer:
            present = staticmethod(learner.present)
            settled = staticmethod(lambda: False)

        learner = Peer
    train._learn(learner, len(x), options, None)


def minisom_sample(x: Any, clusters: int) -> float:
    """Seconds for one sample."""
    som = MiniSom(1, clusters, 3, sigma=0.1, learning_rate=0.02, random_seed=0)
    started = time.perf_counter()
    som.train_random(x[:MINISOM_SAMPLES], MINISOM_SAMPLES)
    return (time.perf_counter() - started) / MINISOM_SAMPLES


def measure(path: Path, options: argparse.Namespace) -> list[dict[str, Any]]:
    table = load_table(path)
    rgb = table.values[table.lattice.above_horizon]
    x = (rgb / rgb.max()).astype(np.float32)
    rows: list[dict[str, Any]] = []
    for rule, order in CASES:
        chosen = TrainOptions(clusters=options.clusters, epochs=options.epochs, rule=rule, order=order)
        one = TrainOptions(clusters=options.clusters, epochs=1, rule=rule, order=order)
        sequence, weights = train._start(x, chosen, "")
        start = x[sequence], sequence, weights
        contestants = {search: lambda s=start, c=chosen, n=search: learn(s, c, n) for search in ("boxes", "all")}
        contestants["scalar"] = lambda s=start, c=one: learn(s, c, "scalar")
        contestants["faiss"] = lambda: kmeans.trained(x, options.clusters)
        seconds = interleaved(contestants, options.rounds)
        seconds["scalar"] = [options.epochs * value for value in seconds["scalar"]]
        ours = statistics.median(seconds["boxes"]) / (options.epochs * len(x))
        row: dict[str, Any] = {"material": path.stem, "rule": rule, "order": order}
        row |= {peer: ratio(seconds, peer, "boxes") for peer in ("all", "scalar", "faiss")}
        row |= {"minisom": minisom_sample(x, options.clusters) / ours, "seconds": statistics.median(seconds["boxes"])}
        ratios = f"{text(row['all'])} | {text(row['scalar'])} | {text(row['faiss'])} | {row['minisom']:.0f}"
        print(f"| {path.stem} | {rule} | {order} | {ratios} | {row['seconds']:.2f} s |", flush=True)
        rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clusters", type=int, default=1000)
    parser.add_argument("--epochs", type=int, default=30)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    faiss.omp_set_num_threads(1)
    print(f"M = {options.clusters}, {options.epochs} epochs, {_core.simd_paths()[-1]}: times the time of ours\n")
    print("| material | rule | order | all, SIMD | all, scalar | faiss k-means | MiniSom, per sample | ours |")
    print("|---|---|---|---|---|---|---|---|")
    rows = [row for name in MATERIALS for row in measure(options.folder / f"{name}.binary", options)]
    for peer in ("all", "scalar", "faiss"):
        medians = [row[peer]["median"] for row in rows]
        print(f"\n{peer}: worst case {min(medians):.2f}, median case {statistics.median(medians):.2f}", end="")
    print()
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
