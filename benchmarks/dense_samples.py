"""What 1.3 million rows cost: reading, compressing, loading.

    uv run python benchmarks/dense_samples.py MEASUREMENT [--folder FOLDER] [--target-size 20kB]

MEASUREMENT, any that Sommerl reads, is interpolated at 59 × 61 × 361 angles from 0° to 87°, written as a CSV file, and
converted by the command. Said are the processor time and the memory that reading takes, the file's bytes, the median
relative error of the file against the measurement at all rows, and the median processor time of loading it.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from sommerl import load
from sommerl.reflectance.samples import Samples


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("measurement", type=Path)
    parser.add_argument("--folder", type=Path, default=Path(), help="for the files")
    parser.add_argument("--target-size", default="20kB")
    options = parser.parse_args()
    rows, small = options.folder / "dense.csv", options.folder / "dense.smrl"
    theta_i, theta_o, phi = np.linspace(0, 87, 59), np.linspace(0, 87, 61), np.arange(361.0)
    light, viewer, turned = (each.ravel() for each in np.meshgrid(theta_i, theta_o, phi, indexing="ij"))
    angles = np.stack([light, 0 * light, viewer, turned], axis=-1)
    there = Samples.at_angles(np.radians(angles), np.zeros((len(angles), 3)))
    f_r = load(options.measurement).eval(there.wi, there.wo)
    header = "theta_i,phi_i,theta_o,phi_o,r,g,b"
    np.savetxt(rows, np.column_stack([angles, f_r]), fmt="%.6g", delimiter=",", header=header, comments="")

    # In a process of its own: memory is counted from its start.
    reading = "import resource, sys, time; from sommerl import load; start = time.process_time(); load(sys.argv[1]); "
    reading += "print(time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    read = subprocess.run([sys.executable, "-c", reading, str(rows)], check=True, capture_output=True, text=True)
    seconds, memory = map(float, read.stdout.split())
    convert = ["convert", str(rows), str(small), "--target-size", options.target_size, "--overwrite"]
    subprocess.run([sys.executable, "-m", "sommerl", *convert], check=True)
    whole = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    times = []
    for _ in range(21):
        start = time.process_time()
        found = load(small)
        times.append(time.process_time() - start)
    error = np.abs(found.eval(there.wi, there.wo) / np.where(f_r == 0, np.nan, f_r) - 1)
    print(f"{len(angles)} rows, {rows.stat().st_size} bytes: read with {seconds:.1f} s, {memory / 1e3:.0f} MB")
    print(f"{small.stat().st_size} bytes; converting takes {whole:.0f} MB at most")
    print(f"median error {np.nanmedian(error):.3%}; loaded with {1e3 * np.median(times):.1f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
