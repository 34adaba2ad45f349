import math

import numpy as np
import pytest
from helpers import SMALL, must_fail, random_directions

from sommerl import MERL, NAMES, BrdfTable, builtin, builtin_table, load
from sommerl.models.builtin import _FITS
from sommerl.models.sgd import PARAMETERS
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import directions, half_diff
from sommerl.system.errors import MaterialError


def by_hand(name, wi, wo, channel):
    """The formula as Bagher et al. 2012 print it, in plain Python."""
    q = {key: values[channel] for key, values in zip(PARAMETERS, _FITS[name], strict=True)}
    theta_h, theta_d, _ = (float(angle[0]) for angle in half_diff(split(wi[None]), split(wo[None])))
    t2 = math.tan(theta_h) ** 2
    a = q["alpha"] + t2 / q["alpha"]
    d = q["kappa"] * math.exp(-a) / (math.pi * a ** q["p"] * math.cos(theta_h) ** 4)
    f = q["f0"] - math.cos(theta_d) * q["f1"] + (1 - q["f0"]) * (1 - math.cos(theta_d)) ** 5

    def g(theta):
        power = q["c"] * max(0.0, theta - q["theta0"]) ** q["k"]
        return min(max(1 + q["lambda"] * (1 - math.exp(min(power, 700))), 0), 1)

    shadowing = g(math.acos(wi[2])) * g(math.acos(wo[2]))
    return max(q["rho_d"] + q["rho_s"] * d * f * shadowing / (wi[2] * wo[2]), 0) / math.pi


def check_formula(brdf, name):
    wi, wo = random_directions(40, 1), random_directions(40, 2)
    expected = [[by_hand(name, a, b, channel) for channel in range(3)] for a, b in zip(wi, wo, strict=True)]
    assert np.allclose(brdf.eval(wi, wo), expected, rtol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_formula(name):
    check_formula(builtin(name), name)


def test_that_check_notices_another_material():
    must_fail(check_formula, builtin("nickel"), "chrome")


def test_they_are_called_stand_ins():
    for name in NAMES:
        assert builtin(name).name == f"{name} (SGD stand-in)"
    assert "SGD stand-in" in builtin_table("nickel", lattice=SMALL).name


def test_tables_hold_the_formula_at_the_cell_centres():
    table = builtin_table("pearl-paint")
    cell = (12, 30, 100)
    wi, wo = directions(*(angle[cell] for angle in MERL.angles()))
    assert np.allclose(table.values[cell], builtin("pearl-paint").eval(wi, wo))


@pytest.mark.parametrize("name", NAMES)
def test_tables_are_usable(name):
    table = builtin_table(name)
    assert np.isfinite(table.values).all()
    assert table.counts.cells_clamped == 0


def check_noise(clean, noisy):
    """The deviations that the paper quotes: 10-15 % near normal incidence, 60-70 % at grazing angles."""
    cosine = np.minimum(*MERL.cosines())
    ratio = np.log(noisy.values[..., 0] / clean.values[..., 0])
    near, grazing = (cosine > 0.95), (cosine > 0) & (cosine < 0.02)
    assert 0.10 < ratio[near].std() < 0.15
    assert 0.57 < ratio[grazing].std() < 0.70
    for cells in (near, grazing):
        assert np.exp(ratio[cells]).mean() == pytest.approx(1, abs=0.02)  # no brighter on the whole


def test_noise():
    clean, noisy = builtin_table("beige-fabric"), builtin_table("beige-fabric", noise=1)
    check_noise(clean, noisy)
    must_fail(check_noise, clean, BrdfTable(clean.values * 1.1))
    assert np.array_equal(noisy.values, builtin_table("beige-fabric", noise=1).values)
    assert not np.array_equal(noisy.values, builtin_table("beige-fabric", noise=2).values)
    assert "noise seed 1" in noisy.name


def test_grazing_directions_have_a_value():
    wi = np.array([np.cos(1e-170), 0, 1e-170])
    assert np.isfinite(builtin("nickel").eval(wi, wi)).all()


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(MaterialError, match=r"blue-metalic-paint: .*did you mean blue-metallic-paint"):
        load("blue-metalic-paint")
    for far in ("missing", "?!"):
        with pytest.raises(MaterialError, match="found neither; built-in are blue-metallic-paint, ") as raised:
            load(far)
        assert "did you mean" not in str(raised.value)


def test_any_brdf_can_be_sampled_to_any_lattice():
    assert BrdfTable.sampled(builtin("chrome"), SMALL).lattice == SMALL
