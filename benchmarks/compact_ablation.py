"""What the SOM and the MAN are worth in compact materials: PSNR at one size, by how the palettes start and are refined.

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
from sommerl.render.compare import judge_on_sphere
from sommerl.render.environment import default_environment

WAYS = {
    "SOM, least squares": ("som", True),
    "k-means, least squares": ("k-means", True),
    "SOM, the MAN's values": ("som", False),
    "k-means, the nearest values": ("k-means", False),
}


def measured(path: Path, size: int) -> list[float]:
    """The best values of the nodes, not quantised; then each of WAYS."""
    source = load(path)
    judge = judge_on_sphere(source, default_environment())
    fitter = Fitter(source)
    nodes = usual_nodes(size)
    problem = fitter.problem(nodes)
    gains, shapes = (round(share * nodes**0.5) for share in (GAINS, SHAPES))

    def quality(values) -> float:
        return judge(FittedTable(problem.lattice, values, fitter.scale, name=source.name))

    found = [quality(problem.best)]
    for start, refine in WAYS.values():
        quantised, _ = quantise(problem, gains, shapes, size, start=start, refine=refine)
        found.append(quality(quantised.values()))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--size", type=int, default=2700, help="of the stream, in bytes")
    options = parser.parse_args()
    print("| material | not quantised |", " | ".join(WAYS), "|")
    print("|---" * (2 + len(WAYS)) + "|")
    rows = []
    for path in sorted(options.folder.iterdir()):
        rows.append(measured(path, options.size))
        print(f"| {path.stem} |", " | ".join(f"{value:.1f}" for value in rows[-1]), "|", flush=True)
    print("| mean |", " | ".join(f"{value:.1f}" for value in np.mean(rows, axis=0)), "|")


if __name__ == "__main__":
    main()
