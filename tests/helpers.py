"""Small tables that many tests share, and what runs checks that must be able to fail."""

import json
import os
import shutil
import signal
import subprocess
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sommerl import BrdfTable, Lattice, SomManBrdf
from sommerl.commands.cli import main
from sommerl.compression.palette import GainsAndShapes
from sommerl.compression.smrl.codes import gain_values, shape_values
from sommerl.reflectance.nodes import NodeLattice
from sommerl.system.errors import SommerlError

SMALL = Lattice(8, 8, 12)
PATIENCE = 300  # s, after which what a test waits for is taken to hang: machines may be busy


def must_fail(check: Callable[..., Any], *broken: Any) -> None:
    """Runs a check on something broken on purpose: the check has to notice."""
    with pytest.raises(AssertionError):
        check(*broken)


def complaint(call: Callable[..., Any], *arguments: Any) -> str | None:
    """What a call says of bad input; None if it takes it. Any other error than Sommerl's own is let through."""
    try:
        call(*arguments)
    except SommerlError as error:
        return str(error)
    return None


def check_sentence(message: str | None, name: str) -> None:
    """One line that names the file, if there is anything to say."""
    assert message is None or ("\n" not in message and f"{name}" in message)


def launch(command: list[str], action: Any = signal.SIG_DFL, **options: Any) -> subprocess.Popen[str]:
    """A program that is at work, with pipes for what it says. action: what it does when it is interrupted."""
    return subprocess.Popen(
        command,
        **options,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Where tests run in the background, the signal is ignored, and programs that they start would ignore it, too.
        preexec_fn=lambda: signal.signal(signal.SIGINT, action),
    )


def tool(name: str) -> str:
    """A program of the system's. Where the tests are the gate (.ci/run), it has to be there."""
    found = shutil.which(name)
    if not found and not os.environ.get("SOMMERL_ALL_TOOLS"):
        pytest.skip(f"needs {name}")
    return found or name


def run_node(*arguments: Any, given: bytes | None = None) -> bytes:
    """What a program that Node runs writes, if it ends well. given: what it reads."""
    command = [tool("node"), *arguments]
    return subprocess.run(command, input=given, capture_output=True, check=True, timeout=PATIENCE).stdout


def random_directions(count: int, seed: int = 0) -> NDArray[np.float64]:
    """Unit vectors above the horizon, uniform over the hemisphere."""
    v = np.random.default_rng(seed).standard_normal((count, 3))
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    v[:, 2] = np.abs(v[:, 2])
    return v


def lambertian_table(albedo: float = 0.5, lattice: Lattice = SMALL) -> BrdfTable:
    values = np.full((*lattice.shape, 3), albedo / np.pi)
    return BrdfTable(values, lattice, name="lambertian")


def compact_material(lattice: NodeLattice, gains: int = 20, shapes: int = 15, *, name: str = "compact") -> SomManBrdf:
    """A material on nodes with random palettes and entries; some shapes are negative in a channel."""
    rng = np.random.default_rng(lattice.size)
    gain_codes = np.sort(rng.choice(max(200, gains), gains, replace=False))
    shape_codes = np.sort(rng.integers(-120, 121, (shapes, 2)), axis=0)
    gain_index, index = (rng.integers(0, count, lattice.size).astype(np.uint16) for count in (gains, shapes))
    return SomManBrdf(
        GainsAndShapes(gain_values(gain_codes), shape_values(shape_codes), 0.04),
        np.stack([gain_index, index]),
        lattice,
        name=name,
    )


def nearest_held(colour: Any) -> NDArray[np.float64]:
    """Of all colours with the luminance of one, and no negative channel, the nearest, found by trying: for each set of
    channels that are not 0, the foot of the perpendicular. Black if the luminance is not positive."""
    colour, y = np.asarray(colour, float), np.array([0.2126, 0.7152, 0.0722])
    feet = [np.zeros(3)]
    if colour @ y > 0:
        kept = [np.array([chosen >> c & 1 for c in range(3)], float) for chosen in range(1, 8)]
        moved = [one * (colour + y * ((colour - one * colour) @ y) / (one @ y**2)) for one in kept]
        feet = [foot for foot in moved if (foot >= 0).all()]
    return min(feet, key=lambda foot: ((foot - colour) ** 2).sum())


def moved_share(colour: Any) -> float:
    """The share of an even colour's energy that this moves."""
    return float(np.abs(nearest_held(colour) - colour).sum() / np.abs(colour).sum())


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[Any, str, str]:
    """Exit status, standard output and standard error of a command."""
    capsys.readouterr()
    try:
        status = main([str(argument) for argument in arguments])
    except SystemExit as stop:
        status = stop.code
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def run_json(capsys: pytest.CaptureFixture[str], *arguments: object) -> Any:
    """What a command prints with --json."""
    status, out, err = run(capsys, *arguments, "--json")
    assert (status, err) == (0, "")
    return json.loads(out)


@contextmanager
def interrupting(what: str):
    """A progress bar, in place of `console.progress`, under which a command is interrupted at its second step."""

    def advance(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    yield advance
