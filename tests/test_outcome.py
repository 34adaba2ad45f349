"""How commands end: a sentence and an exit status, whatever happens, also where nobody can be told."""

import os
import subprocess
import sys

import pytest
from helpers import must_fail, run

from sommerl.commands import info
from sommerl.system.errors import FormatError, OptionError


class Panic(BaseException):
    """As Rust's, no Exception."""


class Silent(Exception):
    def __str__(self):
        raise ValueError("no text")


REPORT = "; please report it, with what SOMMERL_DEBUG=1 adds\n"
UNKNOWN = "error: something went wrong that Sommerl did not expect: "
ERRORS = {
    "known": (FormatError("x: expected a, found b"), 1, "error: x: expected a, found b\n"),
    "option": (OptionError("x: expected a, found b"), 2, "error: x: expected a, found b\n"),
    "system": (OSError(5, "Input/output error", "x"), 1, "error: x: Input/output error\n"),
    "memory": (MemoryError(), 1, "error: not enough memory\n"),
    "unknown": (KeyError("key"), 1, f"{UNKNOWN}KeyError ('key'){REPORT}"),
    "empty": (AssertionError(), 1, f"{UNKNOWN}AssertionError{REPORT}"),
    "lines": (ValueError("a\n\tb\x1b[31m"), 1, f"{UNKNOWN}ValueError (a b�[31m){REPORT}"),
    "long": (RecursionError("n" * 10**6), 1, f"{UNKNOWN}RecursionError ({'n' * 300}…){REPORT}"),
    "surrogates": (ValueError("\udcff"), 1, f"{UNKNOWN}ValueError (�){REPORT}"),
    "silent": (Silent(), 1, f"{UNKNOWN}Silent{REPORT}"),
    "panic": (Panic("index out of bounds"), 1, f"{UNKNOWN}Panic (index out of bounds){REPORT}"),
}


def failing(error):
    def command(options):
        raise error

    return command


@pytest.mark.parametrize("kind", ERRORS)
def test_an_error_of_any_kind_is_one_sentence(capsys, monkeypatch, kind):
    error, status, sentence = ERRORS[kind]
    monkeypatch.setattr(info, "info", failing(error))
    assert run(capsys, "info", "x") == (status, "", sentence)


def test_where_it_came_from_on_request(capsys, monkeypatch):
    monkeypatch.setattr(info, "info", failing(KeyError("k\x1b")))
    monkeypatch.setenv("SOMMERL_DEBUG", "1")
    status, out, err = run(capsys, "info", "x")
    assert (status, out) == (1, "")
    lines = err.splitlines()
    assert lines[0] == "Traceback (most recent call last):"
    assert any("in command" in line for line in lines)
    assert lines[-1].startswith(UNKNOWN)
    assert "\x1b" not in err


def ended(shell, *, buffered=True):
    """Exit status, standard output and standard error of a line of the shell, with $0 for the command line. buffered:
    whether Python writes what it prints when a buffer is full or it ends, as usual, or at once."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"}
    arguments = ["sh", "-c", shell, f"{sys.executable} -m sommerl"]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment)
    return done.returncode, done.stdout, done.stderr


CLOSED = "error: standard output: expected it open, found it closed\n"
FULL = "error: standard output: No space left on device\n"
STREAMS = {
    ">&-": (1, CLOSED),
    ">/dev/full": (1, FULL),
    "2>&-": (0, ""),
    "2>/dev/full": (0, ""),
    "<&-": (0, ""),
    "<&- >&- 2>&-": (1, ""),
    ">/dev/full 2>/dev/full": (1, ""),
}


def check_ends(shell, status, err, *, buffered=True):
    found, out, said = ended(shell, buffered=buffered)
    assert (found, said) == (status, err)
    assert bool(out) == (status == 0)


@pytest.mark.parametrize("buffered", [True, False])
@pytest.mark.parametrize("streams", STREAMS)
@pytest.mark.parametrize("command", ["info nickel", "info nickel --json", "--help"])
def test_streams_that_are_closed_or_full(command, streams, buffered):
    check_ends(f"$0 {command} {streams}", *STREAMS[streams], buffered=buffered)


def test_what_python_itself_makes_of_it_is_noticed():
    must_fail(check_ends, f"{sys.executable} -c 'print(1)' >/dev/full", 1, FULL)


def test_errors_that_nobody_can_be_told():
    for streams in ("2>&-", "2>/dev/full"):
        check_ends(f"$0 info nicel {streams}", 1, "")
        check_ends(f"$0 inf {streams}", 2, "")


def test_closed_streams_lend_their_numbers_to_no_file(tmp_path):
    assert ended(f"$0 convert nickel {tmp_path}/x.xml 2>&- <&-")[0] == 0
    assert (tmp_path / "x.xml").read_text().startswith("<scene")
    assert (tmp_path / "x.xml").read_text().endswith("</scene>\n")
    assert ended(f"$0 convert nickel {tmp_path}/y.xml >&-") == (1, "", CLOSED)
    assert not (tmp_path / "y.xml").exists()  # it is told before the work
