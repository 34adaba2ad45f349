"""docs/glossary.md: the names that it gives are in the code."""

import re
from pathlib import Path

from helpers import must_fail

import sommerl

PACKAGE = Path(sommerl.__file__).parent
GLOSSARY = Path(__file__).parents[1] / "docs" / "glossary.md"


def places(text):
    """Each module that the last column of a table names, with the names that follow it."""
    for line in text.splitlines():
        if line.startswith("|") and "`" in line:
            for place in line.strip("| ").split(" | ")[-1].split(";"):
                module, *names = re.findall(r"`([^`]+)`", place)
                yield module, names


def check_is_there(module, names):
    assert (PACKAGE / module).is_file(), module
    source = (PACKAGE / module).read_text()
    for name in names:
        assert re.search(rf"^(?:def |class )?{name}\b", source, re.MULTILINE), f"{module}: {name}"


def test_every_word_is_where_the_glossary_says():
    found = list(places(GLOSSARY.read_text()))
    assert len(found) > 25
    for module, names in found:
        check_is_there(module, names)
        must_fail(check_is_there, module.replace(".py", "_.py"), names)
        must_fail(check_is_there, module, [*names, "not_there"])
