import numpy as np
import pytest
from helpers import lambertian_table, must_fail, random_directions

from sommerl import load
from sommerl.formats import rgl, rgl_export, tensor
from sommerl.formats.spectra import srgb_weights
from sommerl.models.builtin import builtin
from sommerl.render.environment import default_environment
from sommerl.render.llvm import mitsuba
from sommerl.render.metrics import image_metrics
from sommerl.render.passes import render
from sommerl.render.scenes import sphere
from sommerl.sampling.blinn_phong import BlinnPhongSampler
from sommerl.system.errors import MaterialError

A, B = (w[w[:, 2] > 0.1][:2000] for w in (random_directions(3000, s) for s in (1, 2)))


def check_lambertian(brdf, albedo):
    found = brdf.eval(A, B) * np.pi / albedo
    assert abs(found.mean() - 1) < 3e-3
    assert np.quantile(abs(found - 1), 0.99) < 0.05


def test_a_lambertian_comes_back(tmp_path):
    path = tmp_path / "x.bsdf"
    rgl_export.write(lambertian_table(0.5), path)
    check_lambertian(load(path), 0.5)
    must_fail(check_lambertian, load(path), 0.505)


def test_mitsuba_renders_the_file_as_the_material(tmp_path):
    path, source = tmp_path / "x.bsdf", builtin("blue-metallic-paint")
    rgl_export.write(source, path)
    measured = mitsuba().load_dict({"type": "measured", "filename": str(path)})
    reference = render(sphere(source, default_environment(), size=64), spp=2048)
    image = render(sphere(measured, default_environment(), size=64), spp=2048)
    # Different random directions: most of the distance is noise.
    assert image_metrics(reference.pixels, image.pixels, reference.mask)["psnr_object_db"] > 40


@pytest.mark.parametrize("name", ["nickel", "blue-metallic-paint", "yellow-matte-plastic", "red-fabric"])
def test_our_reader_renders_the_file_as_the_material(tmp_path, name):
    path, source = tmp_path / "x.bsdf", builtin(name)
    rgl_export.write(source, path)
    sampler = BlinnPhongSampler.fitted(source)
    images = [
        render(sphere(brdf, default_environment(), sampler=sampler, size=64), spp=64)
        for brdf in (source, rgl.read(path))
    ]
    assert image_metrics(images[0].pixels, images[1].pixels, images[0].mask)["psnr_object_db"] >= 45


def test_spectra_are_the_same_colours(tmp_path):
    source = builtin("purple-paint")
    rgl_export.write(source, tmp_path / "rgb.bsdf")
    rgl_export.write(source, tmp_path / "spec.bsdf", spectral=True)
    one, other = (load(tmp_path / f"{kind}.bsdf").eval(A, B) for kind in ("rgb", "spec"))
    assert np.allclose(one, other, rtol=1e-4, atol=1e-6)
    fields = tensor.TensorFile(tmp_path / "spec.bsdf", (tmp_path / "spec.bsdf").read_bytes()).fields
    assert "rgb" not in fields
    assert fields["spectra"].shape == (1, 48, 21, 96, 96)


def test_what_single_precision_cannot_hold_is_not_written(tmp_path):
    table = lambertian_table()
    table.values[2] = 3e38
    with pytest.raises(MaterialError, match="expected values that single precision can hold"):
        rgl_export.write(table, tmp_path / "x.bsdf")
    assert not list(tmp_path.iterdir())


def test_dark_materials_keep_their_shape(tmp_path):
    table = lambertian_table(1e-9)
    rgl_export.write(table, tmp_path / "x.bsdf")
    check_lambertian(load(tmp_path / "x.bsdf"), 1e-9)


def check_primaries(spectra):
    assert np.allclose(srgb_weights(rgl_export.WAVELENGTHS).T @ spectra, np.eye(3), atol=1e-9)
    assert np.allclose(spectra.sum(axis=1), 1, atol=0.02)
    assert spectra.min() > -0.01


def test_primaries():
    spectra = rgl_export._primaries()
    check_primaries(spectra)
    must_fail(check_primaries, spectra[:, ::-1])


def test_what_pbrt_reads(tmp_path):
    """The shapes and types that pbrt-v4's reader asks for."""
    rgl_export.write(lambertian_table(), tmp_path / "x.bsdf", spectral=True)
    fields = tensor.TensorFile(tmp_path / "x.bsdf", (tmp_path / "x.bsdf").read_bytes()).fields
    angles = fields["phi_i"].shape + fields["theta_i"].shape
    assert all(fields[name].dtype == np.float32 for name in ("theta_i", "phi_i", "ndf", "sigma", "vndf", "luminance"))
    assert all(fields[name].dtype == np.float32 for name in ("wavelengths", "spectra"))
    assert [len(fields[name].shape) for name in ("ndf", "sigma", "vndf", "luminance", "spectra")] == [2, 2, 4, 4, 5]
    assert fields["vndf"].shape[:2] == fields["luminance"].shape[:2] == fields["spectra"].shape[:2] == angles
    assert fields["spectra"].shape[2:] == fields["wavelengths"].shape + fields["luminance"].shape[2:]
    assert fields["luminance"].shape[2] == fields["luminance"].shape[3]
    assert (fields["jacobian"].shape, fields["jacobian"].dtype) == ((1,), np.uint8)
    assert fields["description"].dtype == np.uint8
