"""What does each effort of the preset `compact` bring, and what does it cost? At one size, against the source itself.

    uv run python benchmarks/efforts.py MATERIAL... [--efforts 1 3 5 8 9] [--size 2700] [--json FILE]

Seconds are of the processor, over all threads, so that a busy machine counts little; they hold the whole of the
search, with the judge that decides between candidates where there are several. Prints Markdown.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from sommerl import Brdf, SommerlError, load
from sommerl.compression.compact.effort import DEFAULT
from sommerl.compression.compact.search import CompactOptions, compress
from sommerl.render.judge import Judge, score

COLUMNS = {
    "psnr_soft_db": "soft light [dB]",
    "psnr_lamp_db": "one lamp [dB]",
    "score": "score [dB]",
    "seconds": "seconds",
}


def measured(source: Brdf, judge: Judge, effort: int, size: int) -> dict[str, float]:
    """The judge's figures, its score, and the processor's seconds."""
    started = time.process_time()
    options = CompactOptions(target_size=size, effort=effort)
    material, _ = compress(source, options, quality=lambda candidate: score(judge.metrics(candidate)))
    seconds = time.process_time() - started
    metrics = judge.metrics(material)
    return metrics | {"score": score(metrics), "seconds": seconds}


def print_row(name: str, row: dict[int, dict[str, float]]) -> None:
    cells = (", ".join(f"{one[key]:.1f}" for key in COLUMNS) for one in row.values())
    print(f"| {name} |", " | ".join(cells), "|", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs="+", metavar="MATERIAL")
    parser.add_argument("--efforts", type=int, nargs="+", default=[1, 3, DEFAULT, 8, 9])
    parser.add_argument("--size", type=int, default=2700, help="of the file, in bytes")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    print(
        "| soft light [dB], one lamp [dB], seconds |", " | ".join(f"effort {effort}" for effort in options.efforts), "|"
    )
    print("|---" * (1 + len(options.efforts)) + "|")
    rows: dict[str, Any] = {}
    try:
        for path in options.materials:
            source = load(path)
            judge = Judge(source)
            judge.metrics(source)  # looks at the source once, before the clock runs
            rows[source.name] = {effort: measured(source, judge, effort, options.size) for effort in options.efforts}
            print_row(source.name, rows[source.name])
            if options.json:  # after each, so that nothing is lost
                options.json.write_text(json.dumps(rows, indent=2))
    except SommerlError as error:
        raise SystemExit(f"error: {error}") from error
    means = {
        effort: {key: float(np.mean([row[effort][key] for row in rows.values()])) for key in COLUMNS}
        for effort in options.efforts
    }
    print_row("mean", means)


if __name__ == "__main__":
    main()
