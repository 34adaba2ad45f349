"""GLSL as WGSL: what the page's translator makes of small shaders. Of the page's own, test_webgpu.py sees pictures."""

import pytest
from helpers import must_fail
from in_node import program

ANSWER = """
import { translated } from "./wgsl.js";
async function answer({ source }) {
    try {
        return translated(source);
    } catch (error) {
        return { error: error.message };
    }
}
"""
MAIN = "\nout vec4 colour;\nvoid main() { colour = vec4(%s); }\n"
BRANCHES = """
#if defined(A) || defined(B) && !defined(C)
const int FOUND = 1;
#ifdef C
const int WITH = 1;
#else
const int WITH = 0;
#endif
#elif defined(C)
const int FOUND = 2;
#define A
#else
const int FOUND = 3; // not A
#endif
#ifndef A
const int LEFT = 1;
#endif
"""
# Which of these lines are left for which names.
LEFT = {
    "": {"FOUND": 3, "LEFT": 1},
    "A": {"FOUND": 1, "WITH": 0},
    "B": {"FOUND": 1, "WITH": 0, "LEFT": 1},
    "AC": {"FOUND": 1, "WITH": 1},
    "BC": {"FOUND": 2},
}
# GLSL, and what stands for it.
STATEMENTS = {
    "float x = a < 0.5 ? 1e-3 : -a;": "var x: f32 = select((-a), 1e-3, (a < 0.5));",
    "uint n = 5u, m = n >> 2u & 3u;": "var n: u32 = 5u; var m: u32 = ((n >> 2u) & 3u);",
    "if (!(a > 0.0)) a += 1.0; else return;": "if (!(a > 0.0)) { a += 1.0; } else { return; }",
    "for (int i = 0; i < 3; i++) a = float(i) * uGiven;": (
        "for (var i: i32 = 0; (i < 3); i++) { a = (f32(i) * given.uGiven); }"
    ),
    "float y; both(a, y); a = -y;": "var y: f32;\nboth(a, &y);\na = (-y);",
    "vec2 v = vec2(a).yx; v[1] = v.x - 1.0;": "var v: vec2f = vec2f(a).yx;\nv[1] = (v.x - 1.0);",
}
AROUND = "uniform float uGiven;\nvoid both(float a, inout float b) { a = b; b = a + b; }\nvoid run(float a) { %s }"


@pytest.fixture(scope="module")
def translated(tmp_path_factory):
    run = program(tmp_path_factory.mktemp("js"), ANSWER)
    return lambda *sources: run([({"source": source}, b"") for source in sources])


def check_left(code, left):
    assert [f"const {name}: i32 = {value};" in code for name, value in left.items()] == [True] * len(left)
    assert code.count("const ") == len(left)


def test_branches(translated):
    sources = ["".join(f"#define {name}\n" for name in names) + BRANCHES + MAIN % "1.0" for names in LEFT]
    found = [one["code"] for one in translated(*sources)]
    for code, left in zip(found, LEFT.values(), strict=True):
        check_left(code, left)
    must_fail(check_left, found[0], LEFT["A"])
    must_fail(check_left, found[3], LEFT["A"])


def check_says(code, wanted):
    assert wanted in code


def test_statements(translated):
    found = translated(*(AROUND % glsl + MAIN % "uGiven" for glsl in STATEMENTS))
    for one, wanted in zip(found, STATEMENTS.values(), strict=True):
        check_says(one["code"], wanted)
        check_says(
            one["code"], "fn both(a_: f32, b: ptr<function, f32>) {\nvar a = a_;a = (*b);\n(*b) = (a + (*b));\n}"
        )
        check_says(one["code"], "main();\nreturn colour;")
    must_fail(check_says, found[0]["code"], list(STATEMENTS.values())[1])


def check_places(found, places, size):
    assert ({one["name"]: one["at"] for one in found["places"]}, found["size"]) == (places, size)


def test_uniforms_are_where_wgsl_has_them(translated):
    given = "uniform float a;\nuniform vec3 b;\nuniform int c;\nuniform vec4 d[2]; uniform uint e; uniform ivec2 f;\n"
    textures = "uniform sampler2D one, other;\nuniform usampler2D whole;\n"
    (found,) = translated(given + textures + MAIN % "a")
    places = {"uUpwards": 0, "a": 8, "b": 16, "c": 28, "d": 32, "e": 64, "f": 72}
    check_places(found, places, 80)
    must_fail(check_places, found, {**places, "c": 32}, 80)
    kinds = ["unfilterable-float", "unfilterable-float", "uint"]
    assert [(one["name"], one["sampleType"]) for one in found["textures"]] == list(
        zip(("one", "other", "whole"), kinds, strict=True)
    )
    assert "@binding(3) var whole: texture_2d<u32>;" in found["code"]


@pytest.mark.parametrize("wrong", ["float x = a b;", "float x = (a;", "if a return;"])
def test_what_it_cannot_read_is_said(translated, wrong):
    (found,) = translated(AROUND % wrong + MAIN % "1.0")
    assert found["error"].startswith("shader: expected ")
