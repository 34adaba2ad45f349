"""What pictures of a material show: the data that is drawn, read back from the axes."""

from pathlib import Path

import numpy as np
import pytest
from compact import material as compact
from helpers import lambertian_table, must_fail
from matplotlib.figure import Figure
from pictures import NICKEL, PAINT, Tilted, axes, drawn, palette_material

from sommerl import MERL, Brdf, BrdfTable, builtin, plots
from sommerl.plots.curves import DIFFERENCES, INCIDENCES
from sommerl.plots.tone import Tone
from sommerl.reflectance.half_diff import directions, spherical
from sommerl.system.errors import MaterialError, MissingDependencyError, OptionError

# Curves


def curves(ax):
    """The lines that hold f_r: the rays to the mirror directions have two points."""
    return [line.get_data() for line in ax.get_lines() if len(line.get_xdata()) > 2]


def check_lobes(ax, brdf, theta_i):
    found = curves(ax)
    assert len(found) == len(theta_i)
    for (theta_o, f_r), angle in zip(found, theta_i, strict=True):
        wi = np.array([-np.sin(angle), 0, np.cos(angle)])
        wo = np.stack([np.sin(theta_o), 0 * theta_o, np.cos(theta_o)], -1)
        floor = ax.get_ylim()[0]
        assert np.allclose(f_r, np.maximum(brdf.eval(wi, wo).mean(-1), floor), rtol=1e-9)
        assert f_r.max() < ax.get_ylim()[1]


@pytest.mark.parametrize("brdf", [PAINT, Tilted(), palette_material(), compact()], ids=lambda brdf: brdf.name)
def test_lobes_are_what_eval_says(brdf):
    ax = drawn(plots.lobes, brdf, projection="polar")
    check_lobes(ax, brdf, INCIDENCES)
    check_lobes(drawn(plots.lobes, brdf, (0.3, 1.2), projection="polar"), brdf, (0.3, 1.2))
    must_fail(check_lobes, ax, NICKEL, INCIDENCES)
    must_fail(check_lobes, ax, brdf, INCIDENCES[::-1])


def check_circle(ax, f_r):
    for _, radius in curves(ax):
        assert np.allclose(radius, f_r, rtol=1e-12)
    low, high = ax.get_ylim()
    assert low < f_r < high


def test_a_lambertian_is_a_circle():
    ax = drawn(plots.lobes, lambertian_table(0.5), projection="polar")
    check_circle(ax, 0.5 / np.pi)
    must_fail(check_circle, ax, 0.4 / np.pi)
    must_fail(check_circle, drawn(plots.lobes, PAINT, projection="polar"), 0.5 / np.pi)


@pytest.mark.parametrize("name", ["chrome", "nickel"])
def test_the_peak_of_a_sharp_lobe_is_not_missed(name):
    """Chrome's highlight is a hundredth of a degree wide. It is found to the percent, and so is its flank."""
    brdf = builtin(name)
    for theta_i, (theta_o, f_r) in zip(INCIDENCES, curves(drawn(plots.lobes, brdf, projection="polar")), strict=True):
        fine = np.concatenate([theta_i + np.linspace(-0.02, 0.02, 40001), np.linspace(-1.57, 1.57, 5001)])
        wi, wo = np.array(spherical(-theta_i, 0.0)), np.stack(spherical(fine, np.zeros_like(fine)), -1)
        truth = brdf.eval(wi, wo).mean(-1)
        inside = (truth > 0) & (abs(fine - theta_i) < 0.02)
        assert f_r.max() > 0.99 * truth[inside].max()
        between = np.exp(np.interp(fine[inside], theta_o, np.log(f_r)))
        assert np.median(abs(between / truth[inside] - 1)) < 0.01


def test_several_materials_differ_in_their_lines():
    ax = drawn(plots.lobes, {"measured": PAINT, "a fit": NICKEL}, (0.0, 1.0), projection="polar")
    lines = [line for line in ax.get_lines() if len(line.get_xdata()) > 2]
    styles = [(line.get_linestyle(), tuple(line.get_color())) for line in lines]
    assert len(set(styles)) == 4
    assert styles[0][0] == styles[1][0] != styles[2][0]
    assert styles[0][1] == styles[2][1] != styles[1][1]
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["$\\theta_i$ = 0°", "$\\theta_i$ = 57.3°", "measured", "a fit"]
    assert len(drawn(plots.lobes, PAINT, projection="polar").get_legend().get_texts()) == len(INCIDENCES)


def check_slices_along_theta_h(ax, brdf, theta_d, phi_d):
    found = curves(ax)
    assert len(found) == len(theta_d)
    for (degrees, f_r), angle in zip(found, theta_d, strict=True):
        wi, wo = directions(*np.broadcast_arrays(np.radians(degrees), angle, phi_d))
        below = np.minimum(wi[2], wo[2]) < 1e-12
        assert np.array_equal(np.isnan(f_r), below)
        assert np.allclose(f_r[~below], brdf.eval(np.stack(wi, -1), np.stack(wo, -1)).mean(-1)[~below], rtol=1e-9)


@pytest.mark.parametrize("brdf", [PAINT, Tilted(), palette_material()], ids=lambda brdf: brdf.name)
def test_slices_along_theta_h_are_what_eval_says(brdf):
    ax = drawn(plots.theta_h_slices, brdf)
    check_slices_along_theta_h(ax, brdf, DIFFERENCES, np.pi / 2)
    must_fail(check_slices_along_theta_h, ax, brdf, DIFFERENCES[::-1], np.pi / 2)
    in_plane = drawn(plots.theta_h_slices, brdf, theta_d=(0.4, 1.3), phi_d=0.0)
    check_slices_along_theta_h(in_plane, brdf, (0.4, 1.3), 0.0)
    assert np.isnan(curves(in_plane)[1][1]).any()
    must_fail(check_slices_along_theta_h, in_plane, brdf, (0.4, 1.3), np.pi / 2)


def test_the_axis_is_spaced_as_merl():
    ax = drawn(plots.theta_h_slices, PAINT)
    place = ax.transData.transform([(x, 1.0) for x in (0, 22.5, 90)])[:, 0]
    assert (place[1] - place[0]) / (place[2] - place[0]) == pytest.approx(0.5)
    assert len(drawn(plots.theta_h_slices, {"a": PAINT, "b": NICKEL}).get_lines()) == 2 * len(DIFFERENCES)


# Images


def check_image(ax, brdf, tone, phi_d):
    (image,) = ax.get_images()
    pixels, (left, right, bottom, top) = image.get_array(), image.get_extent()
    height, width = pixels.shape[:2]
    assert image.origin == "lower"
    x = left + (np.arange(width) + 0.5) / width * (right - left)
    y = bottom + (np.arange(height) + 0.5) / height * (top - bottom)
    wi, wo = directions(*np.broadcast_arrays(x**2 * np.pi / 2, np.radians(y)[:, None], phi_d))
    above = np.minimum(wi[2], wo[2]) > 1e-12
    assert np.array_equal(pixels[..., 3] == 255, above)
    assert not pixels[~above].any()
    shown = tone.srgb8(brdf.eval(np.stack(wi, -1), np.stack(wo, -1)))
    assert np.array_equal(pixels[above][:, :3], shown[above])


@pytest.mark.parametrize("phi_d", [np.pi / 2, 0.0, 0.7])
@pytest.mark.parametrize("brdf", [PAINT, Tilted(), palette_material()], ids=lambda brdf: brdf.name)
def test_the_image_slice_is_what_eval_says(brdf, phi_d):
    ax = axes()
    tone = plots.slices(ax, brdf, phi_d)
    check_image(ax, brdf, tone, phi_d)
    must_fail(check_image, ax, NICKEL, tone, phi_d)
    must_fail(check_image, ax, brdf, tone, 0.9)
    again = axes()
    assert plots.slices(again, NICKEL, phi_d, tone) == tone
    check_image(again, NICKEL, tone, phi_d)


def test_a_nearest_lookup_shows_merls_cells():
    """Two pixels for each of MERL's bins, in each direction."""
    values = np.random.default_rng(2).random((*MERL.shape, 3))
    ax, phi_d = axes(), np.pi / 2 + 1e-4
    tone = plots.slices(ax, BrdfTable(values, interpolation="nearest"), phi_d)
    pixels = ax.get_images()[0].get_array()
    theta_h, theta_d = (axis[..., 0] for axis in MERL.axes()[:2])
    of_cells = BrdfTable(values).values.reshape(-1, 3)[MERL.cell(theta_h, theta_d, phi_d)].swapaxes(0, 1)
    for rows, columns in ((0, 0), (0, 1), (1, 0), (1, 1)):
        above = pixels[rows::2, columns::2, 3] == 255
        assert above.mean() > 0.99
        assert np.array_equal(pixels[rows::2, columns::2, :3][above], tone.srgb8(of_cells)[above])


def test_tones_keep_hue_and_order():
    colours = np.random.default_rng(0).random((1000, 3)) * 10.0 ** np.random.default_rng(1).uniform(-4, 4, (1000, 1))
    tone = Tone.of(colours)
    shown = tone.linear(colours)
    assert 0 <= shown.min() <= shown.max() <= 1
    assert np.allclose(shown / shown.max(-1, keepdims=True), colours / colours.max(-1, keepdims=True))
    order = np.argsort(colours.max(-1))
    assert (np.diff(shown.max(-1)[order]) >= 0).all()
    dark = np.array([[1e-4, 2e-4, 3e-4]]) * tone.base
    assert np.allclose(tone.linear(2 * dark), 2 * tone.linear(dark), rtol=1e-3)
    # No highlight: a grey that is neither black nor white. Nothing at all: black.
    grey = np.full((5, 3), 0.1)
    assert 60 < Tone.of(grey).srgb8(grey)[0, 0] < 200
    assert Tone.of(0 * grey).srgb8(0 * grey).max() == 0


# Sheets


@pytest.mark.parametrize(
    ("material", "kinds"),
    [
        (PAINT, ["lobes", "theta-h", "slices"]),
        (lambertian_table(), ["lobes", "theta-h", "slices", "hits"]),
        (palette_material(), list(plots.KINDS)),
        (compact(), ["lobes", "theta-h", "slices", "palette", "usage"]),
    ],
    ids=["formula", "table", "paper", "compact"],
)
def test_a_sheet_has_what_applies(material, kinds):
    figure, found = plots.sheet(material)
    assert found == kinds
    assert len(figure.axes) == len(kinds)
    assert figure.get_suptitle() == material.name


def test_several_materials_on_a_sheet():
    materials = {"a": palette_material(), "b": palette_material(20), "c": PAINT}
    figure, found = plots.sheet(materials)
    assert found == list(plots.KINDS)
    titles = [ax.get_title() for ax in figure.axes]
    assert [title.partition("\n")[0] for title in titles if "\n" in title] == ["a"] * 3 + ["b"] * 3 + ["c"]
    assert len(titles) == 2 + 1 + 7  # curves together, and hits once
    first = Figure().add_subplot()
    tone = plots.slices(first, materials["a"])
    (of_c,) = [ax for ax in figure.axes if ax.get_title().startswith("c\n")]
    check_image(of_c, PAINT, tone, np.pi / 2)


@pytest.mark.parametrize("extension", [".png", ".pdf", ".svg"])
def test_same_picture_same_bytes(tmp_path, extension, monkeypatch):
    """Whatever the user's settings are, and with no word of date or version."""
    import matplotlib

    paths = [tmp_path / f"{name}{extension}" for name in ("one", "two", "other")]
    for path, brdf in zip(paths, (palette_material(), palette_material(), palette_material(11)), strict=True):
        plots.save(plots.sheet(brdf)[0], path)
        monkeypatch.setitem(matplotlib.rcParams, "lines.linewidth", 9.0)
        monkeypatch.setitem(matplotlib.rcParams, "font.size", 20.0)
    one, two, other = (path.read_bytes() for path in paths)
    assert one == two != other
    assert matplotlib.__version__.encode() not in one
    assert matplotlib.rcParams["font.size"] == 20.0


def test_odd_names(tmp_path):
    """Neither a formula, nor left out of a legend, nor a warning for letters that the font lacks."""
    names = ["$x_", "_hidden", "漢字 {", "long " * 40, "\\theta"]
    figure, _ = plots.sheet(dict.fromkeys(names, lambertian_table()))
    plots.save(figure, tmp_path / "x.png")
    assert len(figure.axes[0].get_legend().get_texts()) == len(INCIDENCES) + len(names)


# What cannot be drawn


@pytest.mark.parametrize("draw", [plots.palette, plots.usage])
@pytest.mark.parametrize("brdf", [PAINT, lambertian_table()], ids=["formula", "table"])
def test_palettes_are_of_compressed_materials(draw, brdf):
    with pytest.raises(MaterialError, match=r"it has no palette, since it is not a compressed material$"):
        draw(axes(), brdf)


def test_hits_are_of_lattices_of_cells():
    for brdf in (PAINT, compact()):
        with pytest.raises(MaterialError, match="hits are drawn only of materials on a lattice of cells"):
            plots.hits(axes(), brdf)


class Black(Brdf):
    name = "black"

    def f_r(self, wi, wo, buffers):
        return 0 * wi[0], 0 * wi[0], 0 * wi[0]


def test_bad_calls():
    with pytest.raises(ValueError, match="expected polar axes, found rectilinear"):
        plots.lobes(axes(), PAINT)
    for angles in ((), (30.0,), (-0.1,), (np.nan,)):
        with pytest.raises(ValueError, match="theta_i: expected angles from 0 to less than π/2"):
            plots.lobes(axes("polar"), PAINT, angles)
        with pytest.raises(ValueError, match="theta_d: expected angles from 0 to less than π/2"):
            plots.theta_h_slices(axes(), PAINT, angles)
    for draw, projection in ((plots.lobes, "polar"), (plots.theta_h_slices, None)):
        with pytest.raises(MaterialError, match="the material is black"):
            draw(axes(projection), Black())
        for many in ({}, dict.fromkeys("abcdef", PAINT)):
            with pytest.raises(MaterialError, match=f"expected 1 to 5 in a picture, found {len(many)}"):
                draw(axes(projection), many)
    with pytest.raises(OptionError, match=r"kind: expected lobes, .* or all, found lobe"):
        plots.sheet(PAINT, "lobe")
    with pytest.raises(OptionError, match=r"x.gif: expected a name that ends in .png or .pdf or .svg, found '.gif'"):
        plots.save(Figure(), Path("x.gif"))


def test_without_matplotlib(monkeypatch):
    import sommerl.system.optional

    def missing(module):
        raise ModuleNotFoundError(module)

    monkeypatch.setattr(sommerl.system.optional.importlib, "import_module", missing)
    with pytest.raises(MissingDependencyError, match="plots: matplotlib is needed and not installed"):
        plots.sheet(PAINT)
