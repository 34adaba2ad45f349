"""Parameters and their bounds; lobes and their derivatives are numbers all over them, on all kinds of arrays."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail
from lobes import FAMILY_LIST, evaluated, label, pairs, scaled, shapes

from sommerl.models.family import Angles
from sommerl.models.lafortune import LAFORTUNE
from sommerl.reflectance.arrays import split
from sommerl.render.llvm import mitsuba
from sommerl.system.jit import drjit, float64

WI, WO = pairs()
ALL_PARAMETERS = [(family, p) for family in FAMILY_LIST for p in family.parameters]
SHAPED = [family for family in FAMILY_LIST if family.parameters]
ARRAYS = {"double": (float64, np.float64), "single": (lambda: mitsuba().Float, np.float32)}
# Where formulas divide by little: the normal, one direction for both, the mirror's, grazing angles on one side or both.
Z = 1e-6
HARD = np.array(
    [
        [(0, 0, 1), (0, 0, 1)],
        [(0.6, 0, 0.8), (0.6, 0, 0.8)],
        [(0.6, 0, 0.8), (-0.6, 0, 0.8)],
        [(1, 0, Z), (0, 0, 1)],
        [(1, 0, Z), (1, 0, Z)],
        [(1, 0, Z), (-1, 0, Z)],
        [(1, 0, Z), (0, 1, Z)],
        [(1, 0, Z), (-0.6, 0, 0.8)],
    ]
)


def check_inverse(parameter, place=None):
    places = np.linspace(0, 1, 21)
    values = parameter.at(places)
    assert np.allclose([(place or parameter.place)(value) for value in values], places, rtol=0, atol=1e-12)
    assert np.allclose(values[[0, -1]], [parameter.low, parameter.high], rtol=1e-12, atol=0)
    assert (np.diff(values) > 0).all()


@pytest.mark.parametrize(("family", "parameter"), ALL_PARAMETERS, ids=label)
def test_values_and_places_are_inverse(family, parameter):
    check_inverse(parameter)
    must_fail(check_inverse, parameter, lambda value: parameter.place(value) + 1e-9)
    must_fail(check_inverse, replace(parameter, high=1.001 * parameter.high), parameter.place)


def check_start(parameter):
    assert parameter.low < parameter.start < parameter.high
    assert 0 < parameter.place(parameter.start) < 1


@pytest.mark.parametrize(("family", "parameter"), ALL_PARAMETERS, ids=label)
def test_searches_begin_within_the_bounds(family, parameter):
    check_start(parameter)
    for wrong in (parameter.low, parameter.high):
        must_fail(check_start, replace(parameter, start=wrong))


def opaque(kind, numbers):
    """As arrays of one number that is not part of the compiled code, so that all shapes share it."""
    arrays = [kind([float(number)]) for number in numbers]
    drjit().make_opaque(arrays)
    return arrays


def angles(kind, dtype, wi, wo):
    return Angles(*(tuple(kind(np.ascontiguousarray(c, dtype)) for c in split(w)) for w in (wi, wo)))


def on_device(name, family, shape, wi=WI, wo=WO):
    make, dtype = ARRAYS[name]
    kind = make()
    return np.array(family.lobe(angles(kind, dtype, wi, wo), *opaque(kind, shape))).astype(np.float64)


def rounding(family, shape, dtype):
    """Relative. That of a cosine is multiplied by the exponent that it is raised to."""
    return np.finfo(dtype).eps * (400 + (0 if family.diffuse else family.exponent(*shape)))


def check_agrees(name, family, shape, found):
    expected, tolerance = evaluated(family, shape, WI, WO), rounding(family, shape, ARRAYS[name][1])
    assert np.allclose(found, expected, rtol=tolerance, atol=1e-6 * tolerance * expected.max())


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("family", FAMILY_LIST, ids=label)
def test_all_kinds_of_arrays_agree(family, name):
    for shape in shapes(family):
        found = on_device(name, family, shape)
        check_agrees(name, family, shape, found)
        must_fail(check_agrees, name, family, shape, 1.1 * found)
    must_fail(check_agrees, name, family, shapes(family)[0], 1.0001 * on_device(name, family, shapes(family)[0]))


def check_numbers(values):
    assert np.isfinite(values).all()
    assert (values >= 0).all()


def everywhere(family, shape):
    """The lobe on all kinds of arrays, where formulas divide by little."""
    wi, wo = HARD[:, 0], HARD[:, 1]
    return np.concatenate(
        [evaluated(family, shape, wi, wo), *(on_device(name, family, shape, wi, wo) for name in ARRAYS)]
    )


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("family", FAMILY_LIST, ids=label)
def test_lobes_are_numbers_up_to_their_bounds(family):
    for shape in shapes(family):
        check_numbers(everywhere(family, shape))
    must_fail(check_numbers, everywhere(scaled(family, -1.0), shape))
    broken = replace(family, lobe=lambda a, *shape: family.lobe(a, *shape) + 0 / (1 - a.cos_h))
    must_fail(check_numbers, everywhere(broken, shape))


def derivative(family, places, chosen, wi=WI, wo=WO):
    """By the place of one parameter, as fits take it."""
    dr, kind = drjit(), float64()
    at = opaque(kind, places)
    dr.enable_grad(at[chosen])
    lobe = family.lobe(angles(kind, np.float64, wi, wo), *values_at(family, at))
    dr.set_grad(at[chosen], 1.0)
    dr.forward_to(lobe)
    return np.array(dr.grad(lobe))


def values_at(family, places):
    return [p.at(place) for p, place in zip(family.parameters, places, strict=True)]


def small_step(family, places, chosen, step=1e-20j):
    """The derivative by a difference in NumPy. Along the imaginary axis, nothing cancels, and no digit is lost."""
    moved = [place + step * (number == chosen) for number, place in enumerate(places)]
    return evaluated(family, values_at(family, moved), WI, WO).imag / step.imag


def check_derivative(family, found, places, chosen):
    expected = small_step(family, places, chosen)
    shape = [float(value) for value in values_at(family, places)]
    tolerance = rounding(family, shape, np.float64) * max(np.abs(expected).max(), 1e-300)
    assert np.allclose(found, expected, rtol=0, atol=tolerance)


# Away from c_xy of −1 and 1, which are kinks.
@pytest.mark.parametrize("place", [0.0, 0.13, 0.37, 0.62, 1.0])
@pytest.mark.parametrize("family", SHAPED, ids=label)
def test_derivatives_are_those_of_small_steps(family, place):
    count = len(family.parameters)
    for chosen in range(count):
        for others in (0.2, place):
            places = [place if number == chosen else others for number in range(count)]
            check_derivative(family, derivative(family, places, chosen), places, chosen)
    must_fail(check_derivative, family, derivative(family, [0.1] * count, 0), [0.1 + 1e-9] * count, 0)


def check_steps(family, places, step):
    """By steps along the imaginary axis and by real ones to both sides, as far as those have digits."""
    expected = small_step(family, places, 0)
    ahead, behind = (evaluated(family, values_at(family, [places[0] + s, *places[1:]]), WI, WO) for s in (step, -step))
    assert np.allclose((ahead - behind) / (2 * step), expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("family", SHAPED, ids=label)
def test_small_steps_along_the_imaginary_axis_are_derivatives(family):
    places = [0.3] * len(family.parameters)
    check_steps(family, places, 1e-6)
    must_fail(check_steps, family, places, 0.03)


def check_at_kink(found):
    """One of both sides' derivatives, or between them."""
    sides = [small_step(LAFORTUNE, [place, 0.3], 0) for place in (0.25 - 1e-12, 0.25 + 1e-12)]
    slack = 1e-9 * np.abs(sides).max()
    assert np.abs(sides[0] - sides[1]).max() > 1e3 * slack
    assert (found >= np.minimum(*sides) - slack).all()
    assert (found <= np.maximum(*sides) + slack).all()


def test_the_derivative_at_a_kink_lies_between_those_beside_it():
    """Where searches for Lafortune's lobe begin."""
    assert LAFORTUNE.parameters[0].place(LAFORTUNE.parameters[0].start) == 0.25
    check_at_kink(derivative(LAFORTUNE, [0.25, 0.3], 0))
    must_fail(check_at_kink, 1.01 * derivative(LAFORTUNE, [0.25, 0.3], 0))


def check_finite(values):
    assert np.isfinite(values).all()


def rooted(family):
    """Broken on purpose: the lobe's value is the same, but its slope is infinite."""

    def lobe(a, first, *others):
        return family.lobe(a, first, *others) + drjit().sqrt(first - drjit().detach(first))

    return replace(family, lobe=lobe)


@pytest.mark.parametrize("family", SHAPED, ids=label)
def test_derivatives_are_numbers_up_to_the_bounds(family):
    wi, wo = HARD[:, 0], HARD[:, 1]
    count = len(family.parameters)
    for place in (0.0, 0.25, 0.5, 1.0):
        for chosen in range(count):
            check_finite(derivative(family, [place] * count, chosen, wi, wo))
        must_fail(check_finite, derivative(rooted(family), [place] * count, 0, wi, wo))
