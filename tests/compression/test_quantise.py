"""The compact preset: palettes, indices, and the choice of a size or a quality."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import compact_material, complaint, lambertian_table, must_fail, random_directions

from sommerl import BrdfTable, Lattice, builtin, load, save
from sommerl.commands.cli import main
from sommerl.compression.compact import effort as efforts
from sommerl.compression.compact import search
from sommerl.compression.compact.lattice_fit import Fitter
from sommerl.compression.compact.quantise import Quantised, quantise
from sommerl.compression.compact.search import CompactOptions, Compressor, compress
from sommerl.compression.smrl import file
from sommerl.compression.smrl.codes import coordinates, gain_codes, gain_values, shape_codes, shape_values
from sommerl.reflectance.nodes import NodeLattice
from sommerl.reflectance.reciprocal import reciprocal
from sommerl.render.judge import JUDGED
from sommerl.system.errors import MaterialError, OptionError

A, B = (w[w[:, 2] > 0.1] for w in (random_directions(20_000, s) for s in (1, 2)))
A, B = A[:15_000], B[:15_000]


@pytest.fixture(scope="module")
def fitter():
    return Fitter(builtin("blue-metallic-paint"), effort=efforts.of(1))


@pytest.fixture(scope="module")
def problem(fitter):
    return fitter.problem(1000)


def test_codes_and_values():
    codes = np.arange(4096)
    assert np.array_equal(gain_codes(gain_values(codes)), codes)
    assert np.all(np.diff(gain_values(codes)) > 0)
    assert gain_values(np.array([0, 128, 256])).tolist() == [0.0, 0.5, 1.5]
    shapes = np.random.default_rng(0).integers(-200, 200, (500, 2))
    assert np.array_equal(shape_codes(coordinates(shape_values(shapes))), shapes)
    assert np.allclose(shape_values(shapes).mean(axis=1), 1)


def check_fits(problem, found, stream, target):
    quantised, data = found, stream
    assert len(data) <= target
    palette = quantised.palette(problem.lattice)
    assert palette.encode(quantised.gain_index, quantised.shape_index) == data
    # That of black is the sum of all squares: 44 dB in the cube-root domain.
    assert problem.excess(quantised.values()) < 4e-5 * problem.excess(0 * problem.best)


def test_a_stream_of_at_most_a_size(problem):
    found, stream = quantise(problem, 80, 50, 800)
    check_fits(problem, found, stream, 800)
    must_fail(check_fits, problem, found, stream, len(stream) - 1)
    worse = Quantised(found.gains, np.roll(found.gain_index, 1), found.shapes, found.shape_index)
    must_fail(
        check_fits, problem, worse, worse.palette(problem.lattice).encode(worse.gain_index, worse.shape_index), 800
    )


def test_more_bytes_are_better(problem):
    errors = [problem.excess(quantise(problem, 80, 50, size)[0].values()) for size in (500, 800)]
    assert errors[1] < errors[0]


def test_it_is_repeatable(problem):
    assert quantise(problem, 60, 40, 700, seed=3)[1] == quantise(problem, 60, 40, 700, seed=3)[1]
    assert quantise(problem, 60, 40, 700, seed=3)[1] != quantise(problem, 60, 40, 700, seed=4)[1]


def test_without_refinement_entries_are_the_sources(problem):
    """The MAN's gains and shapes: those of nodes, as codes."""
    found, _ = quantise(problem, 60, 40, 700, refine=False)
    values = np.maximum(problem.best, 0) + 1e-4
    gains = values.mean(axis=1)
    assert np.isin(found.gains, gain_codes(gains)).all()
    nodes = {tuple(code) for code in shape_codes(coordinates(values / gains[:, None])).tolist()}
    assert {tuple(code) for code in found.shapes.tolist()} <= nodes
    refined, _ = quantise(problem, 60, 40, 700)
    assert problem.excess(refined.values()) < problem.excess(found.values())
    assert not np.isin(refined.gains, gain_codes(gains)).all()


def test_k_means_is_no_other_way_to_the_end(problem):
    """Palettes are refined by turns: where they started matters little, in the mean of some starts."""
    gains, shapes = (round(share * 1000**0.5) for share in (search.GAINS, search.SHAPES))

    def error(start):
        found = [quantise(problem, gains, shapes, 900, start=start, seed=seed)[0] for seed in range(3)]
        return np.mean([problem.error + problem.excess(each.values()) for each in found])

    errors = error("som"), error("k-means")
    assert max(errors) < 1.3 * min(errors)


def test_excess_is_the_difference_of_errors(problem):
    values = problem.best + np.random.default_rng(1).normal(scale=0.1, size=problem.best.shape)
    error = [
        float((z * (problem.equations.product(z) - 2 * problem.equations.right)).sum()) for z in (problem.best, values)
    ]
    assert problem.excess(values) == pytest.approx(error[1] - error[0], rel=1e-3)


@pytest.fixture(scope="module")
def compact():
    return compress(builtin("red-fabric"), CompactOptions(target_size=900, effort=1))


def check_close(brdf, source, worst):
    found, true = brdf.eval(A, B), source.eval(A, B)
    assert np.median(np.abs(found - true) / true) < worst


def test_a_size(tmp_path, compact):
    material, report = compact
    assert save(material, tmp_path / "x.smrl") <= 900
    again = load(tmp_path / "x.smrl")
    assert np.array_equal(again.eval(A, B), material.eval(A, B))
    assert (again.name, again.source) == (material.name, material.source)
    check_close(again, builtin("red-fabric"), 0.02)
    must_fail(check_close, again, builtin("beige-fabric"), 0.02)
    assert report.quality is None
    assert len(report.tried) == 1


def check_albedo(brdf, albedo):
    """From a viewer at 45°, over the hemisphere."""
    light = random_directions(100_000, 5)
    found = (brdf.eval(light, [np.sqrt(0.5), 0, np.sqrt(0.5)]) * light[:, 2:]).mean(axis=0) * 2 * np.pi
    true = albedo * light[:, 2].mean() * 2
    assert np.allclose(found, true, rtol=3e-3)


def test_a_lambertian_comes_back():
    material, _ = compress(lambertian_table(0.5), CompactOptions(target_size=900, effort=1))
    check_close(material, lambertian_table(0.5), 0.01)
    check_albedo(material, 0.5)
    must_fail(check_albedo, material, 0.505)
    assert np.array_equal(material.eval(A, B), material.eval(B, A))


def test_what_is_not_reciprocal_stays_so_or_is_averaged():
    lattice = Lattice(20, 20, 40, reciprocal=False)
    values = np.full((*lattice.shape, 3), 0.1)
    values[:, :, 20:] = 0.3
    source = BrdfTable(values, lattice)
    material, _ = compress(source, CompactOptions(target_size=600, effort=1))
    assert [material.reciprocal, material.mirrored] == [False, False]
    check_close(material, source, 0.02)
    must_fail(check_close, reciprocal(source), source, 0.02)
    material, _ = compress(reciprocal(source), CompactOptions(target_size=600, effort=1))
    assert material.reciprocal
    check_close(material, reciprocal(source), 0.02)
    assert np.median(material.eval(A, B)) == pytest.approx(0.2, rel=0.02)


def test_one_pure_colour():
    source = lambertian_table(0.5)
    source.values[..., 1:] = 0
    material, _ = compress(source, CompactOptions(target_size=600, effort=1))
    found = material.eval(A, B)
    assert np.median(found[:, 0]) == pytest.approx(0.5 / np.pi, rel=0.02)
    assert found[:, 1:].max() < 1e-3 * 0.5 / np.pi


def test_what_decides_is_handed_in(monkeypatch):
    monkeypatch.setattr(efforts, "EFFORTS", (replace(efforts.of(1), spread=(1.0, 0.8, 1.2)),))
    seen = []

    def quality(material):
        seen.append(material.lattice.size)
        return 40.0 + len(seen)

    material, report = compress(builtin("red-fabric"), CompactOptions(target_size=700, effort=1), quality=quality)
    assert report.quality == 43.0
    assert material.lattice.size == seen[-1] == report.tried[-1][1]


def test_a_quality():
    """Of a made-up quality that grows with the file, the smallest that is good enough."""

    def quality(material):
        return 30 + 3 * np.log2(len(file.encode(material)) / 400)

    material, report = compress(builtin("red-fabric"), CompactOptions(target_psnr=33, effort=1), quality=quality)
    assert report.quality >= 33
    assert len(file.encode(material)) < 900
    assert report.quality == pytest.approx(quality(material), abs=1e-3)


def test_a_quality_that_grows_slowly():
    """Only the largest file is good enough."""

    class Slow(search.Compressor):
        def __init__(self):
            self.sizes, self._head = [], 0

        def _candidate(self, size, spread):
            self.sizes.append(size)
            return 40 + 0.8 * np.log2(size / 2000), None

    slow = Slow()
    assert slow.of_quality(40 + 0.8 * np.log2(60_000 / 2000))[0] == pytest.approx(44, abs=0.1)
    assert slow.sizes[-1] == search.LARGEST_SIZE


def test_a_name_that_fills_the_file():
    source = lambertian_table(0.5)
    source.name = "x" * 250
    with pytest.raises(
        MaterialError, match="its name and source take 302 bytes of the 300 asked for; ask for at least 604 bytes"
    ):
        compress(source, CompactOptions(target_size=300))


def test_a_quality_that_a_small_file_has_for_all_its_long_name():
    source = lambertian_table(0.5)
    source.name = "x" * 250
    material, report = compress(source, CompactOptions(target_psnr=45), quality=lambda _: 50.0)
    assert material.name == source.name
    assert 604 <= report.tried[-1][0] < 700


def test_a_quality_out_of_reach(monkeypatch):
    monkeypatch.setattr(search, "LARGEST_SIZE", 600)
    with pytest.raises(
        MaterialError, match=r"it cannot be compressed with 70 dB; the best file found has 12.0 dB with 600 bytes"
    ):
        compress(builtin("red-fabric"), CompactOptions(target_psnr=70, effort=1), quality=lambda material: 12.0)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"target_size": 299}, "target_size: expected 300 to 64000, found 299"),
        ({"target_size": 1e6}, "target_size: expected a whole number, found 1000000.0"),
        ({"target_psnr": float("nan")}, "target_psnr: expected 20 to 80, found nan"),
        ({"target_psnr": 99.0}, "target_psnr: expected 20 to 80, found 99"),
        ({"target_psnr": 40.0, "target_size": 1000}, "a size and a PSNR cannot both be asked for"),
        ({"seed": -1}, "seed: expected 0 to"),
        ({"effort": 0}, "effort: expected 1 to 9, found 0"),
        ({"effort": 10}, "effort: expected 1 to 9, found 10"),
        ({"effort": 1.5}, "effort: expected a whole number, found 1.5"),
    ],
)
def test_bad_options(options, sentence):
    with pytest.raises(OptionError, match=sentence):
        CompactOptions(**options)


@pytest.mark.parametrize("effort", [0, 10])
def test_no_such_effort(effort):
    with pytest.raises(OptionError, match=f"effort: expected 1 to 9, found {effort}"):
        Compressor(builtin("nickel"), effort=effort)


def test_a_psnr_needs_somebody_who_measures():
    assert "a function that measures the quality is needed" in (complaint(compress, builtin("nickel")) or "")


def test_black_is_refused():
    table = lambertian_table(0.5)
    table.values[:] = 0
    assert "it cannot be compressed, since it is black" in (
        complaint(compress, table, CompactOptions(target_size=500)) or ""
    )


def test_on_the_command_line(capsys, tmp_path):
    path = tmp_path / "x.smrl"
    assert main(["compress", "red-fabric", "-o", str(path), "--target-size", "800"]) == 0
    text = capsys.readouterr().out
    assert "PSNR in soft light" in text
    assert path.stat().st_size <= 800


def test_one_that_fails_does_not_hold_up_the_others(capsys, tmp_path, monkeypatch):
    def only_fabric(brdf, options, **_):
        if "fabric" not in brdf.name:
            raise MaterialError(f"{brdf.name}: out of reach")
        return compact_material(NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)), 2, 2, name="fabric"), report

    report = search.CompactReport(40.0, 1.0, [])
    monkeypatch.setattr("sommerl.compression.compact.search.compress", only_fabric)
    figures = {metric.key: 1.0 for metric in JUDGED}
    monkeypatch.setattr("sommerl.render.judge.Judge.metrics", lambda *_: figures)
    assert main(["compress", "nickel", "red-fabric", "-o", str(tmp_path), "--preset", "compact"]) == 1
    error = capsys.readouterr().err
    assert "nickel (SGD stand-in): out of reach" in error
    assert "expected to compress 2 materials, found 1 that failed" in error
    assert [path.name for path in tmp_path.iterdir()] == ["red-fabric.smrl"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--preset", "paper", "--target-size", "800"], "--target-size: expected --preset compact, found paper"),
        (["--target-size", "800", "--clusters", "9"], "--clusters: expected --preset paper, found compact"),
        (["--effort", "2"], "--effort: expected --preset compact, found paper"),
        (["--target-size", "800", "--effort", "10"], "--effort: expected 1 to 9, found 10"),
        (["--target-size", "8"], "--target-size: expected 300 to 64000, found 8"),
    ],
)
def test_bad_arguments(capsys, tmp_path, arguments, sentence):
    assert main(["compress", "nickel", "-o", str(tmp_path / "x.smrl"), *arguments]) == 2
    assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
