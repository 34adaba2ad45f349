import os
import shutil
import subprocess

import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl import BrdfTable, Lattice, TrainOptions, builtin, train
from sommerl.errors import FormatError
from sommerl.formats import shader

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


def tool(name):
    """A program of the system's. Where the tests are the gate (.ci/run), it has to be there."""
    found = shutil.which(name)
    if not found and not os.environ.get("SOMMERL_ALL_TOOLS"):
        pytest.skip(f"needs {name}")
    return found or name


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


def test_in_single_precision_few_pairs_fall_into_the_next_cell(tmp_path):
    brdf = material(Lattice(30, 30, 60), 200, "nearest")
    shader.write(brdf, tmp_path / "x.h")
    far = np.abs(run(tmp_path, "float") - brdf.eval(A, B)).max(axis=1) > 1e-5
    assert far.sum() <= 10


def test_two_headers_in_one_program(tmp_path):
    for name in ("a", "b"):
        shader.write(material(Lattice(9, 7, 11), 60, "nearest"), tmp_path / f"{name}.hpp")
    text = '#include "a.hpp"\n#include "b.hpp"\nint main() {\n'
    text += "return material_a::eval({0, 0, 1}, {0, 0, 1}).x == material_b::eval({0, 0, 1}, {0, 0, 1}).x ? 0 : 1; }\n"
    (tmp_path / "main.cpp").write_text(text)
    subprocess.run([tool("g++"), "-std=c++11", "main.cpp", "-o", "main"], cwd=tmp_path, check=True)
    subprocess.run(tmp_path / "main", check=True)


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


@pytest.mark.parametrize(("lattice", "clusters", "interpolation"), [CASES[0], CASES[2], CASES[4]])
@pytest.mark.parametrize(
    ("extension", "text", "options"), [("glsl", GLSL, ()), ("hlsl", HLSL, ("-D", "-S", "frag", "-e", "main"))]
)
def test_shaders_compile(tmp_path, lattice, clusters, interpolation, extension, text, options):
    brdf = material(lattice, clusters, interpolation)
    for name in ("x", "y"):
        shader.write(brdf, tmp_path / f"{name}.{extension}")
    validate(tmp_path, text, *options)
    must_fail(validate, tmp_path, text.replace("material_y", "material_z"), *options)


def test_arrays_can_live_elsewhere(tmp_path):
    shader.write(material(Lattice(9, 7, 11), 60, "nearest"), tmp_path / "x.glsl")
    buffers = """#version 450
#extension GL_GOOGLE_include_directive : enable
layout(std430, binding = 0) readonly buffer Words { uint words[]; };
layout(std430, binding = 1) readonly buffer Palette { float palette[]; };
#define SOMMERL_WORD(i) words[i]
#define SOMMERL_LUT(i) palette[i]
#include "x.glsl"
layout(location = 0) out vec4 color;
void main() { color = vec4(material_x_eval(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0)), 1.0); }
"""
    validate(tmp_path, buffers)


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
