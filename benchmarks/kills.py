"""Is anything lost, half-written or left behind when a command is killed? Random kills of all commands that write.

    uv run python benchmarks/kills.py [--kills 50] [--seed 0] [--commands NAME,NAME] [--broken]

Each command is first run undisturbed, for its time and its files. Then SIGTERM, SIGINT or SIGKILL comes at a random
time, in a folder with nothing in it or with earlier files of the command. Afterwards every output has to be absent, as
it was, or as the undisturbed run has it; nothing else may be there, but temporary files after SIGKILL and a render's
checkpoint; the exit status has to be 130 (or 0, if the command was through), without a traceback. Run again, the
command has to end with 0 and the files of an undisturbed run, and nothing else. Prints a table; exits with 1 if any of
that is not so. --broken: with a writer that writes where the output is, which has to be noticed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

SIGNALS = signal.SIGTERM, signal.SIGINT, signal.SIGKILL
LONGEST = 900  # seconds that a command may take
CHECKPOINT = ".sommerl-part"
SMALL = ["--size", "32", "--spp", "64"]
# Of each command its arguments, within a folder that has INPUTS.
COMMANDS: dict[str, list[str]] = {
    "compress": ["compress", "nickel", "-o", "x.smrl", "--clusters", "64", "--epochs", "3"],
    "compress-several": ["compress", "nickel", "chrome", "-o", ".", "--clusters", "16", "--epochs", "1", "--overwrite"],
    "compress-compact": ["compress", "nickel", "-o", "x.smrl", "--target-size", "1500"],
    "convert-samples": ["convert", "samples.csv", "x.binary", "--overwrite"],
    "convert-rgl": ["convert", "nickel.smrl", "x.bsdf", "--overwrite"],
    "convert-source": ["convert", "nickel.smrl", "x.h"],
    "convert-snippet": ["convert", "nickel.smrl", "x.xml"],
    "compare": ["compare", "nickel", "nickel.smrl", "-o", "x.png", *SMALL],
    "fit": ["fit", "nickel", "-o", "x.json", "--model", "ward", "--samples", "2000", "--starts", "1"],
    "factor": ["factor", "nickel", "-o", "x.fbrdf", "--lobes", "1", "--terms", "2"],
    "render": ["render", "nickel.smrl", "--against", "nickel", "-o", "x.png", *SMALL],
    "render-exr": ["render", "--scene", "statue", "nickel.smrl", "--against", "nickel", "-o", "x.exr", *SMALL],
    "render-scene": ["render", "scene.xml", "-o", "x.exr", "--spp", "64"],
    "plot": ["plot", "nickel", "nickel.smrl", "-o", "x.pdf"],
    "demo": ["demo", "--out", "."],
    "paper": ["paper", "table1", "-o", ".", "--samples", "1000"],
}
INPUTS = "samples.csv", "nickel.smrl", "scene.xml"
SCENE = """<scene version="3.0.0">
    <integrator type="path"/>
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="32"/><integer name="height" value="32"/>
            <rfilter type="box"/>  <!-- with others, sums depend on the order of threads -->
        </film>
    </sensor>
    <emitter type="constant"/>
    <shape type="sphere"><bsdf type="sommerl"><string name="filename" value="nickel.smrl"/></bsdf></shape>
</scene>
"""
RUN = "from sommerl.__main__ import main; import sys; sys.exit(main())"
# Renders write their checkpoint after each of many passes, so that kills find some.
EAGER = "from sommerl.render import checkpoint, passes; checkpoint.SECONDS = 0.0; passes.SAMPLES_A_PASS = 2**14; "
BROKEN = """
import contextlib, time
from sommerl.system import files
@contextlib.contextmanager
def in_place(path):
    with open(path, "wb") as out:
        class Slow:
            def write(self, data):
                data = bytes(data)
                out.write(data[: len(data) // 2]); out.flush(); time.sleep(2); out.write(data[len(data) // 2 :])
        yield Slow()
files.atomic_write = in_place
"""


@dataclass(frozen=True)
class Good:
    """An undisturbed run: its time [s], and its files by name."""

    seconds: float
    files: dict[str, bytes]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", default=",".join(COMMANDS))
    parser.add_argument("--broken", action="store_true")
    options = parser.parse_args()
    names = options.commands.split(",")
    broken = BROKEN if options.broken else ""
    violations: list[str] = []
    counts: Counter[tuple[str, str]] = Counter()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        inputs = Path(folder) / "inputs"
        _prepare(inputs)
        good: dict[str, Good] = {}
        for kill in range(options.kills):
            name = names[kill % len(names)]
            program = [sys.executable, "-c", broken + (EAGER if name.startswith("render") else "") + RUN]
            if name not in good:
                good[name] = _undisturbed(program, COMMANDS[name], inputs, Path(folder) / "good")
            number, when, old = rng.choice(SIGNALS), rng.uniform(0, 1.05) * good[name].seconds, rng.random() < 0.5
            found = [*_killed(program, name, good[name], inputs, Path(folder) / "killed", number, when, old)]
            counts[name, number.name] += 1
            counts[name, "violations"] += len(found)
            for each in found:
                violations.append(f"{name}, {number.name} after {when:.2f} s: {each}")
                print(violations[-1], file=sys.stderr, flush=True)
    columns = [*(number.name for number in SIGNALS), "violations"]
    print(f"{'command':18}{'seconds':>8}" + "".join(f"{column:>12}" for column in columns))
    for name in good:
        print(f"{name:18}{good[name].seconds:8.1f}" + "".join(f"{counts[name, column]:12}" for column in columns))
    print(f"{options.kills} kills, seed {options.seed}: {len(violations)} violations")
    return 1 if violations else 0


def _prepare(folder: Path) -> None:
    """The inputs of all commands."""
    from sommerl import TrainOptions, builtin, load_table, save, train

    folder.mkdir()
    (folder / "scene.xml").write_text(SCENE)
    save(train(load_table("nickel"), TrainOptions(clusters=16, epochs=1))[0], folder / "nickel.smrl")
    import numpy as np

    angles = np.array([(i, 0, o, phi) for i in range(0, 81, 10) for o in range(0, 81, 10) for phi in range(0, 181, 20)])
    theta_i, _, theta_o, phi = np.radians(angles).T
    wi = np.stack([np.sin(theta_i), 0 * theta_i, np.cos(theta_i)], axis=-1)
    wo = np.stack([np.sin(theta_o) * np.cos(phi), np.sin(theta_o) * np.sin(phi), np.cos(theta_o)], axis=-1)
    rows = np.column_stack([angles, builtin("red-fabric").eval(wi, wo)])
    head = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    np.savetxt(folder / "samples.csv", rows, delimiter=",", header=head, comments="")


def _fresh(folder: Path, inputs: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(inputs, folder)


def _start(program: Sequence[str], arguments: Sequence[str], folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*program, *arguments],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell in the background ignores it
    )


def _undisturbed(program: Sequence[str], arguments: Sequence[str], inputs: Path, folder: Path) -> Good:
    _fresh(folder, inputs)
    process = _start(program, arguments, folder)
    _at_work(process)
    started = time.monotonic()
    _, said = process.communicate(timeout=LONGEST)
    if process.returncode:
        raise RuntimeError(f"{arguments}: {said}")
    return Good(time.monotonic() - started, _outputs(folder))


def _outputs(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name not in INPUTS}


def _at_work(process: subprocess.Popen[str]) -> None:
    """Waits until a process handles signals itself: before that, Python is being started. Or until it has ended."""
    while process.poll() is None:
        status = Path(f"/proc/{process.pid}/status").read_text()
        caught = re.search(r"SigCgt:\s*([0-9a-f]+)", status)
        if caught and int(caught[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.001)


def _killed(
    program: Sequence[str],
    name: str,
    good: Good,
    inputs: Path,
    folder: Path,
    number: signal.Signals,
    when: float,
    old: bool,
) -> Iterator[str]:
    """Kills a command, looks at what is there, and runs it again; says what is not as it should be."""
    _fresh(folder, inputs)
    before = {file: content + b"\nold" for file, content in good.files.items()} if old else {}
    for file, content in before.items():
        (folder / file).write_bytes(content)
    process = _start(program, COMMANDS[name], folder)
    _at_work(process)
    time.sleep(when)
    process.send_signal(number)
    _, said = process.communicate(timeout=LONGEST)
    allowed = (0, -signal.SIGKILL) if number == signal.SIGKILL else (0, 130)
    if process.returncode not in allowed:
        yield f"expected exit status {' or '.join(map(str, allowed))}, found {process.returncode} ({said.strip()})"
    if "Traceback" in said or "Exception ignored" in said:
        yield f"expected no traceback, found {said.strip()}"
    for file, content in _outputs(folder).items():
        if file.endswith(CHECKPOINT) or (number == signal.SIGKILL and file.startswith(".sommerl-")):
            continue
        if file not in good.files:
            yield f"expected nothing besides the outputs, found {file}"
        elif content != before.get(file) and not _same(file, content, good.files[file]):
            yield f"{file}: expected it as it was or whole, found {len(content)} bytes of another content"
    for file in before.keys() - _outputs(folder).keys():
        yield f"{file}: expected it as it was or whole, found none"
    yield from _again(program, name, good, folder)


def _again(program: Sequence[str], name: str, good: Good, folder: Path) -> Iterator[str]:
    process = _start(program, COMMANDS[name], folder)
    _, said = process.communicate(timeout=LONGEST)
    if process.returncode:
        yield f"run again: expected exit status 0, found {process.returncode} ({said.strip()})"
    found = _outputs(folder)
    if found.keys() != good.files.keys():
        yield f"run again: expected {sorted(good.files)}, found {sorted(found)}"
    for file in found.keys() & good.files.keys():
        if not _same(file, found[file], good.files[file]):
            yield f"run again: {file}: expected what an undisturbed run writes, found something else"


def _same(name: str, content: bytes, good: bytes) -> bool:
    """Whether a file is what an undisturbed run writes, but for the time that it took."""
    return _digest(name, content) == _digest(name, good)


def _digest(name: str, content: bytes) -> str:
    if name.endswith(".html"):
        content = re.sub(rb"<td>[0-9.]+ s</td>", b"", content)
    if name.endswith(".json"):
        try:
            found = json.loads(content)
        except ValueError:
            return ""
        for fit in found["fits"]:
            fit.pop("seconds")
        content = json.dumps(found).encode()
    return hashlib.sha256(content).hexdigest()


if __name__ == "__main__":
    sys.exit(main())
