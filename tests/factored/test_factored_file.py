"""Files of factored BRDFs: round trips, and everything that can be wrong with one."""

import struct
from pathlib import Path

import numpy as np
import pytest
from compact import broken
from factored_brdfs import arrays, even, made, sealed
from helpers import must_fail, random_directions, run, run_json
from hypothesis import given, settings
from hypothesis import strategies as st

from sommerl import load
from sommerl.factored.file import LONGEST_FILE, decode, encode, save
from sommerl.factored.material import COLUMNS, ELEVATIONS, ROWS
from sommerl.system import sealed_file
from sommerl.system.errors import FormatError
from sommerl.system.sealed_file import PREFIX

A, B = random_directions(20, 1), random_directions(20, 2)
GOLDEN = Path(__file__).parents[1] / "golden" / "factored.fbrdf"


def check_same(before, after):
    assert (after.name, after.source) == (before.name, before.source)
    assert all(np.array_equal(a, b) for a, b in zip(arrays(before), arrays(after), strict=True))


def test_round_trip(tmp_path):
    path, material = tmp_path / "x.fbrdf", made()
    assert save(material, path) == path.stat().st_size
    check_same(material, load(path))
    assert encode(load(path)) == path.read_bytes()
    must_fail(check_same, made(seed=1), load(path))


def test_a_file_is_told_by_its_content(tmp_path):
    (tmp_path / "x").write_bytes(encode(made()))
    check_same(made(), load(tmp_path / "x"))


def test_golden_file():
    """A file of format 1 from when it was made: it is never to be written anew."""
    check_same(made(1, 2, seed=7), decode(GOLDEN.read_bytes()))
    must_fail(check_same, made(1, 2, seed=8), decode(GOLDEN.read_bytes()))


def check_damage_is_named(data, path):
    path.write_bytes(data)
    message = ""
    try:
        load(path)
    except FormatError as error:
        message = str(error)
    assert message.startswith(f"{path}: expected ")
    assert "\n" not in message


def test_every_damage_is_refused(tmp_path):
    path, data = tmp_path / "x.fbrdf", encode(even())
    for damaged in [*broken(data), data + b"\0", data + data]:
        check_damage_is_named(damaged, path)
    must_fail(check_damage_is_named, data, path)


def check_refused_or_usable(data, read=decode):
    """What an attacker sends, with a checksum that fits."""
    found = error = None
    try:
        found = read(data)
    except Exception as other:
        error = other
    if found is None:
        assert isinstance(error, FormatError), repr(error)
        assert "\n" not in str(error)
        return
    assert np.isfinite(found.eval(A, B)).all()
    check_same(found, decode(encode(found)))


def test_broken_files_with_a_checksum_that_fits():
    for each in broken(encode(even())[PREFIX.size :]):
        check_refused_or_usable(sealed(each))
    must_fail(check_refused_or_usable, encode(even()), lambda data: struct.unpack_from("<d", data, 10**6))


@settings(deadline=None, max_examples=100)
@given(st.binary(max_size=80), st.sampled_from([b"\0\0\1\1", b"\0\0", b""]))
def test_any_bytes(data, head):
    check_refused_or_usable(sealed(head + data))


@pytest.mark.parametrize("version", [0, 2, 65535])
def test_other_versions_are_refused_by_name(version):
    with pytest.raises(FormatError, match=f"expected version 1, found version {version};"):
        decode(sealed(b"", version))


def with_values(change):
    """A file whose values were changed, by a function of half-precision values and of scales."""
    halves = np.ones(3 * ELEVATIONS + ROWS + COLUMNS, "<f2")
    scale = np.ones(1, "<f4")
    change(halves, scale)
    planes = halves.view(np.uint8).reshape(-1, 2).T.tobytes()
    return sealed(b"\0\0\1\1" + sealed_file.deflated(planes + scale.tobytes()))


def nothing(halves, scale):
    pass


def a_value(value):
    return lambda halves, scale: halves.__setitem__(5, value)


def a_scale(value):
    return lambda halves, scale: scale.__setitem__(0, value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        *((a_value(value), "values from 0 to 1") for value in (np.nan, np.inf, -0.5, 1.01)),
        *((a_scale(value), "scales from 0 to") for value in (np.nan, np.inf, -1.0, 2e30)),
    ],
)
def test_bad_values_are_refused(change, message):
    assert decode(with_values(nothing)).terms == (1, 1)
    with pytest.raises(FormatError, match=message):
        decode(with_values(change))


@pytest.mark.parametrize("terms", [b"\0\1", b"\1\0", b"\x21\1", b"\1\xff"])
def test_bad_terms_are_refused(terms):
    with pytest.raises(FormatError, match="expected 1 to 32 lobes and terms"):
        decode(sealed(b"\0\0" + terms + sealed_file.deflated(b"")))


def test_other_terms_than_there_are_values():
    _, _, rest = encode(even()).partition(b"even\0\1\1")
    with pytest.raises(FormatError, match="expected a stream of"):
        decode(sealed(b"\0\0\2\1" + rest))


def test_a_file_too_long_is_not_read(tmp_path):
    (tmp_path / "x.fbrdf").write_bytes(encode(even()) + bytes(LONGEST_FILE))
    with pytest.raises(FormatError, match=f"expected at most {LONGEST_FILE} bytes"):
        load(tmp_path / "x.fbrdf")


def test_the_command(capsys, tmp_path):
    path = tmp_path / "x.fbrdf"
    result = run_json(capsys, "factor", "nickel", "-o", path, "--lobes", 3, "--terms", 2)
    assert result["kind"] == "factored"
    assert result["terms"] == [3, 2]
    assert result["bytes_disk"] == path.stat().st_size
    assert result["bytes_memory"] == 4 * (3 * 3 * ELEVATIONS + 6 * ROWS + 6 * COLUMNS)
    info = run_json(capsys, "info", path)
    assert (result["cells_clamped"], result["energy_clamped"]) == (0, 0)  # which a file does not hold
    described = info.keys() - {"input", "materials", "cells_clamped", "energy_clamped"}
    assert {key: result[key] for key in described} == {key: info[key] for key in described}
    assert 0 < info["facts"]["asymmetry"] < 1
    status, out, _ = run(capsys, "factor", "nickel", "-o", path, "--lobes", 1, "--terms", 1)
    assert status == 0
    assert "asymmetry" in out
    compared = run_json(capsys, "compare", "nickel", path, "--spp", 1, "--size", 16)
    assert compared["candidate"].endswith("(factored)")
    assert run(capsys, "render", path, "-o", tmp_path / "x.png", "--spp", 1, "--size", 16)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (("nickel", "-o", "x.smrl"), 2, "expected a name that ends in .fbrdf, found '.smrl'"),
        (("nickel", "-o", "x.fbrdf", "--lobes", "0"), 2, "--lobes: expected 1 to 32, found 0"),
        (("nickel", "-o", "x.fbrdf", "--terms", "99"), 2, "--terms: expected 1 to 32, found 99"),
        (("nickle", "-o", "x.fbrdf"), 1, "did you mean nickel?"),
        (("nickel", "-o", "x.fbrdf/x.fbrdf"), 1, "x.fbrdf: expected a folder, found something else"),
        (("x.fbrdf", "-o", "x.fbrdf"), 2, "expected an output other than the input"),
    ],
)
def test_bad_arguments(capsys, tmp_path, monkeypatch, arguments, status, message):
    monkeypatch.chdir(tmp_path)
    before = encode(even())
    Path("x.fbrdf").write_bytes(before)
    found, out, err = run(capsys, "factor", *arguments)
    assert (found, out) == (status, "")
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1
    assert Path("x.fbrdf").read_bytes() == before
