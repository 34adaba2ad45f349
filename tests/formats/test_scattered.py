import numpy as np
import pytest
from helpers import moved_share, must_fail, nearest_held, random_directions

from sommerl import MERL, BrdfTable, Lattice, builtin
from sommerl.formats import scattered
from sommerl.formats.scattered import to_table
from sommerl.plots import coverage
from sommerl.reflectance.distance import table_metrics
from sommerl.reflectance.info import Counts
from sommerl.reflectance.samples import Samples
from sommerl.system.errors import FormatError, MissingDependencyError

A, B = (w[w[:, 2] > 0.1] for w in (random_directions(4000, s) for s in (1, 2)))
A, B = A[:3000], B[:3000]
FLIP = np.where((A[:, 0] * B[:, 1] > A[:, 1] * B[:, 0])[:, None], [1, -1, 1], [1, 1, 1])


def sampled(brdf, wi=A, wo=B):
    return Samples(wi, wo, brdf.eval(wi, wo))


def check_constant(table, value):
    wi, wo = random_directions(1000, 3), random_directions(1000, 4)
    assert np.allclose(table.eval(wi, wo), value, rtol=1e-6)


def test_a_lambertian_comes_back():
    table = to_table(Samples(A, B, np.full((len(A), 3), 0.2)), name="x")
    check_constant(table, 0.2)
    must_fail(check_constant, table, 0.22)
    assert table.facts["held_out_log_error_cosine"] < 1e-3


def check_near(source, table, worst):
    assert table_metrics(BrdfTable.sampled(source).values, table.values, MERL)["log_error_cosine"] < worst


def test_a_glossy_material_comes_back():
    source = builtin("red-fabric")
    table = to_table(sampled(source), name="x")
    check_near(source, table, 0.02)
    must_fail(check_near, source, to_table(sampled(builtin("beige-fabric")), name="x"), 0.02)
    assert np.allclose(table.eval(A, B), table.eval(B, A), rtol=1e-12)


def test_more_samples_are_better():
    source = builtin("blue-metallic-paint")
    errors = [to_table(sampled(source, A[:n], B[:n]), name="x").facts["held_out_log_error_cosine"] for n in (300, 3000)]
    assert errors[1] < errors[0]


def test_the_order_of_the_directions_does_not_matter():
    source = builtin("blue-metallic-paint")
    one, other = to_table(sampled(source), name="x"), to_table(sampled(source, B, A), name="x")
    assert np.allclose(one.values, other.values, rtol=1e-4, atol=1e-6)


def test_one_side_of_the_plane_of_incidence_stands_for_both():
    """SGD does not know one side from the other: the mirror images are right."""
    source = builtin("blue-metallic-paint")
    half = to_table(sampled(source, A * FLIP, B * FLIP), name="x")
    assert half.facts["mirrored"]
    assert not to_table(sampled(source), name="x").facts["mirrored"]
    mirrored = half.eval(A * [1, -1, 1], B * [1, -1, 1])
    assert np.abs(half.eval(A, B) - mirrored).mean() < 0.01 * mirrored.mean()
    check_near(source, half, 0.15)


def test_held_out_samples_tell_noise_from_data():
    source, noise = builtin("red-fabric"), np.random.default_rng(0).lognormal(sigma=0.3, size=(len(A), 1))
    noisy = to_table(Samples(A, B, source.eval(A, B) * noise), name="x")
    clean = to_table(sampled(source), name="x")
    assert noisy.facts["held_out_median_relative_error"] > 3 * clean.facts["held_out_median_relative_error"]


def test_what_was_not_measured_is_told(tmp_path):
    source = builtin("red-fabric")
    steep = (A[:, 2] > 0.7) & (B[:, 2] > 0.7)
    some = to_table(sampled(source, A[steep], B[steep]), name="x")
    every = to_table(sampled(source), name="x")
    assert every.facts["coverage"] > 0.97
    assert some.facts["coverage"] < 0.7
    cos_i, cos_o = MERL.cosines()
    assert not some.measured[(np.minimum(cos_i, cos_o) < 0.3) & MERL.above_horizon].any()
    coverage(some, tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_beyond_the_last_samples_no_energy_is_gained():
    """Mirror-like at 60° and no data beyond 70°: the table's albedo at 85° stays below 1."""
    source = builtin("purple-paint")
    inner = (A[:, 2] > 0.35) & (B[:, 2] > 0.35)
    table = to_table(sampled(source, A[inner], B[inner]), name="x")
    light = random_directions(200_000, 5)
    viewer = np.array([np.sin(1.48), 0, np.cos(1.48)])
    albedo = (table.eval(light, viewer) * light[:, 2:]).mean(axis=0) * 2 * np.pi
    assert (albedo < 1).all()


def test_a_lattice_that_is_not_reciprocal():
    lattice = Lattice(20, 20, 40, reciprocal=False)
    table = to_table(sampled(builtin("red-fabric")), name="x", lattice=lattice)
    assert table.lattice == lattice


def test_samples_at_the_horizon_are_left_out():
    level = A * [1, 1, 0] / np.linalg.norm(A[:, :2], axis=1)[:, None]
    source = builtin("red-fabric")
    extended = [
        np.concatenate(pair) for pair in ((A, level[:7]), (B, B[:7]), (source.eval(A, B), np.full((7, 3), 9.0)))
    ]
    table = to_table(Samples(*extended), name="x")
    assert table.facts["samples_at_the_horizon"] == 7
    assert np.array_equal(table.values, to_table(sampled(source), name="x").values)


def rotated(w, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]], axis=-1)


def test_the_same_pair_measured_again_counts_once():
    """Turned about the normal, or in the other order, as goniometers repeat them: errors stay honest."""
    source = builtin("purple-paint")
    wi, wo = A[:800], B[:800]
    once = to_table(sampled(source, wi, wo), name="x")
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    many_i = np.concatenate([rotated(wi, t) for t in turns] + [wo])
    many_o = np.concatenate([rotated(wo, t) for t in turns] + [wi])
    f_r = np.concatenate([source.eval(wi, wo)] * 9)
    again = to_table(Samples(many_i, many_o, f_r), name="x")
    assert again.facts["samples"] == once.facts["samples"] == 800
    key = "held_out_log_error_cosine"
    assert again.facts[key] == pytest.approx(once.facts[key], rel=0.5)
    assert np.abs(again.values - once.values).mean() < 1e-3 * once.values.mean()


def test_one_side_is_told_from_rounded_angles():
    source = builtin("blue-metallic-paint")
    steps = np.arange(0.1, 1.4, 0.1)
    theta_i, theta_o, phi = (x.ravel() for x in np.meshgrid(steps, steps, np.arange(7) * np.pi / 6))
    angles = np.stack([theta_i, 0 * phi, theta_o, phi], axis=-1)
    for digits in (9, 4):
        samples = Samples.at_angles(np.round(angles, digits), np.ones((len(angles), 3)))
        samples = Samples(samples.wi, samples.wo, source.eval(samples.wi, samples.wo))
        assert to_table(samples, name="x").facts["mirrored"]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda wi, wo, f: (wi[:31], wo[:31], f[:31]), "expected 32 to 2000000 samples, found 31"),
        (lambda wi, wo, f: (wi, wo, f * np.nan), "found NaN or infinity"),
        (lambda wi, wo, f: (wi * [1, 1, -1], wo, f), "expected directions above the horizon, found some below it"),
        (lambda wi, wo, f: (wi, wo, -f), "expected a positive reflectance"),
    ],
)
def test_bad_samples(change, sentence):
    with pytest.raises(FormatError, match=sentence):
        to_table(Samples(*change(A, B, np.ones((len(A), 3)))), name="x")


def test_scipy_is_asked_for_by_a_sentence(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr("sommerl.system.optional.importlib.import_module", missing)
    with pytest.raises(MissingDependencyError, match=r"install sommerl\[formats\]"):
        to_table(sampled(builtin("red-fabric")), name="x")


def check_counted(table, cells, energy):
    assert (table.counts.cells_clamped, table.counts.energy_clamped) == (cells, pytest.approx(energy, abs=1e-6))


def test_what_goes_below_zero_is_counted():
    above = int(MERL.above_horizon.sum())
    f_r = np.full((len(A), 3), 0.3)
    check_counted(to_table(Samples(A, B, f_r), name="x"), 0, 0)
    table = to_table(Samples(A, B, f_r * [1, 1, -0.5]), name="x")
    check_counted(table, above, moved_share([1, 1, -0.5]))
    assert np.allclose(table.values, 0.3 * nearest_held([1, 1, -0.5]))
    assert table.facts["samples_negative"] == len(A)
    must_fail(check_counted, table, 0, 0)
    few = np.where((A[:, 2] > 0.95)[:, None], -f_r, f_r)
    table = to_table(Samples(A, B, few), name="x")
    assert table.facts["samples_negative"] == (A[:, 2] > 0.95).sum()
    assert 0 < table.counts.cells_clamped < above / 2
    assert 0 < table.counts.energy_clamped < 0.2


@pytest.mark.parametrize("value", [1e39, -1e39, 1e308])
def test_what_is_too_large_for_single_precision_is_refused(value):
    f_r = np.full((len(A), 3), 0.3)
    f_r[7, 2] = value
    with pytest.raises(FormatError, match="expected values that single precision can hold in every sample"):
        to_table(Samples(A, B, f_r), name="x")


@pytest.mark.parametrize("value", [3e38, -3e38, 1e-45])
def test_the_largest_and_the_smallest_values(value):
    """Planes between them may leave single precision: that is counted."""
    f_r = np.full((len(A), 3), 0.3)
    f_r[::5, 2] = value
    table = to_table(Samples(A, B, f_r), name="x")
    assert np.isfinite(table.values).all()
    assert 0 < table.counts.energy_clamped <= 1


def check_both_sides(samples, mirrored, expected_wi):
    found, said = scattered._both_sides(samples)
    assert said is mirrored
    assert np.array_equal(found.wi, expected_wi)
    assert len(found.wo) == len(found.f_r) == len(expected_wi)


def test_mirror_images_by_hand():
    """Three pairs at azimuths 30°, 60° and 0: on one side of the plane of incidence, or in it. The mirror turns y."""

    def turned(*degrees):
        return np.array([[0.6 * np.cos(np.radians(d)), 0.6 * np.sin(np.radians(d)), 0.8] for d in degrees])

    wi, f_r = turned(0, 0, 0), np.ones((3, 3))
    one_side = Samples(wi, turned(30, 60, 0), f_r)
    check_both_sides(one_side, True, np.concatenate([wi, wi * [1, -1, 1]]))
    assert np.allclose(scattered._both_sides(one_side)[0].wo[3:], turned(-30, -60, 0))
    both = Samples(wi, turned(30, -60, 0), f_r)
    check_both_sides(both, False, wi)
    must_fail(check_both_sides, both, True, np.concatenate([wi, wi]))
    # Next to the normal, and within half a degree of the plane, there are no sides.
    check_both_sides(Samples(wi, turned(30, -0.4, 180.4), f_r), True, np.concatenate([wi, wi * [1, -1, 1]]))
    check_both_sides(Samples(wi * [0.01, 1, 1], turned(30, -60, 0), f_r), True, np.concatenate([wi * [0.01, 1, 1]] * 2))


def test_cells_and_energy_of_what_goes_below_zero_by_hand():
    """One channel at -1, of which the table holds nothing, whatever the weights of cells. Or nothing is moved."""
    lattice = Lattice(1, 2, 1)
    values = np.ones((1, 2, 1, 3))
    values[..., 0] = -1
    held = nearest_held([-1, 1, 1])
    moved = np.abs(held - [-1, 1, 1]).sum()
    found = scattered._changed(lattice, values, BrdfTable(values, lattice))
    assert (found.cells_clamped, found.energy_clamped) == (
        2,
        pytest.approx(moved / (held.sum() + moved)),
    )
    table = BrdfTable(np.ones((1, 2, 1, 3)), lattice)
    assert scattered._changed(lattice, np.ones((1, 2, 1, 3)), table) == Counts(0, 0.0, 0.0)


def check_height(found, by_hand):
    assert found == pytest.approx(by_hand, rel=1e-4)


def test_weights_of_neighbours_by_hand():
    """Pairs of neighbours at ±k/10 along one axis hold k, for k = 1 to 8: the plane is level, and its height the mean
    of k by the tricube weights (1 - (k/8)³)³.
    """
    k = np.arange(1, 9)
    known = np.zeros((16, 4))
    known[:, 0] = np.concatenate([k, -k]) / 10
    held = np.repeat(np.concatenate([k, k])[:, None], 3, axis=1).astype(float)
    height = scattered._planes(scattered._tree(known), known, held, np.zeros((1, 4)))[0, 0]
    weights = [0.994152, 0.953854, 0.849993, 0.669922, 0.431840, 0.193226, 0.035963, 0.0]
    check_height(height, sum(w * n for w, n in zip(weights, range(1, 9), strict=True)) / sum(weights))
    must_fail(check_height, height, 4.5)  # as without weights
