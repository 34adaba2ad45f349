"""What the page's panels draw: their numbers, in Node, against Python. (How they look is checked in the page.)"""

from functools import cache

import compact
import numpy as np
import page_files
import pytest
import rgl_files
from browser import wait_until
from helpers import must_fail
from in_node import program

from sommerl import Lattice, SomManBrdf, load
from sommerl.compression.smrl.file import decode, encode
from sommerl.models.builtin import builtin_table
from sommerl.reflectance.cells import HALF_PI, ON_HORIZON
from sommerl.reflectance.half_diff import directions
from sommerl.viewer.held import held
from sommerl.viewer.page import page

PHI_D = 0.7
ANSWER = """
import { decode } from "./smrl.js";
import { evaluate, places } from "./evaluate.js";
import { albedo } from "./albedo.js";
import { number } from "./draw.js";
import { lobe, scaleOf } from "./lobe.js";
import { chroma, counting, gainPlace } from "./palette.js";
import { cellsOf, directions, nodesOf, sliceSize, sliced } from "./slice.js";

const whole = (job) => { for (;;) { const { done, value } = job.next(); if (done) return value; } };
const light = [-Math.sin(0.6), 0, Math.cos(0.6)];

async function answer({ file, phiD, thetaO, numbers }) {
    const material = await decode(file);
    const { kind, lattice, gains, lut } = material;
    const [columns, rows] = sliceSize(material);
    const slice = Array.from(whole(sliced(material, phiD, columns, rows)), (x) => (Number.isNaN(x) ? null : x));
    const counts = Object.fromEntries(Object.entries(whole(counting(material))).map(([name, n]) => [name, [...n]]));
    const curve = whole(lobe(material, 0.6));
    const withWeight = ({ at, a, b }) => {
        const found = places(material, ...directions((a * a * Math.PI) / 2, (b * Math.PI) / 2, phiD));
        return { at, a, b, weight: found.reduce((sum, one) => sum + (one.at === at ? one.weight : 0), 0) };
    };
    return {
        columns, rows, slice, counts,
        nodes: kind === "nodes" ? nodesOf(lattice, phiD).map(withWeight) : null,
        cells: kind === "cells" ? [...cellsOf(lattice, phiD)] : null,
        albedo: thetaO.map((t) => whole(albedo(material, t))),
        angles: curve.map(([t]) => t),
        lobe: curve.map(([, f]) => f),
        inPlane: curve.map(([t]) => evaluate(material, light, [Math.sin(t), 0, Math.cos(t)])),
        scales: ["linear", "root", "log"].map((name) => [3, 1.5, 0.02, 0].map(scaleOf(name, [0.02, 1.5, 3, 0]).at)),
        places: gains && [...gains].map(gainPlace),
        chroma: Array.from({ length: lut.length / 3 }, (_, n) => chroma(lut.subarray(3 * n))),
        numbers: numbers.map(([x, trim]) => number(x, trim)),
    };
}
"""
VIEWS = np.radians([0, 20, 40, 60, 75, 85])
NUMBERS = {
    (0.0, False): "0",
    (0.1, False): "0.100",
    (0.1, True): "0.1",
    (12.345, False): "12.3",
    (-0.5, True): "−0.5",
    (99.96, False): "100",
    (1234.5, False): "1235",
    (0.00012345, False): "1.23\u00a0·\u00a010⁻⁴",
    (1e-5, True): "10⁻⁵",
    (3.4e38, True): "3.4\u00a0·\u00a010³⁸",
}


def cells(lattice, entries=40):
    rng = np.random.default_rng(lattice.size)
    index = rng.integers(0, entries, lattice.shape).astype(np.uint8)
    return SomManBrdf(rng.random((entries, 3)), index, lattice, name="made up", interpolation="nearest")


def lambertian(albedo):
    lattice = Lattice(8, 8, 12)
    return SomManBrdf(np.full((1, 3), albedo / np.pi), np.zeros(lattice.shape, np.uint8), lattice, name="even")


def glossy():
    """A stand-in that is held with an entry for each cell."""
    table = builtin_table("nickel", lattice=Lattice(40, 30, 36))
    index = np.arange(table.grid.size, dtype=np.uint16).reshape(table.grid.shape)
    values = np.where(table.grid.above_horizon[..., None], table.values, 0).reshape(-1, 3)
    return SomManBrdf(values, index, table.grid, name="glossy", interpolation="trilinear")


MATERIALS = {
    "cells": cells(Lattice(9, 7, 12)),
    "cells, not reciprocal": cells(Lattice(9, 7, 12, reciprocal=False)),
    **{f"nodes, {fold}": compact.material(folds=compact.FOLDS[fold], signed=True) for fold in compact.FOLDS},
}


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    """What the panels find in a material."""
    run = program(tmp_path_factory.mktemp("js"), ANSWER)
    given = {"phiD": PHI_D, "thetaO": VIEWS.tolist(), "numbers": list(NUMBERS)}
    return cache(lambda data: run([(given, data)])[0])


@pytest.fixture(params=MATERIALS)
def material(request):
    return MATERIALS[request.param]


def check_counts(counts, material):
    if material.grid is None:
        gains, shapes = material.index
        assert counts["gain"] == np.bincount(gains, minlength=len(material.palette.gains)).tolist()
        assert counts["shape"] == np.bincount(shapes, minlength=len(material.palette.lut)).tolist()
    else:
        above = material.grid.above_horizon
        assert counts["entry"] == np.bincount(material.index[above], minlength=len(material.palette.lut)).tolist()


def test_counts_of_entries(panels, material):
    counts = panels(encode(material))["counts"]
    check_counts(counts, material)
    must_fail(check_counts, {name: [n[0] + 1, *n[1:]] for name, n in counts.items()}, material)


def check_slice(found, columns, rows, material):
    theta_h = ((np.arange(columns) + 0.5) / columns) ** 2 * HALF_PI
    theta_d = ((np.arange(rows) + 0.5) / rows)[:, None] * HALF_PI
    wi, wo = directions(*np.broadcast_arrays(theta_h, theta_d, PHI_D))
    f_r = decode(encode(material)).eval(np.stack(wi, -1), np.stack(wo, -1))
    f_r[np.minimum(wi[2], wo[2]) <= ON_HORIZON] = np.nan
    assert np.isnan(f_r).any()
    assert np.allclose(np.array(found, float).reshape(f_r.shape), f_r, rtol=1e-5, atol=1e-9, equal_nan=True)


def test_a_slice_is_what_is_evaluated(panels, material):
    found = panels(encode(material))
    check_slice(found["slice"], found["columns"], found["rows"], material)
    must_fail(check_slice, np.array(found["slice"], float) * 1.001, found["columns"], found["rows"], material)


def check_cells(found, lattice):
    k = int(PHI_D / (np.pi if lattice.reciprocal else 2 * np.pi) * lattice.phi_d)
    numbers = np.arange(lattice.size).reshape(lattice.shape)[:, :, k]
    assert found == np.where(lattice.above_horizon[:, :, k], numbers, -1).T.ravel().tolist()


@pytest.mark.parametrize("name", ["cells", "cells, not reciprocal"])
def test_the_cells_of_a_slice(panels, name):
    found, lattice = panels(encode(MATERIALS[name]))["cells"], MATERIALS[name].grid
    check_cells(found, lattice)
    must_fail(check_cells, [n + 1 for n in found], lattice)


def check_nodes(nodes):
    """Each is there once, and counts most, of its row and θ_d, for directions at its place and the slice's φ_d."""
    assert len({node["at"] for node in nodes}) == len({(node["a"], node["b"]) for node in nodes}) == len(nodes) > 0
    inner = [node["weight"] for node in nodes if node["a"] > 0 and 0 < node["b"] < 1]
    assert min(inner) >= 0.5 - 1e-9


@pytest.mark.parametrize("name", [name for name in MATERIALS if name.startswith("nodes")])
def test_the_nodes_of_a_slice(panels, name):
    nodes = panels(encode(MATERIALS[name]))["nodes"]
    check_nodes(nodes)
    must_fail(check_nodes, [*nodes, nodes[0]])
    must_fail(check_nodes, [{**node, "weight": 0.4} for node in nodes])


def check_albedo(found, expected, within):
    assert np.allclose(found, expected, rtol=within, atol=0)


def test_albedo(panels):
    found = np.array(panels(encode(lambertian(0.5)))["albedo"])
    check_albedo(found, 0.5, 0.005)
    must_fail(check_albedo, found * 1.01, 0.5, 0.005)


def test_albedo_of_a_highlight(panels):
    material = glossy()
    found = np.array(panels(encode(material))["albedo"])
    check_albedo(found, material.albedo(VIEWS), 0.02)
    must_fail(check_albedo, found * 1.03, material.albedo(VIEWS), 0.02)


def check_lobe(angles, f, expected):
    assert (np.diff(angles) >= 0).all()
    assert angles[0] < -1.5 < 1.5 < angles[-1]
    assert f == expected


def test_a_lobe(panels, material):
    found = panels(encode(material))
    check_lobe(found["angles"], found["lobe"], found["inPlane"])
    must_fail(check_lobe, found["angles"][::-1], found["lobe"], found["inPlane"])
    must_fail(check_lobe, found["angles"], found["lobe"][::-1], found["inPlane"])


def check_scale(shares):
    assert (shares[0], shares[-1]) == (1, 0)
    assert (np.diff(shares) < 0).all()


def test_scales_of_the_lobe(panels):
    for shares in panels(encode(MATERIALS["cells"]))["scales"]:
        check_scale(shares)
        must_fail(check_scale, [0.9 * share for share in shares])


def check_palette_places(found, palette):
    assert (np.diff(found["places"]) > 0).all() == (np.diff(palette.gains) > 0).all()
    r, g, b = palette.lut.T
    assert np.allclose(found["chroma"], np.stack([r - b, g - (r + b) / 2], -1))


def test_places_of_gains_and_shapes(panels):
    material = MATERIALS[next(name for name in MATERIALS if name.startswith("nodes"))]
    found = panels(encode(material))
    check_palette_places(found, material.palette)
    must_fail(check_palette_places, {**found, "places": found["places"][::-1]}, material.palette)
    must_fail(check_palette_places, {**found, "chroma": np.array(found["chroma"]) + 0.1}, material.palette)


def check_numbers(found):
    assert found == list(NUMBERS.values())


def test_numbers_as_text(panels):
    found = panels(encode(MATERIALS["cells"]))["numbers"]
    check_numbers(found)
    must_fail(check_numbers, [text + "0" for text in found])


FOLDED = """
import { cellAt, evaluate } from "./evaluate.js";
import { Work, sizeOf } from "./draw.js";
import { read } from "./readers.js";
import { directions, folded, rangeOf } from "./slice.js";

async function answer({ turns, sizes, file, ...how }) {
    if (sizes) return sizes.map(sizeOf);
    if (turns) return jobs();
    const material = await read(file, how);
    const [range, angles] = [rangeOf(material), Array.from({ length: 72 }, (_, i) => ((i + 0.5) / 72) * 2 * Math.PI)];
    const pairs = angles.map((angle) => directions(0.3, 0.6, angle));
    const found = pairs.map((pair) => cellAt(material, ...pair).phiD);
    const others = found.map((angle) => directions(0.3, 0.6, angle));
    const f = [pairs, others].map((all) => all.map((pair) => evaluate(material, ...pair)));
    return { range, angles, found, folded: angles.map((angle) => folded(material, angle)), f };
}

/** What is done, in which order, by jobs of the same name that are started at once. */
async function jobs() {
    const [work, done] = [new Work(), []];
    const job = (name) => function* () {
        yield;
        done.push(name);
    };
    work.start("x", job("dropped"));
    work.start("x", job("first"));
    work.start("x", job("overtaken"), true);
    work.start("x", job("after"), true);
    work.start("y", job("other"));
    while (work.jobs.size) await new Promise((next) => setTimeout(next, 5));
    return done;
}
"""
RNG = np.random.default_rng(5)
LATTICES = {180: Lattice(4, 5, 6), 360: Lattice(4, 5, 6, reciprocal=False)}
# Ranges of φ_d in degrees: what is isotropic is not yet mirrored.
RANGES = {
    "bsdf": (360, rgl_files.content()),
    "mbsdf": (180, page_files.mbsdf(RNG.random((9, 9, 8, 3)))),
    **{
        f"table, {degrees}": (degrees, page_files.table(RNG.random((*lattice.shape, 3)), lattice))
        for degrees, lattice in LATTICES.items()
    },
}
SIZES = {0: "0 B", 588: "588 B", 2700: "2,700 B", 9999: "9,999 B", 10_000: "10.0 kB", 12_400: "12.4 kB"}
SIZES |= {999_499: "999 kB", 999_500: "1.00 MB", 34_992_012: "35.0 MB"}


@pytest.fixture(scope="module")
def folds(tmp_path_factory):
    return program(tmp_path_factory.mktemp("js"), FOLDED)


def check_range(found, degrees):
    """Every φ_d of the range is looked up as itself, the others where f_r is the same."""
    angles, looked_up = np.array(found["angles"]), np.array(found["found"])
    within = angles < np.radians(degrees)
    assert np.degrees(found["range"]) == pytest.approx(degrees)
    assert np.allclose(looked_up[within], angles[within])
    assert (looked_up < found["range"]).all()
    assert np.allclose(found["folded"], looked_up)
    assert np.allclose(*found["f"], rtol=1e-9)


@pytest.mark.parametrize("name", RANGES)
def test_the_slider_goes_through_all_slices(folds, name):
    degrees, data = RANGES[name]
    found = folds([({"name": name, "format": name.partition(",")[0]}, data)])[0]
    check_range(found, degrees)
    must_fail(check_range, found, 540 - degrees)
    must_fail(check_range, {**found, "range": found["range"] / 2}, degrees)


def check_halves(f):
    assert not np.allclose(f, f[::-1], rtol=0.01)


def test_a_measurement_has_two_halves(folds):
    halves = {name: folds([({"name": name}, RANGES[name][1])])[0]["f"][0] for name in ("bsdf", "mbsdf")}
    check_halves(halves["bsdf"])
    must_fail(check_halves, halves["mbsdf"])


def check_sizes(found):
    assert found == list(SIZES.values())


def test_sizes_as_text(folds):
    found = folds([({"sizes": list(SIZES)}, b"")])[0]
    check_sizes(found)
    must_fail(check_sizes, [text.replace(",", "") for text in found])


def check_jobs(done):
    assert sorted(done) == ["after", "first", "other"]
    assert done.index("first") < done.index("after")


def test_jobs_of_the_same_name(folds):
    done = folds([({"turns": True}, b"")])[0]
    check_jobs(done)
    must_fail(check_jobs, done[::-1])
    must_fail(check_jobs, ["dropped", *done])


SEEN = """() => {
    const { slice, theme } = sommerl.panels;
    const places = ["#panels .legend", "#panels .panel:nth-child(2) output"];
    const texts = places.map((one) => document.querySelector(one).textContent);
    const lefts = [...document.querySelectorAll(".panel")].map((one) => one.getBoundingClientRect().left);
    return { most: slice.slider.input.max, texts, theme, columns: lefts.map((x) => (x > Math.min(...lefts) ? 1 : 0)) };
}"""
DRAWN = "!sommerl.panels.work.jobs.size && Boolean(sommerl.panels.slice.plot.map?.shown)"


def check_seen(seen, most, columns):
    assert (seen["most"], seen["texts"]) == (most, ["a label, 12.4 kB", "90°"])
    assert seen["columns"] == columns
    theme = seen["theme"]
    assert all([*theme.values(), *theme["channels"], *theme["accents"]])


# Lobe, slice, palette, albedo: in which column each is.
@pytest.mark.parametrize(("width", "columns"), [(1280, [0, 1, 1, 0]), (390, [0, 0, 0, 0])])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_panels_of_a_measurement(browse, tmp_path, width, columns, scheme):
    (tmp_path / "file.bsdf").write_bytes(RANGES["bsdf"][1])
    html = page([held(load(tmp_path / "file.bsdf"), "a label", name="a name", size=12_400)])
    shown = browse(
        html,
        ready=f"window.sommerl?.first > 0 && {DRAWN}",
        viewport={"width": width, "height": 700},
        color_scheme=scheme,
    )
    seen = shown.evaluate(SEEN)
    check_seen(seen, "360", columns)
    must_fail(check_seen, {**seen, "theme": {**seen["theme"], "channels": ["", "", ""]}}, "360", columns)
    must_fail(check_seen, seen, "180", columns)
    shown.evaluate("sommerl.panels.slice.following.checked = true")
    shown.evaluate("sommerl.panels.setPointer({ wi: [0.5, -0.3, Math.sqrt(0.66)], wo: [-0.1, 0.2, Math.sqrt(0.95)] })")
    wait_until(
        shown, f"{DRAWN} && sommerl.panels.slice.phiD > Math.PI && sommerl.panels.slice.plot.map.shown.phiD > Math.PI"
    )
    said = shown.locator("#panels .said").nth(1).text_content()
    turned = shown.locator("#panels .panel:nth-child(2) output").text_content()
    assert round(float(said.partition("φd = ")[2].partition("°")[0])) == int(turned[:-1])


# Jobs that have begun, or are about to, when a second material comes.
ANOTHER = """(kept) => {
    const { panels } = sommerl;
    if (kept) panels.work.drop = () => {};
    const [material] = panels.materials;
    panels.setMaterials([material, null]);
    panels.now();
    panels.setMaterials([material, material]);
    const errors = [];
    for (let turn = 0; turn < 100; turn++) {
        try {
            panels.work.run();
        } catch (error) {
            errors.push(error.message);
        }
    }
    return errors;
}"""


def test_another_material_while_the_first_is_drawn(browse):
    shown = browse(page([held(MATERIALS["cells"], "a")]))
    assert shown.evaluate(ANOTHER, False) == []
    wait_until(shown, f"{DRAWN} && sommerl.panels.albedo.curves.length === 2")
    assert "push" in shown.evaluate(ANOTHER, True)[0]
