"""The scenes by name: what they take, what their masks show, and that they repeat."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers import lambertian_table, must_fail

from sommerl import builtin
from sommerl.render.environment import default_environment
from sommerl.render.llvm import mitsuba
from sommerl.render.meshes import knot
from sommerl.render.passes import render
from sommerl.render.scene_registry import SCENES, make_scene
from sommerl.render.viewpoint import Viewpoint
from sommerl.sampling.cosine import CosineSampler
from sommerl.system.errors import OptionError

mi = mitsuba()
DOCS = Path(__file__).parents[2] / "docs" / "scenes.md"


def materials(name):
    """As many as a picture has, of those that are the scene's own."""
    return [builtin(material) for material in SCENES[name].materials[: SCENES[name].places]]


def check_same(scene, spp, seed=3, other=3):
    """Not all numbers of samples give the same sums in one pass of Mitsuba's."""
    first, again = render(scene, spp=spp, seed=seed).pixels, render(scene, spp=spp, seed=other).pixels
    assert np.array_equal(first, again)


@pytest.mark.parametrize("name", SCENES)
def test_same_seed_same_pixels(name):
    greys = [lambertian_table(0.3 + 0.1 * place) for place in range(SCENES[name].places)]
    scene = make_scene(name, greys, size=40)  # once: Mitsuba compiles for each
    for _ in range(3):
        check_same(scene, 37)
    must_fail(check_same, scene, 37, 3, 4)


def test_shapes_and_lamps_come_in_the_order_of_the_description():
    """Mitsuba draws lamps by their number: in another order, the same seed would give another image."""
    scene = make_scene("still-life", [lambertian_table()] * 3, size=8)
    shapes = [shape.id() for shape in scene.mitsuba.shapes()]
    assert shapes == [*scene.objects, "table", "key", "rim", "front"]
    lamps = [emitter.get_shape() for emitter in scene.mitsuba.emitters()]
    assert [lamp.id() for lamp in lamps if lamp] == ["key", "rim", "front"]


def test_the_objects_are_what_carries_the_materials():
    """With black materials, the mask is what no light comes from."""
    for name in ("statue", "ball", "still-life"):
        scene = make_scene(name, [lambertian_table(1e-9)] * SCENES[name].places, size=96)
        image = render(scene, spp=16)
        assert image.pixels[image.mask].mean() < 0.05 * image.pixels[~image.mask].mean()
        black = image.pixels.max(axis=-1) < 1e-7
        edges = sum(np.abs(np.diff(image.mask.astype(int), axis=axis)).sum() for axis in (0, 1))
        assert (black & ~image.mask).sum() < 0.01 * image.mask.sum()
        assert (image.mask & ~black).sum() < edges


def check_no_holes(brdf):
    """Hardly any pixel of the statue is black: its front is outside, and its smooth normals face the camera."""
    image = render(make_scene("statue", [brdf], environment=np.ones((8, 16, 3), np.float32), size=128), spp=64)
    assert (image.pixels[image.mask].max(axis=-1) < 0.02).mean() < 1e-3


def test_the_statue_has_no_holes():
    check_no_holes(lambertian_table(0.5))
    must_fail(check_no_holes, lambertian_table(0.01))


def test_a_mesh_stands_on_the_plane_at_unit_height():
    whole = make_scene("statue", materials("statue"), size=64)
    other = make_scene("statue", materials("statue"), mesh=knot("any name").moved(5, 5, 5), size=64)
    rows = [np.flatnonzero(render(scene, spp=1).mask.any(axis=1))[[0, -1]] for scene in (whole, other)]
    assert np.abs(rows[0] - rows[1]).max() <= 3


def test_the_same_directions_for_all_materials():
    """A brighter material gives a brighter image and no other noise: no path ends by what it carries."""
    environment = default_environment(32)
    grey, dark = (
        render(make_scene("statue", [lambertian_table(albedo)], environment=environment, size=32), spp=4)
        for albedo in (0.4, 0.2)
    )
    inside = np.logical_and.reduce([np.roll(grey.mask, (y, x), (0, 1)) for y in (-1, 0, 1) for x in (-1, 0, 1)])
    ratio = grey.pixels[inside] / dark.pixels[inside]
    assert ratio.min() > 1.9999  # and more where light bounces between folds
    assert ratio.max() > 2.05


def check_docs(markdown):
    rows = re.findall(r"^\| `([a-z-]+)` \|", markdown[: markdown.index("\n\n    ")], re.MULTILINE)
    assert rows == list(SCENES)


def test_docs_have_a_row_for_each_scene():
    markdown = DOCS.read_text("utf-8")
    check_docs(markdown)
    must_fail(check_docs, markdown.replace("| `grid` |", "| `cube` |"))


def test_scenes_refuse_what_they_do_not_take():
    with pytest.raises(OptionError, match="still-life: expected 3 materials, found 1"):
        make_scene("still-life", materials("statue"))
    with pytest.raises(OptionError, match="expected no environment"):
        make_scene("still-life", materials("still-life"), environment=default_environment(16))
    with pytest.raises(OptionError, match="sphere: expected no mesh"):
        make_scene("sphere", materials("sphere"), mesh=knot("knot"))
    with pytest.raises(OptionError, match="still-life: expected no view"):
        make_scene("still-life", materials("still-life"), view=Viewpoint(0, 10))
    for name in ("statue", "ball"):
        with pytest.raises(OptionError, match=f"{name}: expected a view from above the plane"):
            make_scene(name, materials(name), view=Viewpoint(20, -30))
    with pytest.raises(OptionError, match="grid: expected 1 material, found 0"):
        make_scene("grid", [])
    with pytest.raises(OptionError, match="scene: expected sphere, statue, ball, sample, still-life, grid, found cube"):
        make_scene("cube", [])


@pytest.mark.parametrize("name", SCENES)
def test_samplers_are_the_ones_that_are_given(name):
    """Cosine sampling is the same for all materials, and other than the default."""
    brdfs = materials(name)
    one, other = (
        render(
            make_scene(name, brdfs, samplers=[CosineSampler.fitted(brdf) for brdf in fitted_to], size=24), spp=4
        ).pixels
        for fitted_to in (brdfs, brdfs[::-1])
    )
    assert np.array_equal(one, other)
    assert not np.array_equal(one, render(make_scene(name, brdfs, size=24), spp=4).pixels)


def brightness(name, brdf):
    image = render(make_scene(name, [brdf] * SCENES[name].places, size=48), spp=256)
    return image.pixels[image.mask].mean()


def check_as_bright(found, expected):
    assert found == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("name", SCENES)
def test_a_lambertian_is_mitsubas_diffuse(name):
    """Mitsuba's own material, whose code has nothing in common with ours."""
    own = brightness(name, mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}))
    check_as_bright(brightness(name, lambertian_table(0.5)), own)
    must_fail(check_as_bright, brightness(name, lambertian_table(0.51)), own)
