from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail
from scipy.optimize import least_squares

from sommerl import Brdf, BrdfTable, Lattice, TrainOptions, builtin, train
from sommerl.fitting import FitOptions, fit, fit_all
from sommerl.fitting.data import samples_of
from sommerl.fitting.search import Search
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.models.standards import STANDARDS
from sommerl.system.errors import MaterialError, OptionError

COARSE = Lattice(24, 20, 24)
SPECULAR = [name for name, family in FAMILIES.items() if not family.diffuse]
FEW = FitOptions(samples=5000, starts=6)
NAMES = (*FAMILIES, *STANDARDS)


def known(model, specular, seed=0):
    """A material of a Lambertian base and lobes that are different enough to be told apart."""
    random = np.random.default_rng(seed)
    lobes = [Lobe(FAMILIES["lambertian"], tuple(random.uniform(0.05, 0.4, 3)), {})]
    for number in range(specular):
        shape = {}
        for p in FAMILIES[model].parameters:
            # Not so narrow that a coarse lattice has no cell in the lobe: roughness 0.03 to 0.2, exponents 20 to 600.
            wide, far = (0.25, 0.2) if p.name == "n" else (0.4, 0.2)
            low, high = (0.2, 0.8) if p.scale == "linear" else (wide + far * number, wide + far * number + 0.1)
            shape[p.name] = float(p.at(random.uniform(low, high)))
        lobes.append(Lobe(FAMILIES[model], tuple(random.uniform(0.05, 0.4, 3)), shape))
    return MultiLobe(model, sorted(lobes, key=lambda lobe: lobe.exponent))


def check_recovered(found, truth):
    """The goals: 1 % in every parameter and a relative error of 1e-6."""
    assert found.relative_error <= 1e-6
    for one, other in zip(found.brdf.lobes, truth.lobes, strict=True):
        assert one.family == other.family
        assert (*one.albedo, *one.values) == pytest.approx((*other.albedo, *other.values), rel=0.01)


@pytest.mark.parametrize("specular", [1, 2])
@pytest.mark.parametrize("model", SPECULAR)
def test_a_table_of_known_parameters_gives_them_back(model, specular):
    truth = known(model, specular)
    table = BrdfTable.sampled(truth, COARSE)
    found = fit(table, model, FitOptions(lobes=1 + specular, sampling="lattice", loss="l2"))
    check_recovered(found, truth)
    must_fail(check_recovered, found, known(model, specular, seed=1))


@pytest.mark.parametrize("loss", ["l2", "cosine-l2", "log", "cube-root"])
@pytest.mark.parametrize("model", ["lambertian", "oren-nayar", "ward", "ggx"])
def test_so_does_every_loss_on_a_sphere(model, loss):
    truth = known(model, 1, seed=2)
    if FAMILIES[model].diffuse:
        truth = MultiLobe(model, [truth.lobes[-1]])
    found = fit(truth, model, FitOptions(samples=5000, loss=loss))
    # Where the loss is not linear, albedos are searched, too, and the last digits are not reached.
    assert found.relative_error <= (1e-6 if loss.endswith("l2") else 1e-5)
    assert found.brdf.lobes[-1].values == pytest.approx(truth.lobes[-1].values, rel=0.01)
    assert found.brdf.lobes[-1].albedo == pytest.approx(truth.lobes[-1].albedo, rel=0.01)


def by_least_squares(samples, family, starts, seed=0):
    """The least error that SciPy's trust region finds from random starts, over all parameters at once."""
    random = np.random.default_rng(seed)
    low = np.array([0] * 6 + [p.low for p in family.parameters], float)
    high = np.array([5] * 6 + [p.high for p in family.parameters], float)

    def residuals(x):
        shape = {p.name: v for p, v in zip(family.parameters, x[6:], strict=True)}
        lobes = [Lobe(FAMILIES["lambertian"], tuple(x[:3]), {}), Lobe(family, tuple(x[3:6]), shape)]
        return ((MultiLobe("x", lobes).eval(samples.wi, samples.wo) - samples.f_r) * samples.wi[:, 2:]).ravel()

    best = np.inf
    for _ in range(starts):
        shape = [p.at(place) for p, place in zip(family.parameters, random.uniform(0.02, 0.98, 4), strict=False)]
        start = [*random.uniform(0, 1, 6), *shape]
        best = min(best, least_squares(residuals, start, bounds=(low, high), method="trf", x_scale="jac").cost)
    return np.sqrt(2 * best / samples.f_r.size)


def check_no_worse(error, outside):
    assert error <= outside * (1 + 1e-6)


@pytest.mark.parametrize("model", ["ward", "cook-torrance", "lafortune"])
def test_no_worse_than_least_squares(model):
    """The other models, and 50 starts: benchmarks/fits.py."""
    material, options = builtin("pearl-paint"), FitOptions(samples=1500)
    outside = by_least_squares(samples_of(material, options), FAMILIES[model], 5)
    error = fit(material, model, options).error
    check_no_worse(error, outside)
    must_fail(check_no_worse, 1.001 * error, error)


def test_solved_albedos_are_no_worse_than_searched_ones():
    samples = samples_of(builtin("pearl-paint"), FEW)
    families = (FAMILIES["lambertian"], FAMILIES["ashikhmin-shirley"])
    solving, searching = (Search(families, samples, FEW) for _ in range(2))
    searching.solves = False
    solved, searched = (search.run(lambda done: None)[0].error for search in (solving, searching))
    assert solved <= searched * (1 + 1e-9)
    assert searched == pytest.approx(solved, rel=1e-3)


def check_found_from_anywhere(errors):
    assert max(errors) <= 1.001 * min(errors)


def test_other_starts_find_the_same():
    """Three lobes and a loss that is not linear: the longest search."""
    options = FitOptions(samples=3000, loss="log", lobes=3)
    samples = samples_of(builtin("nickel"), options)
    families = [FAMILIES[name] for name in ("lambertian", "lafortune", "lafortune")]
    searches = [Search(families, samples, replace(options, seed=seed)) for seed in range(3)]
    errors = [search.run(lambda done: None)[0].error for search in searches]
    check_found_from_anywhere(errors)
    must_fail(check_found_from_anywhere, [*errors, 1.002 * min(errors)])


def check_conserves(found):
    sums = np.sum([lobe.albedo for lobe in found.brdf.lobes], axis=0)
    assert (sums <= 1 + 1e-8).all()
    assert sums.max() == pytest.approx(1, abs=1e-6)  # it would like to have more


@pytest.mark.parametrize("brightness", [1.0, 1500.0])
@pytest.mark.parametrize("loss", ["l2", "cosine-l2", "cube-root"])
def test_energy(loss, brightness):
    albedos = [(0.8 * brightness, 0.5 * brightness, 0.1), (0.4 * brightness, 0.4, 0.4)]
    lobes = [Lobe(FAMILIES["lambertian"], albedos[0], {}), Lobe(FAMILIES["ward"], albedos[1], {"alpha": 0.3})]
    bright = MultiLobe("bright", lobes)
    options = {"samples": 20_000, "starts": 4, "loss": loss}
    bounded = fit(bright, "ward", FitOptions(**options, conserve_energy=True))
    check_conserves(bounded)
    free = fit(bright, "ward", FitOptions(**options))
    must_fail(check_conserves, free)
    assert free.error < bounded.error


def test_all_models_and_their_report():
    steps = []
    found = fit_all(builtin("red-fabric"), FEW, progress=lambda done, total: steps.append(done / total))
    assert {each.model for each in found} == set(FAMILIES)
    assert [each.error for each in found] == sorted(each.error for each in found)
    assert steps == sorted(steps)
    assert steps[-1] == 1
    for each in found:
        report = each.as_json()
        assert report.keys() >= {"model", "lobes", "loss", "error", "parameters", "starts", "seconds"}
        assert len(report["parameters"]) == report["lobes"] == (1 if FAMILIES[each.model].diffuse else 2)
        assert len(report["starts"]) == (1 if each.model == "lambertian" else FEW.starts)
        assert each.error <= min(start["error"] for start in report["starts"])


def test_same_options_same_fit():
    one, other = (fit(builtin("red-fabric"), "ggx", FEW).as_json() for _ in range(2))
    assert one | {"seconds": 0} == other | {"seconds": 0}


def test_a_compressed_material_and_its_table_alike():
    table = BrdfTable.sampled(builtin("red-fabric"), COARSE)
    material, _ = train(table, TrainOptions(clusters=64, epochs=3))
    options = FitOptions(sampling="lattice", starts=4)
    one, other = (fit(brdf, "ward", options) for brdf in (table, material))
    assert one.samples == other.samples == COARSE.above_horizon.sum()
    assert one.brdf.lobes[1].values == pytest.approx(other.brdf.lobes[1].values, rel=0.2)


class Made(Brdf):
    """One value in all directions."""

    name = "made"

    def __init__(self, value):
        self.value = value

    def f_r(self, wi, wo, buffers):
        return (self.value + 0 * wi[0],) * 3


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (0.0, "it is black"),
        (float("nan"), "it is black"),
        (float("inf"), "its largest reflectance is 3.40282e+38, not from 1e-15 to 1e+15"),
        (-0.1, "it is black"),
        (1e-200, "its largest reflectance is 1e-200, not from 1e-15 to 1e+15"),
        (1e160, "its largest reflectance is 1e+160, not from 1e-15 to 1e+15"),
    ],
)
def test_what_cannot_be_fitted(value, why):
    with pytest.raises(MaterialError) as caught:
        fit(Made(value), "ward", FitOptions(samples=1000))
    assert str(caught.value) == f"made: no model can be fitted to it, since {why}"


def test_a_constant_is_lambertian():
    found = fit(Made(0.1), "ggx", FitOptions(samples=1000, starts=3))
    assert found.relative_error < 1e-7
    assert found.brdf.lobes[0].albedo == pytest.approx([0.1 * np.pi] * 3, rel=1e-3)


@pytest.mark.parametrize(
    ("model", "lobes", "message"),
    [
        ("wardd", None, f"model: expected {', '.join(NAMES)} or all, found wardd; did you mean ward?"),
        ("GGX", None, f"model: expected {', '.join(NAMES)} or all, found GGX; did you mean ggx?"),
        ("xyz", None, f"model: expected {', '.join(NAMES)} or all, found xyz"),
        ("ward", 1, "lobes: expected 2 to 4 of ward, its Lambertian base included, found 1"),
        ("lambertian", 2, "lobes: lambertian is a base itself and has 1 lobe, found 2"),
    ],
)
def test_models_that_there_are_not(model, lobes, message):
    with pytest.raises(OptionError) as caught:
        fit(builtin("nickel"), model, FitOptions(lobes=lobes, samples=1000))
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lobes": 5}, "lobes: expected 1 to 4, found 5"),
        ({"lobes": 0}, "lobes: expected 1 to 4, found 0"),
        ({"samples": 10}, "samples: expected 1000 to 10000000, found 10"),
        ({"starts": 0}, "starts: expected 1 to 1000, found 0"),
        ({"lobes": 1.5}, "lobes: expected a whole number, found 1.5"),
        ({"starts": "3"}, "starts: expected a whole number, found '3'"),
        ({"seed": -1}, "seed: expected 0 to 18446744073709551615, found -1"),
        ({"loss": "l1"}, "loss: expected l2 or cosine-l2 or log or cube-root, found l1"),
        ({"sampling": "cube"}, "sampling: expected sphere or lattice, found cube"),
    ],
)
def test_options_out_of_range(options, message):
    with pytest.raises(OptionError) as caught:
        FitOptions(**options)
    assert str(caught.value) == message
