"""What the head of a source code says, and what --no-sampler leaves out."""

import re

import numpy as np
import pytest
from helpers import compact_material, lambertian_table, must_fail, run_json
from library_files import packed
from sampled import NODES
from shader_programs import compact, run

import sommerl
from sommerl import TrainOptions, save, train
from sommerl.commands.cli import main
from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import CPP, GLSL, HLSL, MSL, WGSL

ELEMENT = {  # how often an array of so many elements is declared, as a pattern
    "C++": r"{type} {name}\[{size}\]",
    "GLSL": r"{type} {name}\[{size}\]",
    "HLSL": r"{type} {name}\[{size}\]",
    "MSL": r"{type} {name}\[{size}\]",
    "WGSL": r"{name} = array<{type}, {size}>",
}


def check_arrays_are_described(text, language):
    described = re.findall(r"^//   (\w+): (\d+) of (\w+) \((\d+) bytes\), (\w+)\(i\)$", text, re.M)
    assert len(described) == len(re.findall(r"= array<|\w+\[\d+\] = ", text))
    for name, size, kind, octets, reader in described:
        assert re.search(ELEMENT[language.name].format(name=name, size=size, type=kind), text)
        values = re.search(rf"\b{name}\b[^/]*?[({{]\n(.*?)\n[)}}]", text, re.S)[1]
        assert len(values.split(",")) == int(size)
        assert int(octets) == int(size) * (8 if kind == "double" else 4)
        assert re.search(rf"(define|fn) {reader}\(i", text)


@pytest.mark.parametrize("language", [CPP, GLSL, HLSL, MSL, WGSL], ids=lambda one: one.name)
def test_all_arrays_are_described(language):
    for text in (
        shader.source(compact("several bands"), language, "material_x"),
        shader.atlas_source([compact("several bands"), compact_material(NODES)], language, "material_x"),
    ):
        check_arrays_are_described(text, language)
        must_fail(check_arrays_are_described, re.sub(r"(\d+) of", r"1\1 of", text, count=1), language)


def check_head(text, lines):
    head = text[: text.index("\n\n")].splitlines()
    assert set(lines) <= set(head)


def test_it_says_which_version_source_quality_and_command(capsys, tmp_path):
    trained, _ = train(lambertian_table(), TrainOptions(clusters=1, epochs=1))
    trained.metrics.update(relative_error=0.0123456)
    save(trained, tmp_path / "n.smrl")
    assert main(["convert", str(tmp_path / "n.smrl"), str(tmp_path / "my n.h"), "--no-sampler"]) == 0
    text = (tmp_path / "my n.h").read_text()
    brdf = sommerl.load(tmp_path / "n.smrl")
    figures = [f"{key} {value:.4g}" for key, value in brdf.metrics.items() if isinstance(value, int | float)]
    assert figures
    lines = [
        f"// {brdf.name}",
        f"// Written by Sommerl {sommerl.__version__}, in C++.",
        f"// Source: SHA-256 {brdf.source.sha256}",
        f"// Quality: {', '.join(figures)}",
        "// Command: sommerl convert n.smrl 'my n.h' --no-sampler",
    ]
    check_head(text, lines)
    must_fail(check_head, text.replace(" --no-sampler", ""), lines)
    assert str(tmp_path) not in text


def test_a_material_of_a_library_keeps_its_name(capsys, tmp_path):
    (tmp_path / "few.smrlib").write_bytes(packed())
    run_json(capsys, "convert", f"{tmp_path / 'few.smrlib'}:nodes/both", tmp_path / "x.h")
    text = (tmp_path / "x.h").read_text()
    assert "// Command: sommerl convert few.smrlib:nodes/both x.h\n" in text
    assert str(tmp_path) not in text


def check_without_sampler(text):
    assert not re.search(r"_sample\b|_pdf\b|sampler", text, re.I)


def test_without_a_sampler_f_r_is_the_same(tmp_path):
    brdf, bare = compact("several bands"), shader.Settings(sampler=False)
    shader.write(brdf, tmp_path / "x.h")
    whole = run(tmp_path, "double")
    must_fail(check_without_sampler, (tmp_path / "x.h").read_text())
    shader.write(brdf, tmp_path / "x.h", bare)
    check_without_sampler((tmp_path / "x.h").read_text())
    assert np.array_equal(run(tmp_path, "double"), whole)


@pytest.mark.parametrize("extension", ["h", "glsl", "hlsl", "metal", "wgsl"])
def test_no_sampler_of_one_and_of_several(capsys, tmp_path, extension):
    paths = [tmp_path / f"{k}.smrl" for k in range(2)]
    for path in paths:
        save(compact("several bands"), path)
    for inputs in (paths[:1], paths):
        output = tmp_path / f"x{len(inputs)}.{extension}"
        run_json(capsys, "convert", *inputs, output, "--no-sampler")
        check_without_sampler(output.read_text().replace("--no-sampler", ""))


def test_no_sampler_is_of_source_code_alone(capsys, tmp_path):
    assert main(["convert", "nickel", str(tmp_path / "x.bsdf"), "--no-sampler"]) == 2
    assert "--no-sampler: expected an output of source code, found" in capsys.readouterr().err


def test_a_size_is_asked_for_where_the_input_is_not_compressed(capsys, tmp_path):
    run_json(capsys, "convert", "nickel", tmp_path / "x.wgsl", "--target-size", "2kB")
    text = (tmp_path / "x.wgsl").read_text()
    assert "// Command: sommerl convert nickel x.wgsl --target-size 2000" in text
    assert "material_x_gain" in text  # of the preset compact
    assert re.search(r"^// Quality: .*psnr_soft_db \d+", text, re.M)
