"""Many materials in one BSDF of Mitsuba: which one is where, and that nothing is read beyond the arrays."""

import numpy as np
import pytest
from atlases import COUNT, MATERIALS, atlas, turned
from helpers import must_fail, random_directions
from histograms import check_drawn_from, counted, expected, viewer

from sommerl import builtin, save
from sommerl.compression.atlas import Atlas
from sommerl.reflectance.arrays import DrjitOps, Packed16, Section
from sommerl.render.bsdf import make_atlas_bsdf, make_bsdf, register
from sommerl.render.llvm import drjit, mitsuba

mi, dr = mitsuba(), drjit()
A, B = (random_directions(3000, seed) * [1, 1, 0.8] + [0, 0, 0.2] for seed in (1, 2))
A, B = (w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (A, B))
NUMBERS = np.random.default_rng(3).integers(0, COUNT, len(A))
PIXELS = np.arange(COUNT, dtype=np.float32)[None, :, None]


def bitmap(pixels=PIXELS):
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True, "filter_type": "nearest"}


def in_bitmap(made, pixels=PIXELS):
    return make_atlas_bsdf(made, mi.load_dict(bitmap(pixels)))


def interaction(wo, numbers, count=COUNT):
    """Of viewers (n, 3) at the middle of the pixels of these numbers."""
    si = dr.zeros(mi.SurfaceInteraction3f, max(len(wo), len(numbers)))
    si.wi, si.sh_frame = mi.Vector3f(*wo.T), mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.uv = mi.Point2f((np.asarray(numbers) + 0.5) / count, 0.5)
    return si


def check_values(plugin, si=None):
    si = si or interaction(B, NUMBERS)
    found = np.array(plugin.eval(mi.BSDFContext(), si, mi.Vector3f(*A.T))).T / A[:, 2:]
    true = atlas().eval(A, B, NUMBERS)
    away = np.abs(found - true) - 1e-5 * np.array([np.abs(m.eval(A, B)).max() for m in MATERIALS])[NUMBERS, None]
    assert (away <= 2e-3 * np.abs(true)).mean() > 0.999


def test_a_bitmap_says_which_material_is_where():
    check_values(in_bitmap(atlas()))
    must_fail(check_values, in_bitmap(turned()))
    must_fail(check_values, in_bitmap(atlas(), PIXELS[:, ::-1].copy()))


def test_samples_and_densities_are_those_of_the_atlas():
    plugin, ctx, si = in_bitmap(atlas()), mi.BSDFContext(), interaction(B, NUMBERS)
    u = np.random.default_rng(5).random((3, len(B))).astype(np.float32)
    sample, weight = plugin.sample(ctx, si, mi.Float(u[0]), mi.Point2f(u[1], u[2]))
    wi, pdf, _ = atlas().sample(B, u.T.astype(float), NUMBERS)
    drawn = np.isclose(np.array(sample.wo).T, wi, atol=1e-4).all(axis=1) & np.isclose(np.array(sample.pdf), pdf, 1e-2)
    assert drawn.mean() > 0.99  # single precision moves some samples to the next cell
    value, density = plugin.eval_pdf(ctx, si, sample.wo)
    assert np.isclose(np.array(density), np.array(sample.pdf), rtol=1e-3).mean() > 0.99
    light, largest = np.array(weight) * np.array(sample.pdf), np.abs(np.array(value)).max()
    assert np.allclose(light, np.array(value), rtol=2e-3, atol=1e-6 * largest)


def check_draws(plugin, density, number):
    """The χ² test of `histograms`."""
    u = np.random.default_rng(0).random((3, 100_000)).astype(np.float32)
    si = interaction(viewer(60)[None], np.full(u.shape[1], number))
    sample, _ = plugin.sample(mi.BSDFContext(), si, mi.Float(u[0]), mi.Point2f(u[1], u[2]))

    def pdf(wi, wo):
        light = mi.Vector3f(*wi.reshape(-1, 3).T)
        found = density.pdf(mi.BSDFContext(), interaction(wo[None], np.full(wi.size // 3, number)), light)
        return np.array(found).astype(float).reshape(wi.shape[:-1])

    drawn = np.array(sample.wo).T[np.array(sample.pdf) > 0].astype(float)
    check_drawn_from(counted(drawn, 60), expected(pdf, 60, nodes=20, at_once=True), COUNT)


@pytest.mark.parametrize("number", range(COUNT))
def test_directions_are_drawn_from_the_density(number):
    plugin = in_bitmap(atlas())
    check_draws(plugin, plugin, number)
    must_fail(check_draws, in_bitmap(turned()), plugin, number)


@pytest.mark.parametrize("number", range(COUNT))
def test_the_diffuse_reflectance_is_that_of_the_material(number):
    si = interaction(viewer(50)[None], [number])
    found = [
        np.array(plugin.eval_diffuse_reflectance(si)) for plugin in (in_bitmap(atlas()), make_bsdf(MATERIALS[number]))
    ]
    assert np.allclose(*found, rtol=1e-5)


class Watched(DrjitOps):
    """Looks at every index before it is used: what is beyond a buffer may end the process."""

    def gather(self, buffer, index):
        if not isinstance(buffer, Section):
            size = 2 * len(buffer.pairs) if isinstance(buffer, Packed16) else len(buffer)
            assert int(dr.max(index)[0]) < size
        return super().gather(buffer, index)


def check_stays_inside(plugin, monkeypatch):
    """Numbers that are none, in lanes that are active or not, and directions that are none."""
    monkeypatch.setattr("sommerl.reflectance.arrays.DrjitOps", Watched)
    anything = np.array([-1e30, -1.0, 0.0, COUNT, 1e10, 1e30, np.nan, 2.0], np.float32)
    si, ctx = interaction(B[:8], range(8), 8), mi.BSDFContext()
    si.wi.x = mi.Float(np.array([np.nan, *B[1:8, 0]], np.float32))
    textured = make_atlas_bsdf(plugin, mi.load_dict(bitmap(anything[None, :, None])))
    for active in (True, mi.Bool(np.arange(8) % 2 == 0), False):
        sample, _ = textured.sample(ctx, si, mi.Float(anything), mi.Point2f(anything, 0.5), active)
        found = textured.eval(ctx, si, mi.Vector3f(*A[:8].T), active), textured.pdf(ctx, si, sample.wo, active)
        dr.eval(found, sample, textured.eval_diffuse_reflectance(si, active))


def test_nothing_is_read_beyond_the_arrays(monkeypatch):
    check_stays_inside(atlas(), monkeypatch)
    monkeypatch.setattr(Atlas, "__len__", lambda self: COUNT + 1)
    must_fail(check_stays_inside, atlas(), monkeypatch)


def test_it_says_what_it_is():
    plugin, flags = in_bitmap(atlas()), mi.BSDFFlags
    assert plugin.flags() == flags.GlossyReflection | flags.FrontSide | flags.SpatiallyVarying
    assert f"{COUNT} materials" in str(plugin)
    assert "number.data" in mi.traverse(plugin).keys()  # noqa: SIM118


# --- scenes


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("atlas")
    for k, material in enumerate(MATERIALS):
        save(material, folder / f"{k}.smrl")
    register()
    return [folder / f"{k}.smrl" for k in range(COUNT)]


def properties(files, **others):
    named = {f"material_{k}": str(path) for k, path in enumerate(files)}
    return {"type": "sommerl-atlas", "number": bitmap(), **named, **others}


def test_scenes_name_materials_by_their_numbers(files):
    check_values(mi.load_dict(properties(files)))
    check_values(mi.load_dict(properties(files, number=bitmap(PIXELS / 255), number_scale=255.0)))
    must_fail(check_values, mi.load_dict(properties(files[::-1])))
    twice = mi.load_dict(properties(files, scale=2.0, tint={"type": "rgb", "value": 0.5}, comment="nothing"))
    check_values(twice)


def test_scenes_in_xml_and_shapes_with_numbers(files):
    """Two spheres and a mesh, of one BSDF."""
    named = "".join(f'<string name="material_{k}" value="{path}"/>' for k, path in enumerate(files))
    number = '<texture type="mesh_attribute" name="number"><string name="name" value="face_material"/></texture>'
    attribute = '<texture type="uniform" name="face_material"><float name="value" value="{}"/></texture>'
    spheres = "".join(f'<shape type="sphere"><ref id="a"/>{attribute.format(k)}</shape>' for k in (5, 2))
    scene = mi.load_string(
        f'<scene version="3.0.0"><bsdf type="sommerl-atlas" id="a">{named}{number}</bsdf>{spheres}</scene>'
    )
    numbers = [5, 2]
    assert scene.shapes()[0].bsdf() == scene.shapes()[1].bsdf()
    si = interaction(B, 0 * NUMBERS)
    for shape, k in zip(scene.shapes(), numbers, strict=True):
        si.shape = mi.ShapePtr(shape)
        found = np.array(shape.bsdf().eval(mi.BSDFContext(), si, mi.Vector3f(*A.T))).T
        alone = np.array(make_bsdf(MATERIALS[k]).eval(mi.BSDFContext(), si, mi.Vector3f(*A.T))).T
        assert np.allclose(found, alone, rtol=1e-4, atol=1e-5 * np.abs(alone).max())


def test_faces_of_a_mesh_have_their_materials():
    number = mi.load_dict({"type": "mesh_attribute", "name": "face_material"})
    mesh = mi.Mesh("m", 3 * COUNT, COUNT)
    mesh.add_attribute("face_material", 1, np.arange(COUNT, dtype=np.float32))
    si = interaction(B, 0 * NUMBERS)
    si.shape, si.prim_index = mi.ShapePtr(mesh), mi.UInt32(NUMBERS.astype(np.uint32))
    check_values(make_atlas_bsdf(atlas(), number), si)
    si.prim_index = mi.UInt32(((NUMBERS + 1) % COUNT).astype(np.uint32))
    must_fail(check_values, make_atlas_bsdf(atlas(), number), si)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"material_1": None}, "sommerl-atlas: expected material_0, material_1, …, found no material_1"),
        ({f"material_{k}": None for k in range(COUNT)}, "found no material_0"),
        ({"number": None}, "sommerl-atlas: expected a texture `number`, which says where each material is, found none"),
        ({"material_1": "nickel"}, "nickel .*: expected a compact material for an atlas, found a model"),
        ({"material_1": "nickle"}, "did you mean nickel"),
        ({"number_scale": -1.0}, "number_scale: expected a number of at least 0, found -1"),
    ],
)
def test_what_a_scene_cannot_ask_for(files, change, sentence):
    kept = {name: value for name, value in (properties(files) | change).items() if value is not None}
    with pytest.raises(RuntimeError, match=sentence):
        mi.load_dict(kept)


def test_scalar_variants_give_the_same(files):
    before = mi.variant()
    mi.set_variant("scalar_rgb")
    try:
        register()
        plugin = mi.load_dict(properties(files[:3], number={"type": "uniform", "value": 2.0}))
        for a, b, u in zip(A[:20], B[:20], np.random.default_rng(1).random((20, 3)), strict=True):
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(*map(float, b))
            found = np.array(plugin.eval(mi.BSDFContext(), si, mi.Vector3f(*map(float, a))))
            true = MATERIALS[2].eval(a, b) * a[2]
            assert np.allclose(found, true, rtol=1e-3, atol=1e-5)
            sample, _ = plugin.sample(mi.BSDFContext(), si, float(u[0]), mi.Point2f(*map(float, u[1:])))
            assert plugin.pdf(mi.BSDFContext(), si, sample.wo) == pytest.approx(sample.pdf, rel=1e-2)
    finally:
        mi.set_variant(before)


def test_a_material_that_is_no_atlas_is_what_it_was():
    assert str(make_bsdf(builtin("nickel"))) == "SommerlBsdf[nickel (SGD stand-in)]"
