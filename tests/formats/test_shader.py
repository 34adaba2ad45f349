import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from helpers import compact_material, must_fail, tool
from shader_programs import CASES, COMPACT, FOLDED, STRICT, A, B, compact, folded, material, run, validate

from sommerl import BrdfTable, Lattice, SomManBrdf, builtin
from sommerl.compression.palette import GainsAndShapes
from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import CPP, GLSL, HLSL, MSL, WGSL
from sommerl.system.errors import FormatError


def check_like_python(brdf, found):
    assert np.allclose(found, brdf.eval(A, B), rtol=1e-5, atol=1e-12)


def in_header(tmp_path, brdf, real):
    """f_r that the C++ header of a material gives for A and B. real: its type of numbers."""
    shader.write(brdf, tmp_path / "x.h")
    return run(tmp_path, real)


@pytest.mark.parametrize(("lattice", "clusters", "interpolation"), CASES)
def test_the_header_gives_what_python_gives(tmp_path, lattice, clusters, interpolation):
    brdf = material(lattice, clusters, interpolation)
    found = in_header(tmp_path, brdf, "double")
    check_like_python(brdf, found)
    if clusters > 1:
        must_fail(
            check_like_python, brdf.with_interpolation({"nearest": "trilinear"}.get(interpolation, "nearest")), found
        )


@pytest.mark.parametrize("case", COMPACT)
def test_compact_materials_are_the_same_in_the_header(tmp_path, case):
    brdf = compact(case)
    found = in_header(tmp_path, brdf, "double")
    check_like_python(brdf, found)
    broken = SomManBrdf(GainsAndShapes(1.001 * brdf.palette.gains, brdf.lut, 0.04), brdf.index, brdf.lattice, name="x")
    must_fail(check_like_python, broken, found)


def check_same_bits(one, other):
    assert np.array_equal(one, other)


@pytest.mark.parametrize("case", FOLDED)
def test_folded_materials_are_the_same_in_the_header(tmp_path, case):
    brdf, (lattice, signed) = folded(case), FOLDED[case]
    shader.write(brdf, tmp_path / "x.h")
    found = run(tmp_path, "double")
    check_like_python(brdf, found)
    assert (found < 0).any() == signed
    for broken in (
        replace(lattice, reciprocal=not lattice.reciprocal),
        replace(lattice, mirrored=not lattice.mirrored, phi_d=((0,),) * 3),
    ):
        index = brdf.index[:, : broken.size]
        other = SomManBrdf(brdf.palette, index, broken, name="x")
        must_fail(check_like_python, other, found)
    mirror = [1, -1, 1]
    images = ((B, A), lattice.reciprocal), ((A * mirror, B * mirror), lattice.mirrored)
    for (a, b), same in images:
        image = run(tmp_path, "double", a=a, b=b)
        if same:
            check_same_bits(image, found)
        else:
            must_fail(check_same_bits, image, found)


def check_like_python_in_single_precision(brdf, found):
    expected = brdf.eval(A, B)
    away = np.abs(found - expected) - 1e-9  # where the blend is about 0, little is left of its digits
    assert (away <= 1e-3 * expected).all(axis=-1).mean() > 0.999
    assert (away <= 1e-4 * expected).all(axis=-1).mean() > 0.95


@pytest.mark.parametrize("case", COMPACT)
def test_compact_materials_in_single_precision(tmp_path, case):
    brdf = compact(case)
    found = in_header(tmp_path, brdf, "float")
    check_like_python_in_single_precision(brdf, found)
    must_fail(check_like_python_in_single_precision, brdf, found * 1.0002)


@pytest.mark.parametrize("case", FOLDED)
def test_folded_materials_in_single_precision(tmp_path, case):
    brdf = folded(case)
    shader.write(brdf, tmp_path / "x.h")
    found = run(tmp_path, "float")
    check_folded_in_single_precision(brdf, found)
    must_fail(check_folded_in_single_precision, brdf, -found if brdf.palette.signed else found * 1.01)


def check_folded_in_single_precision(brdf, found):
    """Differences of large numbers, whose cubes have few digits."""
    expected = brdf.eval(A, B)
    away = np.abs(found - expected) - 1e-6 * np.abs(expected).max()
    assert (away <= 1e-3 * np.abs(expected)).all(axis=-1).mean() > 0.999


def check_small(path, brdf):
    """Functions, palette, lattice and sampler, and half a word of 13 letters a node."""
    assert path.stat().st_size < 70_000 + 6.5 * brdf.lattice.size


def test_a_compact_material_is_small(tmp_path):
    for entries in (256, 257):  # two nodes a word, or one
        brdf = compact_material(COMPACT["big"][0], entries, entries)
        shader.write(brdf, tmp_path / f"{entries}.glsl")
    check_small(tmp_path / "256.glsl", brdf)
    must_fail(check_small, tmp_path / "257.glsl", brdf)


def test_in_single_precision_few_pairs_fall_into_the_next_cell(tmp_path):
    brdf = material(Lattice(30, 30, 60), 200, "nearest")
    shader.write(brdf, tmp_path / "x.h")
    far = np.abs(run(tmp_path, "float") - brdf.eval(A, B)).max(axis=1) > 1e-5
    assert far.sum() <= 10


PROGRAM = """
#include "a.hpp"
#include "b.hpp"
#include "c.hpp"
#include <cstdio>
int main() {
    const sommerl_real3 n{0, 0, 1};  // one type for all three
    std::printf("%.17g %.17g %.17g", material_a_eval(n, n).x, material_b_eval(n, n).x, material_c_eval(n, n).x);
}
"""


def check_values_along_the_normal(text, brdfs):
    expected = [brdf.eval([0, 0, 1], [0, 0, 1])[0] for brdf in brdfs]
    assert np.allclose(list(map(float, text.split())), expected, rtol=1e-5)


def test_headers_of_both_kinds_in_one_program(tmp_path):
    brdfs = [compact("several bands"), material(Lattice(9, 7, 11), 60, "nearest"), compact("one node in phi_d")]
    for name, brdf in zip("abc", brdfs, strict=True):
        shader.write(brdf, tmp_path / f"{name}.hpp")
    (tmp_path / "main.cpp").write_text(PROGRAM)
    subprocess.run([tool("g++"), *STRICT, "-o", "main", "main.cpp"], cwd=tmp_path, check=True)
    found = subprocess.run(tmp_path / "main", check=True, capture_output=True, text=True).stdout
    check_values_along_the_normal(found, brdfs)
    must_fail(check_values_along_the_normal, found, brdfs[::-1])


GLSL_PROGRAM = """#version 450
#include "x.glsl"
#include "y.glsl"
layout(location = 0) in vec3 wo;
layout(location = 1) in vec3 u;
layout(location = 0) out vec4 color;
void main() {
    float pdf;
    vec3 wi = material_x_sample(wo, u, pdf);
    color = vec4(material_x_eval(wi, wo) + material_y_eval(wi, wo), pdf + material_y_pdf(wi, wo));
}
"""
HLSL_PROGRAM = """#include "x.hlsl"
#include "y.hlsl"
float4 main(float3 wo : A, float3 u : B) : SV_Target {
    float pdf;
    float3 wi = material_x_sample(wo, u, pdf);
    return float4(material_x_eval(wi, wo) + material_y_eval(wi, wo), pdf + material_y_pdf(wi, wo));
}
"""


SHADERS = pytest.mark.parametrize(
    ("extension", "text", "options"),
    [("glsl", GLSL_PROGRAM, ("-V",)), ("hlsl", HLSL_PROGRAM, ("-V", "-D", "-S", "frag", "-e", "main"))],
)


def check_shaders_compile(folder, x, y, extension, text, options):
    """Two materials in one program."""
    for name, brdf in (("x", x), ("y", y)):
        shader.write(brdf, folder / f"{name}.{extension}")
    validate(folder, text, *options)
    must_fail(validate, folder, text.replace("material_y", "material_z"), *options)


@pytest.mark.parametrize(("lattice", "clusters", "interpolation"), [CASES[0], CASES[2], CASES[4]])
@SHADERS
def test_shaders_compile(tmp_path, lattice, clusters, interpolation, extension, text, options):
    brdf = material(lattice, clusters, interpolation)
    check_shaders_compile(tmp_path, brdf, brdf, extension, text, options)


@pytest.mark.parametrize("case", ["big", "one node in phi_d"])
@SHADERS
def test_shaders_of_compact_materials_compile(tmp_path, case, extension, text, options):
    check_shaders_compile(tmp_path, compact(case), compact("several bands"), extension, text, options)
    check_shaders_compile(tmp_path, compact(case), material(*CASES[3]), extension, text, options)


@pytest.mark.parametrize("case", FOLDED)
@SHADERS
def test_shaders_of_folded_materials_compile(tmp_path, case, extension, text, options):
    check_shaders_compile(tmp_path, folded(case), compact("several bands"), extension, text, options)


WEBGL = re.sub(r"layout\(.*\) ", "", GLSL_PROGRAM).replace("450", "300 es").replace("vec", "highp vec")
WEBGL = WEBGL.replace("float pdf", "highp float pdf").replace("= highp", "=").replace("highp vec4(", "vec4(")


def test_shaders_compile_for_web_pages(tmp_path):
    x, y = compact("one node in phi_d"), material(*CASES[3])
    check_shaders_compile(tmp_path, x, y, "glsl", WEBGL, ())


BUFFERS = """#version 450
layout(std430, binding = 0) readonly buffer Words { uint words[]; };
layout(std430, binding = 1) readonly buffer Palette { float palette[]; };
layout(std430, binding = 2) readonly buffer Gains { float gains[]; };
layout(std430, binding = 3) readonly buffer Nodes { uint nodes[]; };
layout(std430, binding = 4) readonly buffer Sampler { uint cells[]; };
#define material_x_WORD(i) words[i]
#define material_x_LUT(i) palette[i]
#define material_x_GAIN(i) gains[i]
#define material_x_LATTICE(i) nodes[i]
#define material_x_SAMPLER(i) cells[i]
#include "x.glsl"
layout(location = 0) out vec4 color;
void main() {
    vec3 n = vec3(0.0, 0.0, 1.0);
    color = vec4(material_x_eval(n, n), material_x_pdf(n, n));
}
"""


@pytest.mark.parametrize("made", [lambda: material(*CASES[3]), lambda: compact("several bands")])
def test_arrays_can_live_elsewhere(tmp_path, made):
    shader.write(made(), tmp_path / "x.glsl")
    validate(tmp_path, BUFFERS, "-V")
    must_fail(validate, tmp_path, BUFFERS.replace("uint words[]", "float words[]"), "-V")


LANGUAGES = (CPP, GLSL, HLSL, MSL, WGSL)


def check_is_filled_in(text):
    assert not re.findall("@[A-Za-z_]*@?", text)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    "made",
    [
        lambda: material(*CASES[0]),
        lambda: material(*CASES[4]),
        lambda: compact("big"),
        lambda: folded("both, signed"),
    ],
)
def test_nothing_is_left_of_the_templates_marks(made, language, monkeypatch):
    brdf = made()
    check_is_filled_in(shader.source(brdf, language, "x"))
    monkeypatch.setattr(shader, "OF_SAMPLER", shader.OF_SAMPLER[1:])
    must_fail(check_is_filled_in, shader.source(brdf, language, "x"))


def test_a_name_cannot_break_out_of_its_comment(tmp_path):
    brdf = material(Lattice(9, 7, 11), 60, "nearest")
    brdf.name = "evil\\\nint main() { @NAME@ }"
    text = shader.source(brdf, CPP, "x")
    assert "// evil int main() { @NAME@ }\n" in text.replace("  ", " ")


def test_names():
    names = ["nickel", "my nickel", "2-nickel__x", "é", "银", "_"]
    found = [shader.identifier(name) for name in names]
    assert found[:3] == ["material_nickel", "material_my_nickel", "material_2_nickel_x"]
    assert len(set(found)) == len(names)
    assert not any("__" in name for name in found)


def test_a_table_is_refused(tmp_path):
    with pytest.raises(FormatError, match="expected a compressed material"):
        shader.write(BrdfTable.sampled(builtin("nickel"), Lattice(9, 7, 11)), tmp_path / "x.h")
    assert not list(tmp_path.iterdir())
