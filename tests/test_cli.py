import hashlib
import os
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
from helpers import PATIENCE, launch, must_fail, run, run_json

import sommerl
from sommerl import NAMES, BrdfTable, Lattice, load
from sommerl.commands.cli import main
from sommerl.formats import merl
from sommerl.formats.load import load_table
from sommerl.sampling.named import SAMPLERS

QUICK = ["--clusters", "16", "--epochs", "1"]
SMALL_PICTURE = ["--size", "24", "--spp", "4"]
INFO_KEYS = {
    "kind", "name", "clusters", "lattice", "interpolation", "domain", "bytes_paper", "bytes_memory", "bytes_disk",
    "options", "source_sha256",
}  # fmt: skip
COMPRESS_KEYS = INFO_KEYS | {
    "epochs", "seconds", "quantisation_error", "units_dropped", "cells_clamped", "output",
}  # fmt: skip
IMAGE_KEYS = {"psnr_object_db", "psnr_frame_db", "psnr_unrounded_db", "ssim", "delta_e_itp", "flip"}
COMPARE_KEYS = IMAGE_KEYS | {"table_rmse", "table_log_error_cosine", "table_relative_error"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A MERL file and what `compress` made of it."""
    folder = tmp_path_factory.mktemp("materials")
    assert main(["convert", "pearl-paint", str(folder / "pearl.binary")]) == 0
    assert main(["compress", str(folder / "pearl.binary"), "-o", str(folder / "pearl.smrl"), *QUICK]) == 0
    return folder


def test_compress_and_info(capsys, folder, tmp_path):
    path = tmp_path / "out.smrl"
    result = run_json(capsys, "compress", folder / "pearl.binary", "-o", path, *QUICK)
    assert result.keys() >= COMPRESS_KEYS
    assert result["clusters"] == 16
    assert result["epochs"] == len(result["quantisation_error"]) == 1
    assert result["bytes_disk"] == path.stat().st_size
    assert result["bytes_paper"] == 4 * 1_458_000 + 24 * 16
    info = run_json(capsys, "info", path)
    assert info.keys() >= INFO_KEYS
    assert all(info[key] == result[key] for key in INFO_KEYS)
    assert (info["kind"], info["name"], info["lattice"]) == ("som-man", "pearl", [90, 90, 180])
    assert (info["interpolation"], info["domain"]) == ("nearest", "linear")
    assert info["options"]["rule"] in ("paper", "kohonen")
    assert info["source_sha256"] == load_table(folder / "pearl.binary").source.sha256


def test_same_options_same_bytes(folder, tmp_path):
    assert main(["compress", str(folder / "pearl.binary"), "-o", str(tmp_path / "again.smrl"), *QUICK]) == 0
    assert (tmp_path / "again.smrl").read_bytes() == (folder / "pearl.smrl").read_bytes()


def test_every_training_option_arrives(capsys, folder, tmp_path):
    given = {"clusters": 5, "epochs": 2, "seed": 3, "rule": "paper", "alpha": 0.25, "order": "table", "radius": 1.5}
    given["topology"] = "sheet"
    flags = [text for key, value in given.items() for text in (f"--{key}", str(value))]
    result = run_json(capsys, "compress", folder / "pearl.binary", "-o", tmp_path / "x.smrl", *flags)
    assert result["options"] == given
    result = run_json(capsys, "compress", folder / "pearl.binary", "-o", tmp_path / "y.smrl", *flags, "--distinct")
    assert result["options"] == given | {"distinct": True}
    assert run_json(capsys, "info", tmp_path / "y.smrl")["options"] == result["options"]


def test_several_inputs_go_to_a_folder(capsys, folder, tmp_path):
    result = run_json(capsys, "compress", folder / "pearl.binary", "nickel", "-o", tmp_path / "made" / "here", *QUICK)
    tmp_path = tmp_path / "made" / "here"
    assert [one["output"] for one in result["materials"]] == [str(tmp_path / f"{n}.smrl") for n in ("pearl", "nickel")]
    assert load(tmp_path / "nickel.smrl").name == "nickel (SGD stand-in)"


def test_info_of_a_table_and_of_a_formula(capsys, folder):
    info = run_json(capsys, "info", folder / "pearl.binary")
    assert info.keys() >= INFO_KEYS
    assert (info["kind"], info["bytes_disk"], info["clusters"]) == ("table", 34_992_012, None)
    assert run_json(capsys, "info", "chrome")["kind"] == "model"
    assert "90 × 90 × 180" in run(capsys, "info", folder / "pearl.smrl")[1]


def test_convert_there_and_back(capsys, folder, tmp_path):
    result = run_json(capsys, "convert", folder / "pearl.smrl", tmp_path / "back.binary")
    assert result["bytes_disk"] == 34_992_012
    back, material = merl.read(tmp_path / "back.binary"), load(folder / "pearl.smrl")
    assert np.allclose(back.values, material.values, rtol=1e-15)


def test_convert_to_smrl_compresses_with_the_defaults(capsys, folder, tmp_path, monkeypatch):
    from sommerl.commands import compress

    seen = []
    original = compress.trained

    def quick(table, options):
        seen.append(options)
        return original(table, sommerl.TrainOptions(clusters=4, epochs=1))

    monkeypatch.setattr(compress, "trained", quick)
    result = run_json(capsys, "convert", folder / "pearl.binary", tmp_path / "x.smrl")
    assert seen == [sommerl.TrainOptions()]
    assert result.keys() >= COMPRESS_KEYS


def test_noise(capsys, tmp_path, folder):
    run_json(capsys, "convert", "pearl-paint", tmp_path / "noisy.binary", "--noise", 1)
    clean, noisy = load(folder / "pearl.binary"), load(tmp_path / "noisy.binary")
    assert 0.05 < np.abs(noisy.values / clean.values - 1).mean() < 1


def test_compare(capsys, folder, tmp_path):
    picture = tmp_path / "both.png"
    result = run_json(capsys, "compare", folder / "pearl.binary", folder / "pearl.smrl", *SMALL_PICTURE, "-o", picture)
    assert result.keys() >= COMPARE_KEYS
    assert 10 < result["psnr_object_db"] < result["psnr_frame_db"] < 60
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert (result["reference"], result["candidate"]) == ("pearl.binary (nearest)", "pearl.smrl (nearest)")
    pair = folder / "pearl.binary", folder / "pearl.smrl"
    status, out, _ = run(capsys, "compare", *pair, *SMALL_PICTURE, "-o", picture)
    assert status == 0
    assert "".join(out.split()).startswith(f"{pair[1]}against{pair[0]}")  # which is wrapped
    assert out.endswith(f"Wrote {picture}\n")
    assert "PSNR, object" in out
    assert "PSNR, object, not rounded" in out


def test_compare_says_how_tables_are_looked_up(capsys, folder):
    table, material = folder / "pearl.binary", folder / "pearl.smrl"
    asked = run_json(capsys, "compare", table, material, *SMALL_PICTURE, "--lookup", "trilinear")
    assert asked["reference"] == "pearl.binary (trilinear)"
    tables = run_json(capsys, "compare", table, table, *SMALL_PICTURE)
    assert tables["candidate"] == "pearl (trilinear)"
    assert tables["psnr_frame_db"] is None
    assert tables["table_rmse"] == 0
    assert "identical" in run(capsys, "compare", table, table, *SMALL_PICTURE)[1]
    assert run_json(capsys, "compare", "pearl-paint", table, *SMALL_PICTURE)["reference"].endswith("(formula)")


@pytest.mark.parametrize("extension", ["png", "exr"])
def test_render(capsys, folder, tmp_path, extension):
    path = tmp_path / f"out.{extension}"
    result = run_json(capsys, "render", "--scene", "sphere", folder / "pearl.smrl", "-o", path, *SMALL_PICTURE)
    assert result.keys() >= {"image", "seconds", "spp", "variant"}
    assert result["image"] == str(path)
    first = path.read_bytes()
    run(capsys, "render", folder / "pearl.smrl", "-o", path, *SMALL_PICTURE)
    assert path.read_bytes() == first
    run(capsys, "render", folder / "pearl.smrl", "-o", path, *SMALL_PICTURE, "--seed", 1)
    assert path.read_bytes() != first


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_render_with_a_sampler(capsys, folder, tmp_path, sampler):
    def pixels(name, *options):
        found = run_json(capsys, "render", folder / "pearl.smrl", "-o", tmp_path / name, *SMALL_PICTURE, *options)
        return found["sampler"], (tmp_path / name).read_bytes()

    chosen, ours = pixels("chosen.exr", "--sampler", sampler), pixels("ours.exr")
    assert (chosen[0], ours[0]) == (sampler, "half-vector")
    assert (chosen[1] == ours[1]) == (sampler == "half-vector")


def test_render_in_an_environment_from_a_file(capsys, folder, tmp_path):
    run_json(capsys, "render", folder / "pearl.smrl", "-o", tmp_path / "probe.exr", *SMALL_PICTURE)
    options = "-o", tmp_path / "out.png", "--envmap", tmp_path / "probe.exr"
    found = run(capsys, "render", folder / "pearl.binary", *options, *SMALL_PICTURE, "--lookup", "nearest")
    assert found[0] == 0
    assert found[2].startswith(f"warning: {tmp_path / 'probe.exr'}: the image has 24 × 24 pixels, and is stretched")


def test_demo(capsys, tmp_path, monkeypatch):
    from sommerl.commands import demo

    monkeypatch.setattr(demo, "TrainOptions", lambda: sommerl.TrainOptions(clusters=4, epochs=1))
    monkeypatch.setattr(demo, "compare_on_sphere", partial(demo.compare_on_sphere, size=32, spp=8))
    result = run_json(capsys, "demo", "--out", tmp_path / "demo")
    assert result.keys() >= COMPRESS_KEYS | IMAGE_KEYS
    for path in result["output"].values():
        assert os.path.getsize(path) > 0
    status, out, _ = run(capsys, "demo", "--out", tmp_path / "demo")
    assert status == 0
    for line in (
        "PSNR, frame",
        "size as the paper counts it",
        "size in memory",
        "size on disk",
        "training",
        "index.html",
    ):
        assert line in out


def check_refused(capsys, tmp_path, arguments, status, message):
    """One sentence on standard error, nothing elsewhere, no file, no traceback."""
    before = sorted(tmp_path.rglob("*"))
    found, out, err = run(capsys, *arguments)
    assert (found, out) == (status, "")
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert message in err
    assert sorted(tmp_path.rglob("*")) == before


BAD_FILES = {
    "empty.binary": b"",
    "empty.smrl": b"",
    "text.txt": b"f_r = 0.5\n",
    "short.binary": np.array([90, 90, 180], "<i4").tobytes() + b"123",
    "dimensions.binary": np.array([90, 90, 91], "<i4").tobytes(),
    "corrupt.smrl": b"SMRL\0\0" + b"\x17" * 60,
    "newer.smrl": b"SMRL\x09\0" + b"\x17" * 60,
    "short.smrl": b"SMRL",
}


@pytest.mark.parametrize("name", BAD_FILES)
@pytest.mark.parametrize("command", ["compress", "info", "convert", "compare", "render"])
def test_bad_files_are_refused_by_every_command(capsys, tmp_path, command, name):
    path = tmp_path / name
    path.write_bytes(BAD_FILES[name])
    rest = {
        "compress": ["-o", tmp_path / "out.smrl"],
        "info": [],
        "convert": [tmp_path / "out.binary"],
        "compare": ["nickel"],
        "render": ["-o", tmp_path / "out.png"],
    }
    check_refused(capsys, tmp_path, [command, path, *rest[command]], 1, f"{path}: expected")


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["info", "blue-metalic-paint"], 1, "did you mean blue-metallic-paint"),
        (["info", "{}/none.smrl"], 1, "none.smrl: there is no such file"),
        (["info", "{}"], 1, "expected a folder with materials, found none in it"),
        (["compress", "nickle", "-o", "{}/no/folder/x.smrl"], 1, "did you mean nickel"),
        (["compress", "nickel", "-o", "/dev/null/x.smrl"], 1, "/dev/null: expected a folder, found something else"),
        (["compress", "nickel", "-o", "{}/x.binary"], 2, "expected a name that ends in .smrl, found '.binary'"),
        (
            ["compress", "nickel", "chrome", "-o", "{}/x.smrl"],
            2,
            "expected a folder for 2 inputs, found the name of a file",
        ),
        (["compress", "nickel", "nickel", "-o", "{}"], 2, "two that would be written to one file"),
        (["render", "nickel", "-o", "{}/x.png", "--lookup", "nearest"], 1, "found another (formula)"),
        (["compress", "nickel", "-o", "{}/x.smrl", "--clusters", "0"], 2, "--clusters: expected 1 to 65536, found 0"),
        (
            ["compress", "nickel", "-o", "{}/x.smrl", "--clusters", "many"],
            2,
            "--clusters: expected a whole number, found many",
        ),
        (["compress", "nickel", "-o", "{}/x.smrl", "--alpha", "nan"], 2, "--alpha: expected a number above 0"),
        (
            ["compress", "nickel", "-o", "{}/x.smrl", "--rule", "hebb"],
            2,
            "--rule: expected paper or kohonen, found hebb",
        ),
        (["compress", "nickel"], 2, "required: -o"),
        (["convert", "nickel", "{}/x.obj"], 2, "expected a name that ends in .smrl or .binary or .bsdf"),
        (["convert", "{}/none.binary", "{}/x.binary", "--noise", "1"], 2, "--noise: expected a built-in material"),
        (["convert", "nickel", "{}/x.binary", "--noise", "-1"], 2, "--noise: expected a seed"),
        (["compare", "nickel", "chrome", "--spp", "0"], 2, "--spp: expected 1 to"),
        (["compare", "nickel", "chrome", "--size", "0"], 2, "--size: expected 8 to"),
        (["compare", "nickel", "chrome", "--seed", "-1"], 2, "--seed: expected 0 to"),
        (["compare", "nickel", "chrome", "-o", "{}/x.exr"], 2, "expected a name that ends in .png"),
        (["render", "nickel", "-o", "{}/x.jpg"], 2, "expected a name that ends in .png or .exr"),
        (["render", "nickel", "-o", "{}/x.png", "--envmap", "{}/no.exr"], 1, "found no file"),
        (
            ["render", "nickel", "-o", "{}/x.png", "--scene", "moon"],
            2,
            "--scene: expected sphere or statue or ball or sample or still-life or grid, found moon",
        ),
        (["render", "nickel", "-o", "{}/x.png", "--sampler", "dice"], 2, "--sampler: expected "),
        (["compres"], 2, "compres: expected a command, found none of that name; did you mean compress?"),
        (["demo", "--out", "/dev/null/demo"], 1, "/dev/null/demo"),
    ],
)
def test_bad_arguments(capsys, tmp_path, arguments, status, message):
    filled = [argument.format(tmp_path) for argument in arguments]
    check_refused(capsys, tmp_path, filled, status, message)


def test_that_check_notices_a_command_that_succeeds_and_one_that_says_nothing(capsys, tmp_path):
    must_fail(check_refused, capsys, tmp_path, ["info", "nickel"], 0, "nickel")
    must_fail(check_refused, capsys, tmp_path, ["info", "nickle"], 1, "another message")


def test_more_units_than_colours(capsys, tmp_path):
    planes = np.full((3, 90 * 90 * 180), 100.0)
    planes[0, :4] = [1, 2, 3, 4]
    path = tmp_path / "few.binary"
    path.write_bytes(np.array([90, 90, 180], "<i4").tobytes() + planes.tobytes())
    message = "few: expected at least 6 distinct colours, one a cluster, found 5"
    check_refused(capsys, tmp_path, ["compress", path, "-o", tmp_path / "x.smrl", "--clusters", 6], 1, message)


def test_help_teaches_by_example(capsys):
    status, out, _ = run(capsys, "--help")
    assert status == 0
    for word in ("compress", "Examples:", "sommerl demo", *NAMES):
        assert word in out
    for command in ("demo", "compress", "info", "convert", "compare", "fit", "factor", "render", "plot", "paper"):
        status, out, _ = run(capsys, command, "--help")
        assert status == 0
        assert f"sommerl {command}" in out.split("Example:")[1]
    assert run(capsys, "--version")[1].startswith("sommerl 0.")


def test_a_bad_input_among_several_is_found_before_anything_is_written(capsys, tmp_path):
    arguments = ["compress", "nickel", "nickle", "-o", tmp_path, *QUICK]
    check_refused(capsys, tmp_path, arguments, 1, "did you mean nickel")


def test_compressing_a_compressed_material_again(capsys, folder, tmp_path):
    result = run_json(capsys, "compress", folder / "pearl.smrl", "-o", tmp_path, "--clusters", 4, "--epochs", 1)
    assert result["output"] == str(tmp_path / "pearl.smrl")
    # It is made from that file, and that file from what it says.
    info = run_json(capsys, "info", folder / "pearl.smrl")
    assert result["source_sha256"] == hashlib.sha256((folder / "pearl.smrl").read_bytes()).hexdigest()
    assert result["made_from"][1]["sha256"] == info["source_sha256"]


def test_360_bins_survive_every_command(capsys, tmp_path):
    lattice = Lattice(phi_d=360, reciprocal=False)
    values = np.random.default_rng(0).random((*lattice.shape, 1)) * [0.1, 0.2, 0.3]
    merl.write(BrdfTable(values, lattice), tmp_path / "a.binary")
    run_json(capsys, "compress", tmp_path / "a.binary", "-o", tmp_path / "a.smrl", *QUICK)
    assert run_json(capsys, "info", tmp_path / "a.smrl")["lattice"] == [90, 90, 360]
    run_json(capsys, "convert", tmp_path / "a.smrl", tmp_path / "b.binary")
    assert load(tmp_path / "b.binary").lattice == lattice
    result = run_json(capsys, "compare", tmp_path / "a.smrl", tmp_path / "b.binary", *SMALL_PICTURE)
    assert result["table_rmse"] < 1e-12


def test_an_output_is_not_its_input(capsys, folder, tmp_path):
    path = tmp_path / "a.smrl"
    path.write_bytes((folder / "pearl.smrl").read_bytes())
    check_refused(capsys, tmp_path, ["compress", path, "-o", path], 2, "expected an output other than the input")
    check_refused(capsys, tmp_path, ["convert", path, path], 2, "expected an output other than the input")


@pytest.mark.parametrize("flags", [["--json"], []])
def test_output_that_nobody_reads(folder, flags):
    process = start("info", folder / "pearl.smrl", *flags)
    process.stdout.close()
    assert process.wait() == 1
    assert process.stderr.read() == ""
    process.stderr.close()


def test_odd_names_and_terminals(folder, tmp_path):
    path = tmp_path / "[" / "b].smrl"
    path.parent.mkdir()
    path.write_bytes((folder / "pearl.smrl").read_bytes())
    out, err = start("info", path, env=os.environ | {"PYTHONIOENCODING": "ascii", "COLUMNS": "200"}).communicate()
    assert err == ""
    assert str(path) in out


def test_a_folder_does_not_hide_a_builtin(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "chrome").mkdir()
    info = run_json(capsys, "info", "chrome")
    assert (info["kind"], info["bytes_disk"]) == ("model", None)


def start(*arguments, **options):
    return launch([sys.executable, "-m", "sommerl", *map(str, arguments)], **options)


def test_interrupting_leaves_no_file(tmp_path):
    # With a neighbourhood of 50 units it lasts; with more, it is a while until the learner looks up from its work.
    options = ("--clusters", 5000, "--epochs", 1000, "--radius", 50)
    process = start("compress", "nickel", "-o", tmp_path / "x.smrl", *options)
    time.sleep(5)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (130, "")
    assert err == "error: interrupted; nothing was left half-written\n"
    assert list(tmp_path.iterdir()) == []


def test_import_needs_numpy_alone():
    code = "import sys; from sommerl import *; print(*{m.partition('.')[0] for m in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    foreign = {"mitsuba", "drjit", "scipy", "skimage", "colour", "rich", "PIL", "argparse"}
    assert not foreign & set(done.stdout.split())
    assert "numpy" in done.stdout.split()
