"""The command `view`."""

import base64
import json
import os
import signal
import subprocess
import sys
import urllib.request
import zlib
from pathlib import Path

import numpy as np
import page_files
import pytest
from browser import DESKTOP
from helpers import PATIENCE, compact_material, complaint, lambertian_table, must_fail, run, run_json

from sommerl import TrainOptions, save, train
from sommerl.commands import view
from sommerl.formats import fits
from sommerl.reflectance.nodes import NodeLattice
from sommerl.viewer import versions

SECTION = (Path(__file__).parents[2] / "docs" / "json.md").read_text().split("\n## `view`")[1].partition("\n## ")[0]


@pytest.fixture
def grey(tmp_path):
    path = tmp_path / "grey.smrl"
    save(train(lambertian_table(), TrainOptions(clusters=1, epochs=1))[0], path)
    return path


def materials_in(page):
    text = page.read_text("utf-8").partition('id="materials">')[2].partition("</script>")[0]
    return json.loads(text)


def test_a_page_is_written(capsys, grey, tmp_path):
    page = tmp_path / "new" / "page.html"
    result = run_json(capsys, "view", grey, "nickel", "-o", page)
    assert (result["output"], result["url"]) == (str(page), None)
    assert result["bytes_page"] == page.stat().st_size
    assert [each["label"] for each in result["materials"]] == ["lambertian", "nickel (SGD stand-in)"]
    assert result["materials"][0]["versions"] == [{"step": "reference", "bytes": grey.stat().st_size}]
    assert result["materials"][1]["versions"] == [{"step": "reference", "bytes": None}]
    assert [(one["name"], one["format"]) for one in materials_in(page)] == [(str(grey), "smrl"), ("nickel", "table")]
    keys = {*result, *result["materials"][0]} - {"materials", "warnings", "input", "name"}
    assert [key for key in keys if f"`{key}`" not in SECTION] == []
    status, out, _ = run(capsys, "view", grey, "-o", page)  # its own page is replaced
    assert (status, out.startswith(f"lambertian → {page} (")) == (0, True)


def test_versions_are_compressed_into_it(capsys, grey, tmp_path, monkeypatch):
    """The long search is not made: see docs/notebooks."""
    asked_for = []

    def compress(brdf, **options):
        asked_for.append((options["target_size"], options["seed"], options["progress"] is not None))
        return compact_material(NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)), 2, 2), None

    monkeypatch.setattr(versions, "compress", compress)
    page, table = tmp_path / "page.html", tmp_path / "half.json"
    fits.write(table, "half", [{"model": "lambertian", "parameters": [{"family": "lambertian", "albedo": [0.5] * 3}]}])
    result = run_json(capsys, "view", table, "-o", page, "--clusters", "1", "--sizes", "0.8kB")
    assert [each["step"] for each in result["versions"]] == ["reference", "M = 1", "800 B"]
    assert asked_for == [(800, 0, True)]
    found = materials_in(page)
    label = result["label"]
    assert [one["group"] for one in found] == [label] * 3
    assert [one["format"] for one in found] == ["table", "smrl", "smrl"]
    assert found[2]["bytes"] <= 800
    assert found[1]["command"] == f"sommerl compress {table} -o half-M1.smrl --clusters 1"
    assert (found[2]["name"], found[2]["label"]) == ("half-800.smrl", f"{label}, 800 B")


def test_a_folder_is_all_that_can_be_read_in_it(capsys, grey, tmp_path):
    (tmp_path / "broken.smrl").write_bytes(b"SMRL")
    status, _, err = run(capsys, "view", tmp_path, "-o", tmp_path / "page.html")
    assert status == 0
    assert err.startswith(f"warning: {tmp_path / 'broken.smrl'}: expected")
    assert len(materials_in(tmp_path / "page.html")) == 1


def counted(monkeypatch):
    """How often each material is read from now on."""
    counts, load = {}, view.load

    def reads(source):
        counts[source] = counts.get(source, 0) + 1
        return load(source)

    monkeypatch.setattr(view, "load", reads)
    return counts


def test_each_of_many_is_read_once(capsys, grey, tmp_path, monkeypatch):
    folder = tmp_path / "many"
    folder.mkdir()
    for number in range(12):
        (folder / f"{number:02}.smrl").write_bytes(grey.read_bytes())
    counts = counted(monkeypatch)
    result = run_json(capsys, "view", folder, "-o", tmp_path / "page.html")
    assert list(counts.values()) == [1] * 12
    assert [each["label"] for each in result["materials"]][:2] == ["00.smrl: lambertian", "01.smrl: lambertian"]
    status, out, _ = run(capsys, "view", folder, "-o", tmp_path / "page.html")
    assert status == 0
    assert out.startswith("00.smrl: lambertian, 01.smrl: lambertian, 02.smrl: lambertian and 9 more → ")


def test_two_paths_of_one_file_have_two_labels(capsys, grey, tmp_path):
    again = tmp_path / ".." / tmp_path.name / grey.name
    result = run_json(capsys, "view", grey, again, "-o", tmp_path / "x.html")
    assert len({each["label"] for each in result["materials"]}) == 2


def test_one_of_several_in_a_file_has_no_size_of_its_own(capsys, tmp_path):
    table = tmp_path / "half.json"
    model = {"model": "lambertian", "parameters": [{"family": "lambertian", "albedo": [0.5] * 3}]}
    fits.write(table, "half", [model])
    page = tmp_path / "page.html"
    result = run_json(capsys, "view", table, f"{table}:lambertian", "-o", page)
    assert [one["bytes"] for one in materials_in(page)] == [table.stat().st_size, None]
    assert [each["versions"][0]["bytes"] for each in result["materials"]] == [table.stat().st_size, None]


def test_a_measured_bsdf_is_put_in_as_it_is(capsys, tmp_path, browse):
    path, page = tmp_path / "paint.mbsdf", tmp_path / "page.html"
    path.write_bytes(page_files.mbsdf(np.random.default_rng(0).random((3, 3, 4, 3))))
    result = run_json(capsys, "view", path, "-o", page)
    size = path.stat().st_size
    assert (result["name"], result["label"]) == ("paint", "paint")
    assert result["versions"] == [{"step": "reference", "bytes": size}]
    (one,) = materials_in(page)
    assert [one[key] for key in ("name", "format", "bytes", "group")] == [str(path), "mbsdf", size, "paint"]
    data = base64.b64decode(one["data"])
    assert (zlib.decompress(data, wbits=-15) if one["deflated"] else data) == path.read_bytes()
    assert browse(page.read_text("utf-8")).evaluate("document.getElementById('messages').textContent.trim()") == ""
    versions = run_json(capsys, "view", path, "-o", page, "--clusters", "2")["versions"]
    assert [each["step"] for each in versions] == ["reference", "M = 2"]
    path.write_bytes(b"something else")
    assert "found another kind of file" in run(capsys, "view", path, "-o", page)[2]


SIZES = {
    300: "300 B", 2700: "2,700 B", 9999: "9,999 B", 10_000: "10.0 kB", 12_400: "12.4 kB", 64_000: "64.0 kB",
    123_456: "123 kB", 999_600: "1,000 kB",
}  # fmt: skip


def test_sizes_are_written_as_the_page_has_them():
    assert [versions.shown_size(size) for size in SIZES] == list(SIZES.values())
    assert [one.step for one in versions.asked([1000, 12_400, 64_000])] == ["1,000 B", "12.4 kB", "64.0 kB"]
    assert [one.step for one in versions.asked([12_400, 12_410, 2700])] == ["12,400 B", "12,410 B", "2,700 B"]
    assert complaint(versions.asked, [299]).startswith("sizes: expected 300 to ")


ERRORS = [
    (["{grey}", "-o", "{folder}/page.png"], "{folder}/page.png: expected a name that ends in .html"),
    (["{grey}", "-o", "{folder}/x.html", "--port", "80"], "--port: expected no -o beside it"),
    (["{grey}", "-o", "{folder}/x.html", "--no-open"], "--no-open: expected no -o beside it"),
    (["{grey}", "{grey}", "-o", "{folder}/x.html"], "MATERIAL: expected different ones, found {grey} twice"),
    (["{grey}", "--port", "65536"], "--port: expected 0 to 65535, found 65536"),
    (["{grey}", "--sizes", "1,2"], "--sizes: expected "),
    (["{grey}", "--sizes", "1000,"], "--sizes: expected numbers between commas, found 1000,"),
    (["{grey}", "--sizes", "big"], "--sizes: expected a number of bytes, like 8000 or 8kB, found big"),
    (["{grey}", "--clusters", "0"], "--clusters: expected 1 to"),
    (["{grey}", "--clusters", "2,2"], "--clusters: expected different numbers, found 2, 2"),
]


@pytest.mark.parametrize(("options", "sentence"), ERRORS)
def test_options_that_cannot_be(capsys, grey, tmp_path, options, sentence):
    names = {"grey": grey, "folder": tmp_path}
    status, _, err = run(capsys, "view", *(word.format(**names) for word in options))
    assert status == 2
    assert err.startswith(f"error: {sentence.format(**names)}")
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["grey.smrl"]


def test_a_page_that_is_too_large(capsys, grey, tmp_path, monkeypatch):
    monkeypatch.setattr(view, "LARGEST_PAGE", 1000)
    status, _, err = run(capsys, "view", grey, "-o", tmp_path / "page.html")
    assert status == 2
    assert err.startswith("error: MATERIAL: expected materials for a page of at most 1.0 kB, found ")


@pytest.fixture
def serve():
    """Starts the command, and ends it."""
    started = []

    def serve(*arguments):
        command = [sys.executable, "-m", "sommerl", "view", *map(str, arguments)]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = subprocess.Popen(command, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"}, **streams)
        started.append(process)
        return process

    yield serve
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


def check_ended(process, number):
    """As all commands end that are interrupted."""
    process.send_signal(number)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err) == (130, "", "error: interrupted; nothing was left half-written\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_until_it_is_interrupted(serve, grey, number):
    process = serve(grey, "--no-open")
    line = process.stdout.readline()
    assert line.startswith("lambertian → http://127.0.0.1:")
    assert line.endswith("/ (Ctrl-C ends)\n")
    url = line.split(" ")[2]
    with urllib.request.urlopen(url, timeout=10) as answer:
        assert answer.read().startswith(b"<!doctype html>")
    check_ended(process, number)


def test_with_json_the_address_comes_first(serve, grey):
    process = serve(grey, "--no-open", "--json")
    text = ""
    while not text.endswith("\n}\n"):
        text += process.stdout.readline()
    result = json.loads(text)
    assert (result["output"], result["label"], result["warnings"]) == (None, "lambertian", [])
    port = result["url"].removeprefix("http://127.0.0.1:").removesuffix("/")
    other = serve(grey, "--no-open", "--port", port)
    out, err = other.communicate(timeout=PATIENCE)
    assert (other.returncode, out) == (2, "")
    assert err.startswith(f"error: --port: expected a free port, found {port} (")
    check_ended(process, signal.SIGINT)


def test_a_browser_shows_what_is_served(serve, grey, browse):
    process = serve(grey, "--no-open")
    url = process.stdout.readline().split(" ")[2]
    page = browse(url, viewport=DESKTOP)
    assert page.title().startswith("lambertian")
    check_ended(process, signal.SIGINT)


class Opens:
    """A browser of its own window."""

    def __init__(self):
        self.opened = []

    def open(self, url):
        self.opened.append(url)
        return True


def check_opened(url):
    assert view._opened(url)


def test_a_browser_is_opened_but_none_in_the_terminal(monkeypatch):
    import webbrowser

    browser = Opens()
    monkeypatch.setattr(webbrowser, "get", lambda: browser)
    check_opened("http://127.0.0.1:1/")
    assert browser.opened == ["http://127.0.0.1:1/"]
    monkeypatch.setattr(webbrowser, "get", lambda: webbrowser.GenericBrowser("lynx"))
    must_fail(check_opened, "http://127.0.0.1:1/")

    def none():
        raise webbrowser.Error

    monkeypatch.setattr(webbrowser, "get", none)
    must_fail(check_opened, "http://127.0.0.1:1/")


def check_no_page(capsys, path, page):
    status, _, err = run(capsys, "view", path, "-o", page)
    assert (status, page.exists()) == (1, False)
    assert "bytes of data" in err


def test_a_damaged_measured_bsdf_gives_no_page(capsys, tmp_path):
    path, page = tmp_path / "paint.mbsdf", tmp_path / "page.html"
    whole = page_files.mbsdf(np.ones((3, 3, 4, 3)))
    path.write_bytes(whole[:-1])
    check_no_page(capsys, path, page)
    path.write_bytes(whole)
    must_fail(check_no_page, capsys, path, page)
