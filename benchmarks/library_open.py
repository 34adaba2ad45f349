"""How long it takes to open a library of many materials and fetch one: a .smrlib, beside the same index as JSON.

    uv run python benchmarks/library_open.py [--materials 10000] [--repeats 20] MATERIAL.smrl

The library holds the one material again and again, under names of its own, with records as `library build` makes them.
Each figure is of opening, fetching and decoding a material of a name near the middle, in one process: the lowest and
the median over the repeats. Files are in the system's cache. Sizes are in bytes.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sommerl import Library
from sommerl.compression.smrl import file, library_file
from sommerl.compression.smrl.library_index import Entry

METRICS = {"psnr_soft_db": 50, "psnr_lamp_db": 40, "log_error": 0.1, "log_error_grazing": 0.2, "albedo_ratio": 1}


def entries(count: int) -> list[Entry]:
    """Records with names, sources and figures that differ as those of a real library do."""
    rng = np.random.default_rng(0)
    found: list[Entry] = []
    for number in range(count):
        name = f"stand-in-{number % 99:02d}/tint-{number // 99:04d}"
        digest = hashlib.sha256(name.encode()).hexdigest()
        metrics = {key: float(value * rng.uniform(0.9, 1.1)) for key, value in METRICS.items()}
        red, green, blue, gloss, metal = rng.random(5).tolist()
        options = {"target_size": 2700, "target_psnr": None, "seed": 0, "reciprocal": False}
        looks = {"colour": (red, green, blue), "gloss": gloss, "metalness": metal}
        found.append(Entry(name, f"{name}.binary", 34_992_012, digest, options, metrics, **looks))
    return found


def timed(call: Callable[[], object], repeats: int) -> tuple[float, float]:
    """The lowest and the median time of a call [ms]."""
    times: list[float] = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(1000 * (time.perf_counter() - started))
    return min(times), statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("material", type=Path)
    parser.add_argument("--materials", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=20)
    options = parser.parse_args()
    data, records = options.material.read_bytes(), entries(options.materials)
    wanted = records[len(records) // 2].name
    with tempfile.TemporaryDirectory() as folder:
        path, rows = Path(folder) / "x.smrlib", Path(folder) / "x.json"
        with path.open("wb") as out:
            size = library_file.write(out, records, lambda name: data)
        rows.write_text(json.dumps([vars(record) for record in records]))

        def fetch() -> None:
            with Library(path) as library:
                library[wanted]

        def parse() -> None:
            found = {row["name"]: row for row in json.loads(rows.read_bytes())}
            file.decode(data if wanted in found else b"")

        ours, theirs = (timed(call, options.repeats) for call in (fetch, parse))
    each = (size - len(data) * len(records)) / len(records)
    print(f"{len(records)} materials of {len(data)} B: {size / 1e6:.2f} MB, {each:.1f} B each for the index")
    for name, (low, middle) in ((".smrlib", ours), ("JSON rows", theirs)):
        print(f"open, fetch one, decode: {name:10} {low:6.1f} ms at best, {middle:6.1f} ms median")
    print(f"ratio of the best: {theirs[0] / ours[0]:.1f}")


if __name__ == "__main__":
    main()
