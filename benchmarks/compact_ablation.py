"""What the SOM and the MAN are worth in compact materials, by how the palettes start and are refined: the PSNR in soft
light, and the judge's score, at one size.

uv run python benchmarks/compact_ablation.py FOLDER [--size BYTES]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from sommerl import load
from sommerl.compression.compact.fitted_table import FittedTable
from sommerl.compression.compact.lattice_fit import Fitter
from sommerl.compression.compact.quantise import quantise
from sommerl.compression.compact.search import GAINS, SHAPES, usual_nodes
from sommerl.render.judge import Judge, score

WAYS = {
    "SOM, least squares": ("som", True),
    "k-means, least squares": ("k-means", True),
    "SOM, the MAN's values": ("som", False),
    "k-means, the nearest values": ("k-means", False),
}


def measured(path: Path, size: int) -> list[tuple[float, float]]:
    """PSNR and score of the best values of the nodes, not quantised; then of each of WAYS."""
    source = load(path)
    judge = Judge(source)
    fitter = Fitter(source)
    nodes = usual_nodes(size)
    problem = fitter.problem(nodes)
    gains, shapes = (round(share * nodes**0.5) for share in (GAINS, SHAPES))

    def quality(values) -> tuple[float, float]:
        made = FittedTable(problem.lattice, values, fitter.scale, signed=source.signed, name=source.name)
        metrics = judge.metrics(made)
        return metrics["psnr_soft_db"], score(metrics)

    found = [quality(problem.best)]
    for start, refine in WAYS.values():
        quantised, _ = quantise(problem, gains, shapes, size, start=start, refine=refine)
        found.append(quality(quantised.values()))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--size", type=int, default=2700, help="of the stream, in bytes")
    options = parser.parse_args()
    print("| material | not quantised |", " | ".join(WAYS), "|")
    print("|---" * (2 + len(WAYS)) + "|")
    rows = []
    for path in sorted(options.folder.iterdir()):
        rows.append(measured(path, options.size))
        print_row(path.stem, rows[-1])
    print_row("mean", np.mean(rows, axis=0))


def print_row(name: str, values) -> None:
    print(f"| {name} |", " | ".join(f"{psnr:.1f}, {points:.2f}" for psnr, points in values), "|", flush=True)


if __name__ == "__main__":
    main()
