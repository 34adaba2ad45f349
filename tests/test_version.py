"""One version, in rust/Cargo.toml, and what quotes it."""

import json
import re
import tomllib
from importlib.metadata import version
from pathlib import Path

from helpers import must_fail

import sommerl

ROOT = Path(__file__).parents[1]


def check_quoted(citation):
    assert re.search(r"^version: (.*)$", citation, re.M)[1] == sommerl.__version__


def test_all_say_the_same():
    assert version("sommerl") == sommerl.__version__
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    check_quoted(citation)
    must_fail(check_quoted, citation.replace(sommerl.__version__, "0.0.7"))
    assert json.loads((ROOT / "javascript" / "package.json").read_text("utf-8"))["version"] == sommerl.__version__


def third_party(lock):
    """Names and versions of the Rust packages that come from elsewhere."""
    packages = tomllib.loads(lock)["package"]
    return {f"{each['name']} {each['version']}" for each in packages if "source" in each}


def check_licences(lock, page):
    assert third_party(lock) <= set(re.findall(r"^\* (\S+ \S+)$", page, re.M))


def test_the_page_of_licences_has_all_packages():
    lock = (ROOT / "rust" / "Cargo.lock").read_text("utf-8")
    page = (ROOT / "THIRD_PARTY.md").read_text("utf-8")
    check_licences(lock, page)
    must_fail(check_licences, lock, page.replace("* numpy ", "* another "))
