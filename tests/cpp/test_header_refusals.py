"""include/sommerl.hpp refuses what Python refuses, with an error code, and does nothing that is undefined."""

import struct
import zlib

import compact
import numpy as np
import pytest
from compact import FOLDS
from factored_brdfs import even
from factored_brdfs import sealed as sealed_factors
from headers import ERRORS, GOLDEN, HERE, cells, codes, compiled, output, probe, sharing
from helpers import must_fail
from library_files import METRICS, apart, everything, together

from sommerl import Lattice
from sommerl.compression.smrl import file
from sommerl.compression.smrl.library_index import INDEX_HEAD
from sommerl.factored import file as factored_file
from sommerl.system.errors import SommerlError
from sommerl.system.sealed_file import PREFIX, deflated

FILES = sorted(path for path in GOLDEN.iterdir() if path.suffix in (".smrl", ".fbrdf", ".smrlib"))


def taken(read, data):
    """Whether Python takes a file."""
    try:
        read(data)
    except SommerlError:
        return False
    return True


def check_refuses_like_python(found, files, read):
    expected = [taken(read, data) for data in files]
    assert [code == "none" for code in found] == expected


def reader(path):
    return {".smrl": file.decode, ".fbrdf": factored_file.decode, ".smrlib": everything}[path.suffix]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_golden_files_that_are_cut_off_or_changed(path):
    data = path.read_bytes()
    damaged = compact.broken(data)[:: 5 if path.suffix == ".smrlib" else 1] + [
        data + more for more in (b"\0", b"SMRL", bytes(100))
    ]
    found = codes(probe(), damaged)
    assert set(found) <= set(ERRORS) - {"none", "not_loaded", "file", "memory", "missing"}
    (fine,) = codes(probe(), [data])
    assert fine == "none"


def small(kind):
    """A small material, and what seals a body."""
    if kind == "cells":
        made = cells(Lattice(3, 2, 3), 3, "nearest")
        made.options, made.metrics = {"seed": 1}, {"rmse": 0.25}
        return file.encode(made), file.decode, compact.sealed
    if kind == "factored":
        return factored_file.encode(even()), factored_file.decode, sealed_factors
    made = compact.material((2, 1, 3, 3, "walk"), 4, folds=FOLDS[kind], signed=True)
    made.options, made.metrics = {"seed": 1, "source_facts": {"samples": 3}}, {"rmse": 0.25}
    return file.encode(made), file.decode, compact.sealed


@pytest.mark.parametrize("kind", ["cells", "factored", *FOLDS])
def test_broken_files_with_a_checksum_that_fits(kind):
    data, read, seal = small(kind)
    files = [seal(each) for each in compact.broken(data[PREFIX.size :])]
    found = codes(probe(), files)
    check_refuses_like_python(found, files, read)
    must_fail(check_refuses_like_python, ["none"] * len(files), files, read)


def test_version_1(tmp_path):
    data = compact.in_version_1(compact.material((2, 1, 3, 3, "walk"), 4))
    files = [compact.sealed(each, 1) for each in compact.broken(data[PREFIX.size :])]
    check_refuses_like_python(codes(probe(), files), files, file.decode)


def test_broken_libraries_with_checksums_that_fit():
    data, _ = sharing()
    sections, head, payload = apart(data)
    files = []
    for at in range(len(payload)):  # of the index
        changed = payload[:at] + bytes([payload[at] ^ (1, 0x80, 0x41)[at % 3]]) + payload[at + 1 :]
        files.append(together([list(section) for section in sections], head, changed))
    for number in (1, 2):  # what is shared, and the materials
        contents = sections[number][2]
        for at in range(0, len(contents), 7):
            parts = [list(section) for section in sections]
            parts[number][2] = contents[:at] + bytes([contents[at] ^ 0x41]) + contents[at + 1 :]
            files.append(together(parts))
    for n in range(len(head)):
        changed = [value + (n == i) for i, value in enumerate(head)]
        files.append(together([list(section) for section in sections], changed, payload))
    files += [
        together(sections[:2]),
        together(sections[1:]),
        together([*sections, sections[0]]),
        together([*sections, [9, 1, b""]]),
    ]
    files.append(together([*sections, [9, 0, b"passed over"]]))
    found = codes(probe(), files)
    check_refuses_like_python(found, files, everything)
    assert found[-1] == "none"


def test_long_names_of_metrics():
    found = codes(probe(), METRICS)
    check_refuses_like_python(found, METRICS, everything)
    assert found == ["none", "notes"] * 2
    must_fail(check_refuses_like_python, ["notes", *found[1:]], METRICS, everything)  # as bytes would be counted


def with_notes(notes):
    body = bytes([1, 1, 120, 0]) + struct.pack("<H", len(notes)) + notes
    return compact.sealed(body + NODES[NODES.index(b"\0\0\0") + 3 :])


NODES = file.encode(compact.material((2, 1, 3, 3, "walk"), 4))[PREFIX.size + 9 :]


NOTES = r"""
{}
 { }
[]
1
{
{}}
{"a":1,}
{"a" 1}
{"options":{}}
{"options":[]}
{"options":null}
{"options":{"a":[1]}}
{"options":{"a":true,"b":null,"c":-1.5e-7}}
{"metrics":{"a":{}}}
{"options":{"source_facts":{"a":1}}}
{"metrics":{"source_facts":{"a":1}}}
{"options":{"source_facts":{"a":{}}}}
{"options":{"source_facts":1}}
{"a":NaN}
{"a":Infinity}
{"a":1e400}
{"a":1e-400}
{"a":01}
{"a":1.}
{"a":.5}
{"a":1e}
{"a":-}
{"a":+1}
{"options":{"a":1e301}}
{"options":{"a":1e299}}
{"a":"\u12g4"}
{"a":"\x"}
{"a":"\u00e4\n"}
{"a":"ä"}
{"a":tru}
nul
"""


def test_notes():
    many = ",".join(f'"{n}":1' for n in range(65))
    notes = NOTES.splitlines()
    notes += ['{"options":{"a":"%s"}}' % ("x" * count) for count in (1000, 1001)]
    notes += ['{"options":{"%s":1}}' % ("x" * count) for count in (100, 101)]
    notes += ['{"options":{' + each + "}}" for each in (many, many[: many.rindex(",")])]
    notes += ['{"a":' + "[" * count + "]" * count + "}" for count in (31, 32)]
    files = [with_notes(each.encode()) for each in (*notes, '{"a":"\n"}', "\ufeff{}", "{}\0")]
    files += [with_notes(b'{"a":"%s"}' % some) for some in (b"\xff", b"\xed\xa0\x80", b"\xc0\x80", b"\xf4\x90\x80\x80")]
    found = codes(probe(), files)
    check_refuses_like_python(found, files, file.decode)
    assert set(found) == {"none", "notes"}


def test_each_error_is_told():
    good = (GOLDEN / "nodes-2-both.smrl").read_bytes()
    of_cells = (GOLDEN / "cells.smrl").read_bytes()
    cases = {
        b"": "truncated",
        b"SMRL\1\0": "truncated",
        b"SMRX" + good[4:]: "kind",
        good[:4] + b"\3\0" + good[6:]: "version",
        good[:-1]: "checksum",
        compact.sealed(bytes([1, 200]), 2): "truncated",
        compact.sealed(bytes([1, 2, 0xC3, 0x28, 0])): "name",
        compact.sealed(bytes([7, 0, 0, 0, 0])): "version",
        compact.sealed(good[PREFIX.size :] + b"\1"): "stream",
        compact.sealed(of_cells[PREFIX.size :] + b"\0"): "stream",
        compact.sealed(bytes([0, 0, 0, 0, 0]) + struct.pack("<HHHBBI", 5000, 5000, 5000, 1, 0, 9)): "contents",
        compact.sealed(bytes([1, 0, 0, 0, 0]) + struct.pack("<fB", float("inf"), 1)): "contents",
    }
    assert codes(probe(), cases) == list(cases.values())


def test_no_more_memory_than_the_counts_say():
    """A stream that goes on and on; and an index that says it is long."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    bomb = packer.compress(bytes(10**8)) + packer.flush()
    head = bytes([0, 0, 0, 0, 0]) + struct.pack("<HHHBBI", 3, 2, 3, 1, 0, 1)
    long = together([[1, 1, INDEX_HEAD.pack(2**32 - 1, 255, 0, 0, 0) + bomb[:1000]], [2, 1, b""]])
    assert codes(probe(), [compact.sealed(head + bomb), long]) == ["stream", "contents"]


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "none.smrl", tmp_path):
        printed = output(probe(), "call", path, "", "float", "eval", status=1)
        assert b"expected " in printed
    printed = output(probe(), "call", GOLDEN / "library-1.smrlib", "no such", "float", "eval", status=1)
    assert printed == b"expected a material of that name in the library, found none\n"


def test_threads_share_a_material(tmp_path):
    program = compiled(HERE / "threads.cpp", "-O1", "-fsanitize=thread", folder=tmp_path)
    output(program, GOLDEN / "nodes-2-both.smrl")


def test_random_bytes_at_several_places():
    rng, files = np.random.default_rng(7), []
    for kind in ("cells", "factored", *FOLDS):
        data, _, seal = small(kind)
        for _ in range(200):
            each = bytearray(data[PREFIX.size :])
            for at in rng.integers(0, len(each), 4):
                each[at] = rng.integers(0, 256)
            files.append((kind, seal(bytes(each))))
    for kind in ("cells", "factored", "both"):
        some = [data for each, data in files if each == kind]
        check_refuses_like_python(codes(probe(), some), some, small(kind)[1])


def flat():
    """A small file of many cells, a third of them in columns of which none is above the horizon."""
    lattice = Lattice(65535, 1, 63)
    bins = (lattice.theta_h, lattice.theta_d, lattice.phi_d)
    head = bytes(5) + struct.pack("<HHHBBI", *bins, lattice.reciprocal, 1, 1)
    return compact.sealed(head + deflated(bytes(24 + int(lattice.above_horizon.sum()))))


def check_reads_flat(program):
    """In the time that other files of that size take: a search up each column for each of its cells took minutes."""
    assert codes(program, [flat(), flat()[:-1]]) == ["none", "checksum"]


def test_columns_below_the_horizon():
    check_reads_flat(probe())
