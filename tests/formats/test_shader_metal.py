"""MSL, compiled as C++ with a stand-in for Metal's library: Metal's own compiler runs on Apple's machines alone."""

import numpy as np
import pytest
from helpers import must_fail
from shader_programs import CASES, A, B, compact, folded, material, run

from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import MSL

STAND_IN = """#pragma once
#include <cmath>
#include <cstdint>
typedef std::uint32_t uint;
struct float3 {
    float x, y, z;
    float3(float a, float b, float c) : x(a), y(b), z(c) {}
};
namespace metal { using std::abs; using std::atan2; using std::floor; using std::sqrt; }
#define constant static const
#define thread
typedef float3 sommerl_real3;  // what the program of the tests calls it
"""


def found_in(folder, text):
    (folder / "metal_stdlib").write_text(STAND_IN)
    (folder / "x.h").write_text(text)
    return run(folder, "float")


def check_like_python(brdf, found):
    """In single precision; a pair at the edge of a cell may fall into the next one."""
    expected = brdf.eval(A, B)
    away = np.abs(found - expected) - 1e-6 * np.abs(expected).max()
    assert (away <= 1e-3 * np.abs(expected)).all(axis=-1).mean() > 0.999


@pytest.mark.parametrize(
    "made",
    [
        lambda: material(*CASES[2]),
        lambda: material(*CASES[5]),
        lambda: compact("several bands"),
        lambda: folded("both"),
    ],
)
def test_it_gives_what_python_gives(tmp_path, made):
    brdf = made()
    text = shader.source(brdf, MSL, "material_x")
    found = found_in(tmp_path, text)
    check_like_python(brdf, found)
    must_fail(check_like_python, brdf, found * 1.01)
