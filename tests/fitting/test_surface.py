"""Fits of standards' surface models."""

import numpy as np
import pytest
from helpers import must_fail

from sommerl.fitting import FitOptions, fit
from sommerl.fitting.data import samples_of
from sommerl.fitting.surface import SurfaceObjective
from sommerl.models.standard import Surface
from sommerl.models.standards import STANDARDS
from sommerl.system.errors import OptionError

FEW = FitOptions(samples=2000, starts=3)


def paint(model):
    """A material of a model, whose inputs are not where a search begins."""
    numbers = [float(chosen.at(0.15 + 0.7 * k / len(model.places))) for k, chosen in enumerate(model.places)]
    return Surface("paint", model, model.by_name(numbers))


def objective(model, loss):
    return SurfaceObjective(model, samples_of(paint(model), FEW), loss)


def check_slopes(value, places):
    """Derivatives, against differences."""
    slopes = value(places)[1]
    for k in range(len(places)):
        step = 1e-5 * np.eye(len(places))[k]
        difference = (value(places + step)[0] - value(places - step)[0]) / 2e-5
        assert slopes[k] == pytest.approx(difference, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("loss", ["l2", "cosine-l2", "log", "cube-root"])
@pytest.mark.parametrize("model", STANDARDS.values(), ids=lambda model: model.name)
def test_slopes_are_those_of_the_distance(model, loss):
    found = objective(model, loss)
    places = np.random.default_rng(0).uniform(0.3, 0.7, len(model.places))
    check_slopes(found.value, places)

    def broken(x):
        distance, slopes = found.value(x)
        return distance, 1.01 * slopes + 1e-4

    must_fail(check_slopes, broken, places)


@pytest.mark.parametrize("model", STANDARDS.values(), ids=lambda model: model.name)
def test_a_fit_finds_what_a_model_made(model):
    """Some inputs do the same, so only the values are compared."""
    made = paint(model)
    found = fit(made, model.name, FEW)
    assert found.relative_error < 0.01
    assert found.error == pytest.approx(found.relative_error * objective(model, "cosine-l2").scale)
    assert isinstance(found.brdf, Surface)
    assert found.brdf.model is model
    # The error is of the material that is returned.
    samples = samples_of(made, FEW)
    differences = (found.brdf.eval(samples.wi, samples.wo) - samples.f_r) * samples.wi[:, 2:]
    assert np.sqrt((differences**2).mean()) == pytest.approx(found.error, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (FitOptions(lobes=2), "lobes: openpbr has layers of its own and no number of lobes, found 2"),
        (FitOptions(conserve_energy=True), "conserve_energy: expected a sum of lobes, found openpbr"),
    ],
)
def test_options_that_a_standard_cannot_have(options, message):
    with pytest.raises(OptionError, match=message):
        fit(paint(STANDARDS["openpbr"]), "openpbr", options)
