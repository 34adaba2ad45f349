"""The page with WebGPU: it shows what it shows with WebGL2, and goes on with that where WebGPU fails."""

import base64
import io
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from browser import READY, Noise, check_quiet, numbers, wait_until
from helpers import must_fail
from PIL import Image

from sommerl import load
from sommerl.models.builtin import builtin
from sommerl.render.metrics import exposure, psnr, to_srgb8
from sommerl.viewer.held import held
from sommerl.viewer.page import page

GOLD = Path(__file__).parent / "gold.smrl"
SMALL = {"width": 360, "height": 500}
# Both devices calculate in single precision, and do not have to round alike: a path may meet an edge on one and miss
# it on the other. Here, where the processor calculates for both, pictures are equal.
LEAST = 60  # dB
KIND = "sommerl.picture.device.kind"


@pytest.fixture
def chromium(chromium_with_webgpu):
    """Of this file's pages."""
    return chromium_with_webgpu


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A page of a compressed material and of another one's table."""
    made = tmp_path_factory.mktemp("page") / "page.html"
    shown = [held(load(GOLD), "gold", name="gold.smrl"), held(builtin("purple-paint"), "purple-paint")]
    made.write_text(page(shown), "utf-8")
    return made


@pytest.fixture(scope="module")
def both(chromium_with_webgpu, path):
    """The page with WebGPU, and with WebGL2. Their exposure is given, and so the same."""
    noise, pages = Noise(), []
    for fragment in ("#scale=3&device=webgpu", "#scale=3&device=webgl"):
        shown = chromium_with_webgpu.new_page(viewport=SMALL)  # in a window of its own, or it would stand still
        pages.append(shown)
        noise.listen(shown, path.as_uri())
        shown.goto(path.as_uri() + fragment)
        wait_until(shown, READY)
    assert [one.evaluate(KIND) for one in pages] == ["WebGPU", "WebGL2"]
    yield pages
    for shown in pages:
        shown.context.close()
    check_quiet(noise)


def asked(both, script, *given):
    return [one.evaluate(script, list(given)) for one in both]


def numbers_asked(both, script, *given):
    return [numbers(one, script, list(given)) for one in both]


def check_alike(found, expected, least=LEAST):
    assert psnr(expected, found) >= least


RADIANCE = "([number, state, paths]) => sommerl.radiance(number, state, 48, 48, paths)"
SCENES = {
    "a lamp": (0, 1, {"scene": "sphere", "environment": False}),
    "a table": (1, 1, {"scene": "sphere", "environment": False, "azimuth": 30}),
    "an environment": (0, 8, {"scene": "sphere", "environment": True}),
    "statue": (0, 2, {"scene": "statue", "environment": True}),
    "ball": (1, 4, {"scene": "ball", "environment": False, "elevation": 30}),
    "sample": (0, 2, {"scene": "sample", "environment": True, "elevation": 45}),
}


@pytest.mark.parametrize("name", SCENES)
def test_pictures_are_those_of_webgl2(both, name):
    number, paths, state = SCENES[name]
    given = [number, {"light": [40, 50], **state}, paths]
    found, expected = (one.reshape(48, 48, 4) for one in numbers_asked(both, RADIANCE, *given))
    scale = exposure(expected[..., :3], expected[..., 3] >= 0.5)
    found, expected = (to_srgb8(one[..., :3] * scale) for one in (found, expected))
    check_alike(found, expected)
    must_fail(check_alike, found[::-1], expected)
    must_fail(check_alike, np.roll(found, 1, axis=1), expected)


SHOWN = """
async ([view]) => {
    const { picture, state, loop } = sommerl;
    sommerl.change({ b: 1, view, scene: "sphere", azimuth: 25, light: [50, 40] });
    const whole = () => !loop.anew && picture.count === 16 && loop.resolution === 1;
    const done = () => whole() && loop.compared === 16 && (view === "flip") === Boolean(sommerl.figures?.flip);
    while (!done()) await new Promise((next) => setTimeout(next, 20));
    picture.show(state);
    return [sommerl.canvas.toDataURL(), sommerl.figures.psnr, sommerl.figures.flip];
}
"""


def picture_of(url):
    return np.array(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB"))


def check_same_figures(found, expected):
    assert found == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("view", ["split", "side", "difference", "flip"])
def test_the_canvas_and_the_figures_are_those_of_webgl2(both, view):
    (found, *figures), (expected, *others) = asked(both, SHOWN, view)
    found, expected = picture_of(found), picture_of(expected)
    assert np.ptp(expected) > 150
    check_alike(found, expected)
    must_fail(check_alike, found[::-1], expected)
    must_fail(check_alike, found[:, ::-1], expected)
    check_same_figures(figures[0], others[0])
    must_fail(check_same_figures, {name: value + 0.01 for name, value in figures[0].items()}, others[0])
    assert (figures[1] is not None) == (view == "flip")
    if view == "flip":
        check_same_figures(figures[1], others[1])
        must_fail(check_same_figures, 1.1 * figures[1], others[1])


DRAWN = "([number, wi, wo, what]) => sommerl.evaluate(number, wi, wo, what)"


def check_mostly_equal(found, expected):
    """But where both choose between neighbours that are nearly as near."""
    assert np.isclose(found, expected, rtol=1e-3, atol=1e-4).all(axis=-1).mean() > 0.995


@pytest.mark.parametrize(("number", "what"), list(product((0, 1), ("entries", "sample", "pdf"))))
def test_directions_and_entries_are_those_of_webgl2(both, number, what):
    rng = np.random.default_rng(3)
    wo = rng.normal(size=(1000, 3))
    wo[:, 2] = np.abs(wo[:, 2])
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    wi = rng.random((1000, 3)) if what == "sample" else np.roll(wo, 1, axis=0)
    given = [number, wi.ravel().tolist(), wo.ravel().tolist(), what]
    found, expected = (one.reshape(-1, 3) for one in numbers_asked(both, DRAWN, *given))
    assert np.isfinite(found).all()
    check_mostly_equal(found, expected)
    if (number, what) != (1, "entries"):  # a table has none
        must_fail(check_mostly_equal, np.roll(found, 1, axis=0), expected)


MARKED = """
async ([wi, wo]) => {
    const { picture, loop } = sommerl;
    const [shape] = await sommerl.evaluate(0, wi, wo, "entries");
    sommerl.change({ view: "a", scene: "sphere", light: [20, 40] });
    sommerl.highlight({ material: 0, shape });
    while (!picture.used || loop.resolution < 1 || loop.anew) await new Promise((next) => setTimeout(next, 20));
    const found = await picture.device.pixels(picture.used);
    sommerl.highlight(null);
    return found;
}
"""


def test_the_pixels_of_an_entry_are_those_of_webgl2(both):
    found, expected = (one.reshape(-1, 4) for one in numbers_asked(both, MARKED, [0.1, 0.2, 0.9], [0.2, -0.1, 0.9]))
    assert 50 < (expected[:, 0] == 255).sum() < 0.9 * len(expected)
    check_mostly_equal(found, expected)
    must_fail(check_mostly_equal, np.roll(found, 5, axis=0), expected)
    must_fail(check_mostly_equal, 255 - found, expected)


def saved(shown):
    shown.evaluate("sommerl.change({ view: 'a', scene: 'sphere', azimuth: 25, light: [50, 40] })")
    wait_until(shown, "sommerl.picture.count === 16 && sommerl.loop.resolution === 1 && !sommerl.loop.anew")
    with shown.expect_download() as download:
        shown.click("text=Save PNG")
    return np.array(Image.open(Path(download.value.path())).convert("RGB"))


def test_a_picture_is_saved(both):
    found, expected = (saved(one) for one in both)
    assert np.ptp(found) > 150
    check_alike(found, expected)
    must_fail(check_alike, np.zeros_like(found), expected)


LOSE = "sommerl.picture.device.device.destroy()"


def check_webgl2(shown, words=""):
    assert shown.evaluate("document.getElementById('messages').textContent") == words
    assert shown.evaluate(KIND) == "WebGL2"


def test_a_device_that_is_lost(browse, path):
    """The page goes on with WebGL2, and with its state."""
    shown = browse(path.as_uri() + "#device=webgpu&from=33,5,1&view=a", viewport=SMALL)
    must_fail(check_webgl2, shown)
    with shown.expect_event("load"):
        shown.evaluate(LOSE)
    wait_until(shown, READY)
    check_webgl2(shown)
    assert shown.evaluate("[sommerl.state.azimuth, sommerl.state.view]") == [33, "a"]
    assert "device=webgl" in shown.evaluate("sommerl.link()")


def test_a_device_that_is_lost_takes_nothing_along(browse, path):
    """What was dropped would be lost, too: the page says what has happened."""
    shown = browse(path.as_uri() + "#device=webgpu", viewport=SMALL)
    shown.evaluate("data => sommerl.dropped('x.smrl', data)", base64.b64encode(GOLD.read_bytes()).decode())
    shown.evaluate(LOSE)
    wait_until(shown, "document.querySelector('#messages p')")
    assert shown.text_content("#messages p").startswith("The graphics device was lost: reload the page.")
    assert shown.evaluate("sommerl.materials.length") == 3
    assert shown.locator("#messages p").count() == 1


BROKEN = {
    "none": "delete Navigator.prototype.gpu",
    "no adapter": "GPU.prototype.requestAdapter = async () => null",
    "an adapter that does not come": "GPU.prototype.requestAdapter = () => new Promise(() => {})",
    "no device": "GPUAdapter.prototype.requestDevice = () => Promise.reject(new Error('x'))",
    "a shader that is refused": (
        "const old = GPUDevice.prototype.createShaderModule;"
        "GPUDevice.prototype.createShaderModule = function () { return old.call(this, { code: 'x' }); }"
    ),
    "no canvas": (
        "const old = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...how) {"
        "    return kind === 'webgpu' ? null : old.call(this, kind, ...how); }"
    ),
}


@pytest.mark.parametrize("how", BROKEN)
def test_webgl2_takes_the_place_of_what_fails_at_the_start(browse, path, how):
    shown = browse(path.as_uri(), first=BROKEN[how], viewport=SMALL)
    check_webgl2(shown)
    assert "device" not in shown.evaluate("sommerl.link()")
    must_fail(check_webgl2, shown, "x")
