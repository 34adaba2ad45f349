"""A short run of benchmarks/hostile.py, and readers that are broken on purpose."""

import dataclasses
import importlib.util
import sys
from pathlib import Path

import pytest
from helpers import must_fail

from sommerl.system import door

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "hostile.py"
DEAR = ("samples-table", "merl")  # a load of which takes seconds; their own tests damage them


def _script():
    spec = importlib.util.spec_from_file_location("hostile", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["hostile"] = module  # where its data classes look for their types
    spec.loader.exec_module(module)
    return module


hostile = _script()
NATIVE = ("nbrdf-h5", "nbrdf-keras", "obj", "ply", "exr", "hdr", "pfm")


def check_no_fault(report):
    assert report.faults == {}
    assert report.accepted >= 1
    assert report.refused >= 1


@pytest.mark.parametrize("name", [name for name in hostile.BY_NAME if name not in (*NATIVE, *DEAR)])
def test_readers(tmp_path, name):
    check_no_fault(hostile.attack(hostile.BY_NAME[name], 0.7, 0, tmp_path, tmp_path / "out"))


@pytest.mark.parametrize("name", NATIVE)
def test_readers_that_rely_on_others(tmp_path, name):
    """In a process of their own, which may die."""
    check_no_fault(hostile.in_child(hostile.BY_NAME[name], 1.5, 0, tmp_path / "out"))


def broken(load):
    return dataclasses.replace(hostile.BY_NAME["fits"], load=load)


def without_end(path):
    raise IndexError("list index out of range")


def too_much(path):
    door.read(path, 2**30)
    return door.read(path, 2**30)


def without_limit(path):
    with door.opened(path) as file:
        return file._stream.read(2**24 + 3)


@pytest.mark.parametrize("load", [without_end, too_much, without_limit])
def test_broken_readers_are_noticed(tmp_path, load):
    report = hostile.attack(broken(load), 0.1, 0, tmp_path, tmp_path / "out")
    must_fail(check_no_fault, report)
    assert all(Path(kept).is_file() for kept in report.faults.values() if kept)


def test_a_process_that_dies_is_noticed(tmp_path, monkeypatch):
    script = tmp_path / "dies.py"
    script.write_text("import os, sys\nopen(sys.argv[8] + '/file.json', 'w').write('x')\nos.abort()\n")
    monkeypatch.setattr(hostile, "__file__", str(script))
    report = hostile.in_child(hostile.BY_NAME["fits"], 5.0, 0, tmp_path / "out")
    must_fail(check_no_fault, report)
    assert any("status -6" in what for what in report.faults)
    assert (tmp_path / "out" / "fits-0.json").read_text() == "x"


def test_the_same_seed_damages_alike():
    import random

    damaged = [[hostile.mutated(random.Random(seed), bytes(range(200))) for _ in range(3)] for seed in (1, 1, 2)]
    assert damaged[0] == damaged[1] != damaged[2]
