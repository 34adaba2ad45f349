"""What values that were measured on a grid (.mbsdf) become in compact files, and how rough they are.

    uv run python benchmarks/measured_grids.py FILE.mbsdf... [--sizes 2700 8000 32000]

For each size: PSNR in soft light and under one lamp against the measurement, which is read linearly between its bins;
and the median relative error of all values after .mbsdf → .smrl → .mbsdf. Roughness, in θ_i, θ_o and φ, of what was
measured and of what was written again: the median relative difference between a value and the cubic through the two
on either side of it, divided by what that is for noise of 1 (√(70 / 36)). What the measurement has more than a file
much larger than it needs to be is noise, or detail finer than the bins.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sommerl import compress
from sommerl.compression.smrl import file
from sommerl.formats import mbsdf
from sommerl.render.judge import Judge

CUBIC = np.array([1, -4, 6, -4, 1]) / 6  # a value, less the cubic through its neighbours


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--sizes", nargs="*", type=int, default=[2700, 8000, 32000])
    options = parser.parse_args()
    print("| | bytes | soft light [dB] | one lamp [dB] | median error | roughness |\n|---|---|---|---|---|---|")
    for path in options.files:
        source = mbsdf.read(path)
        judge = Judge(source)
        print(f"| {path.stem} | {path.stat().st_size:,} | | | | {_roughness(source.values)} |")
        for size in options.sizes:
            small, _ = compress(source, target_size=size)
            metrics = judge.metrics(small)
            with tempfile.TemporaryDirectory() as folder:
                mbsdf.write(small, Path(folder, path.name))
                again = mbsdf.read(Path(folder, path.name)).values
            there = source.values != 0
            error = np.median(np.abs(again[there] / source.values[there] - 1))
            figures = f"{metrics['psnr_soft_db']:.1f} | {metrics['psnr_lamp_db']:.1f} | {error:.1%}"
            print(f"| | {len(file.encode(small)):,} | {figures} | {_roughness(again)} |", flush=True)
    return 0


def _roughness(values: NDArray[np.float64]) -> str:
    """values: (θ_i, θ_o, φ, channels)."""
    found = []
    for axis in range(3):
        each = np.moveaxis(values, axis, 0)
        off = np.sum([weight * each[k : len(each) - 4 + k] for k, weight in enumerate(CUBIC)], axis=0)
        middle = each[2:-2]
        there = middle != 0
        found.append(np.median(np.abs(off[there] / middle[there])) / np.linalg.norm(CUBIC))
    return ", ".join(f"{one:.1%}" for one in found)


if __name__ == "__main__":
    sys.exit(main())
