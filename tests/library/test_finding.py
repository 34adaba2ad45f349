"""Materials are found by what they are called and how they look."""

import colorsys

import numpy as np
import pytest
from helpers import complaint, must_fail
from test_record import GOOD

from sommerl import NAMES, builtin
from sommerl.library.finding import (
    SORTED_BY,
    Wanted,
    colour_distance,
    colour_named,
    digits,
    in_order,
    looks,
    nearest,
    oklab,
    unlikeness,
)


def record(name, **known):
    return type(GOOD)(**{**vars(GOOD), "name": name, **known})


# name, bytes, colour, gloss, metalness, PSNR
KNOWN = [
    ("metal/nickel-0", 300, (0.3, 0.3, 0.26), 0.7, 0.9, 50.0),
    ("metal/gold", 200, (0.5, 0.3, 0.05), 0.5, 0.8, 45.0),
    ("Paint/red-1", 100, (0.3, 0.02, 0.02), 0.4, 0.1, None),
    ("Paint/red-2", 100, (0.02, 0.02, 0.3), 0.1, 0.0, 55.0),
]
RECORDS = [
    record(
        name, bytes=size, colour=colour, gloss=gloss, metalness=metal, metrics={"psnr_soft_db": psnr} if psnr else {}
    )
    for name, size, colour, gloss, metal, psnr in KNOWN
]


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        (Wanted(), [0, 1, 2, 3]),
        (Wanted("RED"), [2, 3]),
        (Wanted("*-?"), [0, 2, 3]),
        (Wanted("paint/*"), [2, 3]),
        (Wanted("paint/["), []),
        (Wanted(gloss=(0.4, 0.6)), [1, 2]),
        (Wanted(metalness=(0.8, 1.0)), [0, 1]),
        (Wanted("metal", gloss=(0.6, 1.0), metalness=(0.5, 1.0)), [0]),
    ],
)
def test_what_is_wanted(wanted, found):
    assert [number for number, each in enumerate(RECORDS) if each in wanted] == found


@pytest.mark.parametrize(
    ("by", "order"),
    [
        ("name", [2, 3, 1, 0]), ("size", [2, 3, 1, 0]), ("quality", [1, 0, 3, 2]), ("colour", [2, 1, 3, 0]),
        ("gloss", [3, 2, 1, 0]), ("metalness", [3, 2, 1, 0]),
    ],
)  # fmt: skip
def test_orders(by, order):
    assert in_order(RECORDS, by) == [RECORDS[number] for number in order]
    assert in_order(RECORDS, by, reverse=True) == [RECORDS[number] for number in order[::-1]]
    assert by in SORTED_BY


def check_oklab(convert):
    """Known values (Ottosson 2020): white is 1, 0, 0; and a hue keeps its angle when it darkens."""
    assert convert([1, 1, 1]) == pytest.approx([1, 0, 0], abs=1e-4)
    assert convert([1, 0, 0]) == pytest.approx([0.62796, 0.22486, 0.12585], abs=1e-4)
    bright, dark = convert([0.5, 0.2, 0.1]), convert([0.05, 0.02, 0.01])
    assert bright[1] / bright[2] == pytest.approx(dark[1] / dark[2])


def test_oklab():
    check_oklab(oklab)
    must_fail(check_oklab, lambda rgb: np.array(colorsys.rgb_to_yiq(*rgb)))


def test_colours_are_named_by_css_or_digits():
    assert digits(colour_named("Gold")) == "#ffd700"
    assert digits(colour_named("#FC0")) == digits(colour_named("ffcc00")) == "#ffcc00"
    assert digits((7.0, -1.0, 0.2158605)) == "#ff0080"
    assert complaint(colour_named, "golld", "--colour").endswith("found golld; did you mean gold?")
    assert complaint(colour_named, "#ff00") is not None


def test_the_nearest_colour_comes_first():
    for name, number in (("crimson", 2), ("gold", 1), ("blue", 3), ("silver", 0)):
        wanted = colour_named(name)
        found = nearest(RECORDS, lambda each, wanted=wanted: colour_distance(each.colour, wanted))
        assert found[0][0] == RECORDS[number]
        assert [far for _, far in found] == sorted(far for _, far in found)
    assert len(nearest(RECORDS, lambda each: each.gloss, 2)) == 2
    assert colour_distance((0.2, 0.1, 0), (0.2, 0.1, 0)) == 0


def check_likeness(far):
    """Of each pair, the second is more like the first than the third is."""
    for name, like, unlike in (
        ("nickel", "chrome", "red-fabric"),
        ("red-fabric", "beige-fabric", "chrome"),
        ("blue-metallic-paint", "green-metallic-paint", "pearl-paint"),
        ("yellow-matte-plastic", "purple-paint", "nickel"),
    ):
        assert far(name, like) < far(name, unlike)


def test_what_looks_alike_is_near():
    seen = {name: looks(builtin(name)) for name in NAMES}
    assert all(np.isfinite(each).all() and each.shape == (320, 3) for each in seen.values())
    check_likeness(lambda a, b: unlikeness(seen[a], seen[b]))
    must_fail(check_likeness, lambda a, b: -unlikeness(seen[a], seen[b]))
    assert unlikeness(seen["nickel"], seen["nickel"]) == 0
    assert unlikeness(seen["nickel"], seen["chrome"]) == unlikeness(seen["chrome"], seen["nickel"])
