import itertools

import numpy as np
import pytest
from helpers import SMALL, must_fail

from sommerl import BrdfTable, TrainOptions, _core, train
from sommerl.compression.paper import reference
from sommerl.system.errors import MaterialError, OptionError

CASES = [
    (rule, order, clusters, radius, topology)
    for rule, order, clusters in itertools.product(("paper", "kohonen"), ("seeded", "table"), (1, 2, 3, 15, 16, 17, 64))
    for radius, topology in ((0.0, "chain"), (3.0, "chain"), (1.5, "sheet"))
]


def trace(kernels, table, options):
    """Everything that training makes, the learner's weights and stored originals among them."""
    kept = []

    class Recorded:
        EMPTY = kernels.EMPTY
        Quantiser = kernels.Quantiser

        class Learner:
            def __new__(cls, *arguments, **options):
                kept.append(kernels.Learner(*arguments, **options))
                return kept[0]

    material, report = train(table, options, kernels=Recorded)
    learned = kept[0].weights().tobytes(), kept[0].stored_cells().tobytes()
    return *learned, material.lut.tobytes(), material.index.tobytes(), report.quantisation_error


def check_same_bits(kernels, table, options):
    assert trace(kernels, table, options) == trace(reference, table, options)


@pytest.mark.parametrize(("rule", "order", "clusters", "radius", "topology"), CASES)
def test_the_core_equals_the_reference_bit_for_bit(small_table, rule, order, clusters, radius, topology):
    options = TrainOptions(
        clusters=clusters, epochs=4, rule=rule, alpha=0.5, order=order, radius=radius, topology=topology, seed=clusters
    )
    check_same_bits(_core, small_table, options)


def test_the_core_equals_the_reference_at_the_default_rate(small_table):
    check_same_bits(_core, small_table, TrainOptions(clusters=32, epochs=8))


@pytest.mark.parametrize(("rule", "clusters"), list(itertools.product(("paper", "kohonen"), (3, 16, 40))))
def test_the_core_equals_the_reference_with_distinct_cells(small_table, rule, clusters):
    check_same_bits(_core, small_table, TrainOptions(clusters=clusters, epochs=8, rule=rule, alpha=0.3, distinct=True))


@pytest.mark.parametrize("fault", ["distance", "tie", "replace", "rate"])
def test_that_check_notices_the_smallest_faults(small_table, fault):
    class Broken(reference.Learner):
        def present(self, start, stop, alpha, falloff):
            if fault == "rate":
                alpha = np.nextafter(np.float32(alpha), np.float32(1))
            return super().present(start, stop, alpha, falloff)

        def _attract(self, winner, x, cell, alpha):
            if fault == "replace":  # never replaces what it has stored
                if reference.EMPTY in self._stored[winner]:
                    super()._attract(winner, x, cell, alpha)
            elif fault == "distance":  # stores the nearest three seen, but is not drawn to them
                before = self._c[winner].copy()
                super()._attract(winner, x, cell, alpha)
                self._c[winner] = before
            elif fault == "tie":  # a stored original at the same distance stays
                if cell not in self._stored[winner]:
                    super()._attract(winner, x, cell, alpha)
            else:
                super()._attract(winner, x, cell, alpha)

    class Kernels:
        EMPTY = reference.EMPTY
        Learner = Broken
        Quantiser = reference.Quantiser

    must_fail(check_same_bits, Kernels, small_table, TrainOptions(clusters=16, epochs=3, alpha=0.5))


def test_one_step_by_hand():
    """Two units; one presented triple; Eq. 1, 2, 4 and 6 on paper."""
    x = np.array([[0.5, 0.5, 0.5]], np.float32)
    weights = np.array([[0.25, 0.5, 0.5], [1.0, 1.0, 1.0]], np.float32)
    learner = _core.Learner(x, np.array([7], np.uint32), weights, "paper", 2)
    distance = learner.present(0, 1, 0.5, np.ones(1, np.float32))
    assert distance == 0.25
    # 0.25 + 0.5 · 0.5 · 0.25 = 0.3125, and again, towards what is now stored: 0.3125 + 0.25 · 0.1875 = 0.359375
    assert learner.weights().tolist() == [[0.359375, 0.5, 0.5], [1.0, 1.0, 1.0]]
    assert learner.stored_cells()[:, 0].tolist() == [7, _core.EMPTY]


def test_ties_go_to_the_lowest_unit():
    x = np.array([[0.5, 0.0, 0.0]], np.float32)
    lut = np.array([[1.0, 0, 0], [0.0, 0, 0]] * 20, np.float32)
    assert reference.Quantiser(lut).query(x).tolist() == [0]
    for search, simd in itertools.product(("boxes", "all"), _core.simd_paths()):
        assert _core.Quantiser(lut, search, simd).query(x).tolist() == [0]
        assert _core.Quantiser(lut[1:], search, simd).query(x).tolist() == [0]


def test_lut_holds_originals_and_every_cell_its_nearest(small_table):
    material, _ = train(small_table, TrainOptions(clusters=20, epochs=5))
    above = SMALL.above_horizon
    originals = {tuple(value) for value in small_table.values[above]}
    assert all(tuple(entry) in originals for entry in material.lut)
    distance = ((small_table.values[above][:, None] - material.lut) ** 2).sum(axis=-1)
    chosen = distance[np.arange(len(distance)), material.index[above]]
    assert np.allclose(chosen, distance.min(axis=1), rtol=1e-4, atol=1e-12)
    assert (material.index[~above] == 0).all()


@pytest.mark.parametrize("clusters", [85, 86, 256, 257])
def test_looking_up_cell_centres_gives_the_cells(small_table, clusters):
    """With 8 or 16 bits an index must not wrap where it is multiplied."""
    material, _ = train(small_table, TrainOptions(clusters=clusters, epochs=1, alpha=0.001))
    assert material.index.max() == clusters - 1
    assert np.array_equal(BrdfTable.sampled(material, SMALL).values, material.values)


def test_any_brdf_can_be_trained_on(small_table):
    options = TrainOptions(clusters=8, epochs=1)
    first, _ = train(small_table, options)
    again, _ = train(first, options)
    assert np.array_equal(again.values, first.values)
    assert again.source.sha256 != small_table.source.sha256  # that of its direct source


def test_values_below_the_horizon_do_not_matter(small_table):
    values = small_table.values.copy()
    values[~SMALL.above_horizon] = 1e9
    options = TrainOptions(clusters=8, epochs=3)
    one, other = train(small_table, options)[0], train(BrdfTable(values, SMALL), options)[0]
    assert np.array_equal(one.lut, other.lut)
    assert np.array_equal(one.index, other.index)


def test_seed_and_order_change_the_result_and_nothing_else_does(small_table):
    def result(**options):
        return train(small_table, TrainOptions(clusters=16, epochs=3, **options))[0].lut.tobytes()

    assert result() == result()
    assert result() != result(seed=1)
    assert result() != result(order="table")


def test_units_that_never_win_are_dropped():
    """A neighbourhood far wider than the chain moves all units to one place: the lowest of them wins ever after."""
    values = np.random.default_rng(2).integers(0, 65, (*SMALL.shape, 3)) / 64  # sums and differences are exact
    options = TrainOptions(clusters=4, epochs=1, alpha=1.0, radius=1000.0, rule="kohonen")
    material, report = train(BrdfTable(values, SMALL), options)
    assert report.units_dropped == 4 - material.clusters > 0
    assert material.index.max() < material.clusters


def test_as_many_units_as_colours_is_lossless_and_more_are_refused():
    values = np.ones((*SMALL.shape, 3))
    values[0, 0, :5, 0] = [0.1, 0.2, 0.3, 0.4, 0.5]
    table = BrdfTable(values, SMALL, name="six")
    material, _ = train(table, TrainOptions(clusters=6, epochs=2))
    assert np.array_equal(material.values, table.values)
    with pytest.raises(MaterialError, match="six: expected at least 7 distinct colours, one a cluster, found 6"):
        train(table, TrainOptions(clusters=7))


def test_lambertian_goes_through():
    values = np.full((*SMALL.shape, 3), 0.18 / np.pi)
    material, report = train(BrdfTable(values, SMALL), TrainOptions(clusters=1, epochs=2))
    assert (material.eval([0.6, 0.0, 0.8], [0, 0.6, 0.8]) == 0.18 / np.pi).all()
    assert report.quantisation_error == [0.0, 0.0]


def test_no_call_into_the_core_takes_long(small_table, monkeypatch):
    """An interruption waits for the end of a call; so each of them is bounded, the query's too."""
    monkeypatch.setattr("sommerl.compression.paper.train.COMPARISONS_A_CALL", 640)
    counts = []

    class Kernels:
        class Learner(_core.Learner):
            def present(self, start, stop, alpha, falloff):
                counts.append((stop - start) * 16)
                return super().present(start, stop, alpha, falloff)

        class Quantiser:
            def __init__(self, lut):
                self.entries, self.quantiser = len(lut), _core.Quantiser(lut)

            def query(self, triples):
                counts.append(len(triples) * self.entries)
                return self.quantiser.query(triples)

    options = TrainOptions(clusters=16, epochs=2)
    material, _ = train(small_table, options, kernels=Kernels)
    assert max(counts) <= 640
    assert sum(counts) == 3 * 16 * SMALL.above_horizon.sum()
    monkeypatch.undo()
    assert np.array_equal(material.index, train(small_table, options)[0].index)


def test_report_and_progress(small_table):
    steps = []
    _, report = train(small_table, TrainOptions(clusters=8, epochs=6), progress=lambda *step: steps.append(step))
    assert len(report.quantisation_error) == 6
    assert report.quantisation_error[-1] < report.quantisation_error[0]
    assert report.seconds > 0
    assert steps[-1][0] == steps[-1][1] == 6 * SMALL.above_horizon.sum()
    assert [done for done, _ in steps] == sorted(done for done, _ in steps)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("clusters", 0), ("clusters", 65537), ("epochs", 0), ("seed", -1), ("alpha", 0.0), ("alpha", 1.5),
        ("alpha", float("nan")), ("clusters", 4.5), ("seed", "one"), ("alpha", None),
        ("radius", -1.0), ("radius", float("inf")), ("rule", "hebb"), ("order", "up"),
        ("topology", "torus"), ("distinct", "yes"), ("distinct", 2),
    ],
)  # fmt: skip
def test_senseless_options_are_refused(option, value):
    with pytest.raises(OptionError, match=f"^{option}: expected .*, found"):
        TrainOptions(**{option: value})


def test_options_may_be_numpys_numbers():
    options = TrainOptions(
        clusters=np.int64(4), seed=np.uint8(1), alpha=np.float32(0.5), radius=2, distinct=np.bool(True)
    )
    found = options.clusters, options.seed, options.alpha, options.radius, options.distinct
    assert [type(value) for value in found] == [int, int, float, float, bool]


def test_distinct_is_noted_only_where_it_is_set():
    assert "distinct" not in TrainOptions().noted()
    assert TrainOptions(distinct=True).noted() == TrainOptions().noted() | {"distinct": True}


def test_the_core_refuses_what_would_read_outside():
    x, cells, falloff = np.zeros((4, 3), np.float32), np.arange(4, dtype=np.uint32), np.ones(1, np.float32)
    learner = _core.Learner(x, cells, x, "paper", 4)
    for start, stop in ((0, 5), (3, 2)):
        with pytest.raises(ValueError, match="a range within the triples"):
            learner.present(start, stop, 0.5, falloff)
    with pytest.raises(ValueError, match="expected a falloff"):
        learner.present(0, 4, 0.5, falloff[:0])
    for arguments in (
        (x[:, :2], cells, x, "paper", 4), (x, cells[:3], x, "paper", 4), (x, cells, x[:0], "paper", 4),
        (x, cells, x, "hebb", 4), (x, cells, x, "paper", 0), (x, cells, x, "paper", 4, "luck"),
        (x, cells, x, "paper", 4, "boxes", "sse9"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="expected"):
            _core.Learner(*arguments)
    for arguments in ((x[:0],), (x[:, :2],), (x, "scalar"), (x, "boxes", "sse9")):
        with pytest.raises(ValueError, match="expected"):
            _core.Quantiser(*arguments)
