"""The Rust crate of rust/reader gives what Python gives, and refuses what Python refuses."""

import re
import subprocess
from functools import cache

import compact
import numpy as np
import pytest
from headers import ERRORS, GOLDEN, KINDS, ROOT, asked, codes, output, pairs, sharing, written
from helpers import must_fail, tool
from library_files import METRICS
from test_header import check_densities, check_facts, check_samples, check_values
from test_header_refusals import FILES, check_reads_flat, check_refuses_like_python, small

import sommerl
from sommerl.compression.smrl import file
from sommerl.system.sealed_file import PREFIX

COUNT = 10_000
A, B = pairs(COUNT)
U = np.random.default_rng(4).random((COUNT, 3))


@cache
def example(name):
    """A program of rust/reader/examples, which notices overflows."""
    build = [
        tool("cargo"),
        "build",
        "--quiet",
        "--locked",
        "--profile",
        "test",
        "--package",
        "sommerl",
        "--example",
        name,
    ]
    done = subprocess.run(build, cwd=ROOT / "rust", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ROOT / "rust" / "target" / "debug" / "examples" / name


def facts(path, name=""):
    return output(example("probe"), "facts", path, name).decode().splitlines()


@pytest.mark.parametrize("kind", KINDS)
def test_values_samples_densities_and_facts_are_those_of_python(kind, tmp_path):
    path = written(KINDS[kind](), tmp_path)
    brdf = sommerl.load(path)
    found, drawn, densities = (
        asked(example("probe"), path, "double", call, A, other)
        for call, other in (("eval", B), ("sample", U), ("pdf", B))
    )
    check_values(brdf, found[:, :3], A, B, "double")
    must_fail(check_values, brdf, found[:, :3] * [1, 1.01, 1], A, B, "double")
    check_samples(brdf, drawn, A, U, "double")
    must_fail(check_samples, brdf, drawn * [1, 1, 1, 1, 1, 1, 1.01, 1], A, U, "double")
    check_densities(brdf, densities[:, 6], A, B, "double")
    must_fail(check_densities, brdf, densities[:, 6] * 1.1, A, B, "double")
    check_facts(brdf, facts(path))


@pytest.mark.parametrize("path", [path for path in FILES if path.suffix != ".smrlib"], ids=lambda path: path.name)
def test_golden_materials(path):
    found = asked(example("probe"), path, "double", "eval", A, B)[:, :3]
    check_values(sommerl.load(path), found, A, B, "double")
    must_fail(check_values, sommerl.load(path), found[::-1], A, B, "double")


def test_materials_of_libraries(tmp_path):
    data, materials = sharing()
    path = tmp_path / "x.smrlib"
    path.write_bytes(data)
    for name in materials:
        brdf = sommerl.load(f"{path}:{name}")
        found = asked(example("probe"), path, "double", "eval", A, B, name)[:, :3]
        check_values(brdf, found, A, B, "double")
        check_facts(brdf, facts(path, name), of_notes=False)
    printed = output(example("probe"), "facts", path, "no such", status=1)
    assert printed == b"expected a material of that name in the library, found none\n"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_golden_files_that_are_cut_off_or_changed(path):
    data = path.read_bytes()
    damaged = [*compact.broken(data)[:: 5 if path.suffix == ".smrlib" else 1], data + b"\0"]
    assert set(codes(example("probe"), damaged)) <= set(ERRORS) - {"none", "not_loaded", "file", "memory", "missing"}
    assert codes(example("probe"), [data]) == ["none"]


@pytest.mark.parametrize("kind", ["cells", "factored", "both", "neither"])
def test_broken_files_with_a_checksum_that_fits(kind):
    data, read, seal = small(kind)
    files = [seal(each) for each in compact.broken(data[PREFIX.size :])]
    check_refuses_like_python(codes(example("probe"), files), files, read)
    must_fail(check_refuses_like_python, ["none"] * len(files), files, read)


def test_long_names_of_metrics():
    assert codes(example("probe"), METRICS) == ["none", "notes"] * 2


def test_version_1():
    data = compact.in_version_1(compact.material((2, 1, 3, 3, "walk"), 4))
    files = [compact.sealed(each, 1) for each in compact.broken(data[PREFIX.size :])]
    check_refuses_like_python(codes(example("probe"), files), files, file.decode)


def test_the_example():
    path = GOLDEN / "nodes-2-both.smrl"
    printed = output(example("albedo"), path).decode()
    brdf = sommerl.load(path)
    (numbers,) = re.findall(r"f_r = \[(.*)\] 1/sr", printed)
    assert np.allclose(np.float64(numbers.split(",")), brdf.eval([0, 0, 1], [0.6, 0, 0.8]))
    albedo = float(re.findall(r"albedo = (\S+)", printed)[0])
    assert abs(albedo / brdf.albedo(np.arccos(0.8)).mean() - 1) < 0.1
    shown = re.findall(r"```no_run\n(.*?)```", (ROOT / "rust" / "reader" / "README.md").read_text(), re.DOTALL)
    assert shown[0].replace("// ", "//! ", 1) == (ROOT / "rust" / "reader" / "examples" / "albedo.rs").read_text()


def test_columns_below_the_horizon():
    check_reads_flat(example("probe"))
