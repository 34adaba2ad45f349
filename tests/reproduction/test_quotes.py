"""Numbers of the reproduction that pages quote are those of the reports that are kept.

A page quotes a number by a comment behind it, "54.26<!-- fig5 som-man default -->": the item, the key of the paper's
number, and which of paper, eq2 and default it is.
"""

import json
import re
from pathlib import Path

import pytest
from helpers import must_fail

from sommerl.reproduction.printed import printed

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
QUOTE = re.compile(r"(-?[\d,]*\.?\d+)<!-- (\w+) (.+?) (paper|eq2|default) -->")
MOST = 5_000_000  # bytes of what is kept


def kept():
    """The numbers of all reports, by item and key."""
    reports = [json.loads(path.read_text()) for path in sorted(RESULTS.glob("*.json"))]
    return {(i["name"], n["key"]): n for report in reports for i in report["items"] for n in i["numbers"]}


def check_quoted(text, numbers):
    found = QUOTE.findall(text)
    assert len(found) == text.count(" default -->") + text.count(" eq2 -->") + text.count(" paper -->")
    for shown, item, key, which in found:
        value = numbers[item, key][which]
        digits = len(shown.partition(".")[2])
        assert shown == f"{value:,.{digits}f}", (item, key, which, value)
    return len(found)


def test_quoted_numbers_are_those_of_the_reports():
    numbers = kept()
    quoted = sum(check_quoted(path.read_text(), numbers) for path in PAGES)
    assert quoted >= 8
    must_fail(check_quoted, "99.99<!-- fig5 som-man default -->", numbers)
    must_fail(check_quoted, "about x<!-- fig5 som-man default -->", numbers)


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.name)
def test_reports_that_are_kept_are_of_full_runs(path):
    report = json.loads(path.read_text())
    assert report["extent"] == "full"
    assert report["date"]
    assert report["machine"]
    assert {"sommerl", "numpy", "mitsuba"} <= report["versions"].keys()
    assert path.with_suffix(".html").exists()
    for item in report["items"]:
        assert {each["key"]: each["paper"] for each in item["numbers"]} == {
            key: each.value for key, each in printed(item["name"]).items()
        }


def test_what_is_kept_is_small():
    assert 0 < sum(path.stat().st_size for path in RESULTS.iterdir()) <= MOST
