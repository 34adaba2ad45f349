import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import directions, half_diff, phi_d_range


def by_rotation(wi, wo):
    """Rusinkiewicz's definition: rotate the half vector onto the normal, and look where the light went."""
    h = (wi + wo) / np.linalg.norm(wi + wo)
    theta_h, phi_h = np.arccos(h[2]), np.arctan2(h[1], h[0])
    c, s = np.cos(-phi_h), np.sin(-phi_h)
    about_normal = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(-theta_h), np.sin(-theta_h)
    about_binormal = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    d = about_binormal @ about_normal @ wi
    return theta_h, np.arccos(d[2]), np.arctan2(d[1], d[0]) % (2 * np.pi)


def check_definition(function):
    wi, wo = random_directions(500, 1), random_directions(500, 2)
    expected = np.array([by_rotation(a, b) for a, b in zip(wi, wo, strict=True)]).T
    for found, wanted in zip(function(split(wi), split(wo), reciprocal=False), expected, strict=True):
        assert np.allclose(found, wanted, atol=1e-9)


def test_agrees_with_the_definition_by_rotations():
    check_definition(half_diff)


def test_that_check_notices_a_swapped_pair_and_a_mirrored_angle():
    def mirrored(wi, wo, reciprocal):
        theta_h, theta_d, phi_d = half_diff(wi, wo, reciprocal)
        return theta_h, theta_d, 2 * np.pi - phi_d

    must_fail(check_definition, lambda wi, wo, reciprocal: half_diff(wo, wi, reciprocal))
    must_fail(check_definition, mirrored)


def test_round_trip_over_all_angles():
    angles = np.meshgrid(np.linspace(0.01, 1.5, 20), np.linspace(0.01, 1.5, 20), np.linspace(0.01, 3.1, 20))
    for found, given in zip(half_diff(*directions(*angles)), angles, strict=True):
        assert np.allclose(found, given, atol=1e-9)


def test_directions_are_unit_vectors():
    for w in directions(np.array([0.3]), np.array([1.1]), np.array([2.0])):
        assert sum(c**2 for c in w)[0] == pytest.approx(1)


def check_reciprocity(function):
    wi, wo = random_directions(100_000, 3), random_directions(100_000, 4)
    wi[:100, 1] = wo[:100, 1] = 0  # in the plane of incidence, where φ_d is 0 or π
    wi[100:200] = wo[100:200] * [-1, -1, 1]  # mirror directions, where φ_d says nothing
    for one, other in zip(function(split(wi), split(wo)), function(split(wo), split(wi)), strict=True):
        assert np.array_equal(one, other)


def test_both_orders_give_the_same_bits():
    check_reciprocity(half_diff)


def test_that_check_notices_unfolded_angles_and_folding_after_the_arctangent():
    def folded_late(wi, wo):
        theta_h, theta_d, phi_d = half_diff(wi, wo, reciprocal=False)
        return theta_h, theta_d, np.where(phi_d >= np.pi, phi_d - np.pi, phi_d)

    must_fail(check_reciprocity, lambda wi, wo: half_diff(wi, wo, reciprocal=False))
    must_fail(check_reciprocity, folded_late)


def check_mirror_symmetry(function):
    wi, wo = random_directions(100_000, 3), random_directions(100_000, 4)
    wi[:100, 1] = wo[:100, 1] = 0  # in the plane of the mirror
    wi[100:200] = wo[100:200] * [-1, -1, 1]
    mirror = [1, -1, 1]
    for one, other in zip(
        function(split(wi), split(wo)), function(split(wi * mirror), split(wo * mirror)), strict=True
    ):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("reciprocal", [False, True])
def test_mirror_images_give_the_same_bits(reciprocal):
    check_mirror_symmetry(lambda wi, wo: half_diff(wi, wo, reciprocal, mirrored=True))
    must_fail(check_mirror_symmetry, lambda wi, wo: half_diff(wi, wo, reciprocal))


def test_both_orders_give_the_same_bits_of_what_is_mirrored():
    check_reciprocity(lambda wi, wo: half_diff(wi, wo, mirrored=True))
    must_fail(check_reciprocity, lambda wi, wo: half_diff(wi, wo, reciprocal=False, mirrored=True))


def check_folds(function):
    """Each fold takes φ_d to where the angle without folds goes."""
    wi, wo = split(random_directions(10_000, 9)), split(random_directions(10_000, 10))
    whole = half_diff(wi, wo, False)[2]
    turned, back = whole % np.pi, np.minimum(whole, 2 * np.pi - whole)
    for folds, wanted in (
        ((True, False), turned),
        ((False, True), back),
        ((True, True), np.minimum(turned, np.pi - turned)),
    ):
        found = function(wi, wo, *folds)[2]
        assert np.allclose(found, wanted, atol=1e-9)
        assert 0 <= found.min() <= 1e-2
        assert phi_d_range(*folds) - 1e-2 <= found.max() <= phi_d_range(*folds)


def test_folds():
    check_folds(half_diff)
    must_fail(check_folds, lambda wi, wo, reciprocal, mirrored: half_diff(wi, wo, reciprocal))
    must_fail(check_folds, lambda wi, wo, reciprocal, mirrored: half_diff(wi, wo, mirrored, reciprocal))


def test_swapping_adds_pi_when_not_folded():
    wi, wo = split(random_directions(1000, 5)), split(random_directions(1000, 6))
    one, other = half_diff(wi, wo, reciprocal=False)[2], half_diff(wo, wi, reciprocal=False)[2]
    assert np.allclose(np.abs(one - other), np.pi)


def test_ranges_and_the_pole():
    wi, wo = random_directions(10_000, 7), random_directions(10_000, 8)
    theta_h, theta_d, phi_d = half_diff(split(wi), split(wo))
    assert theta_h.min() >= 0
    assert theta_h.max() <= np.pi / 2
    assert theta_d.min() >= 0
    assert theta_d.max() <= np.pi / 2
    assert phi_d.min() >= 0
    assert phi_d.max() <= np.pi
    up = np.array([[0.0, 0.0, 1.0]])
    assert [float(angle[0]) for angle in half_diff(split(up), split(up))] == [0, 0, 0]


def test_keeps_its_digits_in_the_highlight():
    """An arccosine would give 0 or 1.5e-8 here."""
    wi, wo = directions(np.array([1e-9]), np.array([0.5]), np.array([1.0]))
    assert half_diff(wi, wo)[0][0] == pytest.approx(1e-9, rel=1e-6)
