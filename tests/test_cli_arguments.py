"""How command lines are read: types, names as typed, near names, help."""

import ast
from argparse import ArgumentTypeError
from pathlib import Path
from typing import get_type_hints

import pytest
from helpers import must_fail, run

from sommerl.commands import cli
from sommerl.commands.arguments import Arguments, byte_count, named_as_typed, read
from sommerl.commands.cli import COMMANDS
from sommerl.commands.compress import CompressArguments
from sommerl.commands.fit import FitArguments
from sommerl.models.builtin import NAMES
from sommerl.system.errors import OptionError
from sommerl.system.near import did_you_mean


def typed(*words):
    """What a command line is read as."""
    found = cli.parser().parse_args([str(word) for word in words])
    return read(found.arguments, found)


def test_a_command_gets_what_was_typed_in_types():
    line = "compress a.binary b.binary -o out --target-size 2.7kB --alpha 1 --overwrite"
    found = typed(*line.split())
    assert type(found) is CompressArguments
    assert (found.inputs, found.output) == (("a.binary", "b.binary"), Path("out"))
    assert (found.target_size, found.alpha, found.overwrite, found.json) == (2700, 1.0, True, False)
    assert (found.target_psnr, found.preset, type(found.alpha)) == (None, None, float)
    assert typed("fit", "nickel", "--conserve-energy") == FitArguments(material="nickel", conserve_energy=True)
    assert typed("render", "-o", "x.png", "-D", "a=b", "--define", "c=d").define == ("a=b", "c=d")
    assert typed("render", "-o", "x.png").materials == ()


def check_sources(source):
    """That argparse's Namespace is known to one module alone."""
    assert "Namespace" not in {node.id for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Name)}


def test_a_namespace_goes_no_further_than_the_door():
    folder = Path(cli.__file__).parent
    for path in folder.glob("*.py"):
        if path.name != "arguments.py":
            check_sources(path.read_text())
    must_fail(check_sources, (folder / "arguments.py").read_text())


def check_order(source):
    """The module of a command: its arguments as a dataclass, `arguments`, the command, and what it needs."""
    names = [node.name for node in ast.parse(source).body if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    at = names.index("arguments")
    assert at == 0 or (at == 1 and names[0].endswith("Arguments"))


def test_all_commands_are_read_in_one_order():
    for module in COMMANDS:
        source = Path(module.__file__).read_text()
        check_order(source)
        must_fail(check_order, f"def first(): ...\ndef second(): ...\n{source}")


def check_helped(parser):
    for action in parser.actions():
        assert action.help, action.dest


def test_every_argument_has_a_help_text():
    assert len(cli.parser().commands()) == len(COMMANDS)
    parsers = cli.parser().leaves()
    assert len(parsers) > len(COMMANDS)
    for parser in parsers:
        check_helped(parser)
        assert issubclass(parser.get_default("arguments"), Arguments)
        assert set(get_type_hints(parser.get_default("arguments"))) >= {"json", "threads"}
    parsers[0].add_argument("more")
    must_fail(check_helped, parsers[0])


def test_alone_it_prints_help(capsys):
    alone, asked = run(capsys), run(capsys, "--help")
    assert alone == asked
    assert alone[0] == 0
    assert "usage: sommerl" in alone[1]
    status, out, err = run(capsys, "--frobnicate")
    assert (status, out) == (2, "")
    assert err.startswith("error: --frobnicate: expected an option of sommerl, found none of that name")


FAR = ["missing", "material", "?!", "", "gold", "serve", "x.smrl", "help", "list"]


def check_near(word, name, names):
    assert did_you_mean(word, names) == (f"; did you mean {name}?" if name else "")


def test_names_are_suggested_only_if_near():
    commands = [module.__name__.rpartition(".")[2] for module in COMMANDS]
    for word, name in (("nickle", "nickel"), ("chrom", "chrome"), ("blue-metalic-paint", "blue-metallic-paint")):
        check_near(word, name, NAMES)
    for word, name in (("compres", "compress"), ("plto", "plot"), ("Render", "render"), ("inf", "info")):
        check_near(word, name, commands)
    for word in FAR:
        check_near(word, None, NAMES)
        check_near(word, None, commands)
    must_fail(check_near, "missing", "gold-metallic-paint", NAMES)
    must_fail(check_near, "nickle", None, NAMES)


def check_sentence(capsys, arguments, start, part=""):
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {start}")
    assert part in err
    assert err.count("\n") == 1


NAMED = [
    ("compress nickel -o x.smrl --clusters 0", "--clusters: expected 1 to 65536, found 0"),
    ("compress nickel -o x.smrl --epochs 0", "--epochs: expected 1 to"),
    ("compress nickel -o x.smrl --seed -1", "--seed: expected 0 to"),
    ("compress nickel -o x.smrl --alpha 2", "--alpha: expected a number above 0"),
    ("compress nickel -o x.smrl --radius nan", "--radius: expected 0 to 1000"),
    ("compress nickel -o x.smrl --target-size 8B", "--target-size: expected 300 to 64000, found 8"),
    ("compress nickel -o x.smrl --target-psnr 1", "--target-psnr: expected 20 to 80"),
    ("convert nickel x.smrl --target-size 65kB", "--target-size: expected 300 to 64000, found 65000"),
    ("convert nickel x.binary --target-size 8kB", "--target-size: expected an output that is compressed"),
    ("fit nickel --samples 1", "--samples: expected 1000 to"),
    ("fit nickel --starts 0", "--starts: expected 1 to"),
    ("fit nickel --lobes 9", "--lobes: expected 1 to 4"),
    ("fit nickel --model lambertian --lobes 2", "--lobes: lambertian is a base itself and has 1 lobe, found 2"),
    ("fit nickel --model wadr", "--model: expected lambertian, "),
    ("factor nickel -o x.fbrdf --terms 0", "--terms: expected 1 to 32"),
    ("paper fig5 --only sphere", "--only: expected a part of fig5, found sphere; did you mean spheres?"),
    ("compare nickel chrome --spp 0", "--spp: expected 1 to"),
    ("render nickel -o x.png --size 1", "--size: expected 8 to"),
    ("render nickel -o x.png --threads 0", "--threads: expected 1 to"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "start"), NAMED)
def test_errors_name_options_as_typed(capsys, tmp_path, monkeypatch, line, start):
    monkeypatch.chdir(tmp_path)
    check_sentence(capsys, line.split(), start)
    assert list(tmp_path.iterdir()) == []


def test_that_check_notices_the_name_of_a_field(capsys):
    must_fail(check_sentence, capsys, ["fit", "nickel", "--starts", "0"], "starts: expected")


def test_a_file_of_an_options_name_stays_a_file(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_sentence(capsys, ["render", "nickel", "-o", "seed"], "seed: expected a name that ends in .png")


def test_names_of_fields_become_options_within_the_block_alone():
    with pytest.raises(OptionError, match=r"^--target-size: expected a: b$"), named_as_typed():
        raise OptionError("target_size: expected a: b")
    with pytest.raises(OptionError, match=r"^x/target_size: expected a$"), named_as_typed():
        raise OptionError("x/target_size: expected a")


MISTYPED = [
    ("compres nickel -o x.smrl", "compres: expected a command", "did you mean compress?"),
    ("compress nickel -o x.smrl --clustres 5", "--clustres: expected an option of sommerl compress", "--clusters?"),
    ("compress nickel --outptu=x.smrl", "--outptu=x.smrl: expected an option", "did you mean --output?"),
    ("compress nickel -o x.smrl -x", "-x: expected an option", "found none of that name"),
    ("compress nickel -o x.smrl --preset compcat", "--preset: expected paper or compact", "did you mean compact?"),
    ("compress nickel -o x.smrl --clusters 1e3", "--clusters: expected a whole number, found 1e3", ""),
    ("compress nickel -o x.smrl --alpha half", "--alpha: expected a number, found half", ""),
    ("compress nickel -o x.smrl --target-size 8GB", "--target-size: expected a number of bytes, like 8000 or 8kB", ""),
    ("compress nickel -o x.smrl --target-size 900 --target-psnr 40", "--target-psnr: not allowed beside", "-size"),
    ("compress nickel -o x.smrl --clusters", "--clusters: expected one argument", ""),
    ("paper tabel1", "ITEM: expected fig1 or fig2 or fig3 or ", "did you mean table1?"),
    ("compare nickel chrome more", "more: expected no further argument", ""),
    ("convert nickel", "the following arguments are required: OUT", ""),
]  # fmt: skip


@pytest.mark.parametrize(("line", "start", "part"), MISTYPED)
def test_what_is_mistyped(capsys, tmp_path, monkeypatch, line, start, part):
    monkeypatch.chdir(tmp_path)
    check_sentence(capsys, line.split(), start, part)
    assert list(tmp_path.iterdir()) == []


def test_options_may_be_shortened():
    assert typed("compress", "x", "-o", "y", "--clus", "7").clusters == 7
    assert typed("compress", "x", "-o", "y", "--clus=7").clusters == 7


SIZES = {"8000": 8000, "8kB": 8000, "8 kB": 8000, "8KB": 8000, "2.7kB": 2700, "1MB": 10**6, "300B": 300, "0.5 kb": 500}


def check_size(text, count):
    assert byte_count(text) == count


@pytest.mark.parametrize("text", SIZES)
def test_sizes(text):
    check_size(text, SIZES[text])
    must_fail(check_size, text, SIZES[text] + 24)  # as with 1024 bytes a kB


@pytest.mark.parametrize("text", ["", "kB", "-8kB", "8xB", "8KiB", "1.5", "0.0001kB", "1e3", "٨kB", "8  kB", "8k B"])
def test_what_is_no_size(text):
    with pytest.raises(ArgumentTypeError, match="expected a number of bytes"):
        byte_count(text)
