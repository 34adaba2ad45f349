"""How much faster do two processes build a library than one, and how does Dask's scheduler with two workers compare?

    uv run python benchmarks/library_build.py SOURCES [--count 20] [--rounds 3] [-- OPTIONS OF LIBRARY BUILD]

SOURCES is a folder of materials, as benchmarks/stand_in_library.py makes it; the first `count` of them by name are
built into new folders, by `--jobs 1`, by `--jobs 2` and by a cluster of two workers of one thread on this machine, in
turn, `rounds` times. Times are of the whole command, with the start of its processes; the cluster's are started before.
Prints them, and the ratios of the medians. Without OPTIONS, `--target-size 2700`.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

# Of workers, as of processes of the command line.
ONE_THREAD = dict.fromkeys(("SOMMERL_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", type=Path)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    ours, _, theirs = _split(sys.argv[1:])
    options = parser.parse_args(ours)
    asked = theirs or ["--target-size", "2700"]
    seconds: dict[str, list[float]] = {"--jobs 1": [], "--jobs 2": [], "cluster": []}
    with tempfile.TemporaryDirectory() as name, _cluster(Path(name)) as address:
        sources = Path(name) / "sources"
        _copy(options.sources, sources, options.count)
        for number in range(options.rounds):
            for how, found in seconds.items():
                engine = ["--cluster", address] if how == "cluster" else how.split()
                found.append(_built(sources, Path(name) / f"{number} {how}", [*engine, *asked]))
                print(f"round {number + 1}, {how}: {found[-1]:.1f} s", file=sys.stderr, flush=True)
    middle = {how: statistics.median(found) for how, found in seconds.items()}
    print(f"{options.count} materials, {' '.join(asked)}, {options.rounds} rounds in turn, median [s]:")
    for how, found in seconds.items():
        print(f"  {how:10}{middle[how]:8.1f}   ({', '.join(f'{each:.1f}' for each in found)})")
    print(f"2 processes : 1, throughput   {middle['--jobs 1'] / middle['--jobs 2']:.2f}")
    print(f"Dask, 2 workers : 2 processes, time   {middle['cluster'] / middle['--jobs 2']:.2f}")
    return 0


def _split(words: list[str]) -> tuple[list[str], str, list[str]]:
    at = words.index("--") if "--" in words else len(words)
    return words[:at], "--", words[at + 1 :]


def _copy(sources: Path, folder: Path, count: int) -> None:
    files = sorted(path for path in sources.rglob("*") if path.is_file())[:count]
    for path in files:
        target = folder / path.relative_to(sources)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)


def _built(sources: Path, output: Path, options: list[str]) -> float:
    command = [sys.executable, "-m", "sommerl", "library", "build", str(sources), "-o", str(output), *options]
    started = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - started


@contextmanager
def _cluster(folder: Path) -> Generator[str]:
    """The address of a scheduler with two workers."""
    file = folder / "scheduler.json"
    with ExitStack() as stack:

        def start(what: str, *options: str) -> None:
            command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(file), *options]
            environment = os.environ | ONE_THREAD
            quiet = subprocess.DEVNULL
            process = subprocess.Popen([*command, "--no-dashboard"], env=environment, stdout=quiet, stderr=quiet)
            stack.callback(process.wait)
            stack.callback(process.kill)

        start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-jupyter")
        while not file.exists():
            time.sleep(0.1)
        for _ in range(2):
            start("worker", "--nthreads", "1", "--no-nanny")
        yield json.loads(file.read_text())["address"]


if __name__ == "__main__":
    sys.exit(main())
