"""Is anything lost, half-written or done twice when the build of a library is killed? Kills at random moments.

    uv run python benchmarks/library_kills.py [--kills 50] [--count 100] [--seed 0] [--broken]

A library of `count` small materials is built undisturbed. Then, `kills` times, it is built anew, and killed by SIGKILL
at a random moment: the command alone, whose processes then have to end by themselves, or all of them. What is there has
to be whole: every record readable, every file that has one as it says, and nothing else but temporary files and a file
whose record was about to be written. Built again, it has to end with 0, with nothing done again that was there, and
with the same bytes in every file as the undisturbed one. Prints what was not so; exits with 1 if anything was not.
--broken: with a writer that writes where the output is, which has to be noticed.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sommerl import BrdfTable, Lattice, TrainOptions, save, train
from sommerl.library.index import records
from sommerl.library.verify import verify
from sommerl.system.errors import SommerlError

QUICK = ["--clusters", "2", "--epochs", "1", "--jobs", "2"]
BROKEN = """
import time
from contextlib import contextmanager
from pathlib import Path
from sommerl.library import build
@contextmanager
def in_place(path):
    class Slow:
        def write(self, data):
            with open(path, "wb") as out:
                out.write(data[:200]); out.flush(); time.sleep(0.5); out.write(data[200:])
    yield Slow()
build.atomic_write = in_place
"""
RUN = "from sommerl.__main__ import main; import sys; sys.exit(main())"
LONGEST = 60.0  # seconds in which processes have to end after the one that began them


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--broken", action="store_true")
    options = parser.parse_args()
    program = (BROKEN if options.broken else "") + RUN
    rng, violations, before = random.Random(options.seed), 0, 0
    with tempfile.TemporaryDirectory() as name:
        sources, good, killed = (Path(name) / each for each in ("sources", "good", "killed"))
        _make_sources(sources, options.count)
        started = time.monotonic()
        if _start(program, sources, good).wait():
            raise RuntimeError("the undisturbed build failed")
        seconds = time.monotonic() - started
        for kill in range(options.kills):
            shutil.rmtree(killed, ignore_errors=True)
            when, all_of_them = rng.uniform(0, 1.02) * seconds, rng.random() < 0.5
            process = _start(program, sources, killed)
            time.sleep(when)
            _kill(process, all_of_them=all_of_them)
            there = {path: path.stat().st_ino for path in _recorded(killed)}
            before += len(there)
            found = [*_half(killed), *_again(program, sources, killed, good, there)]
            violations += len(found)
            said = "; ".join(found) or "nothing lost"
            print(f"kill {kill + 1} after {when:.1f} s, {len(there)} done before: {said}", file=sys.stderr, flush=True)
    print(f"{options.count} materials in {seconds:.1f} s, {options.kills} kills, seed {options.seed}")
    print(f"materials done before the kills: {before}; violations: {violations}")
    return 1 if violations else 0


def _make_sources(folder: Path, count: int) -> None:
    lattice, rng = Lattice(8, 8, 12), np.random.Generator(np.random.PCG64(0))
    for number in range(count):
        path = folder / f"{number % 7}" / f"m{number}.smrl"
        path.parent.mkdir(parents=True, exist_ok=True)
        table = BrdfTable(rng.random((*lattice.shape, 3)), lattice, name=path.stem)
        save(train(table, TrainOptions(clusters=4, epochs=1))[0], path)


def _start(program: str, sources: Path, output: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", program, "library", "build", str(sources), "-o", str(output), *QUICK]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, stdout=quiet, stderr=quiet, start_new_session=True)


def _kill(process: subprocess.Popen[bytes], *, all_of_them: bool) -> None:
    """Kills a build, and waits until all of its processes are gone."""
    if all_of_them:
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()
    until = time.monotonic() + LONGEST
    while time.monotonic() < until:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.02)
    raise RuntimeError(f"processes of a killed build go on after {LONGEST:.0f} s")


def _recorded(library: Path) -> list[Path]:
    """The files that have a record."""
    if not (library / ".sommerl").is_dir():
        return []
    try:
        return [library / record.file for record in records(library).values()]
    except SommerlError:  # which is told as a violation
        return []


def _half(library: Path) -> Iterator[str]:
    """What is not whole in a library whose build was killed."""
    if not (library / ".sommerl").is_dir():
        return
    try:
        _, faults = verify(library)
    except SommerlError as error:
        yield str(error)
        return
    unknown = [fault.file for fault in faults if not fault.name]
    yield from (fault.sentence for fault in faults if fault.name)
    if len(unknown) > 1:
        yield f"expected one file at most whose record was about to be written, found {len(unknown)}"
    for file in unknown:
        ends = subprocess.run(
            [sys.executable, "-m", "sommerl", "info", str(library / file)], capture_output=True, text=True
        )
        if ends.returncode:
            yield ends.stderr.strip()


def _again(program: str, sources: Path, library: Path, good: Path, there: dict[Path, int]) -> Iterator[str]:
    status = _start(program, sources, library).wait()
    if status:
        yield f"built again: expected exit status 0, found {status}"
    twice = [path for path, number in there.items() if path.stat().st_ino != number]
    if twice:
        yield f"built again: expected nothing to be done twice, found {len(twice)}"
    found, wanted = _contents(library), _contents(good)
    if found.keys() != wanted.keys():
        yield f"built again: expected the files of an undisturbed build, found others: {found.keys() ^ wanted.keys()}"
    changed = [name for name in found.keys() & wanted.keys() if found[name] != wanted[name]]
    if changed:
        yield f"built again: expected the bytes of an undisturbed build, found others in {', '.join(changed)}"


def _contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


if __name__ == "__main__":
    sys.exit(main())
