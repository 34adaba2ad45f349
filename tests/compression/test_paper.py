"""Training, end to end, against §4 of the paper written once more (`section_4.py`): every bit of what is learnt."""

import itertools
from dataclasses import asdict
from math import ceil, cos, pi, sin, sqrt

import numpy as np
import pytest
from helpers import must_fail
from section_4 import som_man

from sommerl import BrdfTable, Lattice, TrainOptions, _core, train
from sommerl.compression.paper import reference
from sommerl.compression.paper import train as training

LATTICE = Lattice(4, 4, 6)
NEIGHBOURHOODS = [(0.0, "chain"), (1.5, "chain"), (1.2, "sheet")]
CASES = list(itertools.product(("paper", "kohonen"), ("seeded", "table"), NEIGHBOURHOODS, (False, True)))
NEIGHBOURS = TrainOptions(clusters=7, epochs=4, alpha=0.4, radius=1.5)


def table(seed=0):
    """Random colours, most of them dark, of which some are alike."""
    random = np.random.default_rng(seed)
    values = random.random((*LATTICE.shape, 3)) ** 4
    values[1, :, 2:4] = values[2, 1, 3]
    return BrdfTable(values, LATTICE, name="random")


def above_horizon():
    """Of the cells' centres, by the cosines of both directions: cos θ_h cos θ_d ∓ sin θ_h sin θ_d cos φ_d."""
    cells = []
    for h, d, p in np.ndindex(*LATTICE.shape):
        theta_h, theta_d, phi_d = ((h + 0.5) / 4) ** 2 * pi / 2, (d + 0.5) / 4 * pi / 2, (p + 0.5) / 6 * pi
        across = sin(theta_h) * sin(theta_d) * cos(phi_d)
        cells += [(h, d, p)] if cos(theta_h) * cos(theta_d) > abs(across) + 1e-12 else []
    return cells


def learnt(source, options, kernels=_core):
    """Weights, stored cells, LUT, index above the horizon, and the quantisation error of each epoch."""
    kept = []

    class Recorded:
        Quantiser = kernels.Quantiser

        @staticmethod
        def Learner(*arguments, **options):
            kept.append(kernels.Learner(*arguments, **options))
            return kept[0]

    material, report = train(source, options, kernels=Recorded)
    index = [int(material.index[cell]) for cell in above_horizon()]
    return kept[0].weights(), kept[0].stored_cells(), material.lut, index, report.quantisation_error


def by_section_4(source, options):
    given = asdict(options)
    given["columns"] = options.clusters if given.pop("topology") == "chain" else ceil(sqrt(options.clusters))
    return som_man([tuple(source.values[cell].tolist()) for cell in above_horizon()], **given)


def check_same(found, expected):
    weights, stored, lut, index, errors = expected
    assert np.array_equal(found[0], weights)
    assert np.array_equal(found[1], [[reference.EMPTY if cell is None else cell for cell in unit] for unit in stored])
    assert np.array_equal(found[2], lut)
    assert (found[3], found[4]) == (index, errors)


@pytest.mark.parametrize(("rule", "order", "neighbourhood", "distinct"), CASES)
def test_training_is_section_4(rule, order, neighbourhood, distinct):
    radius, topology = neighbourhood
    options = TrainOptions(
        clusters=7, epochs=4, seed=3, rule=rule, alpha=0.4, order=order, radius=radius, topology=topology,
        distinct=distinct,
    )  # fmt: skip
    source = table()
    expected = by_section_4(source, options)
    for kernels in (_core, reference):
        check_same(learnt(source, options, kernels), expected)


def farthest(weights, stored, x):
    """Each unit's farthest original for its LUT entry, in place of the nearest."""
    filled = stored != reference.EMPTY
    distance = ((x[np.where(filled, stored, 0)] - weights[:, None]) ** 2).sum(axis=-1)
    return stored[np.arange(len(stored)), np.where(filled, distance, -1).argmax(axis=1)]


def twice_as_steep(sigma):
    return falloff(sigma / sqrt(2))


def at_first(sigma):
    return falloff(NEIGHBOURS.radius if sigma else 0.0)


falloff = training._falloff
FAULTS = {
    "Eq. 7's factor": ("ALPHA_DECAY", 0.7),
    "the radius never shrinks": ("_falloff", at_first),
    "the falloff's half": ("_falloff", twice_as_steep),
    "each unit's farthest original": ("_lut_cells", farthest),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_that_check_notices(monkeypatch, fault):
    source = table()
    expected = by_section_4(source, NEIGHBOURS)
    check_same(learnt(source, NEIGHBOURS), expected)
    monkeypatch.setattr(training, *FAULTS[fault])
    must_fail(check_same, learnt(source, NEIGHBOURS), expected)


def test_that_check_notices_cells_that_are_stored_again():
    expected = by_section_4(table(), TrainOptions(clusters=7, epochs=4, distinct=True))
    must_fail(check_same, learnt(table(), TrainOptions(clusters=7, epochs=4)), expected)


def test_that_check_notices_another_order_of_the_lut():
    source = table()
    weights, stored, lut, index, errors = by_section_4(source, NEIGHBOURS)
    reverse = [len(lut) - 1 - entry for entry in index]
    must_fail(check_same, learnt(source, NEIGHBOURS), (weights, stored, lut[::-1], reverse, errors))


def check_collapsed(stored):
    """Every unit that won holds one cell in all its three slots."""
    won = stored[stored[:, 0] != reference.EMPTY]
    assert len(won) > 0
    assert (won == won[:, :1]).all()


def check_distinct(stored):
    """No unit holds a cell twice."""
    for unit in stored.tolist():
        cells = [cell for cell in unit if cell != reference.EMPTY]
        assert len(set(cells)) == len(cells)


@pytest.mark.parametrize(("rule", "alpha"), [("kohonen", 0.02), ("paper", 0.5)])
def test_three_memories_become_one_cell_unless_cells_are_distinct(small_table, rule, alpha):
    """Eq. 3-5 to the letter: a unit's nearest cell comes back in each epoch and takes the farthest slot."""
    given = {"clusters": 16, "epochs": 30, "rule": rule, "alpha": alpha}
    stored, apart = (learnt(small_table, TrainOptions(**given, distinct=value))[1] for value in (False, True))
    check_collapsed(stored)
    check_distinct(apart)
    assert (apart != reference.EMPTY).all()
    must_fail(check_collapsed, apart)
    must_fail(check_distinct, stored)


def test_a_cell_that_comes_back_by_hand():
    """One unit at ½, two cells at ½ and 1, Kohonen's rule, α = 0: the weight stays where it is.

    Epoch 1: both fill empty slots, [0, 1, -]. Epoch 2: cell 0 fills the third; cell 1, at a distance of ½ (squared ¼,
    times three channels), is as far as the farthest slot, which holds cell 1 already. Epoch 3: cell 0 takes that slot.
    """
    x = np.array([[0.5] * 3, [1.0] * 3], np.float32)
    for kernels in (_core, reference):
        repeated, distinct = (
            kernels.Learner(x, np.arange(2, dtype=np.uint32), x[:1], "kohonen", 1, distinct=value)
            for value in (False, True)
        )
        seen = []
        for _ in range(3):
            for learner in (repeated, distinct):
                learner.present(0, 2, 0.0, np.ones(1, np.float32))
            seen.append(repeated.stored_cells().tolist())
            assert distinct.stored_cells().tolist() == [[0, 1, reference.EMPTY]]
        assert seen == [[[0, 1, reference.EMPTY]], [[0, 1, 0]], [[0, 0, 0]]]


def test_units_that_never_win_are_missing_in_both():
    """A neighbourhood far wider than the chain moves all units to one place, where the lowest of them wins."""
    values = np.random.default_rng(2).integers(0, 65, (*LATTICE.shape, 3)) / 64
    source = BrdfTable(values, LATTICE)
    options = TrainOptions(clusters=4, epochs=1, alpha=1.0, radius=1000.0)
    expected = by_section_4(source, options)
    assert len(expected[2]) < 4
    check_same(learnt(source, options), expected)
