"""Readers and writers on measured data: goals, not measured bests."""

import statistics
from pathlib import Path

import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl import BrdfTable, load
from sommerl.formats import rgl, rgl_export
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.gamut import without_negatives
from sommerl.reflectance.reciprocal import reciprocal
from sommerl.render.compare import compare_on_sphere
from sommerl.render.compress import compress
from sommerl.render.environment import default_environment
from sommerl.render.judge import Judge
from sommerl.render.llvm import drjit, mitsuba

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
RGL = sorted((DATA / "rgl").glob("*.bsdf"))
STAND_INS = (
    "blue-metallic-paint", "yellow-matte-plastic", "nickel", "purple-paint", "green-metallic-paint", "beige-fabric",
)  # fmt: skip
A, B = (w[w[:, 2] >= 0.05][:10_000].astype("f4").astype("f8") for w in (random_directions(12_000, s) for s in (1, 2)))


@pytest.mark.parametrize("path", RGL, ids=lambda path: path.stem)
def test_rgl_as_mitsuba_evaluates_it(path):
    """Within a thousandth, but for values below 1e-4, where Mitsuba's single precision is felt."""
    mi, dr = mitsuba(), drjit()
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    si = dr.zeros(mi.SurfaceInteraction3f, len(B))
    si.wi = _vectors(B.T)
    theirs = np.array(bsdf.eval(mi.BSDFContext(), si, _vectors(A.T))).T
    ours = rgl.read(path).eval(A, B) * A[:, 2:]
    assert np.all(np.abs(ours - theirs) <= 1e-3 * np.abs(theirs) + 1e-7)


class InMitsuba(Brdf):
    """Mitsuba's own BSDF of a file, for the same sampler and the same directions."""

    def __init__(self, path):
        self.name, self._path = "measured", str(path)

    def f_r(self, wi, wo, buffers):
        """wi, wo: triples of NumPy's arrays or of Dr.Jit's."""
        mi, dr = mitsuba(), drjit()
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi[0]))
        si.wi = _vectors(wo)
        bsdf = mi.load_dict({"type": "measured", "filename": self._path})
        value = bsdf.eval(mi.BSDFContext(), si, _vectors(wi))
        return [(np.array(x) if isinstance(wi[2], np.ndarray) else x) / wi[2] for x in value]


def _vectors(triple):
    mi = mitsuba()
    return mi.Vector3f(*(w.astype(np.float32).ravel() if isinstance(w, np.ndarray) else w for w in triple))


class Held(Brdf):
    """What a table could hold of a material, if it had a cell for each pair of directions."""

    def __init__(self, source):
        self.name, self._source = "held", reciprocal(source)

    def f_r(self, wi, wo, buffers):
        f_r = np.stack(self._source.f_r(wi, wo, self._source.buffers()), axis=-1)
        return tuple(np.moveaxis(without_negatives(f_r), -1, 0))


def test_rgl_as_a_table():
    found = [Judge(Held(source)).metrics(BrdfTable.sampled(source))["psnr_soft_db"] for source in map(load, RGL)]
    assert statistics.mean(found) >= 50
    assert min(found) >= 40


@pytest.mark.parametrize("name", STAND_INS)
def test_stand_ins_as_rgl_files(stand_in, tmp_path, name):
    source = load(stand_in(name))
    rgl_export.write(source, tmp_path / "x.bsdf")
    readers = rgl.read(tmp_path / "x.bsdf"), InMitsuba(tmp_path / "x.bsdf")
    found = compare_on_sphere(source, readers, default_environment(), size=128)
    assert min(each.metrics["psnr_object_db"] for each in found) >= 45


# Of planes with tricube weights alone, over θ_d: what single samples that are held out must not be worse than
CORNELL = {"acryl_blue": 0.070, "cayman": 0.065, "mystique": 0.097}


@pytest.mark.parametrize("name", CORNELL)
def test_cornell(name):
    facts = load(DATA / "cornell" / f"{name}.brdf").facts
    assert facts["samples"] == 1439
    assert facts["mirrored"]
    assert facts["held_out_median_relative_error"] < CORNELL[name]
    assert facts["held_out_lines_median_relative_error"] < 0.25


def check_peak(brdf, samples):
    brightest = samples.f_r[:, 0].argmax()
    found = brdf.eval(samples.wi[brightest], samples.wo[brightest])
    assert np.allclose(found, samples.f_r[brightest], rtol=0.05)


@pytest.mark.parametrize("path", sorted((DATA / "alta").glob("*.dat")), ids=lambda path: path.stem)
def test_tapes_keep_their_peak(path):
    source = load(path)
    material, report = compress(source, target_size=2700)
    assert report.tried[-1][0] <= 2700
    check_peak(material, source.samples)
    must_fail(check_peak, BrdfTable.of(source), source.samples)  # MERL's cells are too wide


def test_neural_fits_are_the_stand_ins(nbrdf_stand_in):
    table = load(nbrdf_stand_in("nickel"))
    network = BrdfTable.sampled(load(f"{DATA / 'nbrdf' / 'merl.npz'}:nickel"))
    above = table.lattice.above_horizon
    assert np.allclose(network.values[above], table.values[above], rtol=1e-6, atol=1e-9)
