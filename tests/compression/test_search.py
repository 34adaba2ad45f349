"""The fast searches against the slow ones, on every instruction set of this machine, over full-length runs."""

import itertools

import numpy as np
import pytest
from helpers import must_fail

from sommerl import Lattice, TrainOptions, _core, builtin_table
from sommerl.compression.paper import reference, train

LATTICE = Lattice(20, 20, 24)
SEARCHES = [(search, simd) for search in ("boxes", "all", "scalar") for simd in _core.simd_paths()]


def prepared(clusters, order="seeded", rule="kohonen", name="nickel"):
    """What a learner is made of, for a material with highlight and body."""
    table = builtin_table(name, lattice=LATTICE)
    rgb = table.values[LATTICE.above_horizon]
    x = (rgb / rgb.max()).astype(np.float32)
    x[: len(x) // 20] = x[0]  # and with many cells alike
    sequence, weights = train._start(x, TrainOptions(clusters=clusters, order=order), name)
    return x[sequence], sequence, weights, rule, clusters


def learnt(learner, cells, alpha, epochs=30):
    """The bits of everything that a learner knows after a run, and how many epochs changed anything."""
    errors, alpha = [], np.float32(alpha)
    for epoch in range(epochs):
        errors += [learner.present(start, min(start + 999, cells), float(alpha), np.ones(1, np.float32))
                   for start in range(0, cells, 999)]  # fmt: skip
        if learner.settled():
            return learner.weights().tobytes(), learner.stored_cells().tobytes(), errors, epoch + 1
        alpha = alpha * np.float32(0.6)
    return learner.weights().tobytes(), learner.stored_cells().tobytes(), errors, epochs


def check_same(one, other, cells, alpha, epochs=30):
    assert learnt(one, cells, alpha, epochs) == learnt(other, cells, alpha, epochs)


@pytest.mark.parametrize(("search", "simd"), SEARCHES[:-1])
@pytest.mark.parametrize("clusters", [1, 16, 17, 64, 300])
def test_every_search_learns_the_same(search, simd, clusters):
    for rule, order, alpha in itertools.product(("paper", "kohonen"), ("seeded", "table"), (0.02, 0.5)):
        setting = prepared(clusters, order, rule)
        peer = _core.Learner(*setting, "scalar", "portable")
        check_same(_core.Learner(*setting, search, simd), peer, len(setting[0]), alpha)


def test_that_check_notices_one_unit_a_bit_off():
    setting = prepared(64)
    weights = setting[2].copy()
    weights[5, 1] = np.nextafter(weights[5, 1], np.float32(1))
    other = _core.Learner(*setting[:2], weights, *setting[3:])
    must_fail(check_same, _core.Learner(*setting), other, len(setting[0]), 0.02)


@pytest.mark.parametrize(("rule", "order"), list(itertools.product(("paper", "kohonen"), ("seeded", "table"))))
def test_full_length_run_against_the_reference(rule, order):
    """40 epochs, to the fixed point and beyond it."""
    setting = prepared(40, order, rule)
    setting = (setting[0][:700], setting[1][:700], *setting[2:])
    learner, peer = _core.Learner(*setting), reference.Learner(*setting)
    check_same(learner, peer, 700, 0.5, 40)


def test_at_the_fixed_point_nothing_changes_any_more():
    setting = prepared(64)
    cells, alpha, ones = len(setting[0]), np.float32(0.02), np.ones(1, np.float32)
    learner = _core.Learner(*setting)
    _, _, _, epochs = learnt(learner, cells, alpha, 100)
    assert epochs < 40
    before = learner.weights().tobytes(), learner.stored_cells().tobytes()
    error = learner.present(0, cells, float(alpha * np.float32(0.6) ** epochs), ones)
    assert learner.settled()
    assert (learner.weights().tobytes(), learner.stored_cells().tobytes()) == before
    assert learner.present(0, cells, 1e-30, ones) == error


def test_training_stops_there_and_the_report_does_not_show_it(monkeypatch):
    table = builtin_table("nickel", lattice=LATTICE)
    seen = []

    class Kernels:
        Quantiser = _core.Quantiser

        class Learner(_core.Learner):
            def settled(self):
                seen.append(super().settled())
                return seen[-1]

    class Never(Kernels):
        class Learner(_core.Learner):
            def settled(self):
                return False

    options = TrainOptions(clusters=32, epochs=60)
    (one, report), (other, full) = (train.train(table, options, kernels=kernels) for kernels in (Kernels, Never))
    assert seen[-1] is True
    assert len(seen) < 60
    assert report.quantisation_error == full.quantisation_error
    assert np.array_equal(one.index, other.index)
    assert np.array_equal(one.lut, other.lut)


def check_query(quantiser, triples, lut):
    assert np.array_equal(quantiser.query(triples), reference.Quantiser(lut).query(triples))


@pytest.mark.parametrize(("search", "simd"), [each for each in SEARCHES if each[0] != "scalar"])
@pytest.mark.parametrize("entries", [1, 2, 15, 16, 17, 33, 256, 1000])
@pytest.mark.parametrize("threads", [1, 3])
def test_query(search, simd, entries, threads):
    rng = np.random.default_rng(entries)
    lut = (rng.integers(0, 12, (entries, 3)) / 16).astype(np.float32)  # many alike, many at equal distances
    triples = (rng.integers(0, 24, (2000, 3)) / 32).astype(np.float32)
    quantiser = _core.Quantiser(lut, search, simd, threads)
    check_query(quantiser, triples, lut)
    check_query(quantiser, triples[:1], lut)
    assert len(quantiser.query(triples[:0])) == 0


def test_that_check_notices_the_higher_of_two_alike():
    lut = np.full((40, 3), 0.25, np.float32)

    class Higher(_core.Quantiser):
        def query(self, triples):
            return 39 - super().query(triples)

    must_fail(check_query, Higher(lut[::-1].copy()), lut, lut)


def turns(rng, cells):
    """Some epochs of a learner: start, stop, α, falloff. Neighbourhoods shrink, as in training, or come again."""
    sigmas = np.array([2.5, 0.0, 1.2, 0.0, 0.0, 0.7, 3.0, 0.0])
    if rng.random() < 0.5:
        sigmas = np.sort(sigmas)[::-1]
    for epoch, sigma in enumerate(sigmas):
        falloff = train._falloff(float(sigma))
        for start in range(0, cells, step := int(rng.integers(1, cells + 1))):
            yield start, min(start + step, cells), float(np.float32(0.3 * 0.8**epoch)), falloff


def check_every_step(one, other, steps):
    """The errors, the weights and what is stored after each."""
    for step in steps:
        assert one.present(*step) == other.present(*step)
        assert one.weights().tobytes() == other.weights().tobytes()
        assert one.stored_cells().tobytes() == other.stored_cells().tobytes()
    assert one.settled() == other.settled()


def wandering(seed, clusters, rule, columns):
    """Few cells, many of them alike, and weights to begin with."""
    rng = np.random.default_rng(seed)
    x = (rng.random((60, 3)) ** rng.integers(1, 6)).astype(np.float32)
    x[rng.integers(0, 60, 12)] = x[0]
    weights = rng.choice(x, clusters)  # some of them alike
    return rng, (x, np.arange(60, dtype=np.uint32), weights, rule, columns)


@pytest.mark.parametrize("simd", _core.simd_paths())
@pytest.mark.parametrize("columns", [1, 5, 17, 64])
@pytest.mark.parametrize("rule", ["paper", "kohonen"])
def test_neighbourhoods_that_change_leave_the_search_exact(rule, columns, simd):
    """Boxes after units have moved with their neighbours, and the other way round: as by brute force, step by step."""
    for seed, clusters in itertools.product(range(4), (17, 40, 64)):
        rng, setting = wandering(seed, clusters, rule, columns)
        steps = list(turns(rng, 60))
        check_every_step(_core.Learner(*setting, "boxes", simd), _core.Learner(*setting, "scalar", "portable"), steps)
        if seed == 0 and clusters == 40 and simd == "portable":
            check_every_step(_core.Learner(*setting), reference.Learner(*setting), steps)


def test_that_check_notices_another_step():
    rng, setting = wandering(0, 40, "kohonen", 5)
    steps = list(turns(rng, 60))
    learner = _core.Learner(*setting)
    learner.present(0, 1, 0.5, np.ones(1, np.float32))
    must_fail(check_every_step, learner, _core.Learner(*setting), steps)
