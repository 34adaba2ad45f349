"""Records: written and read, alone and together, and what is no record is told."""

import copy
import gzip
import json
from math import inf

import pytest
from helpers import complaint, must_fail

from sommerl.library import index
from sommerl.library.record import Record, as_json, from_json, parsed, written

GOOD = Record(
    name="a/gold",
    file="a/gold.smrl",
    bytes=400,
    sha256="0" * 64,
    source="a/gold.bsdf",
    source_bytes=1000,
    source_sha256="f" * 64,
    options={"preset": "compact", "target_size": 400, "target_psnr": None, "reciprocal": False},
    metrics={"psnr_soft_db": inf, "log_error": 0.25},
    colour=(0.5, 0.25, 0.125),
    gloss=0.5,
    metalness=1.0,
)


def again(record):
    return from_json(parsed(written(as_json(record))))


def test_a_record_is_read_as_it_was_written():
    assert again(GOOD) == GOOD
    assert written(as_json(again(GOOD))) == written(as_json(GOOD))
    assert json.loads(written(as_json(GOOD)))["metrics"]["psnr_soft_db"] is None


HOSTILE = {
    "missing": {"name": ...},
    "more": {"extra": 1},
    "name": {"name": ""},
    "name-2": {"name": 3},
    "name-3": {"name": "x" * 5000},
    "name-4": {"name": "\ud800"},
    "file": {"file": "/etc/gold.smrl"},
    "file-2": {"file": "../gold.smrl"},
    "file-3": {"file": "a/../../gold.smrl"},
    "file-4": {"file": "a//gold.smrl"},
    "file-5": {"file": "gold.binary"},
    "file-6": {"file": ".sommerl/gold.smrl"},
    "file-7": {"file": "..\\gold.smrl"},
    "bytes": {"bytes": -1},
    "bytes-2": {"bytes": True},
    "bytes-3": {"bytes": 1.5},
    "bytes-4": {"bytes": 10**30},
    "sha256": {"sha256": "0" * 63},
    "sha256-2": {"sha256": "G" * 64},
    "options": {"options": []},
    "options-2": {"options": {"x": []}},
    "options-3": {"options": {str(n): n for n in range(100)}},
    "metrics": {"metrics": {"x": "1"}},
    "metrics-2": {"metrics": {"x": 10**400}},
    "colour": {"colour": [1, 2]},
    "colour-2": {"colour": [1, 2, None]},
    "gloss": {"gloss": None},
    "metalness": {"metalness": "1"},
}


def check_refused(said):
    message = complaint(from_json, said)
    assert message
    assert "expected" in message


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_no_record_is_refused(name):
    said = as_json(GOOD)
    must_fail(check_refused, copy.deepcopy(said))
    for key, value in HOSTILE[name].items():
        if value is ...:
            del said[key]
        else:
            said[key] = value
    check_refused(said)


@pytest.mark.parametrize("data", [b"", b"{", b"[1", b"[NaN]", b"\xff\xff", b"[" * 100_000])
def test_what_is_no_json_is_refused(data):
    assert "expected JSON" in (complaint(parsed, data) or "")
    assert complaint(parsed, b"{}") is None


def library(folder, *records):
    for record in records:
        index.write_record(folder, record)
    return folder


def another(name, **changed):
    return Record(**{**GOOD.__dict__, "name": name, "file": f"{name}.smrl", **changed})


def test_records_alone_and_together(tmp_path):
    found = {name: another(name) for name in ("a/gold", "b", "c")}
    folder = library(tmp_path, *reversed(found.values()))
    assert index.records(folder) == found
    assert list(index.records(folder)) == list(found)
    index.write_index(folder, found)
    assert index.records(folder) == found
    assert index.record_files(folder) == []
    newer = another("b", bytes=500)
    assert index.records(library(folder, newer))["b"] == newer
    index.write_index(folder, found | {"b": newer})
    before = index.index_path(folder).read_bytes()
    index.write_index(folder, index.records(folder))
    assert index.index_path(folder).read_bytes() == before
    assert sorted(path.name for path in (folder / ".sommerl").iterdir()) == ["index.json.gz"]


def test_a_build_that_ends_while_records_are_read_takes_none_away(tmp_path, monkeypatch):
    """The index is written, and then the records are removed, between a reader's look at both."""
    folder = library(tmp_path, GOOD)
    whole = index.record_files

    def ended(folder):
        files = whole(folder)
        monkeypatch.setattr(index, "record_files", whole)
        index.write_index(folder, {GOOD.name: GOOD})
        return files

    monkeypatch.setattr(index, "record_files", ended)
    assert index.records(folder) == {GOOD.name: GOOD}


def check_damage_is_told(folder, path, data):
    path.write_bytes(data)
    message = complaint(index.records, folder)
    assert message
    assert message.startswith(f"{path}: ")
    assert message.count(str(path)) == 1


def test_damaged_records_and_indices_are_told(tmp_path):
    assert "expected a library" in (complaint(index.records, tmp_path) or "")
    path = index.record_path(library(tmp_path, GOOD), GOOD.file)
    good = path.read_bytes()
    must_fail(check_damage_is_told, tmp_path, path, good)
    for data in (b"", good[:-40], good.replace(b'"bytes":400', b'"bytes":-4'), b"[]", good.replace(b":1}", b":2}")):
        check_damage_is_told(tmp_path, path, data)
    path.write_bytes(good)
    index.write_index(tmp_path, {GOOD.name: GOOD})
    path = index.index_path(tmp_path)
    good = path.read_bytes()
    must_fail(check_damage_is_told, tmp_path, path, good)
    bomb = gzip.compress(b"[" + b"0," * 10**6 + b"0]")
    for data in (b"", good[:-4], good + b"x", good + good, gzip.compress(b"{}"), b"x" + good, bomb):
        check_damage_is_told(tmp_path, path, data)


def test_an_index_is_unpacked_up_to_its_limit(tmp_path, monkeypatch):
    folder = library(tmp_path, GOOD)
    index.write_index(folder, {GOOD.name: GOOD})
    monkeypatch.setattr(index, "LARGEST_INDEX", 400)
    assert "whole" in (complaint(index.records, folder) or "")


def test_a_file_belongs_to_one_material(tmp_path):
    folder = library(tmp_path, GOOD)
    index.write_index(folder, {"other": another("other", file=GOOD.file)})
    assert complaint(index.records, folder) is None
    index.write_record(folder, GOOD)
    assert "for each material" in (complaint(index.records, folder) or "")
