import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl import MERL, BrdfTable, builtin
from sommerl.compression.compact.search import CompactOptions, compress
from sommerl.formats import regression, scattered
from sommerl.formats.scattered import COVERAGE, fitted_to
from sommerl.plots import coverage
from sommerl.reflectance.distance import table_metrics
from sommerl.reflectance.samples import Samples
from sommerl.system.errors import FormatError, MissingDependencyError

A, B = (w[w[:, 2] > 0.1] for w in (random_directions(4000, s) for s in (1, 2)))
A, B = A[:3000], B[:3000]
FLIP = np.where((A[:, 0] * B[:, 1] > A[:, 1] * B[:, 0])[:, None], [1, -1, 1], [1, 1, 1])


def sampled(brdf, wi=A, wo=B):
    return Samples(wi, wo, brdf.eval(wi, wo))


def check_constant(table, value):
    wi, wo = random_directions(1000, 3), random_directions(1000, 4)
    wi, wo = (w[np.minimum(wi[:, 2], wo[:, 2]) > 0.1] for w in (wi, wo))  # where samples are
    off = np.abs(table.eval(wi, wo) / value - 1)
    assert off.mean() < 4e-3  # a constant, times cosines and under a cube root, is no straight line between nodes
    assert np.percentile(off, 99) < 0.02


def test_a_lambertian_comes_back():
    table = fitted_to(Samples(A, B, np.full((len(A), 3), 0.2)), name="x")
    check_constant(table, 0.2)
    must_fail(check_constant, table, 0.22)
    assert table.facts["held_out_log_error_cosine"] < 1e-3


def check_near(source, table, worst):
    assert table_metrics(BrdfTable.sampled(source).values, BrdfTable.of(table).values, MERL)["log_error_cosine"] < worst


def test_a_glossy_material_comes_back():
    source = builtin("red-fabric")
    table = fitted_to(sampled(source), name="x")
    check_near(source, table, 0.02)
    must_fail(check_near, source, fitted_to(sampled(builtin("beige-fabric")), name="x"), 0.02)
    assert np.allclose(table.eval(A, B), table.eval(B, A), rtol=1e-12)


def test_more_samples_are_better():
    source = builtin("blue-metallic-paint")
    errors = [
        fitted_to(sampled(source, A[:n], B[:n]), name="x").facts["held_out_log_error_cosine"] for n in (300, 3000)
    ]
    assert errors[1] < errors[0]


def test_the_order_of_the_directions_does_not_matter():
    source = builtin("blue-metallic-paint")
    one, other = fitted_to(sampled(source), name="x"), fitted_to(sampled(source, B, A), name="x")
    found = one.eval(A, B)
    assert np.abs(found - other.eval(A, B)).mean() < 1e-3 * found.mean()


def test_one_side_of_the_plane_of_incidence_stands_for_both():
    """SGD does not know one side from the other: the mirror images are right."""
    source = builtin("blue-metallic-paint")
    half = fitted_to(sampled(source, A * FLIP, B * FLIP), name="x")
    assert half.facts["mirrored"]
    assert not fitted_to(sampled(source), name="x").facts["mirrored"]
    mirrored = half.eval(A * [1, -1, 1], B * [1, -1, 1])
    assert np.abs(half.eval(A, B) - mirrored).mean() < 0.01 * mirrored.mean()
    check_near(source, half, 0.15)


def test_held_out_samples_tell_noise_from_data():
    source, noise = builtin("red-fabric"), np.random.default_rng(0).lognormal(sigma=0.3, size=(len(A), 1))
    noisy = fitted_to(Samples(A, B, source.eval(A, B) * noise), name="x")
    clean = fitted_to(sampled(source), name="x")
    assert noisy.facts["held_out_median_relative_error"] > 3 * clean.facts["held_out_median_relative_error"]


def test_what_was_not_measured_is_told(tmp_path):
    source = builtin("red-fabric")
    steep = (A[:, 2] > 0.7) & (B[:, 2] > 0.7)
    some = fitted_to(sampled(source, A[steep], B[steep]), name="x")
    every = fitted_to(sampled(source), name="x")
    assert every.facts["coverage"] > 0.97
    assert some.facts["coverage"] < 0.7
    cos_i, cos_o = COVERAGE.cosines()
    assert not some.measured[(np.minimum(cos_i, cos_o) < 0.3) & COVERAGE.above_horizon].any()
    coverage(some, tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_beyond_the_last_samples_no_energy_is_gained():
    """Mirror-like at 60° and no data beyond 70°: the table's albedo at 85° stays below 1."""
    source = builtin("purple-paint")
    inner = (A[:, 2] > 0.35) & (B[:, 2] > 0.35)
    table = fitted_to(sampled(source, A[inner], B[inner]), name="x")
    light = random_directions(200_000, 5)
    viewer = np.array([np.sin(1.48), 0, np.cos(1.48)])
    albedo = (table.eval(light, viewer) * light[:, 2:]).mean(axis=0) * 2 * np.pi
    assert (albedo < 1).all()


def test_samples_at_the_horizon_are_left_out():
    level = A * [1, 1, 0] / np.linalg.norm(A[:, :2], axis=1)[:, None]
    source = builtin("red-fabric")
    extended = [
        np.concatenate(pair) for pair in ((A, level[:7]), (B, B[:7]), (source.eval(A, B), np.full((7, 3), 9.0)))
    ]
    table = fitted_to(Samples(*extended), name="x")
    assert table.facts["samples_at_the_horizon"] == 7
    assert np.array_equal(table.node_values, fitted_to(sampled(source), name="x").node_values)


def rotated(w, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]], axis=-1)


def test_the_same_pair_measured_again_counts_once():
    """Turned about the normal, or in the other order, as goniometers repeat them: errors stay honest."""
    source = builtin("purple-paint")
    wi, wo = A[:800], B[:800]
    once = fitted_to(sampled(source, wi, wo), name="x")
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    many_i = np.concatenate([rotated(wi, t) for t in turns] + [wo])
    many_o = np.concatenate([rotated(wo, t) for t in turns] + [wi])
    f_r = np.concatenate([source.eval(wi, wo)] * 9)
    again = fitted_to(Samples(many_i, many_o, f_r), name="x")
    assert again.facts["samples"] == once.facts["samples"] == 800
    key = "held_out_log_error_cosine"
    assert again.facts[key] == pytest.approx(once.facts[key], rel=0.5)
    assert again.facts["samples_merged"] == 8 * 800
    found = once.eval(A, B)
    assert np.abs(again.eval(A, B) - found).mean() < 0.01 * found.mean()


def test_one_side_is_told_from_rounded_angles():
    source = builtin("blue-metallic-paint")
    steps = np.arange(0.1, 1.4, 0.1)
    theta_i, theta_o, phi = (x.ravel() for x in np.meshgrid(steps, steps, np.arange(7) * np.pi / 6))
    angles = np.stack([theta_i, 0 * phi, theta_o, phi], axis=-1)
    for digits in (9, 4):
        samples = Samples.at_angles(np.round(angles, digits), np.ones((len(angles), 3)))
        samples = Samples(samples.wi, samples.wo, source.eval(samples.wi, samples.wo))
        assert fitted_to(samples, name="x").facts["mirrored"]


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
        fitted_to(Samples(*change(A, B, np.ones((len(A), 3)))), name="x")


def test_scipy_is_asked_for_by_a_sentence(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr("sommerl.system.optional.importlib.import_module", missing)
    with pytest.raises(MissingDependencyError, match=r"pip install 'sommerl\[lab\]'"):
        fitted_to(sampled(builtin("red-fabric")), name="x")


def check_kept(table, value):
    found = table.eval(A[:500], B[:500])
    assert np.abs(found / value - 1).mean() < 2e-3


def test_what_is_below_zero_is_kept_and_told():
    """As tables cannot hold it, it is changed and counted where a table is made."""
    value = 0.3 * np.array([1, 1, -0.5])
    table = fitted_to(Samples(A, B, np.tile(value, (len(A), 1))), name="x")
    check_kept(table, value)
    must_fail(check_kept, table, np.abs(value))
    assert table.signed
    assert table.facts["samples_negative"] == len(A)
    assert BrdfTable.of(table).counts.cells_clamped == MERL.above_horizon.sum()


@pytest.mark.parametrize("value", [1e39, -1e39, 1e308])
def test_what_is_too_large_for_single_precision_is_refused(value):
    f_r = np.full((len(A), 3), 0.3)
    f_r[7, 2] = value
    with pytest.raises(FormatError, match="expected values that single precision can hold in every sample"):
        fitted_to(Samples(A, B, f_r), name="x")


def check_both_sides(samples, mirrored, expected_wi):
    found, said = scattered.both_sides(samples)
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
    assert np.allclose(scattered.both_sides(one_side)[0].wo[3:], turned(-30, -60, 0))
    both = Samples(wi, turned(30, -60, 0), f_r)
    check_both_sides(both, False, wi)
    must_fail(check_both_sides, both, True, np.concatenate([wi, wi]))
    # Next to the normal, and within half a degree of the plane, there are no sides.
    check_both_sides(Samples(wi, turned(30, -0.4, 180.4), f_r), True, np.concatenate([wi, wi * [1, -1, 1]]))
    check_both_sides(Samples(wi * [0.01, 1, 1], turned(30, -60, 0), f_r), True, np.concatenate([wi * [0.01, 1, 1]] * 2))


def check_height(found, by_hand):
    assert found == pytest.approx(by_hand, rel=1e-4)


def test_weights_of_neighbours_by_hand():
    """Pairs of neighbours at ±k/10 along one axis hold k, for k = 1 to 8: the plane is level, and its height the mean
    of k by the weights (1 - (k/8)³)³ / ((k/8)² + 1/100).
    """
    k = np.arange(1, 9)
    known = np.zeros((16, 4))
    known[:, 0] = np.concatenate([k, -k]) / 10
    held = np.repeat(np.concatenate([k, k])[:, None], 3, axis=1).astype(float)
    height = regression.planes(regression.tree(known), known, held, np.zeros((1, 4)))[0, 0]
    weights = [38.796178, 13.156601, 5.643107, 2.576623, 1.077916, 0.337512, 0.046366, 0.000000]
    check_height(height, sum(w * n for w, n in zip(weights, range(1, 9), strict=True)) / sum(weights))
    must_fail(check_height, height, 4.5)  # as without weights


def retro(wi, wo):
    """0.2/π + 10 exp(−α² / (2 (2°)²)), α between wi and wo: made up, and brightest where light comes back."""
    angle = 2 * np.arcsin(np.linalg.norm(wi - wo, axis=-1) / 2)
    return np.repeat((0.2 / np.pi + 10 * np.exp(-(angle**2) / 2 / np.radians(2) ** 2))[:, None], 3, axis=-1)


def about_retro():
    """Directions every degree about those of the light, every 10° of its elevation, and every 10° elsewhere."""
    near = [(x, y) for x in np.arange(-6, 7) for y in np.arange(-6, 7)]
    far = [(x, y) for x in np.arange(-140, 141, 10) for y in np.arange(-90, 91, 10)]
    rows = []
    for theta_i in np.arange(0, 76, 15.0):
        x, y = np.array(near + far).T
        x = x + theta_i
        theta_o = np.hypot(x, y)
        row = np.stack([np.full(len(x), theta_i), 0 * x, theta_o, np.degrees(np.arctan2(y, x))], axis=-1)
        rows.append(row[theta_o < 80])
    found = Samples.at_angles(np.radians(np.concatenate(rows)), np.zeros((sum(map(len, rows)), 3)))
    return Samples(found.wi, found.wo, retro(found.wi, found.wo))


def check_peaks(brdf, theta):
    w = np.stack([np.sin(np.radians(theta)), 0 * theta, np.cos(np.radians(theta))], axis=-1)
    assert np.allclose(brdf.eval(w, w), retro(w, w), rtol=0.05)


def test_retro_reflection_keeps_its_peak():
    """Where it was measured, and half-way between two lines of incidence; and in 2,700 bytes."""
    brdf = fitted_to(about_retro(), name="tape")
    check_peaks(brdf, np.arange(0, 76, 7.5))
    material, report = compress(brdf, CompactOptions(target_size=2700, effort=1))
    assert report.tried[-1][0] <= 2700
    check_peaks(material, np.arange(0, 76, 15.0))
    must_fail(check_peaks, BrdfTable.of(brdf), np.arange(0, 76, 15.0))  # whose cells are 1° wide in θ_d


def misaligned(wi, wo):
    """A highlight of 2° that is 1° off the mirror's direction, to the side of the normal."""
    theta = np.arctan2(np.hypot(wi[:, 0], wi[:, 1]), wi[:, 2]) - np.radians(1)
    phi = np.arctan2(wi[:, 1], wi[:, 0]) + np.pi
    peak = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    angle = np.linalg.norm(wo - peak, axis=-1)
    return np.repeat((0.1 + 10 * np.exp(-(angle**2) / 2 / np.radians(2) ** 2))[:, None], 3, axis=-1)


def test_what_is_not_reciprocal_is_kept_apart():
    rows = [
        (theta_i, 0, np.hypot(x, y), np.degrees(np.arctan2(y, x)))
        for theta_i in (15.0, 30.0, 45.0, 60.0)
        for x in (*(-theta_i + np.arange(-6, 7)), *np.arange(-75, 76, 15))
        for y in (*np.arange(-6, 7), -60, -45, -30, -15, 15, 30, 45, 60)
        if np.hypot(x, y) < 80
    ]
    found = Samples.at_angles(np.radians(rows), np.zeros((len(rows), 3)))
    samples = Samples(found.wi, found.wo, misaligned(found.wi, found.wo))
    brdf = fitted_to(samples, name="x")
    assert brdf.facts["one_sided"]
    assert not brdf.reciprocal
    bright = samples.f_r[:, 0] > 5
    assert np.allclose(brdf.eval(samples.wi[bright], samples.wo[bright]), samples.f_r[bright], rtol=0.05)
