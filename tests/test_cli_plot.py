"""The command `plot`."""

import pytest
from helpers import must_fail, run, run_json
from test_cli import BAD_FILES, check_refused

from sommerl import plots
from sommerl.commands.cli import main

HEADS = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}


@pytest.fixture(scope="module")
def smrl(tmp_path_factory):
    path = tmp_path_factory.mktemp("materials") / "pearl.smrl"
    assert main(["compress", "pearl-paint", "-o", str(path), "--clusters", "16", "--epochs", "1"]) == 0
    return path


@pytest.mark.parametrize("extension", HEADS)
def test_everything_that_applies_is_on_one_sheet(capsys, smrl, tmp_path, extension):
    path = tmp_path / f"x.{extension}"
    result = run_json(capsys, "plot", smrl, "-o", path)
    name = "pearl-paint (SGD stand-in)"
    drawn = {"input": str(smrl), "name": name, "label": name}
    assert result == drawn | {"image": str(path), "kinds": list(plots.KINDS), "materials": [drawn], "warnings": []}
    assert path.read_bytes().startswith(HEADS[extension])
    assert list(tmp_path.iterdir()) == [path]
    again = tmp_path / f"again.{extension}"
    status, out, err = run(capsys, "plot", smrl, "-o", again)
    assert (status, out, err) == (0, f"{name} → {again} ({', '.join(plots.KINDS)})\n", "")
    assert again.read_bytes() == path.read_bytes()


@pytest.mark.parametrize("kind", plots.KINDS)
def test_one_kind(capsys, smrl, tmp_path, kind):
    result = run_json(capsys, "plot", smrl, "-o", tmp_path / "x.png", "--kind", kind)
    assert result["kinds"] == [kind]


def test_all_kinds_of_a_formula(capsys, tmp_path):
    result = run_json(capsys, "plot", "nickel", "-o", tmp_path / "nickel.png")
    assert result["kinds"] == ["lobes", "theta-h", "slices"]


def test_materials_of_one_name_are_told_apart(capsys, smrl, tmp_path):
    copy = tmp_path / "pearl.smrl"
    copy.write_bytes(smrl.read_bytes())
    result = run_json(
        capsys, "plot", "pearl-paint", smrl, copy, "nickel", "-o", tmp_path / "x.png", "--kind", "theta-h"
    )
    name = "pearl-paint (SGD stand-in)"
    others = [f"{smrl}: {name}", f"{copy}: {name}"]
    assert [each["label"] for each in result["materials"]] == [name, *others, "nickel (SGD stand-in)"]
    assert [each["name"] for each in result["materials"]] == [*[name] * 3, "nickel (SGD stand-in)"]


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["nickel", "-o", "{}/x.gif"], 2, "expected a name that ends in .png or .pdf or .svg, found '.gif'"),
        (["nickel", "-o", "{}/x"], 2, "expected a name that ends in .png or .pdf or .svg, found ''"),
        (["nickel", "-o", "/dev/null/x.png"], 1, "/dev/null: expected a folder, found something else"),
        (["nickel", "-o", "/proc/x.png"], 1, "/proc/x.png: cannot be written"),
        (["nickel"], 2, "required: -o/--output"),
        (["-o", "{}/x.png"], 2, "required: MATERIAL"),
        (["{}/none.smrl", "-o", "{}/x.png"], 1, "none.smrl: there is no such file"),
        (["nickle", "-o", "{}/x.png"], 1, "did you mean nickel?"),
        (["nickel", "-o", "{}/x.png", "--kind", "lobe"], 2, "; did you mean lobes?"),
        (
            ["nickel", "-o", "{}/x.png", "--kind", "palette"],
            1,
            "it has no palette, since it is not a compressed material",
        ),
        (["nickel", "-o", "{}/x.png", "--kind", "usage"], 1, "nickel (SGD stand-in): it has no palette"),
        (["nickel", "-o", "{}/x.png", "--kind", "hits"], 1, "hits are drawn only of materials on a lattice of cells"),
        (["nickel", "nickel", "-o", "{}/x.png"], 2, "MATERIAL: expected different ones, found nickel twice"),
        (["nickel"] * 6 + ["-o", "{}/x.png"], 2, "MATERIAL: expected 1 to 5, found 6"),
    ],
)
def test_what_cannot_be_drawn(capsys, tmp_path, arguments, status, message):
    filled = ["plot", *(argument.format(tmp_path) for argument in arguments)]
    check_refused(capsys, tmp_path, filled, status, message)


def test_that_check_notices_a_picture(capsys, tmp_path):
    must_fail(check_refused, capsys, tmp_path, ["plot", "nickel", "-o", tmp_path / "x.png", "--kind", "slices"], 0, "")


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files(capsys, tmp_path, name):
    path = tmp_path / name
    path.write_bytes(BAD_FILES[name])
    check_refused(capsys, tmp_path, ["plot", "nickel", path, "-o", tmp_path / "x.png"], 1, f"{path}: expected")


def test_a_picture_that_fails_leaves_the_old_one(capsys, tmp_path):
    path = tmp_path / "x.png"
    path.write_bytes(b"old")
    assert run(capsys, "plot", "nickel", "-o", path, "--kind", "hits", "--overwrite")[0] == 1
    assert path.read_bytes() == b"old"


def test_a_picture_is_not_written_over_a_material(capsys, smrl, tmp_path):
    path = tmp_path / "material.png"
    path.write_bytes(smrl.read_bytes())
    check_refused(capsys, tmp_path, ["plot", path, "-o", path], 2, "expected an output other than the input")
    assert path.read_bytes() == smrl.read_bytes()


def test_help(capsys):
    status, out, _ = run(capsys, "plot", "--help")
    assert status == 0
    assert "sommerl plot" in out.split("Example:")[1]
    for name, kind in plots.KINDS.items():
        assert f"  {name} " in out
        assert kind.shows in out
