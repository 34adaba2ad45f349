"""The table of formats, and what is made from it: recognition, what is needed, help and docs."""

import io
import sys
from dataclasses import replace
from pathlib import Path

import factored_brdfs
import h5py
import numpy as np
import page_files
import pytest
import rgl_files
from helpers import complaint, lambertian_table, must_fail, random_directions, run
from library_files import MATERIALS, packed

from sommerl import TrainOptions, load, train
from sommerl.compression.smrl import file as smrl_file
from sommerl.factored import file as fbrdf_file
from sommerl.formats import fits, registry
from sommerl.formats.registry import FORMATS, by_extension, extensions, readable, writable
from sommerl.models.nbrdf import SHAPES, WEIGHTS
from sommerl.system import door

DOCS = Path(__file__).parents[2] / "docs" / "formats.md"
A, B = (w[w[:, 2] > 0.2][:40] for w in (random_directions(80, s) for s in (1, 2)))
ANGLES = np.stack([x for w in (A, B) for x in (np.arccos(w[:, 2]), np.arctan2(w[:, 1], w[:, 0]))], axis=-1)
WEIGHT = np.random.default_rng(0).normal(scale=0.4, size=WEIGHTS)
HEAVY = ("scipy.spatial", "h5py")  # what the extra `lab` brings along


def text(head, columns, separator):
    rows = np.hstack([ANGLES, np.full((len(A), columns), 0.2)])
    return "\n".join([head, *(separator.join(f"{x:.9g}" for x in row) for row in rows)]).encode()


def merl():
    return np.array([90, 90, 180], "<i4").tobytes() + np.full(3 * 90 * 90 * 180, 0.5).tobytes()


def keras():
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        for number, (rows, columns) in enumerate(SHAPES, 1):
            file[f"model_weights/dense_{number}/kernel:0"] = np.full((rows, columns), 0.1, "f4")
            file[f"model_weights/dense_{number}/bias:0"] = np.full(columns, 0.1, "f4")
    return out.getvalue()


def saved(save, *arrays, **named):
    out = io.BytesIO()
    save(out, *arrays, **named)
    return out.getvalue()


def written_fits(folder):
    fits.write(folder / "x", "theta_i,phi_i", [{"model": "lambertian", "parameters": [LAMBERTIAN]}])
    return (folder / "x").read_bytes()


def alta():
    return text("#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN", 1, " ")


XOMPT = '"metadata": {"openMaterial3dVersion": "1.0.0"}, "brdf": {"lookupTable": [[5.5e-7, 0.1, 0.2, 0.3, 0.4]]}'
ZEMAX = """Source Measured
Symmetry PlaneSymmetrical
SpectralContent Monochrome
ScatterType BRDF
SampleRotation 1
0
AngleOfIncidence 1
10
ScatterAzimuth 1
0
ScatterRadial 2
0 30
Monochrome
DataBegin
TIS 0.1
1 0.5
DataEnd
"""
LAMBERTIAN = {"family": "lambertian", "albedo": [0.3, 0.2, 0.1]}
SAMPLES = "theta_i_rad,phi_i_rad,theta_o_rad,phi_o_rad,r,g,b"
FIELDS = [(name, "<f8") for name in ("theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b")]
# A file of each format that is read, by the name of the format.
FILES = {
    "Sommerl": lambda _: smrl_file.encode(train(lambertian_table(), TrainOptions(clusters=1, epochs=1))[0]),
    "library": lambda _: packed({"cells": MATERIALS["cells"]}),
    "factored BRDF": lambda _: fbrdf_file.encode(factored_brdfs.even()),
    "MERL": lambda _: merl(),
    "RGL": lambda _: rgl_files.content(),
    "MDL measured BSDF": lambda _: page_files.mbsdf(np.ones((3, 3, 4, 3))),
    "OpenMATERIAL 3D": lambda _: ("{" + XOMPT + "}").encode(),
    "Zemax": lambda _: ZEMAX.encode(),
    "ALTA": lambda _: alta(),
    "ASTM E1392": lambda _: text("LAB_NAME x\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B", 3, ","),
    "Cornell": lambda _: text("7\n400 450 500 550 600 650 700", 7, " "),
    "samples": lambda _: text(SAMPLES, 3, ","),
    "NumPy array": lambda _: saved(np.save, WEIGHT),
    "NumPy archive": lambda _: saved(np.savez, nickel=WEIGHT),
    "neural BRDF": lambda _: keras(),
    "fits": written_fits,
}


def test_there_is_a_file_of_each_format():
    assert set(FILES) == {each.name for each in readable()}


def check_recognised_by_one(data, name):
    assert [each.name for each in readable() if each.sniff(data[: door.HEAD_BYTES])] == [name]


@pytest.mark.parametrize("name", FILES)
def test_one_format_recognises_a_file(tmp_path, monkeypatch, name):
    data = FILES[name](tmp_path)
    check_recognised_by_one(data, name)
    kind = next(each for each in FORMATS if each.name == name)
    greedy = replace(kind, name="any", sniff=lambda head: True)
    for table in ([*FORMATS, greedy], [each for each in FORMATS if each is not kind]):
        monkeypatch.setattr(registry, "FORMATS", table)
        must_fail(check_recognised_by_one, data, name)


def test_what_names_columns_need_not_be_a_text_of_samples():
    check_recognised_by_one(saved(np.save, np.zeros(40, FIELDS)), "NumPy array")
    named = b'{"sommerl_fits": 1, "material": "paint,theta_i,phi_i"}'
    check_recognised_by_one(named, "fits")
    must_fail(check_recognised_by_one, named[1:], "fits")


def check_extensions_differ(formats):
    found = extensions(formats)
    assert len(set(found)) == len(found)
    assert all(each.startswith(".") and each == each.lower() for each in found)


def test_an_extension_names_one_format():
    # Files of RGL's and of Zemax' have one extension, and are told by their content; the first names the extension.
    check_extensions_differ([each for each in readable() if each.name != "Zemax"])
    check_extensions_differ(writable())
    assert by_extension(readable(), Path("x.bsdf")).name == "RGL"
    must_fail(check_extensions_differ, FORMATS)  # .json is read as fits and written as a snippet


def test_extensions_are_taken_in_either_case():
    assert by_extension(readable(), Path("x.JSON")).name == "fits"
    assert by_extension(writable(), Path("x.Json")).name == "Mitsuba snippet"
    assert by_extension(readable(), Path("x.txt")) is None


def check_needs(kind, path):
    """Without the packages of extras, a file is read, or the error names the extra that is in the table."""
    said = complaint(load, path)
    assert said is None if not kind.needs else f"pip install 'sommerl[{kind.needs}]'" in str(said)


@pytest.mark.parametrize("kind", readable(), ids=lambda kind: kind.name)
def test_what_a_format_needs(tmp_path, monkeypatch, kind):
    path = tmp_path / f"x{kind.extensions[0]}"
    path.write_bytes(FILES[kind.name](tmp_path))
    assert complaint(load, path) is None
    for module in HEAVY:
        monkeypatch.setitem(sys.modules, module, None)
    check_needs(kind, path)
    must_fail(check_needs, replace(kind, needs="" if kind.needs else "render"), path)


def check_listed(text, formats):
    lines = text.splitlines()
    for each in formats:
        start = f"  {' '.join(each.extensions)} "
        assert [each.summary in line for line in lines if line.startswith(start) and f" {each.name}: " in line] == [
            True
        ]


def test_help_lists_the_table(capsys):
    read, written = run(capsys, "--help")[1], run(capsys, "convert", "--help")[1]
    check_listed(read, readable())
    check_listed(written, writable())
    must_fail(check_listed, written, readable())


def test_an_unknown_file_is_told_what_is_known(tmp_path):
    (tmp_path / "x.txt").write_text("hello")
    said = complaint(load, tmp_path / "x.txt")
    assert said == f"{tmp_path / 'x.txt'}: expected a material ({', '.join(map(str, readable()))}), found none of these"
    assert "MERL .binary, RGL .bsdf" in said


def test_where_the_bytes_say_nothing_the_extension_decides(tmp_path):
    for name, said in (("x.binary", "expected MERL dimensions"), ("x.smrl", "expected a material file (.smrl)")):
        (tmp_path / name).write_bytes(b"twelve bytes and more")
        assert said in str(complaint(load, tmp_path / name))


def table_of(markdown):
    """The cells of the first table in a text, without its head."""
    first = markdown[markdown.index("\n|") :].lstrip().split("\n\n")[0]
    return [[cell.strip() for cell in line[1:-1].split("|")] for line in first.splitlines()[2:]]


def check_docs(rows):
    expected = [
        [
            each.name,
            " ".join(f"`{extension}`" for extension in each.extensions),
            each.summary,
            "yes" if each.read else "",
            "yes" if each.write else "",
            f"`sommerl[{each.needs}]`" if each.needs else "",
        ]
        for each in FORMATS
    ]
    assert rows == expected


def test_docs_have_the_table():
    rows = table_of(DOCS.read_text("utf-8"))
    check_docs(rows)
    must_fail(check_docs, [*rows[:-1], [*rows[-1][:-1], "`sommerl[fit]`"]])
    must_fail(check_docs, rows[1:])


def test_a_format_reads_or_writes():
    for each in FORMATS:
        assert bool(each.read) == bool(each.sniff) == (each.largest > 0), each
        assert each.read or each.write, each
