"""How much light comes back, from every elevation, for narrow and for wide lobes; and which families promise what."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail
from lobes import FAMILY_LIST, evaluated, label, pairs, scaled, shapes
from quadrature import albedo, over_directions, over_half_vectors

from sommerl.models import cook_torrance, ggx, torrance_sparrow
from sommerl.models.cook_torrance import COOK_TORRANCE
from sommerl.models.ggx import GGX
from sommerl.models.lambertian import LAMBERTIAN
from sommerl.models.microfacets import fresnel
from sommerl.models.oren_nayar import OREN_NAYAR
from sommerl.models.phong import PHONG
from sommerl.models.torrance_sparrow import TORRANCE_SPARROW
from sommerl.models.ward import WARD
from sommerl.models.ward_duer import WARD_DUER
from sommerl.reflectance.half_diff import spherical

ELEVATIONS = np.radians([0, 30, 60, 80, 87, 89, 89.95])
PLACES = (0.0, 0.15, 0.4, 0.6, 0.8, 1.0)
FINER = {"rows": 160, "columns": 48}
TOLERANCE = 1e-3
# Of the families that promise nothing: a shape, and an elevation from which more comes back than came in.
GIVE_MORE = {"oren-nayar": ((0.2,), 89.0), "ward": ((0.5,), 89.95), "ward-duer": ((0.1,), 87.0)}

DISTRIBUTIONS = {
    "cook-torrance": cook_torrance.beckmann,
    "torrance-sparrow": torrance_sparrow.gaussian,
    "ggx": ggx.distribution,
}
KEEPING = [family for family in FAMILY_LIST if family.conserves_energy]
OTHERS = [family for family in FAMILY_LIST if not family.conserves_energy]


def albedos(family, shape, **resolution):
    return np.array([albedo(family, shape, elevation, **resolution) for elevation in ELEVATIONS])


def mirrors(family, places=PLACES):
    """Shapes over all of the bounds, of facets that reflect all."""
    return shapes(family, places, **{p.name: 1.0 for p in family.parameters if p.name == "f0"})


def check_covers(grid):
    """Integrals of one and of the cosine over the hemisphere."""
    wi, solid_angle = grid
    assert (wi[..., 2] > 0).all()
    assert solid_angle.sum() == pytest.approx(2 * np.pi, rel=1e-9)
    assert (solid_angle * wi[..., 2]).sum() == pytest.approx(np.pi, rel=1e-9)


@pytest.mark.parametrize("elevation", ELEVATIONS)
@pytest.mark.parametrize("width", [0.003, 0.3])
def test_grids_cover_the_hemisphere(elevation, width):
    x, _, z = spherical(elevation, 0.0)
    grids = [over_directions((side * x, 0.0, z), width) for side in (1, -1)]
    for wi, solid_angle in [over_half_vectors(elevation, width), *grids]:
        check_covers((wi, solid_angle))
        must_fail(check_covers, (wi, 1.001 * solid_angle))
        must_fail(check_covers, (wi[:, :-1], solid_angle[:, :-1]))


def check_resolved(family, shape, **resolution):
    """Kinks, of grooves and of lobes cut off, cost digits; the tolerance leaves room for that."""
    assert np.allclose(
        albedos(family, shape, **resolution), albedos(family, shape, **FINER), rtol=0, atol=TOLERANCE / 2
    )


@pytest.mark.parametrize("family", FAMILY_LIST, ids=label)
def test_grids_are_fine_enough(family):
    for shape in mirrors(family, (0.0, 0.5, 1.0)):
        check_resolved(family, shape)
    if family is not LAMBERTIAN:
        must_fail(lambda: check_resolved(family, mirrors(family)[0], rows=3, columns=3))


def check_independent_of_the_grid(brighter=1.0):
    """The same lobe by half vectors, and by directions about the mirror's."""
    for elevation in ELEVATIONS:
        wi, solid_angle = over_half_vectors(elevation, 0.1)
        wo = np.broadcast_to(spherical(elevation, 0.0), wi.shape)
        lobe = evaluated(PHONG, (50.0,), wi, wo)
        assert (lobe * wi[..., 2] * solid_angle).sum() == pytest.approx(
            brighter * albedo(PHONG, (50.0,), elevation), rel=1e-4
        )


def test_both_grids_agree():
    check_independent_of_the_grid()
    must_fail(check_independent_of_the_grid, 1.001)


def least(family, shape):
    """Of the light, from where a lobe is brightest. Lafortune's, leant away, may be as dark as one likes."""
    return 0.0 if family.name == "lafortune" and abs(shape[0]) > 1 else 0.2


def check_keeps_energy(found, least):
    assert (found >= 0).all()
    assert least < found.max() <= 1 + TOLERANCE


@pytest.mark.parametrize("family", KEEPING, ids=label)
def test_no_more_comes_back_than_came_in(family):
    for shape in mirrors(family):
        found = albedos(family, shape)
        check_keeps_energy(found, least(family, shape))
        for broken in (1.0021 / found.max(), 0.0, -1.0):
            must_fail(check_keeps_energy, broken * found, least(family, shape))


@pytest.mark.parametrize("family", [COOK_TORRANCE, TORRANCE_SPARROW, GGX], ids=label)
def test_masking_is_what_keeps_energy(family):
    def unmasked(a, shape, f0):
        """Broken on purpose: no facet hides another."""
        density = DISTRIBUTIONS[family.name]
        return density(a, shape) * fresnel(a.cos_d, f0) / (4 * a.cos_i * a.cos_o)

    for shape in (0.05, 0.2, 0.5):
        check_keeps_energy(albedos(family, (shape, 1.0)), 0.2)
        must_fail(check_keeps_energy, albedos(replace(family, lobe=unmasked), (shape, 1.0)), 0.2)


def check_gives_more(family, shape, degrees):
    assert albedo(family, shape, np.radians(degrees)) > 1 + TOLERANCE


@pytest.mark.parametrize("family", OTHERS, ids=label)
def test_families_that_do_not_promise_it_do_not_keep_energy(family):
    shape, degrees = GIVE_MORE[family.name]
    check_gives_more(family, shape, degrees)
    must_fail(check_gives_more, family, shape, 30.0)
    must_fail(check_gives_more, LAMBERTIAN, (), degrees)


def check_oren_nayar_at_grazing(sigma):
    """By hand: for θ_o = π/2, sin α tan β = tan θ_i, and the albedo is A + B / 2; 1.0152 where it is largest."""
    a, b = 1 - 0.5 * 0.2**2 / (0.2**2 + 0.33), 0.45 * 0.2**2 / (0.2**2 + 0.09)
    assert albedo(OREN_NAYAR, (sigma,), np.radians(89.99)) == pytest.approx(a + b / 2, abs=1e-4)


def test_what_oren_and_nayar_reflect_at_grazing_angles():
    check_oren_nayar_at_grazing(0.2)
    must_fail(check_oren_nayar_at_grazing, 0.25)


def check_ratio(wider):
    wi, wo = pairs()
    ward, duer = evaluated(WARD, (0.3,), wi, wo), evaluated(wider, (0.3,), wi, wo)
    assert np.allclose(duer * np.sqrt(wi[:, 2] * wo[:, 2]), ward, rtol=1e-12, atol=0)
    assert (duer >= ward).all()


def test_ward_duer_is_ward_over_the_root_of_the_cosines():
    check_ratio(WARD_DUER)
    must_fail(check_ratio, WARD)
    must_fail(check_ratio, scaled(WARD_DUER, 1.0001))


def check_darkens(family):
    """As the cosine does, as long as the lobe is narrower than the angle to the horizon."""
    for elevation in ELEVATIONS[:5]:
        assert albedo(family, (0.004,), elevation) == pytest.approx(np.cos(elevation), rel=2e-3)


def check_does_not_darken(family):
    for elevation in ELEVATIONS[:5]:
        assert albedo(family, (0.004,), elevation) == pytest.approx(1, rel=2e-3)


def test_ward_darkens_towards_grazing_angles_and_ward_duer_does_not():
    check_darkens(WARD)
    check_does_not_darken(WARD_DUER)
    must_fail(check_darkens, WARD_DUER)
    must_fail(check_does_not_darken, WARD)


def check_grows_without_bound(family, power):
    """As that power of 1 / cos θ_o, for wide lobes: closer to the horizon, the same lobe, ever brighter."""
    near, nearer = (albedo(family, (0.5,), np.pi / 2 - angle) for angle in (1e-4, 1e-5))
    assert np.log10(nearer / near) == pytest.approx(power, abs=0.02)


def test_both_of_wards_grow_without_bound_at_grazing_angles():
    check_grows_without_bound(WARD, 0.5)
    check_grows_without_bound(WARD_DUER, 1.0)
    must_fail(check_grows_without_bound, WARD, 0.0)
    must_fail(check_grows_without_bound, WARD_DUER, 0.5)
