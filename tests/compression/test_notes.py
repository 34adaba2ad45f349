"""What a material file may note."""

import json
from pathlib import Path

import numpy as np
import pytest
from compact import material
from helpers import complaint, must_fail, run
from noted import ESCAPES, FINE, MISTYPED, NOT_PLAIN, with_notes

from sommerl import load, save
from sommerl.compression.smrl import notes
from sommerl.compression.smrl.file import decode
from sommerl.system.errors import FormatError


def check_is_refused(noted):
    message = complaint(decode, with_notes(noted))
    assert message is not None
    assert "expected" in message
    assert message.isprintable()


@pytest.mark.parametrize("noted", NOT_PLAIN + MISTYPED, ids=str)
def test_notes_of_other_types_are_refused(noted):
    check_is_refused(noted)
    must_fail(check_is_refused, FINE[1])


@pytest.mark.parametrize("noted", FINE, ids=str)
def test_plain_notes_are_read(noted):
    found = decode(with_notes(noted))
    assert (found.options, found.metrics) == (noted.get("options", {}), noted.get("metrics", {}))


@pytest.mark.parametrize(
    "noted",
    [b'{"options":{"a":1e999}}', b'{"options":{"a":NaN}}', b'{"options":{"a":' + b"9" * 5000 + b"}}", b"[" * 30_000],
)
def test_numbers_without_end(noted):
    check_is_refused(noted)


def test_what_would_be_refused_is_not_written(tmp_path):
    made = material("minimal")
    made.options = {"source_facts": {"asymmetry": np.float64(0.5)}}
    save(made, tmp_path / "x.smrl")
    assert load(tmp_path / "x.smrl").facts == {"asymmetry": 0.5}
    made.options = {"a": [1]}
    with pytest.raises(FormatError, match=r"options: expected at most 64 names of .*, each with a number"):
        save(made, tmp_path / "y.smrl")
    assert not (tmp_path / "y.smrl").exists()


def check_is_harmless(text):
    assert all(c.isprintable() or c == "\n" for c in text)


def test_no_text_of_a_file_gives_orders_to_a_terminal(capsys, tmp_path):
    made = material("minimal")
    made.name = f"na{ESCAPES}me"
    made.options = {f"k{ESCAPES}": f"v{ESCAPES}", "source_facts": {f"x{ESCAPES}": ESCAPES}}
    made.metrics = {f"m{ESCAPES}": ESCAPES}
    path = tmp_path / f"file{ESCAPES}.smrl"
    save(made, path)
    status, out, err = run(capsys, "info", path)
    assert status == 0
    check_is_harmless(out + err)
    must_fail(check_is_harmless, made.name)
    for arguments in (["info", f"{path}x"], ["info", path, ESCAPES], ["convert", path, tmp_path / f"{ESCAPES}.smrl"]):
        check_is_harmless("".join(run(capsys, *arguments)[1:]))
    assert json.loads(run(capsys, "info", path, "--json")[1])["options"] == made.options


def test_every_name_that_has_a_meaning_is_in_the_documentation():
    written = (Path(__file__).parents[2] / "docs" / "format.md").read_text()
    assert all(f"`{name}`" in written for group in notes.KNOWN.values() for name in group)
