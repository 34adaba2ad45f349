"""The contact sheet in a browser: its cards, their order, and the viewer behind each."""

import pytest
from browser import PATIENCE, PHONE, READY, wait_until
from helpers import must_fail
from library_files import MATERIALS

from sommerl.compression.smrl import file
from sommerl.library.record import Record
from sommerl.viewer.sheet import Shown, sheet
from sommerl.viewer.thumbnails import SIDE, pixels, thumbnail

HOSTILE = '<img src=x onerror="throw 1">'
MADE = {"metal/gold": (300, 45.0, (0.5, 0.3, 0.05), 0.5), "paint/red": (100, 55.0, (0.3, 0.02, 0.02), 0.9)}
MADE[HOSTILE] = (200, None, (0.02, 0.02, 0.3), 0.1)


def shown(name, size, quality, colour, gloss):
    metrics = {} if quality is None else {"psnr_soft_db": quality}
    record = Record(name, "", size, "", "", 0, "", {}, metrics, colour, gloss, 0.5)
    data = MATERIALS["nodes/both"]
    return Shown(record, f"x.smrlib:{name}", data, thumbnail(file.decode(data)))


@pytest.fixture(scope="module")
def html():
    return sheet("a <b>", [shown(name, *known) for name, known in MADE.items()])


def names(page):
    return page.locator(".name").all_text_contents()


def check_order(page, by, expected):
    page.select_option("#sort", by)
    assert [name[:4] for name in names(page)] == expected


def test_cards_are_sorted_and_searched(browse, html):
    page = browse(html)
    assert page.inner_text("h1") == "a <b>"
    assert page.inner_text("#count") == "3 materials"
    assert HOSTILE.rpartition("/")[2] in names(page)
    check_order(page, "size", ["red", HOSTILE[:4], "gold"])
    check_order(page, "quality", ["gold", "red", HOSTILE[:4]])
    check_order(page, "gloss", [HOSTILE[:4], "gold", "red"])
    check_order(page, "colour", ["red", "gold", HOSTILE[:4]])
    must_fail(check_order, page, "size", ["gold", "red", HOSTILE[:4]])
    page.click("#reverse")
    check_order(page, "size", ["gold", HOSTILE[:4], "red"])
    page.fill("#search", "METAL")
    assert names(page) == ["gold"]
    assert page.inner_text("#count") == "1 of 3 materials"
    page.fill("#search", "nothing")
    assert page.inner_text("#none") == "No material is like that."
    page.fill("#search", "")
    page.locator("#gloss").fill("0.8")
    assert names(page) == ["red"]


def test_a_click_opens_the_viewer(browse, html):
    page = browse(html)
    errors = []
    with page.context.expect_page(timeout=PATIENCE) as opening:
        page.click(".card >> nth=0")
    viewer = opening.value
    viewer.set_default_timeout(PATIENCE)
    viewer.on("pageerror", lambda error: errors.append(str(error)))
    wait_until(viewer, READY)
    assert viewer.title() == f"{HOSTILE} - Sommerl"
    assert viewer.evaluate("window.sommerl.materials[0].label") == HOSTILE
    assert viewer.evaluate("window.sommerl.materials[0].name") == f"x.smrlib:{HOSTILE}"
    assert errors == []
    assert page.inner_text("#messages") == ""


def test_on_a_phone_nothing_is_cut_off(browse, html):
    page = browse(html, viewport=PHONE)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def check_picture(found):
    assert found.shape == (SIDE, SIDE, 4)
    opaque = found[..., 3] == 255
    assert 0.7 < opaque.mean() < 0.8
    assert found[0, 0, 3] == 0
    assert found[opaque][:, :3].max() > 120


def test_pictures_show_a_sphere():
    found = pixels(file.decode(MATERIALS["cells"]))
    check_picture(found)
    must_fail(check_picture, found[:, :, ::-1] * 0)
