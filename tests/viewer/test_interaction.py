"""What people do with the page: keys, mouse, touch, addresses, files that are dropped, and what they take along."""

import base64
import io
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from browser import DESKTOP, PHONE, READY, go, numbers, wait_until
from helpers import must_fail
from PIL import Image

from sommerl import load
from sommerl.commands.cli import main
from sommerl.models.builtin import builtin
from sommerl.render.metrics import exposure, psnr, to_srgb8
from sommerl.viewer.held import held
from sommerl.viewer.page import page

FILE = Path(__file__).parent / "gold.smrl"
MARKUP = "<img src=x onerror=alert(1)>.smrl"
SMALL = {"width": 400, "height": 400}  # few pixels: the processor traces their paths


@pytest.fixture(scope="module")
def html():
    """Of a compressed material and of its source."""
    gold = held(load(FILE), "gold", name=str(FILE))
    return page([gold, held(builtin("gold-metallic-paint"), "gold-metallic-paint")])


@pytest.fixture
def shown(browse, html):
    return browse(html, viewport=SMALL)


def state(shown):
    return shown.evaluate("sommerl.state")


KEYS = {
    "ArrowRight": ("azimuth", -5),
    "ArrowDown": ("elevation", 5),
    "Shift+ArrowRight": ("light", [-30, 40]),
    "Shift+ArrowUp": ("light", [-35, 45]),
    "+": ("zoom", 1.1),
    "]": ("stops", 0.25),
    "l": ("environment", True),
    "v": ("view", "side"),
}


def test_keys(shown):
    """On one page, which is as at the start before each: to open one takes longer than all of its keys."""
    start = state(shown)

    def check(key, changed, value):
        shown.keyboard.press(key)
        after = state(shown)
        assert after[changed] == (pytest.approx(value) if isinstance(value, float) else value)
        assert {name for name in start if start[name] != after[name]} - {"scale"} == {changed}

    for key, (changed, value) in KEYS.items():
        shown.evaluate("document.activeElement.blur()")
        must_fail(check, key, changed, value)  # the picture has no focus
        shown.focus("#picture")
        check(key, changed, value)
        shown.keyboard.press("0")
        assert state(shown)["azimuth"] == state(shown)["elevation"] == 0
        shown.evaluate("start => sommerl.change(start)", start)
        assert {name: x for name, x in state(shown).items() if name != "scale"} == {
            name: x for name, x in start.items() if name != "scale"
        }


def test_the_mouse_turns_camera_and_lamp(shown):
    shown.evaluate("sommerl.change({ view: 'a' })")
    box = shown.locator("#picture").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    shown.mouse.move(*middle)
    assert re.search("A: θi .*, θo 0.[01]°, .*1/sr", shown.text_content("#pointer"))
    shown.mouse.down()
    shown.mouse.move(middle[0] + 50, middle[1] + 20)
    shown.mouse.up()
    after = state(shown)
    assert after["azimuth"] == pytest.approx(-20)
    assert after["elevation"] == pytest.approx(8)
    assert after["light"] == [-35, 40]
    shown.keyboard.press("Control+Home")
    shown.mouse.wheel(0, -200)
    assert state(shown)["zoom"] == pytest.approx(1.35, abs=0.01)
    lamp = shown.locator("#lamp").bounding_box()
    shown.mouse.move(lamp["x"] + 12, lamp["y"] + 12)
    shown.mouse.down()
    shown.mouse.move(middle[0], middle[1])
    shown.mouse.up()
    # The lamp is where the viewer is: in the middle of the picture.
    moved = state(shown)
    assert moved["light"] == pytest.approx([moved["azimuth"], moved["elevation"]], abs=1)


def test_two_fingers_zoom(shown):
    shown.evaluate(
        """() => {
            const { canvas } = sommerl;
            const send = (type, pointerId, clientX) => {
                const how = { pointerId, clientX, clientY: 200, buttons: 1, bubbles: true };
                canvas.dispatchEvent(new PointerEvent(type, how));
            };
            canvas.setPointerCapture = () => null;
            send("pointerdown", 7, 150);
            send("pointerdown", 8, 250);
            send("pointermove", 8, 260);
            send("pointermove", 8, 370);
            send("pointerup", 7, 150);
            send("pointerup", 8, 370);
        }"""
    )
    assert state(shown)["zoom"] == pytest.approx(2)
    assert state(shown)["azimuth"] == 0


def test_the_address_holds_the_view(browse, html, shown):
    shown.select_option("#controls section:first-child select >> nth=1", "1")
    shown.evaluate(
        "sommerl.change({ view: 'split', split: 0.25, light: [20, 30], azimuth: 15, zoom: 1.5, tone: 'agx' })"
    )
    wait_until(shown, "location.hash.includes('split=0.25') && location.hash.includes('scale=')")
    expected = state(shown)
    fragment = shown.evaluate("location.hash.slice(1)")
    other = browse(html, viewport=SMALL)

    def check(fragment):
        go(other, fragment)
        found = state(other)
        assert {name: value for name, value in found.items() if name != "scale"} == {
            name: value for name, value in expected.items() if name != "scale"
        }
        assert found["scale"] == pytest.approx(expected["scale"], rel=1e-3)

    check(fragment)
    must_fail(check, fragment.replace("agx", "aces"))
    must_fail(check, "a=9&view=none&from=,,&zoom=x&light=1e9,a&split=-1")  # what is out of range is as at the start


@pytest.mark.parametrize("view", ["split", "side", "difference", "flip"])
def test_ways_to_compare(shown, view):
    shown.evaluate("view => sommerl.change({ b: 1, view })", view)
    wait_until(shown, f"sommerl.figures && (sommerl.figures.flip !== null) === {json.dumps(view == 'flip')}")
    said = shown.text_content("#figures")
    assert "PSNR of this view" in said
    assert ("FLIP" in said) == (view == "flip")
    assert shown.locator("#line").is_visible() == (view == "split")
    assert shown.locator(".tag").first.is_visible() == (view in ("split", "side"))


def test_the_line_is_dragged(shown):
    shown.evaluate("sommerl.change({ b: 1, view: 'split' })")
    box, line = (shown.locator(one).bounding_box() for one in ("#picture", "#line"))
    shown.mouse.move(line["x"] + 8, line["y"] + 100)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 0.2 * box["width"], line["y"] + 100)
    shown.mouse.up()
    assert state(shown)["split"] == pytest.approx(0.2, abs=0.01)
    assert state(shown)["azimuth"] == 0
    shown.keyboard.press("ArrowRight")
    assert state(shown)["split"] == pytest.approx(0.25, abs=0.01)


def test_a_picture_is_saved(shown):
    with shown.expect_download() as download:
        shown.click("text=Save PNG")
    picture = Image.open(io.BytesIO(Path(download.value.path()).read_bytes()))
    assert picture.size == tuple(shown.evaluate("[sommerl.canvas.width, sommerl.canvas.height]"))
    assert max(high for _, high in picture.convert("RGB").getextrema()) > 150


@pytest.mark.parametrize("environment", [True, False])
def test_the_command_renders_the_view(shown, tmp_path, monkeypatch, environment):
    monkeypatch.chdir(tmp_path)
    values = {
        "b": 1,
        "view": "difference",
        "scene": "ball",
        "environment": environment,
        "elevation": 20,
        "light": [-10, 50],
    }
    shown.evaluate("values => sommerl.change(values)", values)
    shown.click("text=Copy command")
    program, *words = shlex.split(shown.input_value("#command"))
    assert program == "sommerl"
    assert words[0] == "render"
    assert words[words.index("--against") + 1] == str(FILE)
    words[words.index("--size") + 1] = "32"
    shown.close()  # or it would trace paths beside the command, for as long as that takes
    assert main([*words, "--spp", "1"]) == 0
    assert (tmp_path / "view.png").exists()


def test_the_command_renders_the_same_picture(shown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    view = {"azimuth": -30, "elevation": 15, "zoom": 1.2, "light": [20, 35], "scene": "sphere"}
    shown.evaluate("view => sommerl.change(view)", view)
    shown.click("text=Copy command")
    words = shlex.split(shown.input_value("#command"))[1:]
    words[words.index("--size") + 1] = "64"

    found = numbers(shown, "() => sommerl.radiance(0, {}, 64, 64, 64)").reshape(64, 64, 4)[::-1]
    shown.close()  # or it would trace paths beside the command
    inside = found[..., 3] == 1
    scale = exposure(found[..., :3], found[..., 3] >= 0.5)

    def check(words):
        assert main([*words, "--spp", "64", "--overwrite"]) == 0
        rendered = np.array(Image.open("view.png").convert("RGB"))
        assert psnr(rendered[inside], to_srgb8(found[..., :3] * scale)[inside]) >= 35

    check(words)
    must_fail(check, [word.replace("--from=-30", "--from=-35") for word in words])


def dropped(shown, name, data):
    shown.evaluate("given => sommerl.dropped(...given)", [name, base64.b64encode(data).decode()])


def test_a_file_is_dropped(shown):
    dropped(shown, MARKUP, FILE.read_bytes())
    assert state(shown)["b"] == 2
    assert state(shown)["view"] == "split"
    wait_until(shown, "sommerl.figures?.psnr")
    assert MARKUP in shown.text_content("#about")
    assert shown.locator("main img").count() == 0


HOSTILE = {
    "empty.smrl": b"",
    "cut.smrl": FILE.read_bytes()[:-9],
    "other.smrl": FILE.read_bytes()[:40] + bytes(500),
    "noise.bsdf": bytes(range(256)) * 8,
    "huge.binary": b"\xff\xff\xff\x7f" * 3 + bytes(64),
    "zeros.binary": bytes(5000),
    "cut.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999 +X 99999\n",
    "cut.exr": b"v/1\x01\x02\0\0\0channels\0chlist\0\xff\xff\xff\x7f",
    "page.mbsdf": b"<script>window.hurt = 1</script>" * 20,
}


def test_broken_files_are_refused(shown):
    for i, (name, data) in enumerate(HOSTILE.items()):
        dropped(shown, name, data)
        said = shown.locator("#messages p").nth(i).text_content()
        assert said.startswith(f"{name}: ")
        assert "Error" not in said
    # The page lives on.
    shown.evaluate("sommerl.change({ azimuth: 30 })")
    wait_until(shown, "sommerl.picture.count >= 2")
    assert state(shown)["b"] == -1 or state(shown)["b"] == 1
    assert shown.evaluate("window.hurt") is None
    shown.click("#messages p:first-child button")
    assert shown.locator("#messages p").count() == len(HOSTILE) - 1


@pytest.mark.parametrize("viewport", [PHONE, {"width": 320, "height": 600}, DESKTOP])
def test_it_fits(browse, html, viewport):
    shown = browse(html, viewport=viewport)
    for scheme in ("light", "dark"):
        shown.emulate_media(color_scheme=scheme)
        assert shown.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
        colours = shown.evaluate(
            "[getComputedStyle(document.body).color, getComputedStyle(document.documentElement).backgroundColor]"
        )
        light = [sum(map(float, colour.partition("(")[2].rstrip(")").split(",")[:3])) for colour in colours]
        assert (light[0] > light[1]) == (scheme == "dark")
        assert shown.locator("#panels canvas").count() >= 4


def test_ways_to_compare_follow_each_other_while_the_picture_gets_better(shown):
    """A map of FLIP that is given back is not shown again: the fixture notes what the console says."""
    said = []
    shown.on("console", lambda message: said.append(message.text))
    for view in ("flip", "split", "flip", "side", "flip", "difference", "b"):
        shown.evaluate("view => sommerl.change({ b: 1, view })", view)
        wait_until(shown, "sommerl.figures?.psnr")
    assert said == []


def test_a_long_name_is_wrapped(browse, html):
    shown = browse(html, viewport={"width": 320, "height": 600})
    dropped(shown, f"{'long' * 50}.smrl", FILE.read_bytes())
    assert shown.evaluate("document.documentElement.scrollWidth") <= 320


def test_a_material_that_is_broken_in_the_page(browse, html):
    """The page says so each time that it is chosen, and goes on showing what it showed."""
    data = held(load(FILE), "gold", name=str(FILE)).packed()["data"]
    shown = browse(html.replace(data, data[:40] + "AAAA" + data[44:]), viewport=SMALL, ready="window.sommerl?.state")
    shown.evaluate("sommerl.change({ a: 1 })")
    wait_until(shown, READY)
    before = shown.locator("#messages p").count()
    for times in (1, 2):
        shown.evaluate("sommerl.change({ a: 0 })")
        wait_until(shown, "sommerl.state.a === 1")
        assert shown.locator("#messages p").count() == before + times
    assert "gold" in shown.locator("#messages p").last.text_content()
