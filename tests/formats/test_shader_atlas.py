"""Source code of many materials: each number gives what its material gives in Python."""

import re

import numpy as np
import pytest
from helpers import must_fail, run_json
from shader_programs import CALLS, FOLDED, A, B, compact, folded, material, run, validate
from shader_programs import CASES as CELLS

from sommerl import builtin, save
from sommerl.commands.cli import main
from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import CPP
from sommerl.sampling.half_vector import HalfVectorSampler
from sommerl.system.errors import FormatError

MADE = [compact("several bands"), *map(folded, list(FOLDED)[::3]), compact("one gain and one shape"), folded("both")]
CALL = """
    double out[7 * COUNT];
    for (sommerl_uint k = 0; k < COUNT; ++k) {
        const auto f = material_x_eval(k + FIRST, a, b);
        number density;
        const auto w = material_x_sample(k + FIRST, a, b, density);
        const double each[] = {f.x, f.y, f.z, w.x, w.z, density, material_x_pdf(k + FIRST, a, b)};
        for (int i = 0; i < 7; ++i) out[7 * k + i] = each[i];
    }
"""
WO, U = A[7:2000], np.random.default_rng(4).random((1993, 3), np.float32).astype(np.float64)


@pytest.fixture(scope="module")
def text():
    return shader.atlas_source(MADE, CPP, "material_x")


def found_in(folder, text, a, b, monkeypatch, first=0):
    """What each material of a header gives, (materials, pairs, 7)."""
    (folder / "x.h").write_text(text)
    call = CALL.replace("COUNT", str(len(MADE))).replace("FIRST", str(first))
    monkeypatch.setitem(CALLS, "several", call)
    found = run(folder, "double", "several", a, b)
    return found.reshape(len(a), len(MADE), 7).swapaxes(0, 1)


def check_values(found, made=MADE):
    for one, brdf in zip(found, made, strict=True):
        assert np.allclose(one[:, :3], brdf.eval(A, B), rtol=1e-5, atol=1e-12)
        pdf = HalfVectorSampler.fitted(brdf).pdf(A, B)
        assert (np.abs(one[:, 6] - pdf) <= 1e-9 * pdf).mean() > 0.999


def test_each_number_has_the_values_of_its_material(tmp_path, text, monkeypatch):
    found = found_in(tmp_path, text, A, B, monkeypatch)
    check_values(found)
    must_fail(check_values, np.roll(found, 1, axis=0))
    for mark in ("+ 1u) + (entry_", "+ 2u) + (entry_"):
        assert mark in text
        must_fail(check_values, found_in(tmp_path, text.replace(mark, "+ 0u) * 0u + (entry_"), A, B, monkeypatch))


def test_numbers_beyond_the_last_are_the_last(tmp_path, text, monkeypatch):
    found = found_in(tmp_path, text, A[:50], B[:50], monkeypatch, first=len(MADE))
    last = found_in(tmp_path, text, A[:50], B[:50], monkeypatch)[-1]
    assert all(np.array_equal(one, last, equal_nan=True) for one in found)


def test_source_of_one_takes_its_number_too():
    assert "eval(sommerl_uint which_, sommerl_real3 wi_" in shader.atlas_source(MADE[:1], CPP, "x")
    assert "which_" not in shader.source(MADE[0], CPP, "x")


def check_directions(found):
    for one, brdf in zip(found, MADE, strict=True):
        wi, pdf, _ = HalfVectorSampler.fitted(brdf).sample(WO, U)
        same = np.abs(one[:, 3:5] - wi[:, ::2]).max(axis=1) <= 1e-13
        assert (same & (np.abs(one[:, 5] - pdf) <= 1e-9 * pdf)).mean() > 0.999


def test_directions_are_those_of_each_materials_sampler(tmp_path, text, monkeypatch):
    found = found_in(tmp_path, text, WO, U, monkeypatch)
    check_directions(found)
    must_fail(check_directions, np.roll(found, 1, axis=0))


GLSL_PROGRAM = """#version 450
#include "x.glsl"
layout(location = 0) flat in uint which;
layout(location = 1) in vec3 wo;
layout(location = 2) in vec3 u;
layout(location = 0) out vec4 color;
void main() {
    float pdf;
    vec3 wi = material_x_sample(which, wo, u, pdf);
    color = vec4(material_x_eval(which, wi, wo), pdf + material_x_pdf(which, wi, wo));
}
"""
HLSL_PROGRAM = """#include "x.hlsl"
float4 main(nointerpolation uint which : A, float3 wo : B, float3 u : C) : SV_Target {
    float pdf;
    float3 wi = material_x_sample(which, wo, u, pdf);
    return float4(material_x_eval(which, wi, wo), pdf + material_x_pdf(which, wi, wo));
}
"""


@pytest.mark.parametrize(
    ("extension", "program", "options"),
    [("glsl", GLSL_PROGRAM, ("-V",)), ("hlsl", HLSL_PROGRAM, ("-V", "-D", "-S", "frag", "-e", "main"))],
)
def test_shaders_compile(tmp_path, extension, program, options):
    shader.write_atlas(MADE, tmp_path / f"x.{extension}")
    validate(tmp_path, program, *options)
    must_fail(validate, tmp_path, program.replace("eval(which, wi", "eval(wi"), *options)


def test_names_of_all_materials_are_listed(text):
    lines = re.findall(r"^//   \d+: .*", text, re.M)
    assert lines == [f"//   {k}: {brdf.name} (unknown; unknown)" for k, brdf in enumerate(MADE)]


def test_materials_that_are_not_compact_are_refused(tmp_path):
    for other in (material(*CELLS[3]), builtin("nickel")):
        with pytest.raises(FormatError, match=f"{other.name.split()[0]}.*: expected compact materials"):
            shader.write_atlas([MADE[0], other], tmp_path / "x.h")
    assert not list(tmp_path.iterdir())


def test_convert_takes_several_materials_and_folders(capsys, tmp_path):
    folder = tmp_path / "materials"
    folder.mkdir()
    for k, brdf in enumerate(MADE[:3]):
        save(brdf, folder / f"{k}.smrl")
    result = run_json(capsys, "convert", folder / "0.smrl", folder / "2.smrl", tmp_path / "x.h")
    assert [each["input"] for each in result["materials"]] == [str(folder / "0.smrl"), str(folder / "2.smrl")]
    assert result["bytes_disk"] == (tmp_path / "x.h").stat().st_size
    assert "of one of 2;" in (tmp_path / "x.h").read_text()
    assert len(run_json(capsys, "convert", folder, tmp_path / "y.glsl")["materials"]) == 3
    assert main(["convert", str(folder), str(tmp_path / "z.hlsl")]) == 0
    assert f"3 materials → {tmp_path / 'z.hlsl'}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (["nickel", "chrome", "{}/x.h"], 1, "nickel (SGD stand-in): expected compact materials"),
        (
            ["nickel", "chrome", "{}/x.smrl"],
            2,
            "x.smrl: expected a name that ends in one of .h, .hpp, .glsl, .hlsl, .metal, .wgsl",
        ),
        (["nickel", "chrome", "{}/x.h", "--noise", "1"], 2, "--noise: expected one built-in material, found 2 inputs"),
    ],
)
def test_what_convert_refuses(capsys, tmp_path, arguments, status, sentence):
    assert main(["convert", *(each.format(tmp_path) for each in arguments)]) == status
    assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
