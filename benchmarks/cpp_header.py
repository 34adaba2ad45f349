"""How fast is include/sommerl.hpp? Ratios of CPU times, peer : ours, from one interleaved run.

    uv run python benchmarks/cpp_header.py POWITACQ FILE.bsdf FILE.binary [--bytes 8000] [--rounds 9]
        [--flags=-O3,-march=native] [--json FILE]

POWITACQ is powitacq_rgb.h of rgl-epfl/brdf-loader, with its .inl beside it. FILE.bsdf, a material of RGL's in RGB, is
what it reads, and is compressed to a compact material of so many bytes for us; FILE.binary, a table of MERL's kind, is
looked up as it is, and is compressed by the preset paper for us. All get the same 100,000 pairs of directions, on one
thread. `load` reads a file and makes it ready for `eval`; our sampler is fitted when it is first asked for, which `load
and sample` has, too. Prints the lines of the headers, too.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

from timing import Seconds, ratio, text

import sommerl

HERE = Path(__file__).resolve().parent
ROWS = {
    "eval, compact : powitacq": ("eval, powitacq", "eval, sommerl"),
    "eval, paper, nearest : MERL's reader on a table in single precision": ("paper, table", "paper, sommerl"),
    "sample and pdf : powitacq": ("sample, powitacq", "sample, sommerl"),
    "load : powitacq": ("load, powitacq", "load, sommerl"),
    "load and sample : powitacq's load": ("load, powitacq", "load and sample, sommerl"),
}


def lines(*paths: Path) -> int:
    return sum(len(path.read_text().splitlines()) for path in paths)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("powitacq", type=Path)
    parser.add_argument("bsdf", type=Path)
    parser.add_argument("binary", type=Path)
    parser.add_argument("--bytes", type=int, default=8000)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--flags", default="-O3,-march=native", help="of the compiler, separated by commas")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    include = HERE.parent / "include"
    with tempfile.TemporaryDirectory() as folder:
        compact, paper, program = (Path(folder) / name for name in ("compact.smrl", "paper.smrl", "program"))
        sommerl.save(sommerl.compress(sommerl.load(options.bsdf), target_size=options.bytes)[0], compact)
        sommerl.save(sommerl.train(sommerl.load_table(options.binary))[0], paper)
        flags = ["-std=c++17", *options.flags.split(","), f"-I{include}", f'-DPOWITACQ="{options.powitacq.resolve()}"']
        subprocess.run(["g++", *flags, HERE / "cpp_header.cpp", "-o", program], check=True)
        command = [program, compact, options.bsdf, paper, options.binary, str(options.rounds)]
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        size = compact.stat().st_size
    seconds: Seconds = {}
    for line in printed.splitlines():
        name, time = line.split("\t")
        seconds.setdefault(name, []).append(float(time))
    results = {name: ratio(seconds, peer, ours) for name, (peer, ours) in ROWS.items()}
    print(f"compact: {size} bytes; flags: {options.flags}\n\n| ours : peer | times faster, median (least-most) |")
    print("|---|---|")
    for name, value in results.items():
        print(f"| {name} | {text(value)} |")
    print("\n| our contestants | median |\n|---|---|")
    for name, times in seconds.items():
        middle = sorted(times)[len(times) // 2]
        print(f"| {name} | {f'{middle * 1e3:.2f} ms' if name.startswith('load') else f'{middle * 1e4:.0f} ns'} |")
    inl = options.powitacq.with_suffix(".inl")
    print(f"\nlines: {lines(include / 'sommerl.hpp')}, powitacq {lines(options.powitacq, inl)}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
