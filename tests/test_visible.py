import pytest
from helpers import must_fail

from sommerl.system.errors import FormatError, SommerlError
from sommerl.system.visible import visible

HIDDEN = (
    "\x00\x07\x1b\x7f\x80\x85\x9b\xad\u200b\u200d\u200e\u200f\u2028\u2029\u202a\u202e\u2066\u2069\ufeff"
    "\ud800\udcff\U000e0041"
)


def check_is_one_line(text):
    assert text.isprintable()


@pytest.mark.parametrize("character", HIDDEN)
def test_what_is_obeyed_or_hidden_is_not_shown(character):
    check_is_one_line(visible(f"a{character}b"))
    must_fail(check_is_one_line, f"a{character}b")


def test_text_is_shown_as_it_is():
    assert visible("Größe θ_h × 3, 材料, naïve 🎨 [/x] $1") == "Größe θ_h × 3, 材料, naïve 🎨 [/x] $1"
    assert visible("a\tb\nc\u00a0d\u2028e") == "a b c d e"
    assert visible("abcdef", 4) == "abc…"


def test_errors_are_one_line():
    assert str(FormatError("x\x1b[2J\n: expected a")) == "x�[2J : expected a"
    assert len(str(SommerlError("x" * 10**6))) == 2000
