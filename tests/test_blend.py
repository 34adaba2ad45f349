"""The blend of two materials in the cube-root domain, and what it is worth."""

import numpy as np
import pytest
from helpers import SMALL, complaint, lambertian_table, must_fail, random_directions, run, run_json
from kinds import KINDS

from sommerl import blend, builtin, load, save
from sommerl.commands import blend as blend_command
from sommerl.commands import convert as convert_command
from sommerl.compression.material import SomManBrdf
from sommerl.system.errors import OptionError

A, B = random_directions(2000, 1), random_directions(2000, 2)
PAIRS = [("nickel", "red-fabric"), ("chrome", "yellow-matte-plastic"), ("pearl-paint", "purple-paint")]
ANGLES = np.radians([0, 45, 75])


def by_hand(first, second, weight):
    return ((1 - weight) * np.cbrt(first.eval(A, B)) + weight * np.cbrt(second.eval(A, B))) ** 3


def check_blend(made, first, second, weight):
    assert np.allclose(made.eval(A, B), by_hand(first, second, weight), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("weight", [0, 0.3, 1])
@pytest.mark.parametrize("kind", ["table-trilinear", "nodes", "rgl", "factored"])
def test_a_blend_is_of_cube_roots(kind, weight):
    first, second = KINDS[kind], builtin("nickel")
    check_blend(blend(first, second, weight), first, second, weight)
    must_fail(check_blend, blend(second, first, 0.4), first, second, 0.3)


def test_negative_channels_stay():
    first = KINDS["rgl"]
    negated = type("Negated", (type(first),), {"f_r": lambda self, *a: tuple(-c for c in type(first).f_r(self, *a))})
    second = object.__new__(negated)
    second.__dict__.update(first.__dict__)
    made = blend(first, second, 0.25)
    assert np.allclose(made.eval(A, B), 0.125 * first.eval(A, B))
    assert np.allclose(blend(first, second, 0.75).eval(A, B), -0.125 * first.eval(A, B))
    assert made.signed == (first.signed or second.signed)


def check_between(made, first, second, weight):
    """Nowhere outside of the two, nor above the linear blend; and so of albedos."""
    x, y, z = (brdf.eval(A, B) for brdf in (first, second, made))
    assert (z >= np.minimum(x, y) * (1 - 1e-9)).all()
    assert (z <= ((1 - weight) * x + weight * y) * (1 + 1e-9) + 1e-15).all()
    p, q, r = (brdf.albedo(ANGLES) for brdf in (first, second, made))
    assert (r <= (1 - weight) * p + weight * q + 1e-4).all()


@pytest.mark.parametrize("names", PAIRS)
def test_a_blend_reflects_no_more_than_the_linear_one(names):
    first, second = map(builtin, names)
    check_between(blend(first, second, 0.4), first, second, 0.4)
    must_fail(check_between, second, first, second, 0.4)


def test_a_blend_of_what_is_reciprocal_is_reciprocal():
    made = blend(builtin("nickel"), builtin("chrome"), 0.5)
    assert made.reciprocal
    assert np.allclose(made.eval(A, B), made.eval(B, A), rtol=1e-9)
    assert not blend(builtin("nickel"), KINDS["rgl"], 0.5).reciprocal
    assert blend(KINDS["table-trilinear"], KINDS["table-nearest"], 0.5).mirrored == KINDS["table-nearest"].mirrored


def test_with_black_it_darkens_by_the_cube():
    black = lambertian_table(1e-30)
    bright = lambertian_table(0.8)
    assert np.allclose(blend(black, bright, 0.5).eval(A, B), 0.125 * bright.eval(A, B), rtol=1e-6)


@pytest.mark.parametrize("weight", [-0.01, 1.01, float("nan"), float("inf")])
def test_weights_are_from_0_to_1(capsys, weight):
    with pytest.raises(OptionError, match="weight: expected 0 to 1, found"):
        blend(builtin("nickel"), builtin("chrome"), weight)
    status, _, err = run(capsys, "blend", "nickel", "chrome", "-o", "x.smrl", "--", weight)
    assert status == 2
    assert err.startswith("error: WEIGHT: expected 0 to 1, found")


def test_a_blend_is_sampled_and_says_what_it_is():
    made = blend(builtin("nickel"), builtin("gold-metallic-paint"), 0.3)
    wi, pdf, weight = made.sample(A[:100], np.random.default_rng(0).random((100, 3)))
    assert np.isfinite(weight).all()
    assert np.allclose(made.pdf(wi, A[:100])[pdf > 0], pdf[pdf > 0], rtol=1e-5)
    assert made.facts["blend_weight"] == 0.3
    assert made.name == "0.7 nickel (SGD stand-in) + 0.3 gold-metallic-paint (SGD stand-in)"
    assert blend(made, builtin("chrome"), 0.5).eval(A, B).shape == A.shape


def test_the_command_writes_what_convert_writes(capsys, tmp_path):
    first, second = tmp_path / "a.smrl", tmp_path / "b.smrl"
    rng = np.random.default_rng(0)
    for path in (first, second):
        save(SomManBrdf(rng.random((5, 3)), rng.integers(0, 5, SMALL.shape).astype(np.uint8), SMALL, name="x"), path)
    found = run_json(capsys, "blend", first, second, 0.25, "-o", tmp_path / "c.binary")
    assert found["blended"] == [str(first), str(second)]
    assert found["weight"] == 0.25
    written, expected = (
        load(tmp_path / "c.binary").with_interpolation("nearest"),
        blend(load(first), load(second), 0.25),
    )
    same = np.isclose(written.eval(A, B), expected.eval(A, B), rtol=1e-6)
    assert same.mean() > 0.9  # both are constant in the cells of SMALL; MERL's may lie across two of them
    assert "snippet" in complaint_of(capsys, "blend", first, second, 0.25, "-o", tmp_path / "c.xml")
    assert "other than the input" in complaint_of(capsys, "blend", first, second, 0.25, "-o", second)
    assert complaint(load, tmp_path / "c.xml") is not None


@pytest.mark.parametrize(("asked", "target"), [([], (None, 48.0)), (["--target-size", "2.7kB"], (2700, None))])
def test_a_smrl_is_compact(capsys, tmp_path, monkeypatch, asked, target):
    made = []

    def instead(source, brdf, output, options, quiet, *, reciprocal):
        made.append((source, (options.target_size, options.target_psnr), reciprocal))
        return {"input": source, "name": brdf.name}

    for module in (blend_command, convert_command):
        monkeypatch.setattr(module, "compact_one", instead)
    found = run_json(capsys, "blend", "nickel", "chrome", 0.5, "-o", tmp_path / "c.smrl", *asked, "--reciprocal")
    assert made == [("nickel + chrome", target, True)]
    assert found["blended"] == ["nickel", "chrome"]


def complaint_of(capsys, *arguments):
    status, _, err = run(capsys, *arguments)
    assert status == 2
    return err


def check_head(path, command):
    assert f"// Command: {command}\n" in path.read_text()


def test_the_head_of_source_code_has_the_command(capsys, tmp_path, monkeypatch):
    """That of the blend, with names in place of paths."""
    first, second = tmp_path / "first.smrl", tmp_path / "a b.smrl"
    for path in (first, second):
        save(KINDS["nodes"], path)
    monkeypatch.setattr(convert_command, "_compressed", lambda brdf, options: KINDS["nodes"])
    output = tmp_path / "c.h"
    run_json(capsys, "blend", first, second, 0.25, "-o", output, "--target-size", "600", "--reciprocal")
    check_head(output, "sommerl blend first.smrl 'a b.smrl' 0.25 -o c.h --target-size 600 --reciprocal")
    must_fail(check_head, output, "sommerl convert 'a b.smrl' c.h --target-size 600 --reciprocal")
