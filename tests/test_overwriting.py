"""No command replaces what is not Sommerl's own, under any of the names that it writes to."""

import os
import threading
from pathlib import Path

import numpy as np
import pytest
from helpers import must_fail, run, run_json

from sommerl.commands.cli import main

LIBRARY = Path(__file__).parent / "golden" / "library-1.smrlib"
SMALL = ["--size", "8", "--spp", "1"]
# Of each command its options, with {} for the folder, and every file that it writes.
COMMANDS = {
    "demo": (["demo", "--out", "{}"], ["index.html", "blue-metallic-paint.smrl", "reference.png", "difference.png"]),
    "compress": (["compress", "nickel", "-o", "{}/x.smrl"], ["x.smrl"]),
    "compress several": (["compress", "nickel", "chrome", "-o", "{}"], ["nickel.smrl", "chrome.smrl"]),
    "convert": (["convert", "nickel", "{}/x.XML"], ["x.XML"]),
    "convert samples": (["convert", "{}/in/x.csv", "{}/x.binary"], ["x.binary", "x.coverage.png"]),
    "blend": (["blend", "nickel", "chrome", "0.5", "-o", "{}/x.smrl"], ["x.smrl"]),
    "library pack": (["library", "pack", str(LIBRARY), "-o", "{}/x.smrlib"], ["x.smrlib"]),
    "library sheet": (["library", "sheet", str(LIBRARY), "-o", "{}/x.html"], ["x.html"]),
    "compare": (["compare", "nickel", "chrome", "-o", "{}/x.png", *SMALL], ["x.png"]),
    "fit": (["fit", "nickel", "-o", "{}/x.json", "--picture", "{}/x.png"], ["x.json", "x.png"]),
    "factor": (["factor", "nickel", "-o", "{}/x.fbrdf"], ["x.fbrdf"]),
    "render": (
        ["render", "nickel", "--against", "chrome", "-o", "{}/x.png", *SMALL],
        ["x.png", "x.reference.png", "x.against.png"],
    ),
    "render to EXR": (
        ["render", "nickel", "--against", "chrome", "-o", "{}/x.exr", *SMALL],
        ["x.exr", "x.reference.exr", "x.difference.exr"],
    ),
    "render a scene": (["render", "{}/in/scene.xml", "-o", "{}/x.exr"], ["x.exr"]),
    "plot": (["plot", "nickel", "-o", "{}/x.pdf"], ["x.pdf"]),
    "paper": (["paper", "-o", "{}"], ["report.html", "report.md", "report.json"]),
    "paper, one item": (["paper", "fig3", "-o", "{}"], ["fig3.html", "fig3.md", "fig3.json"]),
}
CASES = [(command, output) for command, (_, outputs) in COMMANDS.items() for output in outputs]


def write_samples(path):
    angles = [(i, 0, o, phi) for i in (10, 30, 50, 70) for o in (20, 40, 60) for phi in (0, 60, 120, 180)]
    path.parent.mkdir(exist_ok=True)
    head = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    np.savetxt(path, [(*each, 1, 1, 1) for each in angles], delimiter=",", header=head, comments="")


def check_kept(capsys, options, path):
    before = path.read_bytes()
    status, out, err = run(capsys, *options)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {path}: there is already a file of this name")
    assert err.endswith(": choose another name, or replace it with --overwrite\n")
    assert path.read_bytes() == before


@pytest.mark.parametrize(("command", "output"), CASES)
def test_a_file_of_the_users_is_kept(capsys, tmp_path, command, output):
    write_samples(tmp_path / "in" / "x.csv")
    options = [each.format(tmp_path) for each in COMMANDS[command][0]]
    path = tmp_path / output
    path.write_bytes(b"the user's own")
    before = sorted(tmp_path.rglob("*"))
    check_kept(capsys, options, path)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_command_that_replaces_it_is_noticed(capsys, tmp_path):
    (tmp_path / "x.xml").write_bytes(b"the user's own")
    must_fail(check_kept, capsys, ["convert", "nickel", tmp_path / "x.xml", "--overwrite"], tmp_path / "x.xml")


QUICK = {
    "compress": ["--clusters", "4", "--epochs", "1"],
    "convert": [],
    "library pack": [],
    "library sheet": [],
    "convert samples": ["--overwrite"],  # of a MERL table, there is no telling who wrote it
    "paper, one item": [],
    "render": [],
    "render to EXR": [],
}


SAMPLES_SAY = ("extrapolated", "more than there is")  # a few samples of f_r = 1


@pytest.mark.parametrize("command", QUICK)
def test_what_a_command_wrote_it_replaces(capsys, tmp_path, command):
    write_samples(tmp_path / "in" / "x.csv")
    options = [each.format(tmp_path) for each in COMMANDS[command][0]] + QUICK[command]
    for _ in range(2):
        status, _, err = run(capsys, *options)
        warnings = len(SAMPLES_SAY) if command == "convert samples" else 0
        assert (status, err.count("\n")) == (0, warnings)
        assert all(each in err for each in SAMPLES_SAY[:warnings])
    if command == "convert samples":
        check_kept(capsys, options[:-1], tmp_path / "x.binary")


def test_every_command_that_writes_has_the_option(capsys):
    for command, (options, _) in COMMANDS.items():
        assert "--overwrite" in run(capsys, *options[: 1 + (options[0] == "library")], "--help")[1], command
    assert "--overwrite" not in run(capsys, "info", "--help")[1]


def test_overwrite_does_not_extend_to_inputs(capsys, tmp_path):
    assert main(["convert", "nickel", f"{tmp_path}/x.json"]) == 0
    path = tmp_path / "x.csv"
    write_samples(path)
    (tmp_path / "link.xml").symlink_to(path)
    status, _, err = run(capsys, "convert", path, tmp_path / "link.xml", "--overwrite")
    assert status == 2
    assert "expected an output other than the input" in err


def test_a_pipe_takes_the_place_of_a_file(capsys, tmp_path):
    os.mkfifo(tmp_path / "x.xml")
    read = []
    reader = threading.Thread(target=lambda: read.append((tmp_path / "x.xml").read_bytes()))
    reader.start()
    result = run_json(capsys, "convert", "nickel", tmp_path / "x.xml")
    reader.join()
    assert result["bytes_disk"] is None
    assert read[0].startswith(b"<scene")
