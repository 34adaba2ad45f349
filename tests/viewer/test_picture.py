"""The page's pictures against Python's, and its figures against those of who defined them."""

import base64
import io
from pathlib import Path

import flip_evaluator
import numpy as np
import pytest
from browser import go, numbers, wait_until
from helpers import must_fail
from PIL import Image
from scipy.spatial import cKDTree

from sommerl import load
from sommerl.models.builtin import builtin
from sommerl.render.environment import default_environment
from sommerl.render.meshes import Mesh
from sommerl.render.metrics import exposure, psnr, to_srgb8
from sommerl.render.passes import render_all
from sommerl.render.scene_registry import make_scene
from sommerl.render.scenes import finial, material_ball
from sommerl.render.viewpoint import DirectionalLight, Viewpoint
from sommerl.viewer.held import held
from sommerl.viewer.page import page

SIZE = 96
GOLD = Path(__file__).parent / "gold.smrl"  # `sommerl compress gold-metallic-paint --target-size 600`


@pytest.fixture(scope="module")
def materials():
    """On nodes, and on cells that a formula is sampled at."""
    return [load(GOLD), builtin("purple-paint")]


@pytest.fixture(scope="module")
def html(materials):
    return page([held(brdf, f"{brdf.name} {i}") for i, brdf in enumerate(materials)])


@pytest.fixture(scope="module")
def asked(browse_for_all, html):
    """A page that is asked for pictures of any size. Its own is small, since it is drawn all the while."""
    return browse_for_all(html, viewport={"width": 400, "height": 150})


def opened(browse, html, fragment):
    shown = browse(html, viewport={"width": 400, "height": 400})
    go(shown, fragment)
    return shown


def radiance(shown, number, paths, *, size=SIZE, bounces=1, **state):
    """Radiance (size, size, 3) and coverage (size, size)."""
    given = [number, state, size, size, paths, bounces]
    pixels = numbers(shown, "given => sommerl.radiance(...given)", given).reshape(size, size, 4)[::-1]
    return pixels[..., :3], pixels[..., 3]


def sphere(brdf, light, azimuth=0.0, elevation=0.0):
    """A sphere under a lamp of irradiance π, by a ray through the middle of each pixel: radiance, and where it is."""

    def towards(azimuth, elevation):
        a, e = np.radians([azimuth, elevation])
        return np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])

    back = towards(azimuth, elevation)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    eye = 5 * back
    x = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, y = np.meshgrid(x, -x)
    tangent = np.tan(np.arcsin(1 / 5)) / 0.9
    ray = tangent * (x[..., None] * right + y[..., None] * np.cross(back, right)) - back
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    along = ray @ eye
    square = along**2 - eye @ eye + 1
    normal = eye + (-along - np.sqrt(np.maximum(square, 0)))[..., None] * ray
    tangent = np.cross([0.3, 0.5, 0.8], normal)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=-2)
    wi, wo = frame @ towards(*light), np.einsum("yxij,yxj->yxi", frame, -ray)
    f = brdf.eval(wi, wo) * np.pi * np.maximum(wi[..., 2:], 0)
    return np.where(square[..., None] > 0, f, 0), square > 0


def check_alike(found, expected, mask, least):
    scale = exposure(expected, mask)
    assert psnr(*(to_srgb8(one[mask] * scale) for one in (expected, found))) >= least


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(("light", "azimuth", "elevation"), [((-35, 40), 0, 0), ((70, 10), 25, 50)])
def test_a_sphere_under_a_lamp(asked, materials, number, light, azimuth, elevation):
    state = {"scene": "sphere", "environment": False, "azimuth": azimuth, "elevation": elevation}
    found, covered = radiance(asked, number, 1, light=light, **state)
    expected, mask = sphere(materials[number], light, azimuth, elevation)
    assert (mask != (covered > 0)).sum() <= 2  # of which single precision may think otherwise
    check_alike(found, expected, mask & (covered > 0), 45)
    elsewhere, _ = radiance(asked, number, 1, light=[light[0] + 4, light[1]], **state)
    must_fail(check_alike, elsewhere, expected, mask & (covered > 0), 45)


@pytest.mark.parametrize("number", [0, 1])
def test_a_sphere_in_the_environment(asked, materials, number):
    found, _ = radiance(asked, number, 600, size=64, scene="sphere", environment=True)
    scene = make_scene("sphere", [materials[number]], environment=default_environment(), size=64)
    (expected,) = render_all([lambda: scene], spp=1024, seed=0)
    check_alike(found, expected.pixels, expected.mask, 38)
    must_fail(check_alike, found[:, ::-1], expected.pixels, expected.mask, 38)


TRIANGLES = """
async (scene) => {
    await sommerl.store.mesh(scene);
    return sommerl.store.meshes.get(scene).triangles;
}
"""
ALL = 7  # bounces after the first surface, as `sommerl render` has them


def mesh_of(shown, scene):
    """The page's own triangles: it has coarser ones than Python."""
    corner, one, other, *normals = np.moveaxis(numbers(shown, TRIANGLES, scene).reshape(-1, 6, 4)[..., :3], 1, 0)
    positions = np.stack([corner, corner + one, corner + other], axis=1).reshape(-1, 3)
    faces = np.arange(len(positions)).reshape(-1, 3)
    return Mesh(
        scene, positions.astype("f4"), faces.astype("u4"), np.stack(normals, axis=1).reshape(-1, 3).astype("f4")
    )


@pytest.mark.parametrize(("scene", "environment"), [("statue", False), ("ball", True), ("sample", False)])
def test_the_other_scenes(asked, materials, scene, environment):
    lamp = DirectionalLight(40, 50)
    light = default_environment() if environment else lamp
    mesh = None if scene == "sample" else mesh_of(asked, scene)
    name = "sample" if scene == "sample" else "statue"  # which stands as the ball does
    made = make_scene(name, [materials[0]], environment=light, mesh=mesh, view=Viewpoint(20, 25, 1.1), size=64)
    (expected,) = render_all([lambda: made], spp=256, seed=0)
    state = {"scene": scene, "environment": environment, "azimuth": 20, "elevation": 25, "zoom": 1.1}
    found, covered = radiance(asked, 0, 96, size=64, bounces=ALL, light=[40, 50], **state)
    least = 28 if environment else 32  # of which noise and edges take most

    def check(found, covered):
        both, either = expected.mask & (covered >= 0.5), expected.mask | (covered >= 0.5)
        assert both.sum() >= 0.98 * either.sum()
        check_alike(found, expected.pixels, expected.mask, least)

    check(found, covered)
    must_fail(check, found[:, ::-1], covered[:, ::-1])
    must_fail(check, np.roll(found, 2, axis=0), covered)


def test_pythons_meshes_are_the_pages(asked):
    """The page's vertices lie on Python's surfaces, within the error of both."""
    for scene, made in (("statue", finial().standing()), ("ball", material_ball())):
        mesh = mesh_of(asked, scene)

        def check(positions, made=made):
            away, _ = cKDTree(made.positions).query(positions)
            assert np.percentile(away, 99) < 0.009  # half of the way between Python's vertices

        check(mesh.positions)
        must_fail(check, mesh.positions * 1.03)


READ = """
async () => {
    const { picture, state } = sommerl;
    const { psnr, flip } = await picture.figures(state);
    const read = await Promise.all([...picture.shown, picture.map].map((one) => picture.device.pixels(one)));
    const [{ height, width }] = picture.shown;
    return [height, width, psnr.object, psnr.frame, flip, ...read.flatMap((pixels) => [...pixels])];
}
"""


def test_figures(browse, html):
    """PSNR is Python's, and FLIP that of its authors."""
    shown = opened(browse, html, "a=0&b=1&view=flip")
    wait_until(shown, "sommerl.picture.count >= 2 && sommerl.picture.films.length > 1")
    height, width, in_object, in_frame, flip, *_ = found = numbers(shown, READ)
    *pictures, drawn = found[5:].reshape(3, int(height), int(width), 4)[:, ::-1]
    a, b = (one.astype(np.uint8) for one in pictures)
    mask = a[..., 3] >= 128
    pair = [one[..., :3] for one in (a, b)]
    expected, mean, _ = flip_evaluator.evaluate(
        *(one.astype(np.float32) / 255 for one in pair), "LDR", applyMagma=False
    )
    drawn = drawn[..., 0]
    assert mean > 0.01

    def check(drawn):
        assert np.abs(drawn - np.squeeze(expected)).max() <= 1e-3

    check(drawn)
    must_fail(check, drawn[:, ::-1])
    assert in_object == pytest.approx(psnr(*(one[mask] for one in pair)), abs=1e-6)
    assert in_frame == pytest.approx(psnr(*pair), abs=1e-6)
    assert flip == pytest.approx(drawn[mask].mean(), abs=1e-6)


def test_what_is_saved_is_what_is_shown(browse, html):
    """In A's picture exposed as `sommerl render` exposes, the object's 90th percentile is 0.6 linear."""
    shown = opened(browse, html, "view=a")
    wait_until(shown, "sommerl.picture.count === 16 && sommerl.picture.canvas.width > 300")
    # At once: between two calls, the page might have begun another picture.
    shown_scale, *_ = found = numbers(
        shown,
        """async () => {
            sommerl.picture.show(sommerl.state);
            const { scale } = sommerl.state;
            window.saved = sommerl.canvas.toDataURL();
            return [scale, ...(await sommerl.onCanvas())];
        }""",
    )
    data, linear = shown.evaluate("saved"), found[1:]
    pixels = np.array(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB"))
    linear = linear.reshape(*pixels.shape[:2], 4)[::-1]
    mask = linear[..., 3] >= 0.5
    scale = exposure(linear[..., :3], mask)
    assert shown_scale == pytest.approx(scale, rel=0.01)
    expected = to_srgb8(linear[..., :3] * scale)[linear[..., 3] == 1]
    assert np.abs(expected.astype(int) - pixels[linear[..., 3] == 1]).max() <= 2
