"""Which tests are slow? Writes tests/slow.txt from the times that pytest prints.

    SOMMERL_ALL_TOOLS=1 uv run pytest -m "slow or not slow" --durations 0 -vv > times.log
    uv run python benchmarks/slow_tests.py times.log [--least 1.5]

A test function is slow if all its cases together, with what is made for them, take longer than `--least` seconds; `uv
run pytest` leaves it out, `.ci/run` does not. Prints how much time is left to the others. Times depend on the machine,
and on what else it does: the list is made anew when `uv run pytest` takes too long, not with every change, and with
`../shared` beside the clone, whose tests are in it, too.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from pathlib import Path

SLOW = Path(__file__).resolve().parents[1] / "tests" / "slow.txt"
DURATION = re.compile(r"^\s*([\d.]+)s (?:call|setup|teardown)\s+(\S+?::\w+)", re.MULTILINE)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--least", type=float, default=1.5, metavar="SECONDS")
    options = parser.parse_args()
    seconds: Counter[str] = Counter()
    for time, name in DURATION.findall(options.log.read_text("utf-8", "replace")):
        seconds[name] += float(time)
    slow = {name: time for name, time in seconds.items() if time > options.least}
    SLOW.write_text("".join(f"{name}\n" for name in sorted(slow)))
    left = sum(seconds.values()) - sum(slow.values())
    print(f"{len(slow)} of {len(seconds)} functions are slow: {sum(slow.values()):.0f} s; the others take {left:.0f} s")


if __name__ == "__main__":
    main()
