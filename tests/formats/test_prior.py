"""Materials of few samples, and where to measure these."""

import csv
import json

import numpy as np
import pytest
from helpers import must_fail, run, run_json

from sommerl import builtin, load
from sommerl.formats.compared import compared
from sommerl.formats.prior import DEVIATIONS, LATTICE, SMALL, STAND_INS, Prior, sampled, shipped, stand_ins
from sommerl.formats.reading import Reading, reading
from sommerl.formats.scattered import ScatteredBrdf, from_samples
from sommerl.reflectance.arrays import split
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.grid import GridBrdf
from sommerl.reflectance.half_diff import directions, half_diff
from sommerl.reflectance.samples import Samples
from sommerl.system.errors import FormatError

FABRIC = builtin("red-fabric")  # of another kind than the prior's materials, and so never seen by it


def at(angles, brdf: Brdf = FABRIC):
    found = Samples.at_angles(angles, np.zeros((len(angles), 3)))
    return Samples(found.wi, found.wo, brdf.eval(found.wi, found.wo))


PLANNED = shipped().plan(16)


def cells(lattice):
    return tuple(np.stack(w, axis=-1) for w in directions(*(a[lattice.above_horizon] for a in lattice.angles())))


COSINES = np.prod(DEVIATIONS.cosines(), axis=0)[DEVIATIONS.above_horizon]
WEIGHT = DEVIATIONS.solid_angles()[DEVIATIONS.above_horizon] * COSINES


def log_errors(brdf, true=FABRIC):
    wi, wo = cells(DEVIATIONS)
    said, wanted = (np.log(np.maximum(each.eval(wi, wo), 0) * COSINES[:, None] + SMALL) for each in (brdf, true))
    return (said - wanted).mean(axis=1)


def check_near(brdf, most):
    assert np.sqrt(np.average(log_errors(brdf) ** 2, weights=WEIGHT)) < most


def test_the_file_is_small_and_says_its_licence():
    assert len(STAND_INS.read_bytes()) <= 500_000
    assert "MIT License" in (STAND_INS.parent / "LICENSE").read_text()


def test_sixteen_planned_samples_make_a_material():
    """It is nearer than what one known material, or the same samples in another order, say."""
    planned = at(PLANNED)
    check_near(shipped().estimate(planned), 0.15)
    shuffled = Samples(planned.wi, planned.wo, planned.f_r[::-1])
    must_fail(check_near, shipped().estimate(shuffled), 0.15)


def check_passes(estimate, samples):
    assert np.median(np.abs(estimate.eval(samples.wi, samples.wo) / samples.f_r - 1)) < 0.03


def test_samples_are_kept():
    samples = at(PLANNED)
    estimate = shipped().estimate(samples)
    check_passes(estimate, samples)
    must_fail(check_passes, estimate, Samples(samples.wi, samples.wo, 1.1 * samples.f_r))


def check_surer(estimate, other):
    above = DEVIATIONS.above_horizon
    assert (estimate.deviation[above] <= other.deviation[above] + 1e-6).all()
    assert estimate.deviation[above].mean() < 0.9 * other.deviation[above].mean()


def test_more_samples_are_surer():
    some, all_of_them = shipped().estimate(at(PLANNED[:8])), shipped().estimate(at(PLANNED))
    check_surer(all_of_them, some)
    must_fail(check_surer, some, all_of_them)
    assert np.isnan(some.deviation[~DEVIATIONS.above_horizon]).all()
    wi, wo = cells(DEVIATIONS)
    assert np.allclose(some.deviation_at(wi, wo), some.deviation[DEVIATIONS.above_horizon])


def check_calibrated(errors, deviations):
    """Errors are as large as is said, in the mean square, as far as ten materials can tell."""
    assert 0.6 < np.sqrt(np.mean((errors / deviations) ** 2)) < 1.6


def test_errors_are_as_large_as_is_said():
    """Of materials that the prior has not seen. A hundred of them give 0.96 to 1.07 (benchmarks/few_samples.py)."""
    materials = [brdf for _, brdf in sorted(stand_ins().items())]
    prior = Prior(np.stack([sampled(brdf) for brdf in materials[::4]]))
    plan = prior.plan(16)
    errors, deviations = [], []
    for brdf in materials[1::10]:
        estimate = prior.estimate(at(plan, brdf))
        errors.append(log_errors(estimate, brdf))
        deviations.append(estimate.deviation[DEVIATIONS.above_horizon])
    by_weight = np.sqrt(WEIGHT / WEIGHT.mean())
    errors, deviations = by_weight * np.array(errors), np.array(deviations)
    check_calibrated(errors, deviations)
    must_fail(check_calibrated, errors, deviations / 2)
    must_fail(check_calibrated, errors, deviations * 2)


def test_planned_samples_are_better_than_others():
    above = LATTICE.above_horizon
    wi, wo = cells(LATTICE)
    chosen = np.random.default_rng(0).choice(int(above.sum()), 16, replace=False)
    drawn = Samples(wi[chosen], wo[chosen], FABRIC.eval(wi[chosen], wo[chosen]))

    def check_less_variance(estimate, other):
        one, two = ((WEIGHT * each.deviation[DEVIATIONS.above_horizon] ** 2).sum() for each in (estimate, other))
        assert one < 0.8 * two

    planned, random = shipped().estimate(at(PLANNED)), shipped().estimate(drawn)
    check_less_variance(planned, random)
    must_fail(check_less_variance, random, planned)


def test_plans_can_be_measured():
    """Neither direction is near the horizon, they do not stand before one another, and no pair comes twice."""
    assert (PLANNED[:, [0, 2]] <= np.radians(80) + 1e-9).all()
    samples = at(PLANNED)
    assert (np.sum(samples.wi * samples.wo, axis=1) <= np.cos(np.radians(5))).all()
    assert len(np.unique(PLANNED, axis=0)) == 16
    assert np.array_equal(shipped().plan(10), PLANNED[:10])


@pytest.mark.parametrize("channels", [1, 5])
def test_any_number_of_channels(channels):
    """Grey stays grey, and a channel says the same among others that are equal to it."""
    grey = at(PLANNED).f_r[:, :1]
    samples = at(PLANNED)
    prior = Prior(np.random.default_rng(0).uniform(0.1, 1.0, (6, channels, int(LATTICE.above_horizon.sum()))))
    logs, _ = prior._posterior(prior._brightness, _places(samples), np.repeat(grey, channels, axis=1))
    assert logs.shape == (channels, int(LATTICE.above_horizon.sum()))
    assert np.allclose(logs, logs[:1], rtol=0, atol=1e-6)  # products are of single precision


def _places(samples):
    return half_diff(split(samples.wi), split(samples.wo))


def test_it_is_used_where_it_is_asked_for_alone():
    few = at(PLANNED)
    with pytest.raises(FormatError, match="--prior estimates a material of 10 to 1500"):
        from_samples(few, name="x")
    theta = np.radians(np.arange(0, 81, 4.0))
    grid = np.stack(np.meshgrid(theta, theta, np.radians(np.arange(0, 181, 60.0)), indexing="ij"), -1).reshape(-1, 3)
    dense = at(np.insert(grid, 1, 0.0, axis=1))
    assert isinstance(from_samples(dense, name="x"), GridBrdf | ScatteredBrdf)
    with reading(Reading(prior=True)):
        found = from_samples(few, name="x")
        report = compared(found, found, lambda brdf: brdf)
        with pytest.raises(FormatError, match="expected 10 to 1500 samples with --prior, found 9"):
            from_samples(few.some(slice(9)), name="x")
    assert isinstance(found, ScatteredBrdf)
    assert found.estimate is not None
    assert found.facts["prior"].startswith("99 ")
    assert 0.01 < found.facts["deviation_median"] < 1
    assert np.shape(found.facts["deviation"]) == (10, 6)
    assert "held_out" in report  # of what is made with the prior, too
    check_near(found, 0.15)


def test_from_a_plan_to_a_file(capsys, tmp_path):
    plan, measured, out = (tmp_path / name for name in ("plan.csv", "measured.csv", "out.smrl"))
    result = run_json(capsys, "plan", "--samples", "16", "-o", plan)
    assert result["samples"] == 16
    rows = list(csv.reader(plan.read_text().splitlines()[1:]))
    assert rows[0] == ["theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg", "r", "g", "b"]
    assert np.allclose(np.radians(np.array(rows[1:])[:, :4].astype(float)), PLANNED, atol=1e-5)
    run(capsys, "eval", "red-fabric", plan, "-o", measured)
    for preset in (["--target-size", "2.7kB"], []):
        status, printed, warned = run(capsys, "convert", measured, out, "--prior", *preset, "--json", "--overwrite")
        assert status == 0
        assert "estimated from 99 NP stand-ins" in warned
        facts = json.loads(printed)["materials"][0]["facts"]
        assert facts["prior"].startswith("99 ")
        check_near(load(out), 0.2)
        assert out.with_name("out.coverage.png").exists()
    assert load(out).facts["prior"].startswith("99 ")
    assert run(capsys, "compress", measured, "-o", out, "--prior", "--overwrite")[0] == 0
