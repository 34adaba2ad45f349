"""Source code collides with nothing: its names, a program's macros, warnings, and what it leaves behind."""

import re
import subprocess

import pytest
from helpers import must_fail, tool
from shader_programs import CASES, COMPACT, FOLDED, HOSTILE, STRICT, compact, folded, material, validate, validate_wgsl

from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import CPP, GLSL, HLSL, MSL, WGSL

LANGUAGES = pytest.mark.parametrize("language", [CPP, GLSL, HLSL, MSL, WGSL], ids=lambda one: one.name)
MADE = {
    "nearest": lambda: material(*CASES[5]),
    "trilinear": lambda: material(*CASES[3]),
    "nodes": lambda: compact("several bands"),
    "folded": lambda: folded("both, signed"),
}
KINDS = pytest.mark.parametrize("kind", MADE)

# The words of each language itself, which no program can define anew, and the functions of its library.
ALL = "if for return const bool"
OWN = {
    "C++": "static inline typedef struct double std uint32_t cmath cstdint fabs sqrt floor atan2 pragma once include",
    "GLSL": "highp out uint float vec3 atan sqrt floor abs",
    "HLSL": "static out uint float float3 atan2 sqrt floor abs",
    "MSL": "static inline constant thread uint float float3 metal metal_stdlib atan2 sqrt floor abs pragma once "
    "include",
    "WGSL": "fn var array ptr function select u32 f32 vec3f atan2 sqrt floor abs i",
}
DIRECTIVES = "define ifndef endif"


def check_words(text, language):
    """Every word is the language's, or begins with the material's name or ours, or ends with an underscore. That of a
    macro's only parameter is i."""
    code = re.sub(r"//.*|#define \w+\(i\) \w+\[i\]", "", text)
    words = set(re.findall(r"(?<![\w.])[A-Za-z_]\w*", code)) - set(f"{ALL} {OWN[language.name]} {DIRECTIVES}".split())
    others = {word for word in words if not re.match(r"(material_x_|sommerl_|SOMMERL_)\w+$|[a-z]\w*_$", word)}
    assert others <= {"x", "y", "z"}  # the components of vectors


@LANGUAGES
@KINDS
def test_every_word_is_the_languages_or_ours(kind, language):
    text = shader.source(MADE[kind](), language, "material_x")
    check_words(text, language)
    must_fail(check_words, text.replace("wi_", "wi"), language)


def check_takes_back_nothing(text):
    assert "#undef" not in text


@LANGUAGES
@KINDS
def test_no_macro_is_taken_back(kind, language):
    text = shader.source(MADE[kind](), language, "material_x")
    check_takes_back_nothing(text)
    must_fail(check_takes_back_nothing, text + "#undef real\n")


CPP_PROGRAM = """
HOSTILE
#include <cmath>
#include <cstdint>
#define uint unsigned char  // which the system's own headers would not stand
#include "x.h"
#include "y.h"
sommerl_real3 both(sommerl_real3 a, sommerl_real3 b);
sommerl_real3 both(sommerl_real3 a, sommerl_real3 b) {
    sommerl_real density;
    const sommerl_real3 c = material_x_sample(a, b, density), d = material_y_eval(c, b);
    return sommerl_real3(d.x, material_y_pdf(c, b), density);
}
"""


def compile_cpp(folder, compiler, real):
    (folder / "main.cpp").write_text(CPP_PROGRAM.replace("HOSTILE", HOSTILE))
    options = [*STRICT, "-Wshadow", f"-DSOMMERL_REAL={real}", "-fsyntax-only"]
    done = subprocess.run([tool(compiler), *options, "main.cpp"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("real", ["float", "double"])
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@KINDS
def test_the_header_stands_hostile_macros_and_all_warnings(tmp_path, kind, compiler, real):
    shader.write(MADE[kind](), tmp_path / "x.h")
    shader.write(compact("one node in phi_d"), tmp_path / "y.h")
    compile_cpp(tmp_path, compiler, real)
    text = (tmp_path / "x.h").read_text()
    for right, wrong in (("wi_", "wi"), ("sommerl_uint ", "uint "), ("return sommerl_uint(", "return (")):
        assert right in text
        (tmp_path / "x.h").write_text(text.replace(right, wrong))
        must_fail(compile_cpp, tmp_path, compiler, real)


SHADERS = {
    "glsl": (
        """#version 450
HOSTILE
INCLUDED
layout(location = 0) in vec3 o;
layout(location = 0) out vec4 color;
void main() {
    float density;
    vec3 i = material_x_sample(o, o, density);
    color = vec4(material_x_eval(i, o), material_x_pdf(i, o) + density);
}
""",
        ("-V",),
    ),
    "es.glsl": (  # no precision of its own
        """#version 300 es
HOSTILE
INCLUDED
in highp vec3 o;
out highp vec4 color;
void main() {
    highp float density;
    highp vec3 i = material_x_sample(o, o, density);
    color = vec4(material_x_eval(i, o), material_x_pdf(i, o) + density);
}
""",
        (),
    ),
    "hlsl": (
        """HOSTILE
INCLUDED
float4 main(float3 o : A) : SV_Target {
    float density;
    float3 i = material_x_sample(o, o, density);
    return float4(material_x_eval(i, o), material_x_pdf(i, o) + density);
}
""",
        ("-V", "-D", "-S", "frag", "-e", "main"),
    ),
}


def check_shader(folder, text, extension):
    program, options = SHADERS[extension]
    validate(folder, program.replace("HOSTILE", HOSTILE).replace("INCLUDED", text), *options)


@pytest.mark.parametrize("extension", SHADERS)
@KINDS
def test_shaders_stand_hostile_macros(tmp_path, kind, extension):
    text = shader.source(MADE[kind](), HLSL if extension == "hlsl" else GLSL, "material_x")
    check_shader(tmp_path, text, extension)
    broken = [text.replace("material_x_max(", "max("), text.replace(" wi_", " wi")]
    if extension == "es.glsl":
        broken.append(text.replace("highp float ", "float "))
    for each in broken:
        must_fail(check_shader, tmp_path, each, extension)


def check_wgsl(folder, text):
    (folder / "x.wgsl").write_text(text)
    validate_wgsl(folder / "x.wgsl")


@pytest.mark.parametrize("case", [*MADE, *FOLDED, *COMPACT])
def test_naga_takes_the_wgsl(tmp_path, case):
    made = MADE[case]() if case in MADE else folded(case) if case in FOLDED else compact(case)
    text = shader.source(made, WGSL, "material_x")
    check_wgsl(tmp_path, text)
    must_fail(check_wgsl, tmp_path, text.replace("&t_", "t_"))
    must_fail(check_wgsl, tmp_path, text.replace("f32(", "u32("))


def test_naga_takes_the_wgsl_of_several(tmp_path):
    text = shader.atlas_source([compact("several bands"), *map(folded, FOLDED)], WGSL, "material_x")
    check_wgsl(tmp_path, text)
    must_fail(check_wgsl, tmp_path, text.replace("which_: u32", "which_: f32"))
