"""Long work says how far it is where there is no terminal, and which files were written."""

import math
import sys
import time
from functools import partial

import pytest
from helpers import must_fail, run

from sommerl.commands import console, fit
from sommerl.formats import fits


def check_told(capsys, interval, monkeypatch, lines):
    monkeypatch.setattr(console, "INTERVAL", interval)
    with console.progress("training x") as advance:
        for done in (1, 2, 3, 4):
            advance(done, 4)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert [line.partition(" after ")[0] for line in captured.err.splitlines()] == lines


def test_a_line_at_intervals(capsys, monkeypatch):
    """None at the end, which is told otherwise, and none of work that is done before."""
    lines = ["training x: 25%", "training x: 50%", "training x: 75%"]
    check_told(capsys, 0.0, monkeypatch, lines)
    check_told(capsys, math.inf, monkeypatch, [])
    must_fail(check_told, capsys, math.inf, monkeypatch, lines)


def test_the_clock_decides(capsys, monkeypatch):
    """Steps of three seconds, and a line every ten."""
    monkeypatch.setattr(console, "INTERVAL", 10.0)
    clock = iter(range(0, 1000, 3))
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    with console.progress("rendering") as advance:
        for done in range(1, 11):
            advance(done, 20)
    assert capsys.readouterr().err.splitlines() == [
        "rendering: 20% after 12 s, some 48 s left",
        "rendering: 40% after 24 s, some 36 s left",
    ]


def test_a_full_standard_error_stops_no_work(monkeypatch):
    class Full:
        def isatty(self):
            return False

        def write(self, text):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(console, "INTERVAL", 0.0)
    monkeypatch.setattr(sys, "stderr", Full())
    with console.progress("x") as advance:
        advance(1, 2)


@pytest.mark.parametrize("flags", [[], ["--json"]])
def test_commands_tell_it_on_standard_error(capsys, tmp_path, monkeypatch, flags):
    monkeypatch.setattr(console, "INTERVAL", 0.0)
    status, out, err = run(capsys, "factor", "nickel", "-o", tmp_path / "x.fbrdf", "--lobes", 1, "--terms", 1, *flags)
    assert status == 0
    assert err.startswith("factoring nickel (SGD stand-in): ")
    assert "factoring" not in out


LAMBERTIAN = {"family": "lambertian", "albedo": [0.5, 0.5, 0.5]}


def check_wrote(out, *paths):
    assert "".join(out.split()).endswith("Wrote" + ",".join(map(str, paths)))


def test_what_was_written_is_printed(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(fit, "compare_on_sphere", partial(fit.compare_on_sphere, size=32, spp=8))
    paths = [tmp_path / name for name in ("x.json", "x.png")]
    few = ["--model", "lambertian", "--samples", "1000", "--starts", "1"]
    half = tmp_path / "half.json"
    fits.write(half, "half", [{"model": "lambertian", "parameters": [LAMBERTIAN]}])
    # What is fitted is exactly that: the picture's PSNR is infinite, which JSON has no number for.
    out = run(capsys, "fit", half, *few, "-o", paths[0], "--picture", paths[1])[1]
    check_wrote(out, *paths)
    must_fail(check_wrote, out, *paths[::-1])
    assert "Wrote" not in run(capsys, "fit", half, *few)[1]
