"""What is reported of a material, against numbers that are worked out by hand, and by no function of the package."""

from math import e, sqrt

import numpy as np
import pytest
from helpers import compact_material, complaint, must_fail

from sommerl import BrdfTable, Lattice, TrainOptions, train
from sommerl.compression.compact.search import CompactOptions
from sommerl.compression.smrl.file import LONGEST_FILE
from sommerl.formats import held_out as left_out
from sommerl.formats.scattered import fitted_to
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.distance import asymmetry, table_metrics
from sommerl.reflectance.nodes import NodeLattice
from sommerl.reflectance.origin import check_chain
from sommerl.reflectance.samples import Samples
from sommerl.system.errors import OptionError

# Two cells, θ_h = 22.5° and φ_d = 90°: cos θ_i = cos θ_o = cos θ_h cos θ_d. At θ_d = 22.5° and 67.5°, sin θ_d cos θ_d
# is the same, and what is left of the weights is cos² θ_d: (2 + √2) / 4 = 0.853553 and (2 - √2) / 4 = 0.146447.
IN_THETA_D, WEIGHTS_D = Lattice(1, 2, 1), (0.853553, 0.146447)
# Two cells, θ_d = 45° and φ_d = 90°, at θ_h = 90°/16 = 5.625° and 9 · 90°/16 = 50.625°. Weights are
# sin θ_h √θ_h cos² θ_h: 0.098017 · 1 · 0.990393 = 0.097075 and 0.773010 · 3 · 0.402455 = 0.933305, of their sum
# 0.094213 and 0.905787.
IN_THETA_H, WEIGHTS_H = Lattice(2, 1, 1), (0.094213, 0.905787)
BLACK = 0.099  # whose logarithm is that of 0.1, with the floor of 0.001
BRIGHTER = 0.1 * e - 0.001  # and this one's is greater by 1


def check(found, by_hand, rel=1e-5):
    assert found == pytest.approx(by_hand, rel=rel)


@pytest.mark.parametrize(("lattice", "weights"), [(IN_THETA_D, WEIGHTS_D), (IN_THETA_H, WEIGHTS_H)])
@pytest.mark.parametrize("changed", [0, 1])
def test_log_error(lattice, weights, changed):
    """The logarithm differs by 1 in one cell: the error is the root of that cell's weight."""
    one, other = np.full((2, *lattice.shape, 3), BLACK)
    other.reshape(2, 3)[changed] = BRIGHTER
    error = table_metrics(one, other, lattice)["log_error_cosine"]
    check(error, sqrt(weights[changed]))
    must_fail(check, error, sqrt(0.5))  # as without solid angles and cosines
    other.reshape(2, 3)[changed, :2] = BLACK  # in one of three channels
    check(table_metrics(one, other, lattice)["log_error_cosine"], sqrt(weights[changed] / 3))


def test_rmse_and_relative_error():
    """Differences 3 and 4 among six numbers: √(25 / 6). Of a reference of length 13, 5 / 13."""
    one, other = np.zeros((2, *IN_THETA_D.shape, 3))
    one.reshape(6)[:3] = 3, 4, 12
    other.reshape(6)[:] = 3, 4, 9, 0, 4, 0
    found = table_metrics(one, other, IN_THETA_D)
    check(found["rmse"], sqrt(25 / 6))
    check(found["relative_error"], 5 / 13)
    must_fail(check, found["relative_error"], 5 / sqrt(3**2 + 4**2 + 9**2 + 4**2))  # of the candidate's length


def test_cells_and_energy_clamped():
    """One cell of two holds -1, NaN and 3. Its luminance, NaN counted as 0, is 0.004: that of a blue of 0.004 / 0.0722,
    0.055402, which it becomes. Of 3 · 0.853553 + 4 · 0.146447, to which NaN adds nothing, (1 + 2.944598) · 0.146447 are
    moved."""
    table = BrdfTable([[[[1, 1, 1]], [[-1, np.nan, 3]]]], IN_THETA_D)
    assert table.counts.cells_clamped == 1
    check(table.counts.energy_clamped, 0.183595)
    must_fail(check, table.counts.energy_clamped, 3.944598 / 7)  # as without weights


def test_asymmetry():
    """f(a, b) = cos θ_a. Drawn by the cosine, both cosines have the density 2x: their greater is 4/5 in the mean, their
    lesser 8/15, and the mean of both 2/3. So the asymmetry is (4/5 - 8/15) / (2/3) = 2/5."""
    found = asymmetry(lambda wi, wo: (wi[2], 0 * wi[2], 2 * wi[2]))
    check(found, 0.4, rel=0.01)
    must_fail(check, found, 2 / 3, 0.01)  # as without the cosines: (2/3 - 1/3) / (1/2)
    assert asymmetry(lambda wi, wo: (0 * wi[2],) * 3) == 0


def about_the_normal(count, within):
    """Directions within an angle of the normal."""
    random = np.random.default_rng(0)
    theta, phi = within * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def test_coverage():
    """Samples at the normal alone cover what is within r = 10° of it in (θ_h, θ_d, φ_d).

    For small angles, a = h + d and b = h - d, so that dω_a dω_b = 4 dω_h dω_d, and the ball in (h, d) has the volume
    π² r⁴ / 2: of ∬ cos cos dω dω = π², it is 2 r⁴ = 0.001856. On the lattice where that is looked at, whose rows are
    at 90° ((i + ½) / 36)² and columns at 3° (j + ½), the ball holds 12, 11 and 10 rows at 1.5°, 4.5° and 7.5°, with 60
    cells in φ_d each: 1980 of 48,758 above the horizon.
    """
    wi = about_the_normal(80, 1e-3)
    table = fitted_to(Samples(wi, np.roll(wi, 1, axis=0), np.full((80, 3), 0.3)), name="x")
    check(table.facts["coverage"], 2 * (10 * np.pi / 180) ** 4, 0.05)
    must_fail(check, table.facts["coverage"], 1980 / 48758, 0.05)  # as a share of the cells


def held_out(count):
    """Which samples are held out: every tenth of an order that a bit generator's raw output gives."""
    return np.argsort(np.random.PCG64(0).random_raw(count))[::10]


def test_held_out_errors():
    """All samples hold one value but for six in ten of those held out, whose logarithm is greater by 1.

    The others say that value everywhere. So the squared error of the logarithm is the share of those six tenths in the
    sum of cos θ_i cos θ_o; and the median of the relative error is that of one of them.
    """
    random = np.random.default_rng(1)
    wi, wo = (v / np.linalg.norm(v, axis=1)[:, None] for v in np.abs(random.standard_normal((2, 400, 3))) + 0.05)
    wi[::2, 1] *= -1
    weight, tested = wi[:, 2] * wo[:, 2], held_out(400)
    changed = tested[np.argsort(weight[tested])[16:]]
    f_r = np.full((400, 3), BLACK)
    f_r[changed] = BRIGHTER
    facts = fitted_to(Samples(wi, wo, f_r), name="x").facts
    check(facts["held_out_log_error_cosine"], sqrt(weight[changed].sum() / weight[tested].sum()))
    must_fail(check, facts["held_out_log_error_cosine"], sqrt(24 / 40))  # as without the cosines
    check(facts["held_out_median_relative_error"], (BRIGHTER - BLACK) / BRIGHTER)
    must_fail(check, facts["held_out_median_relative_error"], (BRIGHTER - BLACK) / BLACK)
    assert len(tested) == len(wi) / left_out.HELD_OUT


def test_quantisation_error():
    """One unit, two cells at 1 and ½ of the largest value, and steps that float32 rounds away: the weight stays on one
    of the cells, and is √(3 · ¼) = 0.866025 from the other; in the mean of both, 0.433013."""
    table = BrdfTable([[[[4.0] * 3], [[2.0] * 3]]], IN_THETA_D)
    _, report = train(table, TrainOptions(clusters=1, epochs=3, alpha=1e-30))
    check(report.quantisation_error, [0.433013] * 3)
    must_fail(check, report.quantisation_error, [4 * 0.433013] * 3)  # in 1/sr
    assert (report.units_dropped, report.cells_clamped, report.energy_clamped) == (0, 0, 0)


@pytest.mark.parametrize("seed", range(6))
def test_units_dropped(seed):
    """Two units, two cells, and a neighbourhood so wide that the first step takes both units to the first cell.

    From then on both are equally far from everything, and unit 0 wins. If it won the first time, too, being the nearer
    one, unit 1 has never won. Unit 0 starts on the cell whose second random number is the smallest.
    """
    table = BrdfTable([[[[4.0] * 3], [[2.0] * 3]]], IN_THETA_D)
    options = TrainOptions(clusters=2, epochs=1, seed=seed, alpha=1.0, radius=1000.0, order="table")
    raw = np.random.PCG64(seed).random_raw(4)
    by_hand = 1 if raw[2] < raw[3] else 0
    material, report = train(table, options)
    check_dropped(material, report, by_hand)
    must_fail(check_dropped, material, report, 1 - by_hand)


def check_dropped(material, report, by_hand):
    assert (report.units_dropped, material.clusters) == (by_hand, 2 - by_hand)


def test_bytes_of_nodes():
    """Three rows in two bands. Row 0 has 2 × 2 nodes, rows 1 and 2 have 2 × 1: 8 nodes. 2 gains, 3 shapes.

    Memory: two entries of 2 bytes a node, 32; shapes, 3 · 24; gains, 2 · 8; scale, 8. The lattice: rows' first nodes,
    3 · 8; their places and bands, 3 each; rows below, 180; for both bands and both axes, 180 bytes of nodes below and
    181 of places; numbers of nodes in φ_d, 2. As the paper counts: 4 bytes a node, 24 an entry.
    """
    lattice = NodeLattice((0, 30, 180), (0, 1, 1), ((0, 180), (0, 180)), ((0, 90), (0,)))
    material = compact_material(lattice, 2, 3)
    by_hand = (32 + 72 + 16 + 8) + (24 + 3 + 3 + 180 + 4 * (180 + 181) + 2)
    check_bytes(material, by_hand, 4 * 8 + 24 * 5)
    must_fail(check_bytes, material, by_hand + 8, 152)


def check_bytes(material, memory, paper):
    assert (material.bytes_memory, material.bytes_paper) == (memory, paper)


def check_longest(bytes_):
    assert bytes_ == LONGEST_FILE


def test_no_file_is_longer():
    """2 · 2²² + 24 · 2¹⁶ + 2²⁰ = 8,388,608 + 1,572,864 + 1,048,576, as docs/format.md says."""
    check_longest(11_010_048)
    must_fail(check_longest, 11_010_049)


class Even(Brdf):
    """1 everywhere, also where it has no say."""

    name = "even"

    def f_r(self, wi, wo, buffers):
        one = 0 * wi[2] + 1
        return one, one, one


def check_seen(wi, wo, value):
    assert Even().eval(wi, wo).tolist() == [value] * 3


def test_the_horizon_itself_is_dark():
    level, up = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]
    check_seen(up, up, 1)
    must_fail(check_seen, up, up, 0)
    for wi, wo in ((up, level), (level, up), (level, level)):
        check_seen(wi, wo, 0)


@pytest.mark.parametrize("psnr", [20, 50.0, 80])
def test_targets_within_their_bounds(psnr):
    assert CompactOptions(target_psnr=psnr).target_psnr == psnr
    for bad in (19.9, 80.1):
        with pytest.raises(OptionError, match=f"target_psnr: expected 20 to 80, found {bad}"):
            CompactOptions(target_psnr=bad)
    with pytest.raises(OptionError, match="seed: expected 0 to 18446744073709551615, found -1"):
        CompactOptions(seed=-1)


def chain(links):
    """So many sources, the first without its SHA-256, which is in the file's head."""
    return [{"kind": "som-man", "name": "x"}, *[{"kind": "som-man", "name": "y", "sha256": ""}] * (links - 1)]


def check_links(links, sentence=None):
    assert complaint(check_chain, chain(links)) == sentence


def test_chains_have_1_to_8_links():
    check_links(1)
    check_links(8)
    check_links(9, "made_from: expected a list of 1 to 8 sources, found something else")
    must_fail(check_links, 9)
