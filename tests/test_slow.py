"""The list of slow tests names tests that there are."""

from pathlib import Path

from helpers import must_fail

TESTS = Path(__file__).parent


def check_there(names):
    for name in names:
        file, _, function = name.partition("::")
        assert f"def {function}(" in (TESTS.parent / file).read_text("utf-8"), name


def test_slow_tests_are_there():
    names = (TESTS / "slow.txt").read_text().split()
    assert names == sorted(set(names))
    check_there(names)
    must_fail(check_there, [f"{names[0]}_"])
