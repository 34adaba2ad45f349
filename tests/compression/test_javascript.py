"""The decoder in JavaScript, run by Node."""

import json
import shutil
import struct
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from compact import (
    CASES,
    FOLDS,
    arrays,
    bomb,
    broken,
    hostile_streams,
    how,
    in_version_1,
    material,
    scale,
    sealed,
    stream,
)
from helpers import must_fail, run_node
from noted import FINE, NOT_PLAIN, with_notes

from sommerl import Lattice, SomManBrdf
from sommerl.compression.smrl import file, reference_codec
from sommerl.compression.smrl.file import decode, encode
from sommerl.system.errors import FormatError
from sommerl.system.sealed_file import PREFIX

GOLDEN = Path(__file__).parents[1] / "golden"
MAIN = """
import fs from "node:fs";
import { decode } from "./smrl.js";
const hex = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength).toString("hex");
const bytes = fs.readFileSync(0);
const found = [];
for (let at = 0; at < bytes.length; ) {
    const length = bytes.readUInt32LE(at);
    const file = bytes.subarray(at + 4, at + 4 + length);
    at += 4 + length;
    try {
        const material = await decode(file.buffer.slice(file.byteOffset, file.byteOffset + length));
        for (const key of ["lut", "index", "gains", "gainIndex"]) material[key] &&= hex(material[key]);
        found.push(material);
    } catch (error) {
        found.push(error.constructor === Error ? error.message : String(error.stack));
    }
}
fs.writeFileSync(1, JSON.stringify(found));
"""


def cells(entries, lattice, interpolation="nearest"):
    rng = np.random.default_rng(entries)
    index = rng.integers(0, entries, lattice.shape).astype(np.uint8 if entries <= 256 else np.uint16)
    lut = rng.random((entries, 3)) ** 6
    made = SomManBrdf(lut, index, lattice, name="Ärger", interpolation=interpolation, source_sha256="0f" * 32)
    made.options, made.metrics = {"seed": 3}, {"rmse": 1e-3}
    return made


@pytest.fixture(scope="module")
def node(tmp_path_factory):
    """Runs the decoder on the bytes of files: what it finds, or what it says where it refuses."""
    folder = tmp_path_factory.mktemp("js")
    for name in ("smrl.js", "nodes.js"):
        shutil.copy(str(files("sommerl") / "compression" / "smrl" / "javascript" / name), folder)
    (folder / "main.js").write_text(MAIN)
    (folder / "package.json").write_text('{"type": "module"}')

    def run(contents):
        given = b"".join(struct.pack("<I", len(data)) + data for data in contents)
        # JavaScript has but one kind of numbers.
        return json.loads(run_node(folder / "main.js", given=given), parse_int=float)

    return run


def described(made):
    """What JavaScript should find, arrays as bytes."""
    lut, index, gains, gain_index = (part.astype(part.dtype.newbyteorder("<")).tobytes().hex() for part in arrays(made))
    known = {"name": made.name, "sha256": made.source.sha256, "interpolation": made.interpolation, "scale": scale(made)}
    known |= {"lut": lut, "index": index, "notes": {"options": made.options, "metrics": made.metrics}}
    lattice = made.lattice
    if made.grid:
        axes = dict(zip(("thetaH", "thetaD", "phiD"), lattice.shape, strict=True))
        return known | {"kind": "cells", "lattice": axes | {"reciprocal": lattice.reciprocal}}
    axes = dict(zip(("thetaH", "band", "thetaD", "phiD"), lattice.axes(), strict=True))
    known |= {
        "kind": "nodes",
        "lattice": axes | lattice.folds,
        **dict(zip(("signed", "smooth"), how(made), strict=True)),
    }
    return known | {"gains": gains, "gainIndex": gain_index}


def check_same(found, wanted):
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert one == other


def test_the_same_numbers_bit_for_bit(node):
    first = [material(case, seed) for case in CASES for seed in range(2)]
    made = first + [
        material(case, 2, folds=folds, signed=n % 2 > 0) for case in CASES for n, folds in enumerate(FOLDS.values())
    ]
    made += [cells(9, Lattice(4, 5, 6)), cells(256, Lattice(9, 8, 7), "trilinear"), cells(257, Lattice(9, 9, 18))]
    made += [cells(5, Lattice(4, 32, 5, reciprocal=False)), cells(2, Lattice(1, 1, 1)), cells(300, Lattice())]
    golden = [path.read_bytes() for path in sorted(GOLDEN.glob("*.smrl"))]
    made += map(decode, golden)
    found, wanted = node(map(encode, made)), list(map(described, made))
    check_same(found, wanted)
    check_same(node(golden), wanted[-len(golden) :])
    check_same(node(map(in_version_1, first)), wanted[: len(first)])
    made[0].lut[0, 0] += 2.0**-50
    must_fail(check_same, found, list(map(described, made)))


def read(data):
    """What Python finds in the bytes of a file, or what it says where it refuses."""
    try:
        return described(decode(data))
    except FormatError as error:
        return str(error)


def read_plainly(data):
    """The same with the decoder of streams in plain Python."""

    def decoded(stream, reciprocal, mirrored, version):
        *axes, gains, shapes, gain, shape = reference_codec.decode(stream, mirrored, version)
        names = ("theta_h", "band", "theta_d", "phi_d", "gains", "shapes")
        folds = {"reciprocal": reciprocal, "mirrored": mirrored}
        palette = SimpleNamespace(**dict(zip(names, (*axes, gains, shapes), strict=True)), **folds)
        return palette, tuple(np.array(index, np.uint16) for index in (gain, shape))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(file, "_core", SimpleNamespace(NodePalette=SimpleNamespace(decode=decoded)))
        return read(data)


def mutated(body, count, seed):
    """Contents with a few bytes changed anywhere, some of them cut off."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        each = bytearray(body)
        for at in rng.integers(0, len(body), rng.integers(1, 5)):
            each[at] = rng.integers(0, 256)
        yield bytes(each[: rng.integers(1, len(each) + 1) if rng.random() < 0.2 else None])


def noted(notes, made):
    """A file with such notes, whose text may be anything."""
    made.options, made.metrics = {}, {}
    body = encode(made)[PREFIX.size :]
    at = 2 + body[1] + 1 + body[2 + body[1]]
    return sealed(body[:at] + struct.pack("<H", len(notes)) + notes + body[at + 2 :])


FIRST = b'{"kind":"som-man","name":"x"}'
LINK = b'{"kind":"source","name":"x","sha256":"' + b"0f" * 32 + b'"}'
CHAINS = [
    *(b"[]", b"3", b"null", b"{}", b"[" + FIRST + b"]", b"[" + LINK + b"]", b"[[]]", b"[null]"),
    *(b"[" + FIRST + n * (b"," + LINK) + b"]" for n in (1, 7, 8)),
    *(b"[" + FIRST.replace(b"x", name) + b"]" for name in (b"x" * 255, b"x" * 256, "\U0001f600".encode() * 255)),
    *(b"[" + FIRST.replace(b"som-man", kind) + b"]" for kind in (b"factored", b"other", b"")),
    *(b"[" + FIRST + b"," + LINK.replace(b"0f", digits) + b"]" for digits in (b"0F", b"", b"0", b"0g", b"0f\\n")),
    b"[" + FIRST.replace(b'"x"', b"3") + b"]",
    b"[" + FIRST.replace(b"}", b',"more":"x"}') + b"]",
]
NOTES = [
    *(b'{"made_from":' + chain + b"}" for chain in CHAINS),
    *(
        b"{}",
        b"[]",
        b"null",
        b"3",
        b"{",
        b"\xff\xfe",
        b"{}x",
        b"[" * 30000,
        b'{"a":' * 9000,
        b"\xef\xbb\xbf{}",
        b" {} ",
    ),
    *(
        b'{"a":1e999}',
        b'{"a":' + b"9" * 400 + b"}",
        b'{"a":' + b"9" * 5000 + b"}",
        b'{"a":1e-999}',
        b'{"a":-0.0}',
        b'{"a":01}',
    ),
    *(
        b'{"options":null}',
        b'{"options":3}',
        b'{"metrics":[]}',
        b'{"metrics":{"x":NaN}}',
        b'{"metrics":{"x":-Infinity}}',
    ),
    *(b'{"a":' * n + b"1" + b"}" * n for n in (32, 33)),
    *(b'{"a":' + b"[" * n + b"]" * n + b"}" for n in (31, 32, 5000)),
    *(
        b'{"a":"\t"}',
        rb'{"a":"\ud800"}',
        rb'{"a":"\u00e9"}',
        b'{"a":1,"a":{}}',
        b'{"__proto__":{"options":3}}',
        b"{'a':1}",
    ),
]


# A material, and the version of its file.
KINDS = {
    "cells": (lambda: cells(3, Lattice(2, 2, 3)), 1),
    "nodes of version 1": (lambda: material((2, 1, 3, 3, "walk"), 4), 1),
    **{
        name: (lambda folds=folds: material((2, 1, 3, 3, "walk"), 4, folds=folds, signed=True), 2)
        for name, folds in FOLDS.items()
    },
}


@pytest.mark.parametrize("kind", KINDS)
def test_all_decoders_find_the_same_or_say_the_same(node, kind):
    make, version = KINDS[kind]
    made, nodes = make(), kind != "cells"
    data = in_version_1(made) if nodes and version == 1 else encode(made)
    body = data[PREFIX.size :]

    def closed(contents):
        return sealed(contents, version)

    contents = [data[:-1], data + b"\0", b"", data[:20], data[:6], bytes(40)]
    contents += [sealed(body, version) for version in (0, 3, 65535)]
    contents += [closed(body + more) for more in (b"\0", b"\0\0", b"\xff" * 9)]
    contents += [noted(notes, made) for notes in NOTES]
    contents += map(closed, (*broken(body), *mutated(body, 800, 1)))
    contents += [sealed(body, 3 - version), closed(b"\2" + body[1:]), closed(bytes([not nodes]) + body[1:])]
    if nodes:
        stream_, head = stream(data)
        streams = hostile_streams(version, made.lattice.mirrored).values()
        contents += [closed(head + each) for each in (*streams, *mutated(stream_, 400, 2))]
        before, flags = (head[:-4], b"") if version == 1 else (head[:-5], head[-1:])
        scales = [struct.pack("<f", scale) for scale in (0, -1, np.nan, np.inf, 1e-45)]
        contents += [closed(before + scale + flags + stream_) for scale in scales]
        contents += [closed(head[:-1] + bytes([flags]) + stream_) for flags in (*range(18), 255)]
    found, wanted = node(contents), list(map(read, contents))
    check_same(found, wanted)
    if nodes:
        check_same(list(map(read_plainly, contents)), wanted)
        check_same(node([closed(head + bomb())]), [read(closed(head + bomb()))])
    assert all(isinstance(each, str) and "\n" not in each for each in wanted[:12])
    assert len({each for each in wanted if isinstance(each, str)}) > 12
    must_fail(check_same, found, [described(made), *wanted[1:]])
    must_fail(check_same, found, [f"{wanted[0]}.", *wanted[1:]])


def test_no_file_is_longer(node, tmp_path):
    length = file.LONGEST_FILE + 1
    path = tmp_path / "long.smrl"
    path.write_bytes(bytes(length))
    with pytest.raises(FormatError, match=f"expected at most {length - 1} bytes, found {length}"):
        file.load(path)
    assert node([bytes(length)]) == [f"expected at most {length - 1} bytes, found {length}"]


def test_it_takes_the_numbers_that_python_takes(node):
    largest, contents = float(np.finfo(np.float32).max), []
    for value in (largest, np.nextafter(largest, np.inf), 5e-324, 1e308):
        made = cells(3, Lattice(2, 2, 3))
        made.lut[1, 1] = value
        contents.append(encode(made))
    wanted = list(map(read, contents))
    check_same(node(contents), wanted)
    assert [isinstance(each, str) for each in wanted] == [False, True, False, True]


def test_it_takes_the_notes_that_python_takes(node):
    contents = [with_notes(noted) for noted in (*NOT_PLAIN, *FINE, b'{"options":{"a":1e999}}', b"[" * 30_000)]
    found, wanted = node(contents), list(map(read, contents))
    check_same(found, wanted)
    assert sum(isinstance(each, str) for each in wanted) == len(NOT_PLAIN) + 2
    must_fail(check_same, found, ["", *wanted[1:]])
