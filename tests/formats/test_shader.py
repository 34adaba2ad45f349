import re
import subprocess

import numpy as np
import pytest
from helpers import compact_material, must_fail, random_directions, tool

from sommerl import BrdfTable, Lattice, SomManBrdf, TrainOptions, builtin, train
from sommerl.errors import FormatError
from sommerl.formats import shader
from sommerl.nodes import FINE, NodeLattice

A, B = random_directions(10_000, 1), random_directions(10_000, 2)
A[:5], B[:5] = A[:5] * [1, 1, -1], B[:5]  # below the horizon
A[5], B[5:7], A[6] = [0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0, 1]  # mirror directions
MAIN = """
#include "x.h"
#include <cstdio>
typedef SOMMERL_REAL real;
int main() {
    double a[6];
    while (std::fread(a, sizeof(double), 6, stdin) == 6) {
        const material_x::real3 wi{real(a[0]), real(a[1]), real(a[2])}, wo{real(a[3]), real(a[4]), real(a[5])};
        const material_x::real3 f = material_x::eval(wi, wo);
        const double out[3] = {double(f.x), double(f.y), double(f.z)};
        std::fwrite(out, sizeof(double), 3, stdout);
    }
}
"""


def material(lattice, clusters, interpolation):
    table = BrdfTable.sample(builtin("purple-paint"), lattice)
    return train(table, TrainOptions(clusters=clusters, epochs=2))[0].with_interpolation(interpolation)


CASES = [
    (Lattice(30, 30, 60), 200, "nearest"),
    (Lattice(30, 30, 60), 300, "nearest"),  # two bytes an index
    (Lattice(30, 30, 60), 300, "trilinear"),
    (Lattice(9, 7, 11), 60, "trilinear"),  # a number of cells that does not fill the last word
    (Lattice(12, 10, 30, reciprocal=False), 60, "trilinear"),
    (Lattice(12, 10, 30, reciprocal=False), 60, "nearest"),
    (Lattice(1, 1, 1), 1, "trilinear"),
]

BANDS = [tuple(sorted({0, FINE, *range(b + 1, FINE, 7 * b + 9)})) for b in range(3)]
ROWS = tuple(range(0, FINE + 1, 4))
COMPACT = {
    "several bands": (
        NodeLattice((0, 1, 5, 88, 92, 120, 180), (0, 0, 1, 1, 2, 2, 2), tuple(BANDS), tuple(b[:-1] for b in BANDS)),
        (20, 15),
    ),
    "one node in phi_d": (NodeLattice((0, 40, 90, 180), (0,) * 4, ((0, 60, 180),), ((0,),)), (7, 5)),
    "one gain and one shape": (NodeLattice((0, 180), (0, 1), ((0, 180),) * 2, ((0,), (0, 90, 179))), (1, 1)),
    "finest": (NodeLattice((0, 180), (0, 0), (tuple(range(FINE + 1)),), (tuple(range(FINE)),)), (300, 300)),
    "big": (NodeLattice(ROWS, (0,) * 20 + (1,) * 26, (BANDS[0], ROWS), (ROWS[:-1], BANDS[2][:-1])), (256, 256)),
}


def compact(case):
    lattice, palette = COMPACT[case]
    return compact_material(lattice, *palette)


def run(folder, real):
    (folder / "main.cpp").write_text(MAIN)
    options = ["-std=c++11", "-Wall", "-Wextra", "-Werror", f"-DSOMMERL_REAL={real}", "-o", "main"]
    subprocess.run([tool("g++"), *options, "main.cpp"], cwd=folder, check=True)
    done = subprocess.run(folder / "main", input=np.concatenate([A, B], 1).tobytes(), capture_output=True, check=True)
    return np.frombuffer(done.stdout).reshape(-1, 3)


def check_like_python(brdf, found):
    assert np.allclose(found, brdf.eval(A, B), rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize(("lattice", "clusters", "interpolation"), CASES)
def test_the_header_gives_what_python_gives(tmp_path, lattice, clusters, interpolation):
    brdf = material(lattice, clusters, interpolation)
    shader.write(brdf, tmp_path / "x.h")
    found = run(tmp_path, "double")
    check_like_python(brdf, found)
    if clusters > 1:
        must_fail(
            check_like_python, brdf.with_interpolation({"nearest": "trilinear"}.get(interpolation, "nearest")), found
        )


@pytest.mark.parametrize("case", COMPACT)
def test_compact_materials_are_the_same_in_the_header(tmp_path, case):
    brdf = compact(case)
    shader.write(brdf, tmp_path / "x.h")
    found = run(tmp_path, "double")
    check_like_python(brdf, found)
    broken = SomManBrdf(
        brdf.lut, brdf.index, brdf.lattice, gains=1.001 * brdf.gains, gain_index=brdf.gain_index, scale=0.04, name="x"
    )
    must_fail(check_like_python, broken, found)


def check_like_python_in_single_precision(brdf, found):
    expected = brdf.eval(A, B)
    away = np.abs(found - expected) - 1e-9  # where the blend is about 0, little is left of its digits
    assert (away <= 1e-3 * expected).all(axis=-1).mean() > 0.999
    assert (away <= 1e-4 * expected).all(axis=-1).mean() > 0.95


@pytest.mark.parametrize("case", COMPACT)
def test_compact_materials_in_single_precision(tmp_path, case):
    brdf = compact(case)
    shader.write(brdf, tmp_path / "x.h")
    found = run(tmp_path, "float")
    check_like_python_in_single_precision(brdf, found)
    must_fail(check_like_python_in_single_precision, brdf, found * 1.0002)


def check_small(path, brdf):
    """Functions, palette and lattice, and half a word of 13 letters a node."""
    assert path.stat().st_size < 45_000 + 6.5 * brdf.lattice.size


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
    std::printf("%.17g %.17g %.17g", material_a::eval({0, 0, 1}, {0, 0, 1}).x, material_b::eval({0, 0, 1}, {0, 0, 1}).x,
        material_c::eval({0, 0, 1}, {0, 0, 1}).x);
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
    options = ["-std=c++11", "-Wall", "-Wextra", "-Werror", "-o", "main"]
    subprocess.run([tool("g++"), *options, "main.cpp"], cwd=tmp_path, check=True)
    found = subprocess.run(tmp_path / "main", check=True, capture_output=True, text=True).stdout
    check_values_along_the_normal(found, brdfs)
    must_fail(check_values_along_the_normal, found, brdfs[::-1])


GLSL = """#version 450
#extension GL_GOOGLE_include_directive : enable
#include "x.glsl"
#include "y.glsl"
layout(location = 0) in vec3 wi;
layout(location = 1) in vec3 wo;
layout(location = 0) out vec4 color;
void main() { color = vec4(material_x_eval(wi, wo) + material_y_eval(wi, wo), 1.0); }
"""
HLSL = """#include "x.hlsl"
#include "y.hlsl"
float4 main(float3 wi : A, float3 wo : B) : SV_Target {
    return float4(material_x_eval(wi, wo) + material_y_eval(wi, wo), 1.0);
}
"""


def validate(folder, text, *options):
    (folder / "main.frag").write_text(text)
    command = [tool("glslangValidator"), "-V", *options, "main.frag", "-o", "out.spv"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


SHADERS = pytest.mark.parametrize(
    ("extension", "text", "options"), [("glsl", GLSL, ()), ("hlsl", HLSL, ("-D", "-S", "frag", "-e", "main"))]
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


BUFFERS = """#version 450
#extension GL_GOOGLE_include_directive : enable
layout(std430, binding = 0) readonly buffer Words { uint words[]; };
layout(std430, binding = 1) readonly buffer Palette { float palette[]; };
layout(std430, binding = 2) readonly buffer Gains { float gains[]; };
layout(std430, binding = 3) readonly buffer Nodes { uint nodes[]; };
#define SOMMERL_WORD(i) words[i]
#define SOMMERL_LUT(i) palette[i]
#define SOMMERL_GAIN(i) gains[i]
#define SOMMERL_LATTICE(i) nodes[i]
#include "x.glsl"
layout(location = 0) out vec4 color;
void main() { color = vec4(material_x_eval(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0)), 1.0); }
"""


@pytest.mark.parametrize("made", [lambda: material(*CASES[3]), lambda: compact("several bands")])
def test_arrays_can_live_elsewhere(tmp_path, made):
    shader.write(made(), tmp_path / "x.glsl")
    validate(tmp_path, BUFFERS)
    must_fail(validate, tmp_path, BUFFERS.replace("uint words[]", "float words[]"))


def check_leaves_no_macro(text):
    defined, undefined = (set(re.findall(rf"#{word} (\w+)", text)) for word in ("define", "undef"))
    assert defined - undefined <= {"SOMMERL_REAL"}


@pytest.mark.parametrize("language", [shader.CPP, shader.GLSL, shader.HLSL])
def test_no_macro_is_left_for_the_next_file(language):
    text = shader.source(compact("several bands"), language, "x")
    check_leaves_no_macro(text)
    must_fail(check_leaves_no_macro, text.replace("#undef SOMMERL_GAIN\n", ""))


def test_a_name_cannot_break_out_of_its_comment(tmp_path):
    brdf = material(Lattice(9, 7, 11), 60, "nearest")
    brdf.name = "evil\\\nint main() { @NAME@ }"
    text = shader.source(brdf, shader.CPP, "x")
    assert "// evil int main() { @NAME@ }\n" in text.replace("  ", " ")


def test_names():
    names = ["nickel", "my nickel", "2-nickel__x", "é", "银", "_"]
    found = [shader.identifier(name) for name in names]
    assert found[:3] == ["material_nickel", "material_my_nickel", "material_2_nickel_x"]
    assert len(set(found)) == len(names)
    assert not any("__" in name for name in found)


def test_a_table_is_refused(tmp_path):
    with pytest.raises(FormatError, match="expected a compressed material"):
        shader.write(BrdfTable.sample(builtin("nickel"), Lattice(9, 7, 11)), tmp_path / "x.h")
    assert not list(tmp_path.iterdir())
