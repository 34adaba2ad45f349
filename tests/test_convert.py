"""`sommerl convert`, and the loading of every format by its content."""

import json

import numpy as np
import pytest
from helpers import lambertian_table, moved_share, must_fail, random_directions, run, run_json
from rgl_files import content

from sommerl import MERL, BrdfTable, Lattice, TrainOptions, builtin, load, save, train
from sommerl.commands import compress
from sommerl.commands.cli import main
from sommerl.formats import merl

A, B = (w[w[:, 2] > 0.1][:200] for w in (random_directions(300, s) for s in (1, 2)))


@pytest.fixture
def samples(tmp_path):
    brdf = builtin("red-fabric")
    angles = [np.degrees(x) for w in (A, B) for x in (np.arccos(w[:, 2]), np.arctan2(w[:, 1], w[:, 0]))]
    rows = np.column_stack([*angles, brdf.eval(A, B)])
    path = tmp_path / "fabric.csv"
    header = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path


def test_samples_to_a_table_and_a_picture(capsys, samples, tmp_path):
    status, out, _ = run(capsys, "convert", samples, tmp_path / "out.binary", "--json")  # a warning is due
    result = json.loads(out)
    assert status == 0
    assert result["facts"]["samples"] == len(A)
    assert result["samples_report"]["all"]["median"] < 0.05
    assert 0 < result["facts"]["coverage"] <= 1
    assert result["coverage_image"] == str(tmp_path / "out.coverage.png")
    assert (tmp_path / "out.coverage.png").read_bytes().startswith(b"\x89PNG")
    found, true = load(tmp_path / "out.binary").eval(A, B), builtin("red-fabric").eval(A, B)
    assert np.median(np.abs(found - true) / true) < 0.05


def test_a_picture_that_cannot_be_written_is_told_first(capsys, samples, tmp_path):
    (tmp_path / "out.coverage.png").mkdir()
    assert main(["convert", str(samples), str(tmp_path / "out.binary")]) == 1
    assert "out.coverage.png: cannot be written: it is a directory, not a file" in capsys.readouterr().err
    assert not (tmp_path / "out.binary").exists()


def test_what_was_not_measured_is_remembered(capsys, samples, tmp_path):
    assert main(["convert", str(samples), str(tmp_path / "out.smrl")]) == 0
    assert "share of the hemispheres" in capsys.readouterr().out
    facts = run_json(capsys, "info", tmp_path / "out.smrl")["facts"]
    assert facts["samples"] == len(A)
    assert 0 < facts["coverage"] <= 1
    assert run_json(capsys, "info", samples)["facts"]["coverage"] == pytest.approx(facts["coverage"], rel=1e-5)


def test_mostly_extrapolated(capsys, tmp_path):
    """All of it within 30° of the normal."""
    header = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    rows = [(i, 0, o, phi, 0.2, 0.2, 0.2) for i in (5, 15, 30) for o in (5, 15, 30) for phi in range(0, 180, 30)]
    np.savetxt(tmp_path / "x.csv", rows, delimiter=",", header=header)
    assert main(["convert", str(tmp_path / "x.csv"), str(tmp_path / "x.binary")]) == 0
    warned = capsys.readouterr().err
    assert warned.startswith(f"warning: {tmp_path / 'x.csv'}: ")
    assert "% of all pairs of directions above the horizon, by solid angles and cosines, are more than 10°" in warned
    assert warned.count("\n") == 1
    found = run_json_warned(capsys, "convert", tmp_path / "x.csv", tmp_path / "y.bsdf")
    assert [f"warning: {sentence}\n" for sentence in found] == [warned]


def run_json_warned(capsys, *arguments):
    status, out, _ = run(capsys, *arguments, "--json")
    assert status == 0
    return json.loads(out)["warnings"]


def test_names_of_outputs(capsys, tmp_path):
    (tmp_path / "x.bsdf").write_bytes(content())
    assert compress._outputs([str(tmp_path / "x.bsdf"), "nickel"], tmp_path, several=True) == [
        tmp_path / "x.smrl",
        tmp_path / "nickel.smrl",
    ]


def test_for_people_too(capsys, samples, tmp_path):
    assert main(["convert", str(samples), str(tmp_path / "out.bsdf")]) == 0
    text = capsys.readouterr().out
    assert "share of the hemispheres within 10° of a sample: 0." in text
    assert "samples, and what was written: " in text
    assert "fabric → " in text


def test_rgl_to_merl(capsys, tmp_path):
    (tmp_path / "x.bsdf").write_bytes(content())
    result = run_json(capsys, "convert", tmp_path / "x.bsdf", tmp_path / "x.binary")
    assert result["facts"]["asymmetry"] > 0
    assert result["cells_clamped"] == 0
    assert result["bytes_disk"] == 34_992_012
    info = run_json(capsys, "info", tmp_path / "x.bsdf")
    assert info["kind"] == "measurement"
    assert info["facts"] == result["facts"]
    assert len(info["source_sha256"]) == 64


@pytest.fixture
def negative(tmp_path):
    """A measurement whose red is negative everywhere."""
    rgb = np.full((1, 4, 3, 5, 5), 0.3, np.float32)
    rgb[:, :, 0] = -0.1
    (tmp_path / "x.bsdf").write_bytes(content(rgb=rgb))
    return tmp_path / "x.bsdf"


COUNTED = [
    ["convert", "{}", "x.binary"],
    ["compress", "{}", "-o", "x.smrl", "--clusters", 2, "--epochs", 1],
]
MOVED = moved_share([-0.1, 0.3, 0.3])


def check_told(result):
    assert result["cells_clamped"] == MERL.above_horizon.sum()
    assert result["energy_clamped"] == pytest.approx(MOVED, rel=1e-5)
    assert result["energy_averaged"] > 0


@pytest.mark.parametrize("arguments", COUNTED, ids=lambda words: " ".join(map(str, words)))
def test_what_a_table_cannot_hold_is_told(capsys, negative, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    result = run_json(capsys, *(str(word).format(negative) for word in arguments))
    check_told(result)
    must_fail(check_told, result | {"cells_clamped": 0})
    if "x.smrl" in arguments:
        check_told(run_json(capsys, "info", "x.smrl"))
    said = [*(str(word).format(negative) for word in arguments), "--overwrite"]
    assert f"{MERL.above_horizon.sum()}" in run(capsys, *said)[1]


def test_factors_hold_no_negative_numbers_and_say_so(capsys, negative, tmp_path):
    result = run_json(capsys, "factor", negative, "-o", tmp_path / "x.fbrdf", "--lobes", 1, "--terms", 1)
    assert result["cells_clamped"] > 10_000
    assert result["energy_clamped"] == pytest.approx(MOVED, rel=1e-5)


def test_a_measurement_keeps_its_negative_numbers(capsys, negative, tmp_path):
    info = run_json(capsys, "info", negative)
    assert (info["reciprocal"], info["signed"], info["cells_clamped"]) == (False, True, None)
    assert info["facts"]["energy_negative"] == pytest.approx(1 / 7, rel=1e-5)
    assert run_json(capsys, "convert", negative, tmp_path / "y.bsdf")["cells_clamped"] is None
    up = np.array([0.3, 0.1, np.sqrt(0.9)])
    assert np.allclose(load(tmp_path / "y.bsdf").eval(up, up), load(negative).eval(up, up), rtol=0.02)
    assert load(tmp_path / "y.bsdf").eval(up, up)[0] < 0


def test_reciprocal_averages_both_orders(capsys, negative, tmp_path):
    run_json(capsys, "convert", negative, tmp_path / "y.bsdf", "--reciprocal")
    kept, averaged = load(negative), load(tmp_path / "y.bsdf")
    one, other = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    both = [kept.eval(one, other)[1], kept.eval(other, one)[1]]
    assert abs(both[0] - both[1]) > 0.1 * both[0]
    assert np.allclose([averaged.eval(one, other)[1], averaged.eval(other, one)[1]], np.mean(both), rtol=0.05)
    code, _, complaint = run(capsys, "convert", negative, tmp_path / "y.xml", "--reciprocal")
    assert (code > 0, "--reciprocal: expected an output that holds the material" in complaint) == (True, True)
    code, _, complaint = run(capsys, "compress", negative, "-o", tmp_path / "z.smrl", "--reciprocal")
    assert (code > 0, "--reciprocal: expected --preset compact, found paper" in complaint) == (True, True)


@pytest.mark.parametrize("extension", ["h", "hpp", "glsl", "hlsl", "metal", "wgsl"])
def test_source_code(capsys, tmp_path, extension):
    material, _ = train(lambertian_table(), TrainOptions(clusters=1, epochs=1))
    save(material, tmp_path / "x.smrl")
    result = run_json(capsys, "convert", tmp_path / "x.smrl", tmp_path / f"my grey.{extension}")
    text = (tmp_path / f"my grey.{extension}").read_text()
    assert "material_my_grey" in text
    assert result["bytes_disk"] == len(text.encode())


def test_source_code_of_what_is_not_compressed_yet(capsys, tmp_path, monkeypatch):
    small = BrdfTable.sampled(builtin("nickel"), Lattice(20, 20, 20))
    monkeypatch.setattr("sommerl.commands.convert.BrdfTable.of", lambda brdf: small)
    run_json(capsys, "convert", "nickel", tmp_path / "nickel.h")
    assert "material_nickel" in (tmp_path / "nickel.h").read_text()


def test_snippets(capsys, tmp_path):
    run_json(capsys, "convert", "nickel", tmp_path / "x.xml")
    assert 'type="sommerl"' in (tmp_path / "x.xml").read_text()
    run_json(capsys, "convert", "nickel", tmp_path / "x.json")


def test_spectral(capsys, tmp_path):
    run_json(capsys, "convert", "red-fabric", tmp_path / "x.bsdf", "--spectral")
    assert np.allclose(load(tmp_path / "x.bsdf").eval(A, B), builtin("red-fabric").eval(A, B), rtol=0.2)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nickel", "{}/x.h", "--spectral"], "--spectral: expected an output that ends in .bsdf"),
        (["nickel", "{}/x.xml", "--noise", "1"], "--noise: expected an output that holds the material"),
        (["nickel", "{}/x"], "expected a name that ends in"),
    ],
)
def test_bad_options(capsys, tmp_path, arguments, sentence):
    assert main(["convert", *(argument.format(tmp_path) for argument in arguments)]) == 2
    assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_content_and_not_the_extension_tells(tmp_path):
    (tmp_path / "x.binary").write_bytes(content())
    assert load(tmp_path / "x.binary").name == "x"
    merl.write(BrdfTable.sampled(builtin("red-fabric")), tmp_path / "y.bsdf")
    assert isinstance(load(tmp_path / "y.bsdf"), BrdfTable)


@pytest.mark.parametrize(
    "name", ["x.binary", "x.bsdf", "x.brdf", "x.csv", "x.npy", "x.npz", "x.h5", "x.smrl", "x.txt", "x"]
)
@pytest.mark.parametrize("data", [b"\0", b"hello", bytes(range(256)), b"\xff" * 100, "θ\n".encode(), b"\n\n\n"])
def test_what_is_no_material_gets_a_sentence(capsys, tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    assert main(["info", str(path)]) == 1
    message = capsys.readouterr().err
    assert message.startswith(f"error: {path}: ")
    assert "expected" in message
    assert message.count("\n") == 1


def planes(bins=180):
    """What a MERL file may hold: numbers that scaling does not keep, and anything below the horizon."""
    rng = np.random.default_rng(7)
    return rng.lognormal(0, 3, (3, 90, 90, bins))


def check_same_bytes(one, other):
    same = one.read_bytes() == other.read_bytes()
    assert same, "not the same bytes"  # apart, since pytest would spend minutes on how 35 MB differ


@pytest.mark.parametrize("bins", [180, 360])
def test_merl_to_merl_is_byte_identical(capsys, tmp_path, bins):
    source, target = tmp_path / "a.binary", tmp_path / "b.binary"
    stored = planes(bins)
    source.write_bytes(np.array(stored.shape[1:], "<i4").tobytes() + stored.tobytes())
    run_json(capsys, "convert", source, target)
    check_same_bytes(source, target)
    table = load(source)
    merl.write(BrdfTable(table.values, table.lattice), target)  # without the file's own numbers
    must_fail(check_same_bytes, source, target)


def test_what_was_clamped_or_changed_is_written_anew(tmp_path):
    stored = planes()
    stored[1, 20, 10, 90] = -5.0
    source = tmp_path / "a.binary"
    source.write_bytes(np.array(stored.shape[1:], "<i4").tobytes() + stored.tobytes())
    table = merl.read(source)
    assert table.counts.cells_clamped == 1
    table.values[3, 4, 5] *= 2
    merl.write(table, tmp_path / "b.binary")
    again = np.frombuffer((tmp_path / "b.binary").read_bytes(), "<f8", offset=12).reshape(stored.shape)
    assert again[1, 20, 10, 90] == 0
    assert again[0, 3, 4, 5] == pytest.approx(2 * stored[0, 3, 4, 5])
    assert (again != stored).sum() == 3 + 3  # the colour that had a negative channel, and the one that was doubled
