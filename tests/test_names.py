"""Names of files and materials that mean something to a terminal, to matplotlib, to rich or to a compiler."""

import json
import os
import re

import numpy as np
import pytest
from helpers import compact_material, must_fail, random_directions, run

from sommerl import NAMES, builtin, load, save
from sommerl.commands.demo import write_page
from sommerl.formats import scattered
from sommerl.formats.shader.head import comment
from sommerl.plots.contact_sheet import captioned
from sommerl.plots.page import text
from sommerl.reflectance.nodes import NodeLattice

LATTICE = NodeLattice((0, 90, 180), (0, 0, 0), ((0, 90, 180),), ((0, 90),))
NASTY = [
    "$x_{",
    "$$",
    r"\frac{a}$b$",
    "_under",
    "[red]x[/red]",
    "[/]",
    "a\x1b[31mb",
    "a\nb",
    "%s {x} {0}",
    "*/ ??/",
    "\udcff",
]


def check_shown(out):
    assert all(c.isprintable() or c == "\n" for c in out)


@pytest.mark.parametrize("name", [name for name in NASTY if "/" not in name])
def test_every_command_takes_every_name(capsys, tmp_path, name):
    path = tmp_path / f"{name}.smrl"
    save(compact_material(LATTICE, 5, 4, name=name), path)
    for arguments in (["info", path], ["plot", path, "-o", tmp_path / f"{name}.png", "--kind", "lobes"]):
        status, out, err = run(capsys, *arguments)
        assert (status, err) == (0, "")
        check_shown(out)
    must_fail(check_shown, "\x1b")
    assert run(capsys, "convert", path, tmp_path / f"{name}.h")[0] == 0
    assert run(capsys, "convert", path, tmp_path / "x.json")[0] == 0
    if "[" in name and name.isprintable():
        assert name in run(capsys, "info", path)[1].replace("\n", "")


@pytest.mark.parametrize("name", [name for name in NASTY if "/" not in name])
def test_samples_with_such_names(capsys, tmp_path, monkeypatch, name):
    monkeypatch.setattr(scattered, "FEWEST_NODES", 1000)
    a, b = (w[w[:, 2] > 0.1][:60] for w in (random_directions(100, s) for s in (1, 2)))
    angles = [x for w in (a, b) for x in (np.arccos(w[:, 2]), np.arctan2(w[:, 1], w[:, 0]))]
    rows = np.column_stack([*angles, builtin(NAMES[0]).eval(a, b), np.zeros(60)])
    header = f"theta_i_rad,phi_i_rad,theta_o_rad,phi_o_rad,r,g,b,{name.replace(chr(10), ' ')}"
    content = header + "\n" + "\n".join(",".join(f"{x:.6g}" for x in row) for row in rows)
    path = tmp_path / f"{name}.csv"
    path.write_bytes(content.encode("utf-8", "replace"))
    status, out, err = run(capsys, "convert", path, tmp_path / "x.binary", "--json")
    assert status == 0
    check_shown(err)  # a warning of what is extrapolated
    assert os.path.exists(json.loads(out)["coverage_image"])
    path.write_text(content.replace("theta_o_rad", "[bold]").encode("utf-8", "replace").decode())
    status, out, err = run(capsys, "info", path)
    assert (status, out) == (1, "")
    assert "theta_o" in err
    check_shown(err)


@pytest.mark.parametrize("name", NASTY)
def test_titles_and_pages(tmp_path, name):
    assert text(name).removeprefix("\u200b").isprintable()  # which keeps legends from leaving out what is under_scored
    assert len(re.findall(r"(?<!\\)\$", text(name))) == 0
    assert captioned([(name, np.zeros((40, 40, 3), np.uint8))], 1, [name]).shape[2] == 3
    write_page(tmp_path / "x.html", name, [(name, np.zeros((4, 4, 3), np.uint8))], {name: name}, f"<b>{name}")
    page = (tmp_path / "x.html").read_text()
    check_shown(page)
    assert "&lt;b&gt;" in page


@pytest.mark.parametrize("name", [*NASTY, "a\\", "a??/", "a ???/", "/* */", "**/", "*" * 1000])
def test_comments_end_where_they_should(name):
    found = comment(name)
    assert found.isprintable()
    assert len(found) <= 300
    assert not any(mark in found for mark in ("\\", "??", "*/"))


def test_names_of_options(capsys, tmp_path):
    of_options = ["render", "--scene", "\x1b"], ["\x1b"], ["info", "\x1bx", "--\x1b"]
    for arguments, expected in ((["info", "\x1b[2J", "a"], 1), *((each, 2) for each in of_options)):
        status, out, err = run(capsys, *arguments)
        assert (status, out) == (expected, "")
        check_shown(err)
    save(compact_material(LATTICE, 5, 4), tmp_path / "x.smrl")
    assert load(tmp_path / "x.smrl")
