import os
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from helpers import must_fail, random_directions
from histograms import check_drawn_from, counted, expected, viewer

from sommerl import BrdfTable, Lattice, TrainOptions, builtin, save, train
from sommerl.reflectance.arrays import Packed16, gather3, ops
from sommerl.render.bsdf import make_bsdf, register, upload
from sommerl.render.llvm import drjit, mitsuba
from sommerl.sampling.blinn_phong import BlinnPhongSampler
from sommerl.sampling.named import SAMPLERS

mi, dr = mitsuba(), drjit()
LATTICE = Lattice(30, 30, 30)
ANGLES = (0, 45, 80, 88)


def table(name):
    return BrdfTable.sampled(builtin(name), LATTICE)


def interaction(wo):
    """Surface interactions with the viewer at `wo` (3, n)."""
    si = dr.zeros(mi.SurfaceInteraction3f, wo.shape[-1])
    si.wi = mi.Vector3f(*wo)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    return si


def evaluated(brdf, wi, wo):
    """The BSDF's value divided by the cosine."""
    value = make_bsdf(brdf).eval(mi.BSDFContext(), interaction(wo.T), mi.Vector3f(*wi.T))
    return np.array(value).T / np.maximum(wi[:, 2:], 1e-9)


def check_agrees_with_numpy(brdf, values):
    """Single precision moves a few pairs of directions into the cell next door."""
    expected = brdf.eval(*PAIRS)
    close = np.isclose(values, expected, rtol=2e-3, atol=1e-6).all(axis=-1)
    assert close.mean() > 0.999


PAIRS = random_directions(20_000, 1), random_directions(20_000, 2)


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize("clusters", [60, 256, 700])
def test_som_man_material_is_the_same_in_mitsuba(interpolation, clusters):
    material, _ = train(table("pearl-paint"), TrainOptions(clusters=clusters, epochs=2))
    material.interpolation = interpolation
    check_agrees_with_numpy(material, evaluated(material, *PAIRS))


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
def test_table_is_the_same_in_mitsuba(interpolation):
    brdf = table("pearl-paint").with_interpolation(interpolation)
    check_agrees_with_numpy(brdf, evaluated(brdf, *PAIRS))
    must_fail(check_agrees_with_numpy, brdf, evaluated(brdf, PAIRS[0], PAIRS[1][::-1].copy()))


def test_formula_is_the_same_in_mitsuba():
    check_agrees_with_numpy(builtin("pearl-paint"), evaluated(builtin("pearl-paint"), *PAIRS))


def test_table_that_is_not_reciprocal_keeps_light_and_viewer_apart():
    lattice = Lattice(8, 8, 24, reciprocal=False)
    brdf = BrdfTable(np.random.default_rng(0).random((*lattice.shape, 3)), lattice)
    check_agrees_with_numpy(brdf, evaluated(brdf, *PAIRS))
    must_fail(check_agrees_with_numpy, brdf, evaluated(brdf, *PAIRS[::-1]))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_indices_of_either_type_are_gathered_on_the_device(dtype):
    values = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, 1001, dtype, endpoint=True)
    buffer = upload(values)
    assert isinstance(buffer, Packed16) == (dtype == np.uint16)
    index = dr.arange(mi.UInt32, len(values))
    assert np.array_equal(np.array(ops(index).gather(buffer, index)), values)
    triples = upload(np.arange(12.0))
    assert [float(c[0]) for c in gather3(triples, mi.UInt32([2]))] == [6, 7, 8]


def chi2(bsdf, degrees, plugin=None):
    """Mitsuba's χ² test of directions drawn for a viewer at an angle. It integrates smooth densities alone."""
    si = interaction(viewer(degrees)[:, None])

    def draw(u1, u2):
        sample, _ = (plugin or bsdf).sample(mi.BSDFContext(), si, u1, u2)
        return sample.wo, dr.select(sample.pdf > 0, 1.0, 0.0)

    return mi.chi2.ChiSquareTest(
        domain=mi.chi2.SphericalDomain(),
        sample_func=lambda u: draw(u.x, mi.Point2f(u.y, u.z)),
        pdf_func=lambda wi: bsdf.pdf(mi.BSDFContext(), si, wi),
        sample_dim=3,
        sample_count=200_000,
        res=101,
        ires=16,
    )


def check_chi2(*arguments, **options):
    assert chi2(*arguments, **options).run(significance_level=0.01, test_count=16, quiet=True)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", ["beige-fabric", "blue-metallic-paint", "yellow-matte-plastic", "gold-metallic-paint"])
def test_directions_pass_the_chi_square_test(name, degrees):
    check_chi2(make_bsdf(table(name), BlinnPhongSampler.fitted(table(name))), degrees)


@pytest.mark.parametrize("degrees", ANGLES)
def test_that_check_notices_a_sampler_with_another_lobe(degrees):
    brdf = table("blue-metallic-paint")
    fitted = BlinnPhongSampler.fitted(brdf)
    other = make_bsdf(brdf, BlinnPhongSampler(brdf, fitted.exponent * 1.1, fitted.specular))
    must_fail(lambda: check_chi2(make_bsdf(brdf, fitted), degrees, plugin=other))


def check_draws(bsdf, degrees, power=1.0):
    """The χ² test of `histograms`, which takes densities made of cells. power: 1 of numbers that are uniform."""
    u = mi.Float(np.random.default_rng(0).random((3, 100_000)).astype(np.float32).ravel() ** power)
    u = [dr.gather(mi.Float, u, dr.arange(mi.UInt32, 100_000) + 100_000 * k) for k in range(3)]
    sample, _ = bsdf.sample(mi.BSDFContext(), interaction(viewer(degrees)[:, None]), u[0], mi.Point2f(u[1], u[2]))

    def pdf(wi, wo):
        value = bsdf.pdf(mi.BSDFContext(), interaction(wo[:, None]), mi.Vector3f(*wi.reshape(-1, 3).T))
        return np.array(value).astype(float).reshape(wi.shape[:-1])

    drawn = np.array(sample.wo).T[np.array(sample.pdf) > 0].astype(float)
    check_drawn_from(counted(drawn, degrees), expected(pdf, degrees, at_once=True), len(ANGLES) * len(SAMPLERS))


@cache
def sampler(name):
    return SAMPLERS[name].fitted(table("blue-metallic-paint"))


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", SAMPLERS)
def test_directions_are_drawn_from_the_density_of_every_sampler(name, degrees):
    brdf = table("blue-metallic-paint")
    bsdf = make_bsdf(brdf, sampler(name))
    check_draws(bsdf, degrees)
    must_fail(check_draws, bsdf, degrees, 1.1)


@pytest.mark.parametrize("name", SAMPLERS)
def test_sample_weight_is_value_over_density(name):
    brdf = table("blue-metallic-paint")
    bsdf = make_bsdf(brdf, sampler(name))
    si = interaction(random_directions(10_000, 3).T)
    u = np.random.default_rng(1).random((3, 10_000)).astype(np.float32)
    sample, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(u[0]), mi.Point2f(u[1], u[2]))
    value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, sample.wo)
    drawn = np.array(sample.pdf) > 0
    assert 0.5 < drawn.mean() <= 1
    if name == "blinn-phong":  # which draws directions below the horizon, too
        assert drawn.mean() < 1
    if name in ("half-vector", "matusik", "cosine"):
        assert drawn.mean() == 1
    # Single precision moves a few directions into the cell next door.
    same = np.isclose(np.array(pdf)[drawn], np.array(sample.pdf)[drawn], rtol=1e-3)
    assert same.mean() == 1 if name in ("blinn-phong", "cosine") else same.mean() > 0.998
    light = np.array(weight) * np.array(sample.pdf)
    assert np.allclose(light[:, drawn], np.array(value)[:, drawn], rtol=2e-3, atol=1e-6)
    assert (np.array(weight)[:, ~drawn] == 0).all()


def test_only_the_front_side_reflects():
    bsdf = make_bsdf(table("pearl-paint"))
    below = np.array([[0.0], [0.6], [-0.8]])
    up = mi.Vector3f(0, 0.6, 0.8)
    for si, wi in ((interaction(below), up), (interaction(-below), mi.Vector3f(*below))):
        value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, wi)
        assert np.array(value).tolist() == [[0], [0], [0]]
        assert np.array(pdf).tolist() == [0]


def test_scene_files_can_name_a_material(tmp_path):
    material, _ = train(table("nickel"), TrainOptions(clusters=10, epochs=1))
    save(material, tmp_path / "nickel.smrl")
    register()
    path = tmp_path / "nickel.smrl"
    for bsdf in (
        mi.load_dict({"type": "sommerl", "filename": str(path)}),
        mi.load_string(f'<bsdf version="3.0.0" type="sommerl"><string name="filename" value="{path}"/></bsdf>'),
    ):
        value = bsdf.eval(mi.BSDFContext(), interaction(PAIRS[1].T), mi.Vector3f(*PAIRS[0].T))
        check_agrees_with_numpy(material, np.array(value).T / PAIRS[0][:, 2:])


def test_scene_files_can_choose_the_interpolation(tmp_path):
    material, _ = train(table("nickel"), TrainOptions(clusters=10, epochs=1))
    save(material, tmp_path / "nickel.smrl")
    register()
    bsdf = mi.load_dict({"type": "sommerl", "filename": str(tmp_path / "nickel.smrl"), "interpolation": "trilinear"})
    value = bsdf.eval(mi.BSDFContext(), interaction(PAIRS[1].T), mi.Vector3f(*PAIRS[0].T))
    check_agrees_with_numpy(material.with_interpolation("trilinear"), np.array(value).T / PAIRS[0][:, 2:])
    # Mitsuba passes on the errors of plug-ins as RuntimeError.
    with pytest.raises(RuntimeError, match=r"found another \(formula\)"):
        mi.load_dict({"type": "sommerl", "filename": "nickel", "interpolation": "nearest"})


def test_scene_files_can_choose_the_sampler():
    register()
    wi, si = mi.Vector3f(*PAIRS[0].T), interaction(PAIRS[1].T)
    for name, kind in SAMPLERS.items():
        bsdf = mi.load_dict({"type": "sommerl", "filename": "nickel", "sampler": name})
        expected = make_bsdf(builtin("nickel"), kind.fitted(builtin("nickel")))
        assert np.array_equal(bsdf.pdf(mi.BSDFContext(), si, wi), expected.pdf(mi.BSDFContext(), si, wi))
    names = " or ".join(SAMPLERS)
    with pytest.raises(RuntimeError, match=f"sampler: expected {names}, found dice"):
        mi.load_dict({"type": "sommerl", "filename": "nickel", "sampler": "dice"})


def test_paths_in_a_scene_file_may_be_relative_to_it(tmp_path):
    material, _ = train(table("nickel"), TrainOptions(clusters=4, epochs=1))
    save(material, tmp_path / "only_here.smrl")
    scene = tmp_path / "scene.xml"
    bsdf = '<bsdf type="sommerl"><string name="filename" value="only_here.smrl"/></bsdf>'
    scene.write_text(f'<scene version="3.0.0"><shape type="sphere">{bsdf}</shape></scene>')
    register()
    assert "nickel" in str(mi.load_file(str(scene)).shapes()[0].bsdf())


def test_scalar_mode_warns_and_gives_the_same():
    """Without any usable LLVM, in a process of its own."""
    code = """
import warnings
import numpy as np
from sommerl import builtin, BrdfTable, Lattice
from sommerl.system import jit
from sommerl.render import llvm
jit.find_llvm = lambda: None
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    mi = llvm.mitsuba()
assert any("falls back to scalar mode" in str(w.message) for w in caught)
assert mi.variant() == "scalar_rgb"
from sommerl.render.passes import render
from sommerl.render.scenes import sphere
table = BrdfTable(np.full((4, 4, 4, 3), 0.5 / np.pi), Lattice(4, 4, 4))
image = render(sphere(table, np.ones((8, 16, 3), np.float32), size=8), spp=16)
print(image.pixels[3:5, 3:5].mean(), image.mask.sum())
"""
    environment = {key: value for key, value in os.environ.items() if key != "DRJIT_LIBLLVM_PATH"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    mean, count = done.stdout.split()
    assert float(mean) == pytest.approx(0.5, rel=0.05)
    assert int(count) > 20
