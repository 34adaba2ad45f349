"""What commands print with --json: one shape, errors too, and every key documented (docs/json.md)."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers import compact_material, lambertian_table, must_fail, run, run_json
from library_files import packed

from sommerl import TrainOptions, save, train
from sommerl.commands import console, info
from sommerl.reflectance.nodes import NodeLattice
from sommerl.render.environment import default_environment
from sommerl.render.images import write_image

SMALL = ["--size", "16", "--spp", "1"]
PAGE = (Path(__file__).parents[1] / "docs" / "json.md").read_text()
SECTIONS = {part.partition("\n")[0]: part for part in PAGE.split("\n## ")}
EVERYWHERE = ("In every object", "`info`")
DISTANCES = "`compare`"
# Of each command a line, with {} for the folder, and the sections that say what its keys are.
LINES = {
    "info": ("info {}/a.smrl", ()),
    "info of a compact one": ("info {}/compact.smrl", ()),
    "info of a formula": ("info nickel", ()),
    "compress": ("compress {}/a.smrl -o {}/b.smrl --clusters 1 --epochs 1", ("`compress`, and `convert` to `.smrl`",)),
    "convert": ("convert {}/a.smrl {}/x.h", ("`convert` to other formats",)),
    "compare": (f"compare nickel {{}}/a.smrl -o {{}}/x.png {' '.join(SMALL)}", (DISTANCES,)),
    "render": (f"render {{}}/a.smrl -o {{}}/x.png {' '.join(SMALL)}", ("`render`",)),
    "render against": (
        f"render {{}}/a.smrl --against nickel -o {{}}/x.png {' '.join(SMALL)}",
        ("`render`", DISTANCES),
    ),
    "fit": ("fit {}/a.smrl --model lambertian --samples 1000 --starts 1", ("`fit`",)),
    "factor": ("factor nickel -o {}/x.fbrdf --lobes 1 --terms 1", ("`factor`",)),
    "plot": ("plot {}/a.smrl -o {}/x.png --kind theta-h", ("`plot`",)),
    "view": ("view {}/a.smrl -o {}/x.html", ("`view`",)),
    "library pack": ("library pack {}/library.smrlib -o {}/x.smrlib", ("`library pack`",)),
    "library list": ("library list {}/library.smrlib", ("`library list`, `find` and `sheet`",)),
    "library find": ("library find {}/library.smrlib --like nickel", ("`library list`, `find` and `sheet`",)),
    "library sheet": ("library sheet {}/library.smrlib -o {}/x.html", ("`library list`, `find` and `sheet`",)),
    "completion": ("completion bash", ("`completion`",)),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two compressed materials of either preset."""
    folder = tmp_path_factory.mktemp("materials")
    save(train(lambertian_table(0.5), TrainOptions(clusters=1, epochs=1))[0], folder / "a.smrl")
    save(compact_material(NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)), 2, 2), folder / "compact.smrl")
    (folder / "library.smrlib").write_bytes(packed())
    return folder


def check_documented(keys, sections):
    text = "".join(SECTIONS[name] for name in (*EVERYWHERE, *sections))
    missing = [key for key in keys if f"`{key}`" not in text]
    assert missing == []


@pytest.mark.parametrize("name", LINES)
def test_every_key_is_documented(capsys, made, name):
    line, sections = LINES[name]
    result = run_json(capsys, *line.format(*[made] * line.count("{}")).split())
    keys = {*result, *(key for each in result.get("materials", []) for key in each)}
    assert "warnings" in result
    check_documented(keys, sections)
    must_fail(check_documented, {*keys, "undocumented"}, sections)


def check_shape(result, sources):
    """One material or many: `materials`, each with its input and name; the keys of exactly one on the top level."""
    assert [each["input"] for each in result["materials"]] == sources
    assert all(each["name"] for each in result["materials"])
    assert result["warnings"] == []
    for key, value in result["materials"][0].items():
        assert (key in result and result[key] == value) == (len(sources) == 1)


def test_one_shape_for_one_and_for_many(capsys, made, tmp_path):
    several = [str(made / "a.smrl"), "nickel", "chrome"]
    for count in (1, 3):
        result = run_json(capsys, "info", *several[:count])
        check_shape(result, several[:count])
        must_fail(check_shape, result, several[1:])
    must_fail(check_shape, result["materials"][0] | result, several)
    quick = "--clusters", 1, "--epochs", 1
    for sources in (several[:1], [str(made / name) for name in ("a.smrl", "compact.smrl")]):
        result = run_json(capsys, "compress", *sources, "-o", tmp_path / "out", *quick)
        check_shape(result, sources)
        assert [Path(each["output"]).name for each in result["materials"]] == [Path(each).name for each in sources]


def test_both_materials_of_a_comparison(capsys, made):
    result = run_json(capsys, "compare", "nickel", made / "a.smrl", *SMALL)
    assert [(each["input"], each["lookup"]) for each in result["materials"]] == [
        ("nickel", "formula"),
        (str(made / "a.smrl"), "nearest"),
    ]


def test_the_preset_is_said(capsys, made):
    assert run_json(capsys, "info", made / "a.smrl")["preset"] == "paper"
    found = run_json(capsys, "info", made / "compact.smrl")
    assert (found["preset"], run_json(capsys, "info", "nickel")["preset"]) == ("compact", None)
    assert re.search("preset .*compact", run(capsys, "info", made / "compact.smrl")[1])


def test_options_and_quality_of_a_compact_file_that_holds_them(capsys, tmp_path):
    material = compact_material(NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)), 2, 2)
    material.options, material.metrics = {"target_size": 800, "seed": 3}, {"psnr_object_db": 41.5}
    save(material, tmp_path / "x.smrl")
    found = run_json(capsys, "info", tmp_path / "x.smrl")
    assert (found["options"], found["metrics"]) == ({"target_size": 800, "seed": 3}, {"psnr_object_db": 41.5})
    shown = " ".join(re.sub("[│\n]", " ", run(capsys, "info", tmp_path / "x.smrl")[1]).split())
    assert "target_size 800" in shown
    assert "psnr_object_db 41.5" in shown


def check_error(capsys, arguments, status, part):
    found, out, err = run(capsys, *arguments)
    assert found == status
    answer = json.loads(out)
    assert answer.keys() >= {"error", "status", "warnings"}
    assert answer["status"] == status
    assert part in answer["error"]
    assert err == f"error: {answer['error']}\n"


ERRORS = [
    (["info", "nickle", "--json"], 1, "did you mean nickel"),
    (["info", "{}", "--json"], 1, "found none in it"),
    (["info", "--json"], 2, "required: MATERIAL"),
    (["--json"], 2, "--json: expected an option of sommerl"),
    (["inf", "x", "--json"], 2, "did you mean info"),
    (["convert", "nickel", "{}/x.h", "--spectrum", "--json"], 2, "did you mean --spectral"),
    (["compress", "nickel", "-o", "{}/x.smrl", "--clusters", "0", "--js"], 2, "--clusters: expected 1 to"),
    (["compress", "nickel", "-o", "/dev/null/x.smrl", "--json"], 1, "expected a folder, found something else"),
]


@pytest.mark.parametrize(("arguments", "status", "part"), ERRORS)
def test_errors_are_json_too(capsys, tmp_path, arguments, status, part):
    filled = [each.format(tmp_path) for each in arguments]
    check_error(capsys, filled, status, part)
    must_fail(check_error, capsys, filled, status + 1, part)
    assert list(tmp_path.iterdir()) == []


def test_without_the_option_errors_leave_standard_output_alone(capsys):
    for arguments in (["info", "nickle"], ["inf"], ["info", "--", "--json"]):
        assert run(capsys, *arguments)[1] == ""


def test_an_error_that_nobody_thought_of(capsys, monkeypatch):
    def failing(options):
        raise KeyError("key")

    monkeypatch.setattr(info, "info", failing)
    check_error(capsys, ["info", "x", "--json"], 1, "KeyError ('key')")


def test_some_of_several_fail(capsys, made, tmp_path):
    """The others are done, and all are told of."""
    few = made / "a.smrl"
    save(compact_material(NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)), 2, 2), tmp_path / "many.smrl")
    arguments = "compress", few, tmp_path / "many.smrl", "-o", tmp_path / "out", "--clusters", 2, "--epochs", 1
    status, out, err = run(capsys, *arguments, "--json")
    answer = json.loads(out)
    assert (status, answer["status"]) == (1, 1)
    assert answer["error"] == "IN: expected to compress 2 materials, found 1 that failed"
    failed, done = answer["materials"]
    assert failed["input"] == str(few)
    assert err.splitlines() == [f"error: {failed['error']}", f"error: {answer['error']}"]
    assert Path(done["output"]).exists()


def test_warnings_are_in_the_answer(capsys, made, tmp_path):
    """Those of commands, those of modules, and each of one command alone."""
    write_image(tmp_path / "light.exr", np.ascontiguousarray(default_environment(16)[:, :16]))
    arguments = "compare", "nickel", made / "a.smrl", *SMALL, "--envmap", tmp_path / "light.exr", "--json"
    for _ in range(2):
        status, out, err = run(capsys, *arguments)
        (warning,) = json.loads(out)["warnings"]
        assert warning.startswith(f"{tmp_path / 'light.exr'}: the image has 16 × 16 pixels, ")
        assert (status, err) == (0, f"warning: {warning}\n")
    assert run_json(capsys, "info", "nickel")["warnings"] == []


def test_pythons_own_warnings_are_in_the_answer(capsys, monkeypatch):
    def warning(options):
        import warnings

        warnings.simplefilter("always")
        warnings.warn("mind the gap", stacklevel=1)
        return {}

    monkeypatch.setattr(info, "info", warning)
    status, out, err = run(capsys, "info", "x", "--json")
    assert (status, json.loads(out), err) == (0, {"warnings": ["mind the gap"]}, "warning: mind the gap\n")
    assert console.warn.told == ["mind the gap"]
