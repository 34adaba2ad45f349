"""Samples on grids, the report of what was written, and what physics finds."""

import numpy as np
import pytest
from helpers import must_fail, random_directions, run_json

from sommerl import builtin, load
from sommerl.commands import laboratory
from sommerl.commands.cli import main
from sommerl.formats import held_out
from sommerl.formats.compared import compared, figures, samples_of
from sommerl.formats.gridded import grid_of
from sommerl.formats.meant import as_f_r
from sommerl.formats.plausible import checked
from sommerl.formats.reading import AS_IT_IS, Reading, reading
from sommerl.formats.residuals import COLUMNS
from sommerl.formats.scattered import ScatteredBrdf, from_samples
from sommerl.reflectance.grid import GridBrdf
from sommerl.reflectance.samples import Samples, polar_angles

FABRIC = builtin("red-fabric")


def on_grid(brdf, step=4.0, phi_step=10.0, highest=84.0):
    theta = np.arange(0, highest + step / 2, step)
    angles = np.stack(np.meshgrid(theta, theta, np.arange(0, 181, phi_step), indexing="ij"), axis=-1).reshape(-1, 3)
    return measured(brdf, np.insert(angles, 1, 0.0, axis=1))


def measured(brdf, degrees):
    found = Samples.at_angles(np.radians(degrees), np.zeros((len(degrees), 3)))
    return Samples(found.wi, found.wo, brdf.eval(found.wi, found.wo))


GRID = on_grid(FABRIC)


def check_near(brdf, worst):
    wi, wo = random_directions(3000, 1), random_directions(3000, 2)
    high = np.minimum(wi[:, 2], wo[:, 2]) > 0.2
    true = FABRIC.eval(wi[high], wo[high])
    assert np.median(np.abs(brdf.eval(wi[high], wo[high]) - true) / true) < worst


def check_close(report):
    assert report["all"]["median"] < 0.002


@pytest.mark.parametrize("name", ["out.csv", "out.npy", "out.binary"])
def test_what_is_said_of_the_input_is_not_said_of_the_output(capsys, tmp_path, monkeypatch, name):
    """Some of what is written are tables of samples, too: the report reads them as f_r."""
    some = on_grid(FABRIC, 10.0, 30.0, 80.0)
    angles = np.degrees([*polar_angles(some.wi), *polar_angles(some.wo)])
    rows = np.column_stack([*angles, some.f_r * some.wo[:, 2:]])
    header = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    np.savetxt(tmp_path / "in.csv", rows, "%.8g", ",", header=header, comments="")
    options = ["convert", tmp_path / "in.csv", "--values", "f_r-cos"]
    command = [*options[:2], tmp_path / name, *options[2:], "--overwrite"]
    check_close(run_json(capsys, *command)["materials"][0]["samples_report"])
    if name != "out.binary":
        monkeypatch.setattr(laboratory, "load_written", load)
        must_fail(check_close, run_json(capsys, *command)["materials"][0]["samples_report"])


def test_a_regular_grid_is_recognised():
    """In any order, with or without the rows at the normal that say the same, and with some missing."""
    order = np.random.default_rng(0).permutation(len(GRID.wi))
    some = GRID.some(order[len(order) // 50 :])
    found = from_samples(some, name="x")
    assert isinstance(found, GridBrdf)
    assert 0 < found.facts["grid_points_missing"] < 0.05 * len(GRID.wi)
    check_near(found, 0.005)
    must_fail(check_near, from_samples(Samples(GRID.wi, GRID.wo, 1.02 * GRID.f_r), name="x"), 0.005)


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_at_the_normal_all_azimuths_are_one_point(scale):
    """Each point there is repeated in the file, once for every azimuth, and for both directions."""
    assert (GRID.wi[:, 2] == 1).sum() > 100
    constant = Samples(GRID.wi, GRID.wo, np.full_like(GRID.f_r, scale))
    values = grid_of(constant, name="x").values
    check_constant(values, scale)
    must_fail(check_constant, np.where(np.arange(values.shape[1])[:, None, None] == 0, values / 19, values), scale)


def check_constant(values, scale):
    assert values == pytest.approx(scale, rel=1e-6)


def test_dark_materials_have_relative_errors_too():
    dark = GRID.f_r * 1e-4
    samples, half = Samples(GRID.wi, GRID.wo, dark), Samples(GRID.wi, GRID.wo, 0.5 * dark)
    found = figures(samples, grid_of(half, name="half"))
    assert [found[key] for key in ("median", "at_peak")] == pytest.approx([0.5, -0.5], abs=0.02)
    assert held_out.sizes(np.zeros((3, 3))).min() > 0


def test_what_is_no_fine_grid_is_fitted():
    assert grid_of(GRID.some(np.arange(0, len(GRID.wi), 2)), name="x") is None  # half of it is missing
    coarse = on_grid(FABRIC, step=12.0, phi_step=30.0)
    assert grid_of(coarse, name="x") is not None
    assert isinstance(from_samples(coarse, name="x"), ScatteredBrdf)


def test_figures_by_hand():
    """All values of a material that is ten per cent too bright, but for the brightest, which is right."""
    f_r = np.linspace(0.1, 0.5, 101)[:, None] * np.ones(3)
    wi, wo = (w[w[:, 2] > 0.1][:101] for w in (random_directions(300, 1), random_directions(300, 2)))

    class Said:
        def eval(self, a, b):
            known = {tuple(w): v for w, v in zip(wi, f_r, strict=True)}
            return np.array([known[tuple(w)] * (1.0 if known[tuple(w)][0] == 0.5 else 1.1) for w in a])

    found = figures(Samples(wi, wo, f_r), Said())
    assert found["samples"] == 101
    assert [found[key] for key in ("median", "percentile_95", "worst")] == pytest.approx([0.1] * 3)
    assert found["at_peak"] == pytest.approx(0.0, abs=1e-12)


def test_lines_of_incidence():
    degrees = [(i, 0, o, phi) for i in (10, 20, 30, 40, 50) for o in range(5, 80, 5) for phi in (0, 90, 180)]
    lines = held_out.lines(measured(FABRIC, np.array(degrees, float)))
    assert set(np.array(degrees)[lines, 0]) == {20}
    wi, wo = random_directions(3000, 1), random_directions(3000, 2)
    assert not held_out.lines(Samples(wi, wo, np.ones((3000, 3)))).any()  # at random, there are none


def check_report(report, bias):
    assert report["all"]["median"] == pytest.approx(bias, abs=0.01)
    assert report["held_out_lines"]["interpolated"]["median"] == pytest.approx(bias, abs=0.02)


def test_the_report_is_of_what_was_written():
    """Of a grid, lines are left out; and what is written too bright is told, in both parts."""
    source = from_samples(GRID, name="x")

    def brighter(brdf):
        return GridBrdf(*brdf.axes, 1.2 * brdf.values)

    report = compared(source, brighter(source), brighter)
    check_report(report, 0.2)
    must_fail(check_report, compared(source, source, lambda brdf: brdf), 0.2)
    assert compared(FABRIC, FABRIC, lambda brdf: brdf) is None
    assert samples_of(FABRIC) is None


def check_mistake(samples, brdf, option, how=AS_IT_IS):
    assert any(option in sentence for sentence in checked(samples, brdf, how)["mistakes"])


def test_no_option_is_named_that_would_do_nothing():
    """As of files whose values mean one thing alone: the mistake is told, and no option that mends it."""
    samples = Samples(GRID.wi, GRID.wo, 20 * GRID.f_r)
    (said,) = checked(samples, material(samples), None)["mistakes"]
    assert "more than there is" in said
    assert "--" not in said
    check_mistake(samples, material(samples), "--values")


def material(samples, how=AS_IT_IS):
    with reading(how):
        return from_samples(samples, name="x")


def test_values_times_the_cosine_are_found():
    wrong = Samples(GRID.wi, GRID.wo, GRID.f_r * GRID.wo[:, 2:])
    check_mistake(wrong, material(wrong), "--values f_r-cos")
    must_fail(check_mistake, GRID, material(GRID), "--values f_r-cos")
    mended = Reading(values="f_r-cos")
    check_near(material(wrong, mended), 0.005)
    must_fail(check_mistake, as_f_r(wrong, mended), material(wrong, mended), "--values f_r-cos", mended)


@pytest.mark.parametrize("factor", [np.pi, 100 * np.pi])
def test_reflectance_factors_and_per_cent_are_found(factor):
    white = Samples(GRID.wi, GRID.wo, np.full_like(GRID.f_r, 0.8 / np.pi))
    wrong = Samples(white.wi, white.wo, white.f_r * factor)
    check_mistake(wrong, material(wrong), "--values reflectance-factor")
    must_fail(check_mistake, white, material(white), "--values reflectance-factor")
    found = material(wrong, Reading(values="reflectance-factor")).eval(white.wi[5000], white.wo[5000])
    assert np.allclose(found, 0.8 / np.pi)


def test_azimuths_from_the_mirror_are_found():
    shiny = on_grid(builtin("blue-metallic-paint"))
    wrong = Samples(shiny.wi, shiny.wo * [-1, -1, 1], shiny.f_r)
    assert checked(shiny, material(shiny))["brightest"] == "specular"
    check_mistake(wrong, material(wrong), "--phi-from specular")
    must_fail(check_mistake, shiny, material(shiny), "--phi-from specular")
    assert np.allclose(as_f_r(wrong, Reading(phi_from="specular")).wo, shiny.wo)


def test_residuals_and_the_report_of_a_command(capsys, tmp_path):
    """A grid, so that it does not take long: each of its rows, and what MERL's table of it holds there."""
    samples = on_grid(FABRIC, step=5.0, phi_step=30.0, highest=80.0)
    angles = [
        np.degrees(a) for w in (samples.wi, samples.wo) for a in (np.arccos(w[:, 2]), np.arctan2(w[:, 1], w[:, 0]))
    ]
    header = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    rows = np.column_stack([*angles, samples.f_r])
    np.savetxt(tmp_path / "x.csv", rows, delimiter=",", header=header, comments="")
    found = run_json(capsys, "convert", tmp_path / "x.csv", tmp_path / "x.binary", "--residuals", tmp_path / "r.csv")
    table = np.loadtxt(tmp_path / "r.csv", delimiter=",", skiprows=2)
    assert table.shape[1] == len(COLUMNS)
    written = load(tmp_path / "x.binary")
    samples = Samples.at_angles(np.radians(table[:, :4]), table[:, 4:7])
    assert np.allclose(written.eval(samples.wi, samples.wo), table[:, 7:10], rtol=2e-3, atol=1e-4)
    assert found["samples_report"]["all"]["samples"] == len(table)
    assert found["physics"]["mistakes"] == []


def some_samples(path):
    """A small table of samples."""
    some = on_grid(FABRIC, 10.0, 30.0, 80.0)
    rows = np.column_stack([*np.degrees([*polar_angles(some.wi), *polar_angles(some.wo)]), some.f_r])
    np.savetxt(path, rows, "%.8g", ",", header="theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b", comments="")


def check_refused(capsys, output, residuals, *more):
    """Whether residuals are refused before anything is written, and the option is named."""
    some_samples(output.parent / "x.csv")
    there = {path: path.read_bytes() for path in output.parent.iterdir() if path.is_file()}
    code = main(["convert", str(output.parent / "x.csv"), *more, str(output), "--residuals", str(residuals)])
    assert code == 2
    assert "--residuals: expected" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in output.parent.iterdir() if path.is_file()} == there


def test_residuals_are_not_written_over_the_output(capsys, tmp_path):
    check_refused(capsys, tmp_path / "out.csv", tmp_path / "elsewhere" / ".." / "out.csv")
    must_fail(check_refused, capsys, tmp_path / "out.csv", tmp_path / "other.csv")


@pytest.mark.parametrize("name", ["out.h", "out.bin", "out.ktx2", "out.xml"])
def test_residuals_need_an_output_that_can_be_read(capsys, tmp_path, name):
    check_refused(capsys, tmp_path / name, tmp_path / "r.csv")


def test_residuals_are_of_one_material(capsys, tmp_path):
    check_refused(capsys, tmp_path / "out.glsl", tmp_path / "r.csv", "nickel")


def test_residuals_need_samples(capsys, tmp_path):
    assert main(["convert", "nickel", str(tmp_path / "x.binary"), "--residuals", str(tmp_path / "r.csv")]) == 2
    assert "--residuals: expected a material of samples" in capsys.readouterr().err


def check_like_the_first_side(samples):
    """Whether the grid of samples is that of GRID, whose azimuths are from 0 to 180°."""
    expected, found = (grid_of(each, name="x") for each in (GRID, samples))
    assert found.mirrored
    assert found.values.shape == expected.values.shape
    assert np.allclose(found.values, expected.values)


def test_one_side_of_a_grid_stands_for_both():
    """Whichever it is, and however its azimuths are counted."""
    flipped = Samples(GRID.wi, GRID.wo * [1, -1, 1], GRID.f_r)
    check_like_the_first_side(flipped)
    both = [np.concatenate([getattr(each, name) for each in (GRID, flipped)]) for name in ("wi", "wo", "f_r")]
    must_fail(check_like_the_first_side, Samples(*both))
