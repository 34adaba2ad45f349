"""include/sommerl.hpp gives what Python gives, for every kind of file."""

import json
import re

import numpy as np
import pytest
from headers import CHECKED, GOLDEN, HERE, KINDS, ROOT, asked, compiled, output, pairs, probe, sharing, written
from helpers import must_fail

import sommerl
from sommerl.compression.smrl.library_file import LibraryFile
from sommerl.factored.material import FactoredBrdf

COUNT = 10_000
A, B = pairs(COUNT)
U = np.random.default_rng(4).random((COUNT, 3))
FILES = ["golden", "cells", "nodes", "factored"]


def epsilon(real):
    return float(np.finfo({"float": np.float32, "double": np.float64}[real]).eps)


def check_values(brdf, found, a, b, real):
    """Rounding may move a pair at the edge of a cell into the next one; few are so near in double precision."""
    if isinstance(brdf, FactoredBrdf):  # where the half vector is the normal, its azimuth is noise
        azimuth = np.hypot(*(a + b)[:, :2].T) > 1e-3
        a, b, found = a[azimuth], b[azimuth], found[azimuth]
    expected = brdf.eval(a, b)
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    assert ((found == 0) == (expected == 0)).mean() > 0.999
    size = np.abs(expected).max(axis=1, keepdims=True)
    near = np.abs(found - expected) <= allowed(a, b, real) * size
    assert near.all(axis=1).mean() > (0.98 if real == "float" else 0.999)


def allowed(a, b, real):
    """What rounding may change, in parts of a value: more next to the horizon, whose cosines are divided by."""
    lowest = np.minimum(np.abs(a[:, 2]), np.abs(b[:, 2]))[:, None]
    return 4096 * epsilon(real) * (1 + 0.01 / np.maximum(lowest, 1e-6))


@pytest.fixture(params=KINDS)
def kind(request, tmp_path):
    brdf = KINDS[request.param]()
    path = written(brdf, tmp_path)
    return sommerl.load(path), path


@pytest.mark.parametrize("real", ["float", "double"])
def test_values_are_those_of_python(kind, real):
    brdf, path = kind
    a, b = (np.float32(w).astype(np.float64) for w in (A, B))  # which single precision holds
    found = asked(probe(), path, real, "eval", a, b)[:, :3]
    check_values(brdf, found, a, b, real)
    must_fail(check_values, brdf, found * [1, 1.01, 1], a, b, real)


def check_samples(brdf, found, a, u, real):
    """Cells whose probabilities are equal but for rounding may have one unit more or less of 40,960, and another place
    in the alias table; see tests/formats/test_shader_sampling.py for what single precision does."""
    wi, pdf, weight = brdf.sample(a, u)
    assert ((found[:, 6] > 0) == (pdf > 0)).mean() > 0.999
    same = np.abs(found[:, 3:6] - wi).max(axis=1) <= 64 * epsilon(real)
    same &= np.abs(found[:, 6] - pdf) <= 1024 * epsilon(real) * pdf
    assert same.mean() > 0.99
    size = np.abs(weight).max(axis=1)
    close = np.abs(found[:, :3] - weight).max(axis=1) <= 1e-3 * size
    assert close[same].mean() > (0.95 if real == "float" else 0.999)


def check_densities(brdf, found, a, b, real):
    pdf = brdf.pdf(a, b)
    assert ((found == 0) == (pdf == 0)).mean() > 0.999
    assert (np.abs(found - pdf) <= 64 * epsilon(real) * pdf).mean() > 0.99
    assert (np.abs(found - pdf) <= 0.05 * pdf).mean() > 0.999


@pytest.mark.parametrize("real", ["float", "double"])
def test_samples_and_densities_are_those_of_python(kind, real):
    brdf, path = kind
    a, b, u = (np.float32(w).astype(np.float64) for w in (A, B, U))
    drawn = asked(probe(), path, real, "sample", a, u)
    check_samples(brdf, drawn, a, u, real)
    must_fail(check_samples, brdf, drawn * [1, 1, 1, 1, 1, 1, 1.01, 1], a, u, real)
    densities = asked(probe(), path, real, "pdf", a, b)[:, 6]
    check_densities(brdf, densities, a, b, real)
    must_fail(check_densities, brdf, densities * 1.1, a, b, real)


@pytest.mark.parametrize("name", [*sorted(path.name for path in GOLDEN.glob("*.smrl")), "factored.fbrdf"])
def test_golden_files(name):
    brdf = sommerl.load(GOLDEN / name)
    found = asked(probe(), GOLDEN / name, "double", "eval", A, B)[:, :3]
    check_values(brdf, found, A, B, "double")
    other = sommerl.load(GOLDEN / ("cells.smrl" if name != "cells.smrl" else "nodes.smrl"))
    must_fail(check_values, other, found, A, B, "double")


def test_materials_of_libraries(tmp_path):
    data, materials = sharing()
    (tmp_path / "x.smrlib").write_bytes(data)
    for path, names in ((tmp_path / "x.smrlib", materials), (GOLDEN / "library-1.smrlib", None)):
        library = LibraryFile(lambda start, count, path=path: path.read_bytes()[start : start + count])
        for name in names or library.index.names():
            brdf = sommerl.load(f"{path}:{name}")
            found = asked(probe(), path, "double", "eval", A, B, name)[:, :3]
            check_values(brdf, found, A, B, "double")
            check_facts(brdf, facts(path, name), of_notes=names is None)
    other = sommerl.load(GOLDEN / "nodes.smrl")
    must_fail(check_values, other, found, A, B, "double")


def facts(path, name=""):
    return output(probe(), "facts", path, name).decode().splitlines()


def check_facts(brdf, found, of_notes=True):
    name, digest, notes, kind, *flags = found
    assert name == brdf.name
    assert digest == brdf.source.sha256
    if of_notes:
        said = json.loads(notes or "{}")
        assert said.get("options", {}) == getattr(brdf, "options", {})
        assert said.get("metrics", {}) == getattr(brdf, "metrics", {})
    assert int(kind) == (2 if isinstance(brdf, FactoredBrdf) else 0 if brdf.grid else 1)
    expected = brdf.reciprocal, brdf.mirrored, brdf.signed, brdf.lookup != "nearest"
    assert tuple(flag == "1" for flag in flags) == expected


def test_facts(kind):
    brdf, path = kind
    check_facts(brdf, facts(path))
    must_fail(check_facts, brdf, ["another", *facts(path)[1:]])


def test_vectors_that_are_not_directions():
    """The rules of docs/conventions.md."""
    values = np.array([-1, -1e-9, 0, 1e-9, 0.6, 1e20, np.inf, np.nan])
    a, b = np.split(np.stack(np.meshgrid(*[values] * 6), -1).reshape(-1, 6)[::7], 2, axis=1)
    for name in ("cells.smrl", "nodes-2-both.smrl", "nodes-2-neither.smrl", "factored.fbrdf"):
        for real in ("float", "double"):
            path = GOLDEN / name
            f_r, density = (asked(probe(), path, real, call, a, b) for call in ("eval", "pdf"))
            check_vectors(f_r[:, :3], a, b)
            check_vectors(density[:, 6:7], a, b)
            must_fail(check_vectors, f_r[:, :3] * [1, np.nan, 1], a, b)
            drawn = asked(probe(), path, real, "sample", a, np.abs(b))
            known = np.isfinite(a).all(axis=1) & (np.abs(b) <= 1).all(axis=1)
            assert np.array_equal(np.isnan(drawn[:, :7]).all(axis=1), ~known)
            assert np.isfinite(drawn[known]).all()


def check_vectors(found, a, b):
    known = np.isfinite(np.concatenate([a, b], axis=1)).all(axis=1)
    assert np.isnan(found[~known]).all()
    assert np.isfinite(found[known]).all()
    below = known & ((a[:, 2] <= 0) | (b[:, 2] <= 0))
    assert (found[below] == 0).all()


def test_fused_multiply_add_and_no_exceptions_change_nothing(tmp_path):
    """Files are decoded by arithmetic that has to be exact, also where the processor can do otherwise."""
    fast = probe("-O3", "-march=native", "-fno-exceptions")
    for name in sorted(path.name for path in GOLDEN.glob("*.smrl")):
        found = asked(fast, GOLDEN / name, "double", "eval", A, B)[:, :3]
        check_values(sommerl.load(GOLDEN / name), found, A, B, "double")
    path = written(KINDS["nodes, large palettes"](), tmp_path)
    found = asked(fast, path, "double", "eval", A, B)[:, :3]
    check_values(sommerl.load(path), found, A, B, "double")
    must_fail(check_values, sommerl.load(GOLDEN / "nodes.smrl"), found, A, B, "double")


# Of the standard library, which does not stand such macros.
STANDARD = "".join(re.findall("#include <.*>\n", (ROOT / "include" / "sommerl.hpp").read_text()))
HOSTILE = "\n".join(
    f"#define {name}"
    for name in (
        "min(a, b) broken",
        "max(a, b) broken",
        "PI 3",
        "real half",
        "near",
        "far",
        "small char",
        "None 0L",
        "Bool int",
    )
)
OWN_VECTOR = """
#include "sommerl.hpp"
struct Own {
    float x, y, z;
    float operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};
int main() {
    const auto brdf = sommerl::BasicBrdf<float, Own>::load("/nowhere");
    Own wi{};
    float pdf = 0;
    const Own f_r = brdf.eval({0, 0, 1}, {0, 0, 1}), weight = brdf.sample({0, 0, 1}, {0, 0, 0}, &wi, &pdf);
    return brdf.error() == sommerl::Error::file && f_r.x + weight.x + pdf + brdf.pdf(wi, wi) == 0 ? 0 : 1;
}
"""


def test_a_vector_type_of_ones_own_after_hostile_macros(tmp_path):
    (tmp_path / "own.cpp").write_text(STANDARD + HOSTILE + OWN_VECTOR)
    output(compiled(tmp_path / "own.cpp", folder=tmp_path))
    (tmp_path / "fast.cpp").write_text('#include "sommerl.hpp"\nint main() {}')
    with pytest.raises(AssertionError, match="without -ffast-math"):
        compiled(tmp_path / "fast.cpp", "-ffast-math", folder=tmp_path)


def test_the_example(tmp_path):
    program = compiled(ROOT / "include" / "example.cpp", *CHECKED, folder=tmp_path)
    printed = output(program, GOLDEN / "nodes-2-both.smrl").decode()
    brdf = sommerl.load(GOLDEN / "nodes-2-both.smrl")
    f_r = brdf.eval([0, 0, 1], [0.6, 0, 0.8])
    (numbers,) = re.findall(r"f_r = (\S+) (\S+) (\S+) 1/sr", printed)
    assert np.allclose(np.float64(numbers), f_r, rtol=1e-4)
    albedo = float(re.findall(r"albedo = (\S+)", printed)[0])
    assert abs(albedo / brdf.albedo(np.arccos(0.8)).mean() - 1) < 0.1
    assert b"expected a file that can be read" in output(program, tmp_path / "none", status=1)


def test_the_page_shows_the_example():
    shown = re.findall(r"```cpp\n(.*?)```", (ROOT / "docs" / "cpp.md").read_text(), re.DOTALL)
    assert shown[0] == (ROOT / "include" / "example.cpp").read_text()


def test_it_is_fuzzed_by_what_compiles():
    compiled(HERE / "fuzz.cpp", "-fsyntax-only")
