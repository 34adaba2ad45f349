"""One new thing of each kind, added by its row alone as CONTRIBUTING.md says, is everywhere that it should be."""

import importlib
import re
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import lambertian_table, must_fail, run, run_json

from sommerl import TrainOptions, save, train
from sommerl.commands import cli
from sommerl.commands.arguments import Arguments, positional
from sommerl.commands.parser import add_command
from sommerl.formats import fits
from sommerl.formats.format import Format
from sommerl.formats.registry import FORMATS
from sommerl.models.family import Family
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.reflectance.distance import TABLE_METRICS
from sommerl.reflectance.metric import Metric
from sommerl.render.metrics import METRICS
from sommerl.render.scene_registry import SCENES, SceneKind
from sommerl.render.scenes import sphere
from sommerl.sampling.cosine import CosineSampler
from sommerl.sampling.named import SAMPLERS

ROOT = Path(__file__).parents[1]
SMALL = ["--size", "8", "--spp", "1"]
HALF = {"model": "half", "parameters": [{"family": "half", "albedo": [1, 1, 1]}]}


def half(angles):
    """f_r of Lambert's material, halved."""
    return 0.0 * angles.cos_i + 0.5 / np.pi


def read_grey(path, data):
    return MultiLobe(path.stem, [Lobe(FAMILIES["lambertian"], (data[4] / 100,) * 3, {})])


def write_grey(brdf, path):
    path.write_bytes(b"GREY" + bytes([round(100 * np.pi * brdf.eval([0, 0, 1], [0, 0, 1])[0])]))
    return brdf


def square(contents):
    return sphere(contents.brdfs[0], contents.environment, sampler=contents.sampler, size=contents.size)


@dataclass(frozen=True)
class Plain(CosineSampler):
    name = "plain"


@dataclass(frozen=True, kw_only=True)
class GreetArguments(Arguments):
    name: str = positional("NAME", help="who is greeted")


def greet(options: GreetArguments):
    return {"greeting": options.name}


def greeting(add):
    add_command(add, "greet", greet, GreetArguments, "Says a name.", "sommerl greet nickel")


# The new thing of each kind, by the table that it is a row of.
NEW = {
    "FORMATS": Format(
        "grey", (".grey",), "a percentage", sniff=lambda head: head[:4] == b"GREY", read=read_grey, largest=5,
        write=write_grey,
    ),
    "FAMILIES": Family("half", "nobody", (), half, True, None),
    "SAMPLERS": Plain,
    "SCENES": SceneKind("a sphere again", square, ("nickel",)),
    "METRICS": Metric("largest", "largest difference", lambda pair: float(np.max(pair.candidate8)), "{:.0f}".format),
    "TABLE_METRICS": Metric("cells", "table: cells", lambda a, b, lattice: float(lattice.size), "{:.0f}".format),
    "COMMANDS": SimpleNamespace(arguments=greeting),
}  # fmt: skip


@pytest.fixture
def add(monkeypatch):
    """Adds the row of a table."""
    tables = {"FORMATS": FORMATS, "METRICS": METRICS, "TABLE_METRICS": TABLE_METRICS}
    named = {"FAMILIES": (FAMILIES, "half"), "SAMPLERS": (SAMPLERS, "plain"), "SCENES": (SCENES, "square")}
    appended = []

    def row(table):
        if table in tables:
            tables[table].append(NEW[table])
            appended.append(tables[table])
        elif table in named:
            monkeypatch.setitem(*named[table], NEW[table])
        else:
            monkeypatch.setattr(cli, table, (*getattr(cli, table), NEW[table]))

    yield row
    for table in appended:
        table.pop()


def check_format(capsys, folder):
    fits.write(folder / "x.json", "grey", [{"model": "lambertian", "parameters": [GREY]}])
    run_json(capsys, "convert", folder / "x.json", folder / "x.grey", "--overwrite")
    assert (folder / "x.grey").read_bytes() == b"GREY\x28"
    (folder / "any name").write_bytes(b"GREY\x28")
    assert run_json(capsys, "info", folder / "any name")["lobes"] == [GREY]
    assert "  .grey                 grey: a percentage\n" in run(capsys, "--help")[1]
    assert "  .grey                 grey: a percentage\n" in run(capsys, "convert", "--help")[1]
    (folder / "x.txt").write_text("hello")
    assert "grey .grey)" in run(capsys, "info", folder / "x.txt")[2]
    assert ".grey" in run(capsys, "convert", "nickel", "x.foo")[2]


GREY = {"family": "lambertian", "albedo": [0.4, 0.4, 0.4]}


def check_model(capsys, folder):
    fits.write(folder / "x.json", "any", [HALF])
    assert run_json(capsys, "info", f"{folder / 'x.json'}:half")["lobes"][0]["family"] == "half"
    assert re.search(r"^  half$", run(capsys, "fit", "--help")[1], re.MULTILINE)
    fit = run_json(capsys, "fit", "nickel", "--model", "half", "--samples", 1000, "--starts", 1)["fits"][0]
    assert fit["model"] == "half"


def check_sampler(capsys, folder):
    options = "nickel", "-o", folder / "x.png", "--sampler", "plain", *SMALL
    assert run_json(capsys, "render", *options)["sampler"] == "plain"


def check_scene(capsys, folder):
    result = run_json(capsys, "render", "--scene", "square", "-o", folder / "x.png", *SMALL)
    assert (result["scene"], result["material"]) == ("square", "nickel (SGD stand-in) (formula)")
    assert "  square      a sphere again\n" in run(capsys, "render", "--help")[1]


def check_image_metric(capsys, folder):
    options = "nickel", "chrome", *SMALL
    assert run_json(capsys, "compare", *options)["largest"] > 0
    assert re.search(r"largest difference .* \d+ ", run(capsys, "compare", *options)[1])
    against = "nickel", "--against", "chrome", "-o", folder / "x.png", *SMALL
    assert run_json(capsys, "render", *against)["largest"] > 0


def check_table_metric(capsys, folder):
    table = lambertian_table()
    save(train(table, TrainOptions(clusters=1, epochs=1))[0], folder / "grey.smrl")
    output = folder / "again.smrl"
    options = "compress", folder / "grey.smrl", "-o", output, "--clusters", 1, "--epochs", 1
    assert run_json(capsys, *options)["metrics"]["cells"] == table.lattice.size
    assert run_json(capsys, "info", output)["metrics"]["cells"] == table.lattice.size
    assert re.search(rf"table: cells .* {table.lattice.size} ", run(capsys, *options)[1])
    both = folder / "grey.smrl", output, *SMALL
    assert run_json(capsys, "compare", *both)["table_cells"] == table.lattice.size


def check_command(capsys, folder):
    assert run_json(capsys, "greet", "nickel") == {"greeting": "nickel", "warnings": []}
    assert "    greet     says a name\n" in run(capsys, "--help")[1]


CHECKS = {
    "FORMATS": check_format,
    "FAMILIES": check_model,
    "SAMPLERS": check_sampler,
    "SCENES": check_scene,
    "METRICS": check_image_metric,
    "TABLE_METRICS": check_table_metric,
    "COMMANDS": check_command,
}


@pytest.mark.parametrize("table", CHECKS)
def test_its_row_is_all_that_a_new_thing_needs(capsys, tmp_path, add, table):
    with pytest.raises((AssertionError, KeyError)):  # a metric that is not there is no key
        CHECKS[table](capsys, tmp_path)
    add(table)
    CHECKS[table](capsys, tmp_path)


def check_list(markdown):
    """Every table that the list names is where it says, every page is there, and a new row of each is tested here."""
    rows = re.findall(r"^\|.*\| `(\w+)` in `([\w/]+)\.py` \| `([\w/.]+)` \|$", markdown, re.MULTILINE)
    for table, module, page in rows:
        assert hasattr(importlib.import_module(f"sommerl.{module.replace('/', '.')}"), table)
        assert (ROOT / page).is_file()
    assert [table for table, _, _ in rows] == list(CHECKS)


def test_the_list_is_true():
    markdown = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    check_list(markdown)
    must_fail(check_list, markdown.replace("`FORMATS` in", "`KINDS` in"))
    must_fail(check_list, markdown.replace("`docs/scenes.md`", "`docs/stages.md`"))
    must_fail(check_list, markdown.replace("| scene |", "scene |"))
