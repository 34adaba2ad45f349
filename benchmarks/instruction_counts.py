"""Counts the instructions of training, lookup, encoding and decoding on fixed inputs, and compares with what is kept.

    uv run python benchmarks/instruction_counts.py [--keep WHY]

Times differ from run to run; instructions, counted by Callgrind (valgrind), hardly do. What is kept is in
instruction_counts.toml, with the compiler and the reason of the last change. Exit status 1 if one has grown by more
than 3 %. --keep writes the file anew; WHY says why they grew.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path

RUST = Path(__file__).resolve().parents[1] / "rust"
KEPT = Path(__file__).with_suffix(".toml")
WORKS = ("train", "lookup", "encode", "encode-decode")
MOST_GROWTH = 0.03


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", metavar="WHY", help="keep today's counts, and why they are what they are")
    options = parser.parse_args()
    build = [
        "cargo",
        "build",
        "--quiet",
        "--release",
        "--locked",
        "--package",
        "sommerl-kernels",
        "--example",
        "counted",
    ]
    subprocess.run(build, cwd=RUST, check=True)
    found = {work: counted(work) for work in WORKS}
    if options.keep:
        compiler = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.strip()
        rows = "".join(f"{work} = {count}\n" for work, count in found.items())
        KEPT.write_text(f'compiler = "{compiler}"\nwhy = "{options.keep}"\n\n[instructions]\n{rows}')
    kept = tomllib.loads(KEPT.read_text())["instructions"]
    for work in WORKS:
        print(f"{work:14} {found[work]:>13,}  {found[work] / kept[work] - 1:+.1%}")
    if more := grown(found, kept):
        print(f"grown by more than {MOST_GROWTH:.0%}: {', '.join(more)}; `--keep WHY` keeps it", file=sys.stderr)
    return 1 if more else 0


def grown(found: Mapping[str, int], kept: Mapping[str, int]) -> list[str]:
    """The works that take more than is allowed."""
    return [work for work in WORKS if found[work] > kept[work] * (1 + MOST_GROWTH)]


def counted(work: str) -> int:
    """The instructions of one work, and of the process around it."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out"]
        command += [str(RUST / "target" / "release" / "examples" / "counted"), work]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    (count,) = re.findall(r"Collected : (\d+)", said)
    return int(count)


if __name__ == "__main__":
    sys.exit(main())
