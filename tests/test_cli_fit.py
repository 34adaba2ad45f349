"""The command `fit`."""

import json
from functools import partial

import numpy as np
import pytest
from helpers import run, run_json

from sommerl import BrdfTable, builtin
from sommerl.commands import fit as command
from sommerl.formats import merl
from sommerl.models.multi_lobe import FAMILIES

QUICK = ["--samples", "2000", "--starts", "3"]


def test_fit_and_what_it_writes(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(command, "compare_on_sphere", partial(command.compare_on_sphere, size=32, spp=8))
    output, picture = tmp_path / "fits.json", tmp_path / "fits.png"
    arguments = ["red-fabric", *QUICK, "--model", "ward", "--lobes", "3", "-o", output, "--picture", picture]
    result = run_json(capsys, "fit", *arguments)
    (fit,) = result["fits"]
    assert fit.keys() >= {"model", "lobes", "loss", "error", "parameters", "starts", "seconds", "psnr_object_db"}
    assert (fit["model"], fit["lobes"], fit["loss"], fit["samples"]) == ("ward", 3, "cosine-l2", 2000)
    assert [lobe["family"] for lobe in fit["parameters"]] == ["lambertian", "ward", "ward"]
    written = json.loads(output.read_text())
    assert {key: result[key] for key in written} == written
    assert (result["input"], result["output"], result["image"]) == ("red-fabric", str(output), str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")
    # The file is a material for the other commands.
    info = run_json(capsys, "info", output)
    assert (info["kind"], info["name"]) == ("model", "red-fabric (SGD stand-in) (ward fit)")
    assert info["lobes"] == fit["parameters"]
    small = ["--size", "24", "--spp", "4"]
    compared = run_json(capsys, "compare", "red-fabric", f"{output}:ward", *small)
    assert compared["psnr_object_db"] > 20


def test_fit_does_not_write_over_its_input(capsys, tmp_path):
    path = tmp_path / "fits.json"
    run_json(capsys, "fit", "red-fabric", *QUICK, "--model", "ward", "-o", path)
    before = path.read_text()
    for source in (path, f"{path}:ward"):
        status, _, err = run(capsys, "fit", source, *QUICK, "-o", path)
        assert (status, err) == (2, f"error: {path}: expected an output other than the input\n")
        assert path.read_text() == before


def test_all_models_in_a_table(capsys):
    status, out, err = run(capsys, "fit", "red-fabric", *QUICK)
    assert (status, err) == (0, "")
    for name in FAMILIES:
        assert name in out
    errors = [each["error"] for each in run_json(capsys, "fit", "red-fabric", *QUICK)["fits"]]
    assert errors == sorted(errors)
    assert len(errors) == len(FAMILIES)


def test_a_table_and_a_compressed_one(capsys, tmp_path):
    table, compact = tmp_path / "red.binary", tmp_path / "red.smrl"
    merl.write(BrdfTable.sampled(builtin("red-fabric")), table)
    run_json(capsys, "compress", table, "-o", compact, "--clusters", "64", "--epochs", "1")
    found = [
        run_json(capsys, "fit", path, *QUICK, "--model", "ggx")["fits"][0]["parameters"][1]["alpha"]
        for path in ("red-fabric", table, compact)
    ]
    assert found[1:] == pytest.approx([found[0]] * 2, rel=0.1)


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["red-fabric", "--model", "wardd"], 2, "error: --model: expected lambertian, oren-nayar, phong"),
        (["red-fabric", "--lobes", "9"], 2, "error: --lobes: expected 1 to 4, found 9"),
        (["red-fabric", "--model", "ward", "--lobes", "1"], 2, "error: --lobes: expected 2 to 4 of ward"),
        (["red-fabric", "--loss", "l1"], 2, "error: --loss: expected l2 or cosine-l2 or log or cube-root, found l1"),
        (["red-fabric", "-o", "x.txt"], 2, "error: x.txt: expected a name that ends in .json"),
        (["red-fabric", "--picture", "x.jpg"], 2, "error: x.jpg: expected a name that ends in .png"),
        (["red-fabrik"], 1, "error: red-fabrik: expected a file or a built-in material"),
        (["nowhere.binary"], 1, "error: nowhere.binary: there is no such file"),
    ],
)
def test_bad_options(capsys, arguments, status, message):
    found, out, err = run(capsys, "fit", *arguments)
    assert (found, out) == (status, "")
    assert err.startswith(message)
    assert err.count("\n") == 1


def test_black_and_undefined_tables(capsys, tmp_path):
    for value in (0.0, np.nan):
        path = tmp_path / "x.binary"
        path.write_bytes(np.array([90, 90, 180], "<i4").tobytes() + np.full(3 * 1_458_000, value, "<f8").tobytes())
        status, out, err = run(capsys, "fit", path)
        assert (status, out) == (1, "")
        assert err == f"error: {path}: expected a positive, finite reflectance above the horizon, found none\n"


@pytest.fixture
def no_file_beside(monkeypatch):
    """Compressing takes seconds, and is tested elsewhere."""
    monkeypatch.setattr(command, "compress", lambda brdf, **_: (brdf, None))


def test_a_standard_and_what_is_written_of_it(capsys, tmp_path, no_file_beside):
    quick = ["red-fabric", "--samples", "1000", "--starts", "1", "--model"]
    result = run_json(capsys, "fit", *quick, "openpbr", "-o", tmp_path / "x.json")
    (fit,) = result["fits"]
    assert (fit["model"], fit["lobes"], fit["parameters"]["model"]) == ("openpbr", None, "openpbr")
    assert fit["blender"]["Coat Tint"][:3] == pytest.approx(fit["parameters"]["coat_color"], rel=1e-5)
    assert fit["psnr_soft_db"] > 25
    assert fit["smrl"] == {"target_size": 2700, "psnr_soft_db": None}  # the same material: no difference
    info = run_json(capsys, "info", tmp_path / "x.json")
    assert info["surface"] == fit["parameters"]
    status, out, _ = run(capsys, "info", tmp_path / "x.json")
    assert status == 0
    assert "base_color" in out
    for name, model, head in (("x.mtlx", "openpbr", b"<?xml"), ("x.gltf", "gltf", b"{")):
        status, out, err = run(capsys, "fit", *quick, model, "-o", tmp_path / name)
        assert (status, err) == (0, "")
        assert "PSNR in soft light" in out
        assert (tmp_path / name).read_bytes().startswith(head)
    materials = json.loads((tmp_path / "x.gltf").read_text())["materials"]
    assert set(materials[0]["extensions"]) == {f"KHR_materials_{x}" for x in ("specular", "clearcoat", "sheen")}


def test_files_of_standards_hold_their_own_model_alone(capsys, tmp_path):
    status, _, err = run(capsys, "fit", "red-fabric", "--model", "ggx", "-o", tmp_path / "x.mtlx")
    assert status == 2
    assert err == f"error: {tmp_path}/x.mtlx: expected --model openpbr, which .mtlx holds, found ggx\n"
    assert not (tmp_path / "x.mtlx").exists()
