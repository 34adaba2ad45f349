"""The report in its three forms, from made-up outcomes."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from helpers import must_fail

from sommerl.reproduction.cells import QUICK, Outcome, Setting
from sommerl.reproduction.data import RULES, Data
from sommerl.reproduction.items import ALL, ITEMS
from sommerl.reproduction.markdown import document
from sommerl.reproduction.page import page
from sommerl.reproduction.printed import printed
from sommerl.reproduction.report import made
from sommerl.reproduction.section import webp
from sommerl.reproduction.times import interval

SETTING = Setting(Data(called="made-up <data>"), QUICK)
GREY = webp(np.full((4, 4, 3), 128, np.uint8))
DEFAULT, PRINTED = RULES


def outcomes(default=60.0, eq2=30.0):
    """Of Fig. 1, with these PSNRs."""
    values = {
        name: {"psnr_frame_db": value, "psnr_object_db": value - 2}
        for name, value in ((DEFAULT, default), (PRINTED, eq2), ("Lawrence", 44.6))
    }
    return {"fig1/statue": Outcome(values, {"reference": GREY, DEFAULT: GREY, f"{DEFAULT}.difference": GREY})}


def report(**psnr):
    return made(["fig1"], SETTING, outcomes(**psnr), "sommerl paper")


def test_every_number_stands_beside_the_papers():
    numbers = {each["key"]: each for each in report().content["items"][0]["numbers"]}
    assert set(numbers) == set(printed("fig1"))
    ours = numbers["som-man"]
    assert (ours["default"], ours["eq2"], ours["verdict"], ours["verdict_eq2"]) == (60.0, 30.0, "better", "worse")
    assert ours["difference"] == pytest.approx(60 - ours["paper"])
    assert ours["command"] == "sommerl paper fig1 --only statue"
    assert numbers["lawrence"]["verdict"] == "reproduced"
    assert report(default=10.0).content["verdicts"]["worse"] == 1


class Tags(HTMLParser):
    """Tags with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


def check_in_red(text):
    assert any("worse" in (about.get("class") or "") for tag, about in Tags(text).found if tag == "td")
    assert "worse <sup>a</sup></td>" in text


def check_complete_in_itself(text):
    assert not re.search(r'(?:src|href)="(?!data:|#)|url\((?!data:)|@import', text)


def test_the_page():
    text = page(report(default=10.0))
    assert text.startswith("<!doctype html>")
    assert "made-up &lt;data&gt;" in text
    check_in_red(text)
    must_fail(check_in_red, page(report()).replace('<span class="worse">', "<span>"))
    check_complete_in_itself(text)
    must_fail(check_complete_in_itself, text + '<img src="pictures/x.webp">')
    images = [about for tag, about in Tags(text).found if tag == "img"]
    assert len(images) == 3
    assert all(about["alt"] and about["src"].startswith("data:image/webp;base64,") for about in images)


def test_markdown_tells_the_same():
    found = report(default=10.0)
    text = document(found.content)
    for number in found.content["items"][0]["numbers"]:
        assert f"{number['paper']:.5g} dB | " in text
    assert "| **worse** (a) |" in text
    assert "1 reproduced, 1 worse" in text
    assert all(f"]({name})" in text for name in found.pictures)


def test_json_can_be_read_and_begins_with_its_mark():
    text = json.dumps(report().content)
    assert text.startswith('{"sommerl_paper": 1,')
    assert json.loads(text) == report().content


def test_every_item_has_a_title_and_each_number_an_item():
    assert set(ALL) | {"benchmark"} == set(ITEMS)
    assert all(item.title and item.about for item in ITEMS.values())


def test_intervals_hold_the_median_and_narrow_with_rounds():
    random = np.random.default_rng(0)
    few, many = (1 + 0.1 * random.standard_normal(count) for count in (12, 1200))
    for ratios in (few, many):
        median, low, high = interval(ratios)
        assert low <= median == np.median(ratios) <= high
    assert np.ptp(interval(many)[1:]) < np.ptp(interval(few)[1:])
    assert interval(few) == interval(few)
