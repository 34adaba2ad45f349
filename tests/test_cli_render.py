"""The command `render`: scenes, references, and folders."""

import numpy as np
import pytest
from helpers import must_fail, run, run_json

from sommerl import TrainOptions, builtin_table, save, train
from sommerl.reflectance.cells import Lattice
from sommerl.render.environment import default_environment
from sommerl.render.images import encode, signed_difference, write_image
from sommerl.render.llvm import mitsuba
from sommerl.render.metrics import flip_map
from sommerl.render.scene_registry import SCENES

SMALL = ["--size", "24", "--spp", "4"]
KEYS = {"image", "seconds", "spp", "variant", "scene", "material", "materials", "sampler", "resumed", "warnings"}
COMPARE_KEYS = {
    "psnr_object_db", "psnr_frame_db", "psnr_unrounded_db", "ssim", "delta_e_itp", "flip", "table_rmse",
    "table_log_error_cosine", "table_relative_error", "reference", "candidate",
}  # fmt: skip
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def picture(path):
    return np.array(mitsuba().Bitmap(str(path)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Compressed materials, a table, and two files that are none."""
    folder = tmp_path_factory.mktemp("materials")
    for name in ("nickel", "pearl-paint"):
        table = builtin_table(name, lattice=Lattice(30, 30, 30))
        save(train(table, TrainOptions(clusters=16, epochs=1))[0], folder / f"{name}.smrl")
    (folder / "broken.smrl").write_bytes(b"SMRL")
    (folder / "notes.txt").write_text("no material")
    return folder


@pytest.mark.parametrize(
    ("scene", "extension"), [*((name, "png") for name in SCENES if not SCENES[name].each), ("grid", "exr")]
)
def test_every_scene_renders_with_its_own_materials(capsys, tmp_path, scene, extension):
    path = tmp_path / f"out.{extension}"
    result = run_json(capsys, "render", "--scene", scene, "-o", path, *SMALL)
    assert result.keys() >= KEYS
    assert (result["scene"], result["warnings"], result["resumed"]) == (scene, [], False)
    pixels = picture(path)
    assert pixels.shape == ((48, 120, 3) if scene == "grid" else (24, 24, 3))
    assert pixels.dtype == (np.uint8 if extension == "png" else np.float32)
    assert pixels.std() > 0
    assert list(tmp_path.iterdir()) == [path]


def test_materials_are_put_into_the_scene_in_order(capsys, folder, tmp_path):
    given = [folder / "pearl-paint.smrl", "chrome"]
    rest = "-o", tmp_path / "x.png", *SMALL
    result = run_json(capsys, "render", "--scene", "still-life", *given, *rest)
    names = [each["label"].split(" ")[0] for each in result["materials"]]
    assert names == ["pearl-paint", "chrome", "blue-metallic-paint"]
    # A lookup is for what is given: the scene's own materials are formulas.
    result = run_json(capsys, "render", "--scene", "still-life", given[0], "--lookup", "trilinear", *rest)
    assert result["material"].endswith("(trilinear)")


def test_a_view_and_a_light_of_your_own(capsys, tmp_path):
    """Of the scene's own view, the numbers give its own picture; a light in its place gives another."""
    rest = "--scene", "sample", "nickel", *SMALL

    def rendered(*options):
        result = run_json(capsys, "render", *rest, *options, "-o", tmp_path / "x.exr")
        return result["from"], result["light"], picture(tmp_path / "x.exr")

    own, seen, turned = rendered(), rendered("--from", "0,45"), rendered("--from", "-30,45,0.5")
    lit = rendered("--from", "0,45", "--light", "180,45")
    assert (own[0], own[1]) == (None, None)
    assert seen[:2] == ({"azimuth": 0.0, "elevation": 45.0, "zoom": 1.0}, None)
    assert turned[0] == {"azimuth": -30.0, "elevation": 45.0, "zoom": 0.5}
    assert lit[1] == {"azimuth": 180.0, "elevation": 45.0}
    assert np.allclose(seen[2], own[2], rtol=1e-3)
    assert not np.allclose(turned[2], own[2], rtol=1e-3)
    assert not np.allclose(lit[2], own[2], rtol=1e-3)


ANGLES = [
    (["--from", "30"], "--from: expected AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,ZOOM, found 30"),
    (["--from", "30,nan"], "--from: expected AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,ZOOM, found 30,nan"),
    (["--from", "30,90"], "--from: elevation: expected -89 to 89, found 90"),
    (["--from", "0,0,0"], "--from: zoom: expected 0.1 to 10, found 0"),
    (["--light", "0,0,1"], "--light: expected AZIMUTH,ELEVATION, found 0,0,1"),
    (["--light", "0,45", "--envmap", __file__], "--light: expected no --envmap beside it, found one"),
    (["--light", "0,45", "--scene", "still-life"], "still-life: expected no --light, since it has lights of its own"),
    (["--from", "0,45", "--scene", "still-life"], "still-life: expected no --from, since it has a view of its own"),
]


@pytest.mark.parametrize(("options", "sentence"), ANGLES)
def test_a_view_or_a_light_that_cannot_be(capsys, tmp_path, options, sentence):
    status, _, err = run(capsys, "render", "-o", tmp_path / "x.png", *options)
    assert status == 2
    assert err.startswith(f"error: {sentence}")


def check_folder(capsys, folder, path, names):
    status, out, err = run(capsys, "render", "--scene", "grid", folder, "-o", path, *SMALL)
    assert status == 0
    assert err.count("\n") == 1
    assert err.startswith(f"warning: {folder / 'broken.smrl'}: expected")
    assert all(name in out for name in names)


def test_a_grid_of_a_folder_names_what_cannot_be_read(capsys, folder, tmp_path):
    check_folder(capsys, folder, tmp_path / "x.png", ["nickel", "pearl-paint"])
    must_fail(check_folder, capsys, folder, tmp_path / "x.png", ["chrome"])
    labelled = picture(tmp_path / "x.png")
    assert labelled.shape[0] > 24
    assert labelled.shape[1] == 48
    letters = labelled[24:, :, 0]
    assert (letters[:, :24] < 128).any()
    assert (letters[:, 24:] < 128).any()


def test_a_sphere_of_a_grid_is_that_of_the_scene_sphere(capsys, tmp_path):
    run_json(capsys, "render", "--scene", "grid", "nickel", "chrome", "-o", tmp_path / "grid.exr", *SMALL)
    run_json(capsys, "render", "chrome", "-o", tmp_path / "one.exr", *SMALL)
    assert np.array_equal(picture(tmp_path / "grid.exr")[:, 24:], picture(tmp_path / "one.exr"))


@pytest.mark.parametrize("scene", ["statue", "still-life", "grid"])
def test_against_a_reference(capsys, folder, tmp_path, scene):
    path = tmp_path / "out.png"
    rest = [] if scene == "statue" else ["chrome"]
    arguments = ["render", "--scene", scene, folder / "nickel.smrl", *rest, "--against", "nickel", "-o", path]
    result = run_json(capsys, *arguments, *SMALL)
    assert result.keys() >= KEYS | COMPARE_KEYS
    assert 10 < result["psnr_object_db"] < result["psnr_frame_db"] < 80
    assert result["reference"] == "nickel (SGD stand-in) (formula)"
    assert result["candidate"] == "nickel.smrl: nickel (SGD stand-in) (nearest)"
    files = sorted(file.name for file in tmp_path.iterdir())
    assert files == ["out.against.png", "out.png", "out.reference.png"]
    sheet = picture(tmp_path / "out.against.png")
    assert np.array_equal(sheet[:24, :24], picture(tmp_path / "out.reference.png")[:24, :24])


def test_against_itself_nothing_differs(capsys, folder, tmp_path):
    path, material = tmp_path / "out.exr", folder / "nickel.smrl"
    result = run_json(capsys, "render", "--scene", "statue", material, "--against", material, "-o", path, *SMALL)
    assert result["psnr_frame_db"] is None
    assert (picture(tmp_path / "out.difference.exr") == 0).all()
    assert np.array_equal(picture(tmp_path / "out.reference.exr"), picture(path))


def test_against_is_what_compare_says(capsys, folder, tmp_path):
    pair = "nickel", folder / "nickel.smrl"
    compared = run_json(capsys, "compare", *pair, *SMALL)
    rendered = run_json(capsys, "render", pair[1], "--against", pair[0], "-o", tmp_path / "x.png", *SMALL)
    assert {key: rendered[key] for key in COMPARE_KEYS} == {key: compared[key] for key in COMPARE_KEYS}


def test_several_references(capsys, folder, tmp_path):
    """The second one stands for the scene's own second material."""
    start = "render", "--scene", "still-life", folder / "nickel.smrl", "-o", tmp_path / "x.png", *SMALL
    both = "--against", folder / "pearl-paint.smrl", "--against", "chrome"
    one, two = run_json(capsys, *start, *both[:2]), run_json(capsys, *start, *both)
    assert (one["reference"].count(","), two["reference"].count(",")) == (0, 1)
    assert two["psnr_object_db"] < one["psnr_object_db"]


def test_a_mesh_without_normals_renders_and_says_so(capsys, tmp_path):
    (tmp_path / "mesh.obj").write_text(TRIANGLE)
    arguments = ["render", "--scene", "statue", "--mesh", tmp_path / "mesh.obj", "-o", tmp_path / "x.png", *SMALL]
    status, _, err = run(capsys, *arguments)
    assert status == 0
    assert err == f"warning: {tmp_path / 'mesh.obj'}: it has no vertex normals: they are computed from its faces\n"
    run_json(capsys, "render", "--scene", "statue", "-o", tmp_path / "own.png", *SMALL)
    assert not np.array_equal(picture(tmp_path / "x.png"), picture(tmp_path / "own.png"))


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--scene", "statue", "--mesh", "{}/none.obj"], 1, "none.obj: there is no such file"),
        (["--scene", "statue", "--mesh", "{}/text.obj"], 1, "text.obj: the mesh has no triangles"),
        (["--scene", "sphere", "--mesh", "{}/mesh.obj"], 2, "sphere: expected no --mesh"),
        (["--scene", "still-life", "--envmap", "{}/light.exr"], 2, "still-life: expected no --envmap"),
        (["--envmap", "{}/light.png"], 1, "light.png: expected an image of high dynamic range"),
        (
            ["--scene", "still-life", "nickel", "nickel", "nickel", "nickel"],
            2,
            "MATERIAL: expected at most 3 in still-life, found 4",
        ),
        (["nickel", "--against", "nickel", "--against", "nickel"], 2, "--against: expected at most 1, found 2"),
        (["nickel", "--against", "nickle"], 1, "did you mean nickel"),
        (["--scene", "grid", "nickel", "nickle"], 1, "did you mean nickel"),
        (["--scene", "grid", "{}/bad"], 1, "expected a folder with materials, found none"),
        (["--scene", "grid", "{}/empty"], 1, "expected a folder with materials, found none"),
        (["--scene", "statue", "{}/empty"], 1, "found a directory"),
        (["--scene", "grid", *["nickel"] * 20, "--size", "2048"], 2, "--size: expected at most 1831 for 20 materials"),
        (["--scene", "statue", "--size", "0"], 2, "--size: expected 8 to"),
        (["--scene", "grid", "--spp", "0"], 2, "--spp: expected 1 to"),
        (["--envmap", "{}/light.exr", "-o", "{}/light.exr"], 2, "expected an output other than the input"),
    ],
)
def test_what_makes_no_sense_is_refused_by_one_sentence(capsys, tmp_path, arguments, status, message):
    (tmp_path / "mesh.obj").write_text(TRIANGLE)
    (tmp_path / "text.obj").write_text("no mesh\n")
    write_image(tmp_path / "light.exr", default_environment(16))
    (tmp_path / "light.png").write_bytes(encode(np.full((8, 16, 3), 200, np.uint8)))
    for name in ("bad", "empty"):
        (tmp_path / name).mkdir()
    (tmp_path / "bad" / "x.smrl").write_bytes(b"SMRL")
    before = sorted(tmp_path.rglob("*"))
    found, out, err = run(capsys, "render", "-o", f"{tmp_path}/x.png", *(each.format(tmp_path) for each in arguments))
    assert (found, out) == (status, "")
    lines = err.splitlines()
    assert lines[-1].startswith("error: ")
    assert message in lines[-1]
    assert len(lines) == 1 + ("{}/bad" in arguments)  # a warning of each file, too
    assert sorted(tmp_path.rglob("*")) == before


def test_the_three_images_of_a_comparison(capsys, folder, tmp_path):
    """By cosine sampling, whose directions are the same for all: the render, the reference, and the first minus the
    second."""
    options = "--scene", "statue", "--sampler", "cosine", *SMALL
    own, reference = folder / "nickel.smrl", "chrome"
    run_json(capsys, "render", own, "--against", reference, "-o", tmp_path / "x.exr", *options)
    for name, brdf in (("x.exr", own), ("x.reference.exr", reference)):
        run_json(capsys, "render", brdf, "-o", tmp_path / "alone.exr", *options)
        assert np.array_equal(picture(tmp_path / name), picture(tmp_path / "alone.exr"))
    a, b = picture(tmp_path / "x.exr"), picture(tmp_path / "x.reference.exr")
    assert np.array_equal(picture(tmp_path / "x.difference.exr"), a - b)
    assert abs(a - b).max() > 0.01


def test_the_four_panels_of_a_comparison(capsys, folder, tmp_path):
    run_json(capsys, "render", folder / "nickel.smrl", "--against", "chrome", "-o", tmp_path / "x.png", *SMALL)
    a, b = picture(tmp_path / "x.reference.png"), picture(tmp_path / "x.png")
    sheet = picture(tmp_path / "x.against.png")
    panels = [sheet[:24, 24 * k : 24 * (k + 1)] for k in range(4)]
    for panel, expected in zip(panels, (a, b, signed_difference(a, b), flip_map(a, b)), strict=True):
        assert np.array_equal(panel, expected)
    must_fail(lambda: np.testing.assert_array_equal(panels[2], signed_difference(b, a)))


def test_only_spheres_with_a_reference_are_measured(capsys, folder, tmp_path):
    own, path = folder / "nickel.smrl", tmp_path / "x.png"
    alone = run_json(capsys, "render", own, "--against", "nickel", "-o", path, *SMALL)
    rest = "chrome", "pearl-paint", "--scene", "grid"
    grid = run_json(capsys, "render", own, *rest, "--against", "nickel", "-o", path, *SMALL)
    assert {key: grid[key] for key in COMPARE_KEYS} == {key: alone[key] for key in COMPARE_KEYS}


def test_a_label_stands_under_its_sphere(capsys, tmp_path):
    def labels(*names):
        run_json(capsys, "render", "--scene", "grid", *names, "-o", tmp_path / "x.png", "--size", 96, "--spp", 1)
        sheet = picture(tmp_path / "x.png")[96:]
        return sheet[:, :96], sheet[:, 96:]

    both, first, second = labels("nickel", "chrome"), labels("nickel", "nickel"), labels("chrome", "chrome")
    assert np.array_equal(both[0], first[0])
    assert np.array_equal(both[1], second[1])
    assert not np.array_equal(both[0], second[0])


def test_inputs_are_never_written_over(capsys, folder, tmp_path):
    material = (folder / "nickel.smrl").read_bytes()
    light, own = tmp_path / "x.reference.exr", tmp_path / "m.png"
    write_image(light, default_environment(16))
    before = light.read_bytes()
    part = tmp_path / "x.exr.sommerl-part"
    for path in (own, part):
        path.write_bytes(material)
    options = "-o", tmp_path / "x.exr", *SMALL
    for arguments in (
        ("render", "nickel", "--against", "chrome", "--envmap", light, *options),
        ("render", part, *options),
        ("compare", own, "nickel", "-o", own, *SMALL),
        ("compare", "nickel", own, "-o", own, *SMALL),
    ):
        status, _, err = run(capsys, *arguments)
        assert status == 2
        assert "expected an output other than the input" in err
    assert light.read_bytes() == before
    assert own.read_bytes() == part.read_bytes() == material
    assert not (tmp_path / "x.exr").exists()
