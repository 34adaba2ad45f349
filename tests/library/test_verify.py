"""A library is checked: each fault is one line, and decides the exit status."""

import hashlib
import json
import shutil
from dataclasses import replace as with_

import pytest
from helpers import must_fail, run, run_json
from libraries import built, sources

from sommerl.library import index


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    place = tmp_path_factory.mktemp("library")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOMMERL_THREADS", "1")
        built(sources(place / "in", 2), place / "out")
    return place / "out"


@pytest.fixture
def library(good, tmp_path):
    return shutil.copytree(good, tmp_path / "library")


def check_sound(capsys, library):
    status, out, err = run(capsys, "library", "verify", library)
    assert (status, err) == (0, "")
    assert out == f"{library}: 2 materials, each as it was written\n"
    answer = run_json(capsys, "library", "verify", library)
    assert (answer["checked"], answer["faults"]) == (2, [])


def cut(path):
    path.write_bytes(path.read_bytes()[:-1])


def turn(path):
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)


def replace(path):
    path.unlink()
    path.mkdir()


FAULTS = {
    "missing": (lambda path: path.unlink(), "m0", "expected the file of m0, found none"),
    "cut": (cut, "m0", "expected {} bytes, found {}"),
    "changed": (turn, "m0", "expected the checksum in its record, found another: the file has changed"),
    "folder": (replace, "m0", "expected a file, found a directory"),
    "unknown": (lambda path: shutil.copy(path, path.with_name("x.smrl")), "", "expected a record of it, found none"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_told(capsys, library, fault):
    check_sound(capsys, library)
    damage, name, sentence = FAULTS[fault]
    path = library / "m0.smrl"
    size = path.stat().st_size
    damage(path)
    must_fail(check_sound, capsys, library)
    status, out, err = run(capsys, "library", "verify", library, "--json")
    assert status == 1
    file = "m0.smrl" if name else "x.smrl"
    told = f"{library / file}: {sentence.format(size, size - 1)}"
    assert json.loads(out)["faults"] == [{"name": name, "file": file, "sentence": told}]
    total = f"{library}: expected 2 materials as they were written, found 1 faults"
    assert err == f"error: {told}\nerror: {total}\n"


def test_a_file_that_does_not_decode_is_told(capsys, library):
    """Its record agrees with it: somebody wrote both."""
    record = index.records(library)["m0"]
    data = b"SMRL no material"
    (library / "m0.smrl").write_bytes(data)
    index.write_record(library, with_(record, bytes=len(data), sha256=hashlib.sha256(data).hexdigest()))
    status, _, err = run(capsys, "library", "verify", library)
    assert status == 1
    assert err.startswith(f"error: {library / 'm0.smrl'}: expected ")


def test_what_is_no_library(capsys, tmp_path, library):
    assert run(capsys, "library", "verify", tmp_path) == (
        1,
        "",
        f"error: {tmp_path}: expected a library, as `sommerl library build` makes it, found none\n",
    )
    turn(index.index_path(library))
    status, _, err = run(capsys, "library", "verify", library)
    assert status == 1
    assert err.startswith(f"error: {index.index_path(library)}: expected ")
    assert err.count("\n") == 1


def test_sub_commands(capsys):
    status, _, err = run(capsys, "library")
    assert (status, err.count("\n")) == (2, 1)
    status, _, err = run(capsys, "library", "verfy")
    assert (status, "did you mean verify?" in err) == (2, True)
    assert "build" in run(capsys, "library", "--help")[1]
