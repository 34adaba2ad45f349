"""`sommerl paper`, whole: a quick run makes every item, goes on where it was stopped, and leaves a report."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from helpers import must_fail, run, run_json

from sommerl.reproduction.items import ALL
from sommerl.reproduction.printed import items, printed


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("paper")


@pytest.fixture(scope="module")
def content(folder):
    command = [sys.executable, "-m", "sommerl", "paper", "all", "--quick", "-o", folder, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def check_every_number_is_shown(shown):
    """Those of the paper, each with a verdict; those that a quick run leaves out say so."""
    for item in items():
        assert [(each["key"], each["paper"]) for each in shown[item]["numbers"]] == [
            (key, each.value) for key, each in printed(item).items()
        ]
    numbers = [each for item in shown.values() for each in item["numbers"]]
    assert all(each["verdict"].startswith("not ") for each in numbers if each["default"] is None)


def test_a_quick_run_shows_every_number_of_the_paper(content, folder):
    shown = {item["name"]: item for item in content["items"]}
    assert list(shown) == list(ALL)
    check_every_number_is_shown(shown)
    must_fail(check_every_number_is_shown, shown | {"fig5": shown["fig5"] | {"numbers": shown["fig5"]["numbers"][1:]}})
    assert all(each["sentences"] for name, each in shown.items() if name != "fig3")
    assert content["output"][:3] == [str(folder / f"report.{extension}") for extension in ("html", "md", "json")]
    report = json.loads((folder / "report.json").read_text())
    assert (report["extent"], report["items"]) == ("quick", content["items"])
    assert "quick run: its numbers mean nothing" in (folder / "report.html").read_text()
    for item in content["items"]:
        for picture in item["pictures"]:
            assert (folder / picture["file"]).stat().st_size > 100


def test_what_is_measured_is_not_measured_again(capsys, content, folder):
    cells = {path: path.stat().st_mtime_ns for path in (folder / "cells").rglob("*.json")}
    stale = folder / "cells" / "fig3" / "architecture.json"
    stale.write_text(stale.read_text().replace('"sommerl_cell": "', '"sommerl_cell": "0'))
    again = run_json(capsys, "paper", "all", "--quick", "-o", folder)
    assert {path for path in cells if path.stat().st_mtime_ns != cells[path]} == {stale}
    assert again["items"] == content["items"]


def test_one_cell_alone(capsys, content, folder):
    found = run_json(capsys, "paper", "fig2", "--only", "hits", "--quick", "-o", folder)
    assert found["values"]["cells"] == printed("fig2")["cells of the table"].value
    status, out, _ = run(capsys, "paper", "fig2", "--only", "hits", "--quick", "-o", folder)
    assert status == 0
    assert "262440000" in out


def test_a_killed_run_leaves_nothing_half_made(content, folder, tmp_path):
    """What was kept is kept; what was not is made by the next run."""
    command = [sys.executable, "-m", "sommerl", "paper", "fig2", "--quick", "-o", tmp_path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        time.sleep(1.5)
        os.kill(process.pid, signal.SIGKILL)
    subprocess.run(command, check=True, capture_output=True)
    assert json.loads((tmp_path / "fig2.json").read_text())["items"][0]["numbers"][0]["verdict"] == "reproduced"
    assert not list(tmp_path.rglob(".sommerl-*"))
