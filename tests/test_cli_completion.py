"""Completion by the shell."""

import subprocess
import sys

import pytest
from helpers import must_fail, run, run_json, tool

from sommerl.commands.cli import COMMANDS

ASK = """source "$0"
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_shtab_sommerl
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("shell") / "sommerl.bash"
    with path.open("w") as file:
        subprocess.run([sys.executable, "-m", "sommerl", "completion", "bash"], stdout=file, check=True)
    return path


def check_completed(script, line, expected, folder):
    words = ["sommerl", *line.split(" ")]
    done = subprocess.run([tool("bash"), "-c", ASK, script, *words], capture_output=True, text=True, cwd=folder)
    assert set(done.stdout.split()) == set(expected)


LINES = {
    "comp": ["compare", "completion", "compress"],
    "compress --target": ["--target-size", "--target-psnr"],
    "compress --rule ": ["paper", "kohonen"],
    "render --scene s": ["sphere", "statue", "sample", "still-life"],
    "paper t": ["table1", "table2"],
    "info ni": ["nix.smrl", "ninth"],
    "compress x -o ni": ["nix.smrl", "ninth"],
    "compare x ni": ["nix.smrl", "ninth"],
}


@pytest.mark.parametrize("line", LINES)
def test_bash_completes(script, tmp_path, line):
    (tmp_path / "nix.smrl").touch()
    (tmp_path / "ninth").mkdir()
    check_completed(script, line, LINES[line], tmp_path)
    must_fail(check_completed, script, line, ["nothing"], tmp_path)


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_every_shell_knows_every_command(capsys, shell):
    script = run(capsys, "completion", shell)[1]
    for module in COMMANDS:
        assert module.__name__.rpartition(".")[2] in script
    assert run_json(capsys, "completion", shell) == {"shell": shell, "script": script.rstrip("\n"), "warnings": []}


def test_another_shell_is_refused(capsys):
    status, out, err = run(capsys, "completion", "fish")
    assert (status, out) == (2, "")
    assert err.startswith("error: SHELL: expected bash or zsh or tcsh, found fish")


def test_nothing_else_loads_its_package():
    code = (
        "import sys; from sommerl.commands.cli import main; main(['info', 'nickel']); assert 'shtab' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
