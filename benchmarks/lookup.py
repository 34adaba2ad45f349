"""How fast are phase 3 and `eval`, against what? Ratios of times, peer : ours, from interleaved runs.

    uv run python benchmarks/lookup.py FILE [--pairs 10000000] [--rounds 3] [--json FILE]

FILE is a MERL table. Phase 3 asks for the nearest of 1000 LUT entries of every cell; `eval` takes random pairs of
directions, uniform over the hemisphere.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from timing import interleaved, ratio, text

from sommerl import Brdf, TrainOptions, _core, load_table, train


def directions(count: int, seed: int) -> Any:
    v = np.random.default_rng(seed).standard_normal((count, 3))
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    v[:, 2] = np.abs(v[:, 2])
    return v


def query(table: Any, rounds: int) -> dict[str, Any]:
    rgb = table.values[table.lattice.above_horizon]
    scale = rgb.max()
    x = (rgb / scale).astype(np.float32)
    material, _ = train(table, TrainOptions(clusters=1000, epochs=5))
    lut = (material.lut / scale).astype(np.float32)
    contestants = {
        "boxes, 1 thread": lambda: _core.Quantiser(lut, "boxes", None, 1).query(x),
        "all entries, SIMD, 1 thread": lambda: _core.Quantiser(lut, "all", None, 1).query(x),
        "boxes, 2 threads": lambda: _core.Quantiser(lut, "boxes", None, 2).query(x),
    }
    seconds = interleaved(contestants, rounds)
    return {
        "query: all entries, SIMD : boxes": ratio(seconds, "all entries, SIMD, 1 thread", "boxes, 1 thread"),
        "query: 1 thread : 2 threads": ratio(seconds, "boxes, 1 thread", "boxes, 2 threads"),
    }


def lookup(table: Any, pairs: int, rounds: int) -> dict[str, Any]:
    material, _ = train(table, TrainOptions(epochs=5))
    wi, wo = directions(pairs, 1), directions(pairs, 2)
    results: dict[str, Any] = {}
    for interpolation in ("nearest", "trilinear"):
        a, b = material.with_interpolation(interpolation), table.with_interpolation(interpolation)
        contestants = {
            "material": lambda a=a: a.eval(wi, wo),
            "material, NumPy": lambda a=a: Brdf.eval(a, wi, wo),
            "table": lambda b=b: b.eval(wi, wo),
            "table, NumPy": lambda b=b: Brdf.eval(b, wi, wo),
        }
        seconds = interleaved(contestants, rounds)
        results[f"eval, {interpolation}, material: NumPy : core"] = ratio(seconds, "material, NumPy", "material")
        results[f"eval, {interpolation}, table: NumPy : core"] = ratio(seconds, "table, NumPy", "table")
        results[f"eval, {interpolation}, core: float64 table : material"] = ratio(seconds, "table", "material")
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--pairs", type=int, default=10**7)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    table = load_table(options.file)
    results = query(table, 20) | lookup(table, options.pairs, options.rounds)
    print("| peer : ours | times our time, median (least-most) |\n|---|---|")
    for name, value in results.items():
        print(f"| {name} | {text(value)} |")
    if options.json:
        options.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
