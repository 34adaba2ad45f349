"""What a check that fails says: in short, wherever tests run. Of long lists, pytest would tell all in CI."""

import pytest
from helpers import must_fail


def check_equal(found, expected):
    assert found == expected


def check_short(text):
    assert len(text.splitlines()) < 30


def test_lists_that_differ_are_told_in_short():
    with pytest.raises(AssertionError) as failure:
        check_equal(list(range(200)), list(range(1, 201)))
    check_short(str(failure.value))
    must_fail(check_short, 30 * "a line\n")
