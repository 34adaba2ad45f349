"""expected.toml: what the paper prints, and what is said of our numbers beside it."""

import ast
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import must_fail

import sommerl
from sommerl.reproduction.items import ITEMS
from sommerl.reproduction.printed import Printed, items, printed, published

ROOM = Path(sommerl.__file__).parent / "reproduction"
ONE = Printed("x", 40.0, "Fig. 1", "dB", "higher", 0.5, "", "")


def numbers_of(*names):
    return {each.value for name in names for each in printed(name).values()}


def check_whole(each):
    assert each.place
    assert each.better in ("higher", "lower", "near")
    assert each.tolerance >= 0


def test_every_number_has_its_place_and_its_tolerance():
    found = [each for item in items() for each in printed(item).values()]
    assert len(found) == 2 + 4 + 9 + 56 + 4 + 20 + 11 + 1 + 4
    for each in found:
        check_whole(each)
    must_fail(check_whole, replace(found[0], place=""))
    assert set(items()) <= set(ITEMS)
    assert all(each["source"] for each in published().values())


@pytest.mark.parametrize(
    ("of", "ours", "verdict"),
    [
        (ONE, 40.4, "reproduced"),
        (ONE, 39.6, "reproduced"),
        (ONE, 50.0, "better"),
        (ONE, 39.4, "worse"),
        (replace(ONE, better="lower"), 39.4, "better"),
        (replace(ONE, better="near"), 50.0, "worse"),
        (replace(ONE, incomparable="other data"), 50.0, "not comparable"),
        (replace(ONE, incomparable="other data"), 40.1, "reproduced"),
        (ONE, None, "not measured"),
        (replace(ONE, incomparable="other data"), None, "not comparable"),
    ],
)
def test_verdicts(of, ours, verdict):
    assert of.verdict(ours) == verdict


def check_holds_none(source, numbers):
    found = {node.value for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant)}
    assert not found & numbers


def test_the_code_holds_no_number_of_the_paper():
    numbers = numbers_of("fig1", "fig4", "fig5", "table1", "fig6", "table2")
    for path in ROOM.glob("*.py"):
        check_holds_none(path.read_text(), numbers)
    must_fail(check_holds_none, "psnr = 52.12", numbers)
