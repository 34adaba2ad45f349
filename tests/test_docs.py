"""What the pages show works: every command is one that there is, and every example in Python runs."""

import doctest
import functools
import io
import re
import shlex
import shutil
from pathlib import Path

import pytest
from helpers import must_fail

import sommerl
from sommerl.commands import cli
from sommerl.system.errors import SommerlError

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMAND = re.compile(r"^    (?:uv run )?(sommerl (?:.*\\\n)*.*)", re.M)
EXAMPLE = re.compile(r"^```python\n(.*?)^```", re.M | re.S)
SCENE = """<scene version="3.0.0"><shape type="sphere">
<bsdf type="sommerl"><string name="filename" value="nickel.smrl"/></bsdf></shape></scene>"""
EXAMPLES = [
    pytest.param(example, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, example in enumerate(EXAMPLE.findall(page.read_text("utf-8")))
]


def commands(text):
    """The commands that a page shows, as lists of words."""
    for found in COMMAND.findall(text):
        words = shlex.split(found.replace("\\\n", " "), comments=True)
        while words:
            end = words.index("&&") if "&&" in words else len(words)
            yield words[1:end]
            words = words[end + 1 :]


def check_commands(text):
    for words in commands(text):
        try:
            found, unknown = cli.parser().parse_known_args([word for word in words if word != "…"])
        except (SommerlError, SystemExit) as error:
            raise AssertionError(f"{words}: {error}") from error
        assert found.command, words
        assert not unknown, words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_are_such(page):
    check_commands(page.read_text("utf-8"))


@pytest.mark.parametrize("wrong", ["sommerl compres x", "sommerl info x --size 3", "sommerl compress x --target-size"])
def test_wrong_commands_are_noticed(wrong):
    must_fail(check_commands, f"    {wrong}\n")


def test_commands_are_found():
    shown = "text\n\n    sommerl info a  # why\n    sommerl fit b -o c && sommerl info \\\n        c\n"
    assert list(commands(shown)) == [["info", "a"], ["fit", "b", "-o", "c"], ["info", "c"]]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with what the examples read."""
    folder = tmp_path_factory.mktemp("examples")
    for name, source in (("nickel", "nickel"), ("blue", "blue-metallic-paint")):
        sommerl.save(sommerl.compress(sommerl.load(source), target_size=1000, effort=1)[0], folder / f"{name}.smrl")
    built = ["library", "build", folder, "-o", folder / "library", "--target-size", "600", "--effort", "1"]
    for words in (built, ["library", "pack", folder / "library", "-o", folder / "metals.smrlib"]):
        assert cli.main(list(map(str, words))) == 0
    (folder / "scene.xml").write_text(SCENE)
    return folder


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_run(made, tmp_path, monkeypatch, example):
    monkeypatch.chdir(shutil.copytree(made, tmp_path / "here"))
    exec(compile(example, "example", "exec"), {"__name__": "example"})


def test_there_are_examples():
    assert len(EXAMPLES) >= 5


PUBLIC = [name for name in sommerl.__all__ if callable(getattr(sommerl, name))]
METHODS = ["Brdf.eval", "Brdf.sample", "Brdf.pdf", "Brdf.albedo", "Brdf.info"]


def check_shown(thing, name):
    """An object's own docstring has examples, and they are right."""
    (shown,) = doctest.DocTestFinder(recurse=False).find(thing, name, globs={"sommerl": sommerl, **vars(sommerl)})
    assert shown.examples, name
    said = io.StringIO()
    failed, _ = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(shown, out=said.write)
    assert not failed, said.getvalue()


@pytest.mark.parametrize("name", [*PUBLIC, *METHODS])
def test_docstrings_have_examples_that_run(made, tmp_path, monkeypatch, name):
    monkeypatch.chdir(shutil.copytree(made, tmp_path / "here"))
    thing = functools.reduce(getattr, name.split("."), sommerl)
    check_shown(thing, name)


def test_wrong_examples_are_noticed():
    def none():
        """Nothing."""

    def wrong():
        """
        >>> 1 + 1
        3
        """

    for each in (none, wrong):
        must_fail(check_shown, each, "wrong")
