"""What `eval`, `sample` and `pdf` make of any vectors: one rule for every kind of material and sampler."""

from functools import cache

import numpy as np
import pytest
from helpers import must_fail, random_directions
from hypothesis import example, given, settings
from hypothesis import strategies as st
from kinds import KINDS
from sampled import sampler

from sommerl.formats.rgl import RglBrdf
from sommerl.formats.scattered import fitted_to
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.samples import Samples
from sommerl.sampling.named import SAMPLERS

A, B = random_directions(50, 1), random_directions(50, 2)
COMPONENT = st.one_of(
    st.sampled_from([0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 5e-324, 1e155, 1e-155, 2.0]),
    st.floats(-1, 1),
    st.floats(width=64),
)
PAIRS = st.lists(st.tuples(*[COMPONENT] * 6), min_size=1, max_size=8)
EACH = pytest.mark.parametrize("kind", [*KINDS, "scattered"])
EACH_SAMPLER = pytest.mark.parametrize("name", SAMPLERS)


@cache
def material(kind):
    if kind != "scattered":
        return KINDS[kind]
    return fitted_to(Samples(A, B, KINDS["sgd"].eval(A, B)), name="scattered")


def rule(wi, wo):
    """NaN, 0, or 1 where it is up to the material."""
    finite = np.isfinite(wi).all(axis=-1) & np.isfinite(wo).all(axis=-1)
    return np.where(finite, (wi[..., 2] > 0) & (wo[..., 2] > 0), np.nan)


def check_rule(values, wi, wo):
    wanted = np.broadcast_to(rule(wi, wo)[..., None], values.shape)
    assert np.array_equal(np.isnan(values), np.isnan(wanted))
    assert not values[wanted == 0].any()
    assert np.isfinite(values[wanted == 1]).all()
    assert (values[wanted == 1] >= 0).all()


def vectors(pairs):
    pairs = np.array(pairs)
    return pairs[:, :3], pairs[:, 3:]


@EACH
@settings(deadline=None, max_examples=60)
@given(PAIRS)
def test_one_rule_for_any_vectors(kind, pairs):
    wi, wo = vectors(pairs)
    check_rule(material(kind).eval(wi, wo), wi, wo)


@EACH_SAMPLER
@settings(deadline=None, max_examples=60)
@given(PAIRS)
def test_one_rule_for_any_density(name, pairs):
    wi, wo = vectors(pairs)
    check_rule(sampler(name, "glossy").pdf(wi, wo)[:, None], wi, wo)


@EACH_SAMPLER
@settings(deadline=None, max_examples=60)
@given(PAIRS, st.integers(0, 2**32))
@example([(0.0,) * 6, (*(0.0,) * 5, 9.2e307)], 0)  # twice its length is no number
def test_one_rule_for_any_viewer(name, pairs, seed):
    _, wo = vectors(pairs)
    u = np.random.default_rng(seed).random(wo.shape)
    u[0, seed % 3] = (0.0, 1.0, np.nan)[seed % 5 % 3]
    wi, pdf, weight = sampler(name, "glossy").sample(wo, u)
    known = np.isfinite(wo).all(axis=-1) & np.isfinite(u).all(axis=-1)
    for values in (wi, pdf, weight):
        assert np.array_equal(np.isfinite(values).reshape(len(wo), -1).all(axis=-1), known)
    assert not pdf[known & ~(wo[:, 2] > 0)].any()
    assert not weight[known & ~(pdf > 0)].any()


@EACH
def test_that_check_notices_what_breaks_the_rule(kind):
    values = material(kind).eval(A, B)
    check_rule(values, A, B)
    for bad in (np.nan, np.inf, -1.0):
        changed = values.copy()
        changed[3, 1] = bad
        must_fail(check_rule, changed, A, B)
    broken = A.copy()
    broken[3, 1] = np.nan
    must_fail(check_rule, values, broken, B)
    must_fail(check_rule, values, -A, B)


def test_measurements_may_be_negative_and_are_finite():
    """RGL's raw data are what they are."""
    rgl = KINDS["rgl"]
    shape = (len(rgl._theta_i), 3, *rgl._shapes["rgb"])
    raw = RglBrdf(
        *(rgl._buffers["theta_i"], rgl._buffers["vndf"].reshape(-1, *rgl._shapes["vndf"])),
        -rgl._buffers["rgb"].reshape(shape),
        *(rgl._buffers[name].reshape(rgl._shapes[name]) for name in ("ndf", "sigma")),
    )
    values = raw.eval(A, B)
    assert np.isfinite(values).all()
    assert (values < 0).any()
    assert np.isnan(raw.eval(A, [0, np.nan, 1])).all()


def same(one, other):
    """The same rule, here and with a second call on other types of arrays."""
    assert np.array_equal(one, other, equal_nan=True)


@EACH
def test_any_array_of_real_numbers(kind):
    eval_ = material(kind).eval
    up = [[0, 0, 1], [1, 2, 3], [0, 0, -1]]
    wanted = eval_(np.array(up, np.float64), [0.0, 0.0, 1.0])
    for dtype in (np.int8, np.int64, np.float16, np.float32, ">f8", "<f4", np.longdouble):
        same(eval_(np.array(up, dtype), [0, 0, 1]), wanted)
    same(eval_(np.abs(up).astype(np.uint64), np.array([0, 0, 1], bool))[:2], wanted[:2])
    wanted = eval_(A, B)
    frozen = A.copy()
    frozen.flags.writeable = False
    same(eval_(frozen, np.asfortranarray(B)), wanted)
    same(eval_(np.repeat(A, 2, axis=0)[::2], B[::-1][::-1]), wanted)
    same(eval_(A.astype(">f8"), B.tolist()), wanted)
    for shape in ((0, 3), (2, 0, 3)):
        assert eval_(np.zeros(shape), [0, 0, 1]).shape == shape
    assert eval_([0, 0, 1], [0, 0, 1]).shape == (3,)


BAD = [
    *(None, "abc", b"abc", {}, object(), [[0, 0, 1], [0, 0]], [0, 0, 1j], np.zeros(3, complex), np.zeros(3, object)),
    *(np.array(["0", "0", "1"]), np.zeros(3, "M8[s]"), [0, 0, None], ["a", 0, 1]),
    *([], [0, 0], 0.0, np.zeros((3, 2)), np.zeros((2, 4))),
]


def check_refused(call, one, other):
    with pytest.raises(
        ValueError, match=r"^(eval|sample|pdf): (expected [^\n]*, found|random numbers have to be) [^\n]*$"
    ):
        call(one, other)


@EACH
def test_what_is_no_array_of_vectors_is_refused(kind):
    for bad in BAD:
        check_refused(material(kind).eval, bad, [0, 0, 1])
        check_refused(material(kind).eval, [0, 0, 1], bad)
    with pytest.raises(ValueError, match=r"broadcast, found \(2, 3\) and \(4, 3\)$"):
        material(kind).eval(A[:2], B[:4])


@EACH_SAMPLER
def test_samplers_refuse_the_same(name):
    found = sampler(name, "glossy")
    for call in (found.pdf, found.sample):
        for bad in BAD:
            check_refused(call, bad, [0, 0, 1])
            check_refused(call, [0, 0, 1], bad)
    for bad in (-1e-9, 1.001, np.inf, -np.inf):
        check_refused(found.sample, A[:1], [0.5, bad, 0.5])


def test_the_core_follows_the_rule_as_numpy_does():
    """Both evaluate tables."""
    rng = np.random.default_rng(0)
    odd = np.array([0.0, -0.0, 1.0, np.nan, np.inf, -np.inf, 1e300, 1e-300, 0.5, -0.5])
    wi, wo = rng.choice(odd, (2, 3000, 3))
    for kind in ("table-nearest", "table-trilinear", "table-handed", "cells-nearest", "cells-trilinear", "nodes"):
        check_rule(KINDS[kind].eval(wi, wo), wi, wo)
        check_rule(Brdf.eval(KINDS[kind], wi, wo), wi, wo)
