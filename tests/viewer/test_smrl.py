"""The decoder in JavaScript, run by Node."""

import json
import shutil
import struct
import subprocess
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from compact import CASES, arrays, broken, material, sealed
from helpers import must_fail, tool
from noted import FINE, NOT_PLAIN, with_notes

from sommerl import Lattice, SomManBrdf
from sommerl.container import PREFIX
from sommerl.errors import FormatError
from sommerl.som_man.file import decode, encode

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
        found.push(error.constructor === RangeError ? String(error.stack) : null);
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
    """Runs the decoder on the bytes of files: what it finds, None where it refuses."""
    folder = tmp_path_factory.mktemp("js")
    for name in ("smrl.js", "nodes.js"):
        shutil.copy(str(files("sommerl") / "viewer" / name), folder)
    (folder / "main.js").write_text(MAIN)
    (folder / "package.json").write_text('{"type": "module"}')

    def run(contents):
        given = b"".join(struct.pack("<I", len(data)) + data for data in contents)
        return json.loads(
            subprocess.run([tool("node"), folder / "main.js"], input=given, capture_output=True, check=True).stdout
        )

    return run


def described(made):
    """What JavaScript should find, arrays as bytes."""
    lut, index, gains, gain_index = (part.astype(part.dtype.newbyteorder("<")).tobytes().hex() for part in arrays(made))
    known = {"name": made.name, "sha256": made.source_sha256, "interpolation": made.interpolation, "scale": made.scale}
    known |= {"lut": lut, "index": index, "notes": {"options": made.options, "metrics": made.metrics}}
    lattice = made.lattice
    if made.grid:
        axes = dict(zip(("thetaH", "thetaD", "phiD"), lattice.shape, strict=True))
        return known | {"kind": "cells", "lattice": axes | {"reciprocal": lattice.reciprocal}}
    axes = dict(zip(("thetaH", "band", "thetaD", "phiD"), lattice.axes(), strict=True))
    return known | {"kind": "nodes", "lattice": axes, "gains": gains, "gainIndex": gain_index}


def check_same(found, wanted):
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert one == other


def test_the_same_numbers_bit_for_bit(node):
    made = [material(case, seed) for case in CASES for seed in range(2)]
    made += [cells(9, Lattice(4, 5, 6)), cells(256, Lattice(9, 8, 7), "trilinear"), cells(257, Lattice(9, 9, 18))]
    made += [cells(5, Lattice(4, 32, 5, reciprocal=False)), cells(2, Lattice(1, 1, 1)), cells(300, Lattice())]
    made += [decode(path.read_bytes()) for path in sorted(GOLDEN.glob("*.smrl"))]
    found, wanted = node(map(encode, made)), list(map(described, made))
    check_same(found, wanted)
    made[0].lut[0, 0] += 2.0**-50
    must_fail(check_same, found, list(map(described, made)))


def described_or_none(data):
    try:
        return described(decode(data))
    except FormatError:
        return None


@pytest.mark.parametrize(
    "made", [cells(3, Lattice(2, 2, 3)), material((2, 1, 3, 3, "walk"), 4)], ids=["cells", "nodes"]
)
def test_it_refuses_what_python_refuses(node, made):
    data = encode(made)
    body = data[PREFIX.size :]
    contents = [data[:-1], data + b"\0", b"", data[:20], *(sealed(body, version) for version in (0, 2, 65535))]
    contents += [sealed(body + more) for more in (b"\0", b"\0\0", b"\xff" * 9)]
    assert all(described_or_none(each) is None for each in contents)
    contents += map(sealed, broken(body))
    found, wanted = node(contents), list(map(described_or_none, contents))
    check_same(found, wanted)
    must_fail(check_same, found, [described(made), *wanted[1:]])


def test_it_takes_the_numbers_that_python_takes(node):
    largest, contents = float(np.finfo(np.float32).max), []
    for value in (largest, np.nextafter(largest, np.inf), 5e-324, 1e308):
        made = cells(3, Lattice(2, 2, 3))
        made.lut[1, 1] = value
        contents.append(encode(made))
    wanted = list(map(described_or_none, contents))
    check_same(node(contents), wanted)
    assert [each is None for each in wanted] == [False, True, False, True]


def test_it_takes_the_notes_that_python_takes(node):
    contents = [with_notes(noted) for noted in (*NOT_PLAIN, *FINE, b'{"options":{"a":1e999}}', b"[" * 30_000)]
    found, wanted = node(contents), list(map(described_or_none, contents))
    check_same([each and each["notes"] for each in found], [each and each["notes"] for each in wanted])
    assert sum(each is None for each in wanted) == len(NOT_PLAIN) + 2
    must_fail(check_same, found, [{}, *wanted[1:]])
