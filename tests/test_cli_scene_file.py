"""The command `render` with a scene file of the user's own."""

import re

import numpy as np
import pytest
from helpers import interrupting, lambertian_table, must_fail, run, run_json

from sommerl import TrainOptions, save, train
from sommerl.commands import console
from sommerl.formats import scene as snippets
from sommerl.render import checkpoint, passes
from sommerl.render.bsdf import register
from sommerl.render.images import write_image
from sommerl.render.llvm import mitsuba
from sommerl.render.passes import _seed

SCENE = """<scene version="3.0.0">
  <default name="material" value="nickel"/>
  <default name="width" value="12"/>
  {integrator}
  <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <sampler type="{sampler}"><integer name="sample_count" value="8"/></sampler>
    <film type="hdrfilm"><integer name="width" value="$width"/><integer name="height" value="10"/>
      <rfilter type="{filter}"/></film></sensor>
  <shape type="sphere"><transform name="to_world"><translate x="3" z="3"/></transform><emitter type="area"/></shape>
  <shape type="sphere"><bsdf type="sommerl"><string name="filename" value="$material"/></bsdf></shape>
  {more}
</scene>
"""
PATH, AOV = (
    '<integrator type="path"/>',
    '<integrator type="aov"><string name="aovs" value="far:depth,up:sh_normal"/><integrator type="path"/></integrator>',
)
PARTICLES, GRADIENTS = '<integrator type="ptracer"/>', '<integrator type="prb"/>'


def write_scene(path, *, integrator=PATH, sampler="independent", filter="box", more=""):
    path.write_text(SCENE.format(integrator=integrator, sampler=sampler, filter=filter, more=more))
    return path


def picture(path):
    return np.array(mitsuba().Bitmap(str(path)))


@pytest.fixture
def scene(tmp_path):
    return write_scene(tmp_path / "scene.xml")


@pytest.fixture
def short_passes(monkeypatch):
    """Of two samples a pixel."""
    monkeypatch.setattr(passes, "SAMPLES_A_PASS", 12 * 10 * 2)


def own(path, **parameters):
    """The scene as Mitsuba loads it."""
    register()
    return mitsuba().load_file(str(path), parallel=False, **parameters)


def test_it_is_what_mitsuba_renders(capsys, tmp_path, scene):
    result = run_json(capsys, "render", scene, "-o", tmp_path / "x.exr")
    assert result["seconds"] > 0
    del result["seconds"]
    assert result == {
        "image": str(tmp_path / "x.exr"), "spp": 8, "variant": mitsuba().variant(), "scene": str(scene),
        "size": [12, 10], "channels": ["R", "G", "B"], "files": [], "resumed": False, "warnings": [],
        "input": str(scene), "materials": [],
    }  # fmt: skip
    expected = np.array(mitsuba().render(own(scene), spp=8, seed=_seed(0, 0)))
    assert np.array_equal(picture(tmp_path / "x.exr"), expected)
    assert expected.std() > 0


@pytest.mark.parametrize(
    "change", [["--spp", 4], ["--seed", 1], ["-D", "material=chrome"], ["-Dmaterial=chrome"], ["-D", "width=13"]]
)
def test_options_change_it(capsys, tmp_path, scene, change):
    run_json(capsys, "render", scene, "-o", tmp_path / "x.exr", *change)
    run_json(capsys, "render", scene, "-o", tmp_path / "y.exr")
    options = dict(zip(("spp", "seed"), (8, 0), strict=True))
    if change[0] in ("--spp", "--seed"):
        options[change[0][2:]] = change[1]
        parameters = {}
    else:
        parameters = dict([change[-1].removeprefix("-D").split("=")])
    loaded = own(scene, **parameters)
    expected = np.array(mitsuba().render(loaded, spp=options["spp"], seed=_seed(options["seed"], 0)))
    assert np.array_equal(picture(tmp_path / "x.exr"), expected)
    must_fail(lambda: np.testing.assert_array_equal(picture(tmp_path / "y.exr"), expected))


def check_sum(found, sums, weights):
    np.testing.assert_allclose(found, sums / weights[..., None], rtol=2e-6, atol=1e-9)


def test_passes_are_summed_with_their_weights(capsys, tmp_path, short_passes):
    """With a filter wider than a pixel, the mean of finished passes is another image: the last ones count too little or
    too much wherever their samples lie."""
    path = write_scene(tmp_path / "scene.xml", filter="gaussian")
    run_json(capsys, "render", path, "-o", tmp_path / "x.exr")
    loaded = own(path)
    sensor = loaded.sensors()[0]
    held, finished = [], []
    for number in range(4):
        loaded.integrator().render(loaded, sensor=sensor, seed=_seed(0, number), spp=2, develop=False)
        held.append(np.array(sensor.film().develop(raw=True), np.float64))
        finished.append(np.array(sensor.film().develop(), np.float64))
    total = sum(held)
    check_sum(picture(tmp_path / "x.exr"), total[..., :3], total[..., 3])
    must_fail(check_sum, np.mean(finished, axis=0), total[..., :3], total[..., 3])


def check_near(found, expected):
    assert abs(found.mean() - expected.mean()) < 0.1 * expected.mean()


def test_particles_from_the_lights(capsys, tmp_path, short_passes):
    """Of them the film holds no weights: passes are means, and not added up."""
    path = write_scene(tmp_path / "scene.xml", integrator=PARTICLES)
    options = "--spp", 512, "-D", "material=beige-fabric"
    run_json(capsys, "render", path, "-o", tmp_path / "x.exr", *options)
    run_json(capsys, "render", write_scene(path), "-o", tmp_path / "y.exr", *options)
    check_near(picture(tmp_path / "x.exr"), picture(tmp_path / "y.exr"))
    must_fail(check_near, 256 * picture(tmp_path / "x.exr"), picture(tmp_path / "y.exr"))


def test_all_channels_are_kept_in_exr_and_the_colours_in_png(capsys, tmp_path, short_passes):
    path = write_scene(tmp_path / "scene.xml", integrator=AOV)
    result = run_json(capsys, "render", path, "-o", tmp_path / "x.exr")
    names = [field.name for field in mitsuba().Bitmap(str(tmp_path / "x.exr")).struct_()]
    assert sorted(names) == sorted(result["channels"])
    assert {"R", "G", "B", "far.T", "up.X", "up.Y", "up.Z"} <= set(names)
    pixels = picture(tmp_path / "x.exr")
    assert pixels.shape == (10, 12, len(names))
    depth = pixels[5, 6, names.index("far.T")]
    assert 3.9 < depth < 4.4
    run_json(capsys, "render", path, "-o", tmp_path / "x.png")
    run_json(capsys, "render", write_scene(path), "-o", tmp_path / "plain.png")
    assert picture(tmp_path / "x.png").shape == (10, 12, 3)
    assert np.array_equal(picture(tmp_path / "x.png"), picture(tmp_path / "plain.png"))


@pytest.mark.parametrize(("pixels", "shape"), [("luminance", (10, 12)), ("rgba", (10, 12, 4)), ("xyz", (10, 12, 3))])
def test_films_of_other_pixels(capsys, tmp_path, pixels, shape):
    path = write_scene(tmp_path / "scene.xml")
    text = path.read_text().replace("<rfilter", f'<string name="pixel_format" value="{pixels}"/><rfilter')
    path.write_text(text)
    for extension in ("png", "exr"):
        result = run_json(capsys, "render", path, "-o", tmp_path / f"x.{extension}")
        found = picture(tmp_path / f"x.{extension}")
        assert found.squeeze().shape == ((10, 12, 3) if extension == "png" else shape)
        assert len(result["channels"]) == (shape[2] if shape[2:] else 1)
        assert found.reshape(120, -1).std(axis=0).min() > 0


def check_8_bits(found, values):
    assert abs(found.astype(np.float64) - 255 * values).max() <= 0.51


def test_png_is_the_srgb_of_the_film(capsys, tmp_path, scene):
    """At no exposure: what is brighter than 1 is white."""
    for extension in ("png", "exr"):
        run_json(capsys, "render", scene, "-o", tmp_path / f"x.{extension}")
    linear = np.clip(picture(tmp_path / "x.exr").astype(np.float64), 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    check_8_bits(picture(tmp_path / "x.png"), srgb)
    must_fail(check_8_bits, picture(tmp_path / "x.png"), linear)


def test_a_crop_is_rendered_as_one(capsys, tmp_path, monkeypatch):
    """In several passes, as the whole is."""
    monkeypatch.setattr(passes, "SAMPLES_A_PASS", 12 * 10 * 2**13)
    path = write_scene(tmp_path / "scene.xml", filter="gaussian")
    crop = {"crop_width": 5, "crop_height": 4, "crop_offset_x": 4, "crop_offset_y": 3}
    numbers = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in crop.items())
    border = '<boolean name="sample_border" value="true"/>'
    run_json(capsys, "render", path, "-o", tmp_path / "whole.exr", "--spp", 2**16)
    path.write_text(path.read_text().replace("<rfilter", f"{numbers}{border}<rfilter"))
    assert run_json(capsys, "render", path, "-o", tmp_path / "x.exr", "--spp", 2**16)["size"] == [5, 4]
    whole = picture(tmp_path / "whole.exr")[3:7, 4:9]
    assert np.mean(picture(tmp_path / "x.exr")) == pytest.approx(whole.mean(), rel=0.02)


@pytest.fixture
def folder(tmp_path):
    """A scene in a folder of its own, which includes a snippet and has a texture; materials are beside that folder."""
    material, _ = train(lambertian_table(0.5), TrainOptions(clusters=1, epochs=1))
    save(material, tmp_path / "grey & white.smrl")
    place = tmp_path / "scenes"
    (place / "textures").mkdir(parents=True)
    snippets.write(tmp_path / "grey & white.smrl", place / "grey.xml")
    write_image(place / "textures" / "light.exr", np.ones((4, 8, 3), np.float32))
    more = """<path value="textures"/><include filename="grey.xml"/>
      <shape type="rectangle"><ref id="grey"/></shape>
      <emitter type="envmap"><string name="filename" value="$light.exr"/></emitter>"""
    write_scene(place / "scene.xml", more=more)
    return place


LIGHT = "-D", "light=light"


def test_files_are_found_from_the_scene(capsys, tmp_path, folder, monkeypatch):
    monkeypatch.chdir("/")
    result = run_json(capsys, "render", folder / "scene.xml", *LIGHT, "-o", tmp_path / "x.exr")
    assert set(result["files"]) == {"grey.xml", "../grey & white.smrl", "light.exr"}
    assert picture(tmp_path / "x.exr").std() > 0


def test_what_is_read_is_never_written_over(capsys, folder):
    texture = folder / "textures" / "light.exr"
    before = texture.read_bytes()
    for output in (texture, folder / "scene.xml"):
        assert run(capsys, "render", folder / "scene.xml", *LIGHT, "-o", output)[0] == 2
    assert texture.read_bytes() == before


def stop(capsys, monkeypatch, *arguments):
    with monkeypatch.context() as patch:
        patch.setattr(console, "progress", interrupting)
        patch.setattr(checkpoint, "SECONDS", 0.0)
        with pytest.raises(KeyboardInterrupt):
            run(capsys, "render", *arguments)
    return capsys.readouterr().err


@pytest.mark.parametrize("integrator", [PATH, AOV, PARTICLES, GRADIENTS])
def test_it_goes_on_to_the_same_image(capsys, tmp_path, monkeypatch, short_passes, integrator):
    scene = write_scene(tmp_path / "scene.xml", integrator=integrator)
    run_json(capsys, "render", scene, "-o", tmp_path / "whole.exr")
    part = tmp_path / "x.exr.sommerl-part"
    assert f"{part}: from here" in stop(capsys, monkeypatch, scene, "-o", tmp_path / "x.exr")
    assert part.exists()
    assert not (tmp_path / "x.exr").exists()
    assert run_json(capsys, "render", scene, "-o", tmp_path / "x.exr")["resumed"]
    assert not part.exists()
    found, whole = (picture(tmp_path / name) for name in ("x.exr", "whole.exr"))
    # Where several threads add to one pixel, its sum is rounded in any order.
    np.testing.assert_allclose(found, whole, rtol=1e-5 if integrator in (PARTICLES, GRADIENTS) else 0)


def change_scene(folder):
    path = folder / "scene.xml"
    path.write_text(path.read_text().replace('value="8"', 'value="9"', 1))


def change_material(folder):
    save(train(lambertian_table(0.4), TrainOptions(clusters=1, epochs=1))[0], folder.parent / "grey & white.smrl")


def change_texture(folder):
    write_image(folder / "textures" / "light.exr", np.full((4, 8, 3), 2, np.float32))


def change_include(folder):
    (folder / "grey.xml").write_text((folder / "grey.xml").read_text() + "\n")


CHANGES = {
    "scene": (change_scene, ["--spp", "8"]),
    "file ../grey & white.smrl": (change_material, []),
    "file light.exr": (change_texture, []),
    "file grey.xml": (change_include, []),
    "-D material": (None, ["-D", "material=chrome"]),
    "spp": (None, ["--spp", "9"]),
    "seed": (None, ["--seed", "1"]),
}


@pytest.mark.parametrize("what", CHANGES)
def test_whatever_decides_the_pixels_makes_it_another_render(capsys, tmp_path, monkeypatch, folder, short_passes, what):
    usual = folder / "scene.xml", *LIGHT, "-o", tmp_path / "x.exr"
    stop(capsys, monkeypatch, *usual)
    change, options = CHANGES[what]
    if change:
        change(folder)
    status, _, err = run(capsys, "render", *usual, *options)
    assert status == 0
    assert f"it is of a render with another {what}; this render starts anew" in err


def test_mitsuba_warns_on_standard_error_once(capsys, tmp_path, short_passes):
    """And not among the results."""
    path = write_scene(tmp_path / "scene.xml", sampler="stratified")
    status, out, err = run(capsys, "render", path, "-o", tmp_path / "x.exr", "--json")
    assert status == 0
    assert out.startswith("{")
    lines = err.splitlines()
    assert lines
    assert len(set(lines)) == len(lines)
    assert all(re.match(r"warning: Sample count should be square and power of two, rounding to \d+$", x) for x in lines)


@pytest.mark.parametrize(
    ("change", "arguments", "status", "message"),
    [
        (None, ["{}/none.xml"], 1, "none.xml: there is no such file"),
        (None, ["nickel", "{}/scene.xml"], 2, "scene.xml: expected one scene file and no materials, found 2 inputs"),
        (None, ["{}/scene.xml", "--scene", "sphere"], 2, "--scene: expected no such option beside a scene file"),
        (None, ["{}/scene.xml", "--size", "256"], 2, "--size: expected no such option beside a scene file"),
        (None, ["{}/scene.xml", "--size", "0"], 2, "--size: expected no such option beside a scene file"),
        (None, ["{}/scene.xml", "--against", "nickel"], 2, "--against: expected no such option"),
        (None, ["{}/scene.xml", "--sampler", "cosine"], 2, "--sampler: expected no such option"),
        (None, ["{}/scene.xml", "--lookup", "nearest"], 2, "--lookup: expected no such option"),
        (None, ["{}/scene.xml", "--mesh", "x.obj"], 2, "--mesh: expected no such option"),
        (None, ["{}/scene.xml", "--envmap", "x.exr"], 2, "--envmap: expected no such option"),
        (None, ["{}/scene.xml", "--spp", "0"], 2, "--spp: expected 1 to"),
        (None, ["{}/scene.xml", "--seed", "-1"], 2, "--seed: expected 0 to"),
        (None, ["{}/scene.xml", "--variant", "nosuch"], 2, "--variant: expected scalar_rgb"),
        (None, ["nickel", "--variant", "scalar_rgb"], 2, "--variant: expected a scene file"),
        (None, ["nickel", "-D", "a=b"], 2, "-D: expected a scene file"),
        (None, ["{}/scene.xml", "-D", "material"], 2, "-D: expected name=value, found material"),
        (None, ["{}/scene.xml", "-D", "=x"], 2, "-D: expected name=value, found =x"),
        (None, ["{}/scene.xml", "-D", "path=x"], 2, "-D: expected a name other than optimize, parallel, path"),
        (None, ["{}/scene.xml", "-D", "width=9", "-D", "width=8"], 2, "-D: expected each name once, found width again"),
        (None, ["{}/scene.xml", "-D", "unused=1"], 1, "(Found unused parameters: $unused=1)"),
        (None, ["{}/scene.xml", "-D", "width=x"], 1, 'could not parse integer value "x"'),
        (None, ["{}/scene.xml", "-D", "width=1677722"], 1, "the film has 1677722 × 10 pixels, more than 16777216"),
        (None, ["{}/scene.xml", "-D", "material=nickle"], 1, "did you mean nickel"),
        (None, ["{}/scene.xml", "-D", "material=none.smrl"], 1, "none.smrl: there is no such file"),
        (None, ["{}/scene.xml", "-D", "material={}/bad.smrl"], 1, "bad.smrl: expected at least"),
        (
            ("</scene>", ""),
            ["{}/scene.xml"],
            1,
            "Mitsuba cannot load the scene (Parsing of XML",
        ),
        ((r"\$material", "$other"), ["{}/scene.xml"], 1, "undefined parameter: $other"),
        (('value="8"', 'value="0"'), ["{}/scene.xml"], 2, "scene.xml: sample_count: expected 1 to"),
        (("perspective", "nosuch"), ["{}/scene.xml"], 1, 'Plugin "nosuch" not found'),
        (("<bsdf", '<float name="x" value="1"/><bsdf'), ["{}/scene.xml"], 1, "Found 1 unreferenced property"),
        (("<rfilter", '<include filename="no.xml"/><rfilter'), ["{}/scene.xml"], 1, "scene.xml"),
        (('<integrator type="path"/>', ""), ["{}/scene.xml"], 1, "the scene has no integrator"),
        (("<sensor.*</sensor>", ""), ["{}/scene.xml"], 1, "scene.xml: the scene has no sensor"),
        ((" type=", " typ="), ["{}/scene.xml"], 1, "scene.xml: Mitsuba cannot load the scene"),
        (None, ["{}/snippet.xml"], 1, "snippet.xml: the scene has no shapes (a snippet has to be included"),
        (None, ["{}/bsdf.xml"], 1, "bsdf.xml: the file describes no scene"),
        (None, ["{}/zeros.xml"], 1, "zeros.xml: Mitsuba cannot load the scene"),
        (None, ["{}/folder.xml"], 1, "folder.xml: it is not a file"),
        (None, ["{}/scene.xml", "-o", "{}/x.jpg"], 2, "x.jpg: expected a name that ends in .png or .exr"),
    ],
)
def test_what_makes_no_sense_is_refused_by_one_sentence(capsys, tmp_path, change, arguments, status, message):
    text = write_scene(tmp_path / "scene.xml").read_text()
    if change:
        (tmp_path / "scene.xml").write_text(re.sub(*change, text, flags=re.DOTALL))
    (tmp_path / "bad.smrl").write_bytes(b"SMRL")
    (tmp_path / "zeros.xml").write_bytes(bytes(1000))
    (tmp_path / "bsdf.xml").write_text('<bsdf version="3.0.0" type="diffuse"/>')
    (tmp_path / "folder.xml").mkdir()
    snippets.write("nickel", tmp_path / "snippet.xml")
    before = sorted(tmp_path.rglob("*"))
    found, out, err = run(capsys, "render", "-o", f"{tmp_path}/x.png", *(each.format(tmp_path) for each in arguments))
    assert (found, out) == (status, "")
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert message in err
    assert "Traceback" not in err
    assert ".cpp" not in err
    assert sorted(tmp_path.rglob("*")) == before
