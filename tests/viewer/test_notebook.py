"""The page in notebooks, and the notebooks in docs/, which run."""

import html
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from browser import READY, wait_until
from helpers import compact_material, lambertian_table, must_fail
from kinds import KINDS

import sommerl
from sommerl.system.errors import MaterialError, OptionError, SommerlError

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))
# In a process of its own: a kernel has threads, and what waits for it a loop of events.
RUN = """
import sys
import nbformat
from nbclient import NotebookClient

notebook = nbformat.read(sys.argv[1], 4)
NotebookClient(notebook, timeout=600, resources={"metadata": {"path": "."}}).execute()
nbformat.write(notebook, "run.ipynb")
"""


def executed(path, folder):
    """The cells of a notebook that has run in a folder."""
    own = {f"{name}_DIR": str(folder) for name in ("JUPYTER_CONFIG", "JUPYTER_DATA", "JUPYTER_RUNTIME")}
    environment = os.environ | own | {"IPYTHONDIR": str(folder / "ipython"), "PYTHONWARNINGS": "ignore"}
    done = subprocess.run(
        [sys.executable, "-c", RUN, path], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "run.ipynb").read_text("utf-8"))["cells"]


def check_runs(path, folder):
    cells = executed(path, folder)
    pages = [
        output["data"] for cell in cells for output in cell.get("outputs", []) if "text/html" in output.get("data", {})
    ]
    assert len(pages) == 1
    assert "".join(pages[0]["text/html"]).startswith('<iframe title="Sommerl" sandbox="allow-scripts allow-downloads"')


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path, tmp_path):
    check_runs(path, tmp_path)


def test_a_notebook_that_fails_is_noticed(tmp_path):
    notebook = json.loads(NOTEBOOKS[0].read_text("utf-8"))
    code = next(cell for cell in notebook["cells"] if cell["cell_type"] == "code")
    code["source"] = ["raise ValueError('broken on purpose')"]
    notebook["cells"] = [code]
    (tmp_path / "broken.ipynb").write_text(json.dumps(notebook))
    must_fail(check_runs, tmp_path / "broken.ipynb", tmp_path)


def check_stripped(notebook):
    for cell in notebook["cells"]:
        assert cell["cell_type"] != "code" or (cell["outputs"], cell["execution_count"]) == ([], None)


def test_they_are_kept_without_outputs():
    assert len(NOTEBOOKS) == 2
    for path in NOTEBOOKS:
        notebook = json.loads(path.read_text("utf-8"))
        check_stripped(notebook)
        code = next(cell for cell in notebook["cells"] if cell["cell_type"] == "code")
        code["outputs"] = [{"output_type": "stream", "name": "stdout", "text": ["1"]}]
        must_fail(check_stripped, notebook)


def test_a_frame_shows_the_page(browse):
    shown = sommerl.view(KINDS["nodes"])
    host = browse(f"<!doctype html><title>notebook</title>{shown._repr_html_()}", ready="true")
    frame = host.frames[1]
    wait_until(frame, READY)
    assert frame.evaluate("document.title").startswith("compact")
    assert frame.evaluate("self.origin") == "null"  # it cannot reach the notebook


def test_the_page_is_saved_as_a_file(tmp_path):
    shown = sommerl.view(KINDS["nodes"], height=300)
    shown.save(tmp_path / "x.html")
    assert (tmp_path / "x.html").read_text("utf-8") == shown.html
    frame = shown._repr_html_()
    assert "height: 300px" in frame
    assert ' allow="clipboard-write" ' in frame
    assert html.unescape(re.search(r'srcdoc="([^"]*)"', frame)[1]) == shown.html
    assert repr(shown) == f"<page of {len(shown.html.encode())} bytes; save(PATH) writes it>"


def labels(*brdfs):
    text = sommerl.view(*brdfs).html.partition('id="materials">')[2].partition("</script>")[0]
    return [one["label"] for one in json.loads(text)]


def test_materials_are_told_apart():
    table, nodes = lambertian_table(), compact_material(KINDS["nodes"].lattice, name="lambertian")
    small, _ = sommerl.train(table, sommerl.TrainOptions(clusters=1, epochs=1))
    assert labels(table, KINDS["rgl"]) == ["lambertian", "rgl"]
    found = labels(table, small, nodes, nodes)
    assert found[:2] == ["lambertian, trilinear", "lambertian, M = 1"]
    assert re.fullmatch(r"lambertian, [\d,]+ B, 3", found[2])
    assert len(set(found)) == 4


def test_a_file_that_is_given_twice_has_two_labels(tmp_path):
    sommerl.save(KINDS["nodes"], tmp_path / "x.smrl")
    found = labels(tmp_path / "x.smrl", tmp_path / "x.smrl")
    assert [label.rpartition(", ")[2] for label in found] == ["1", "2"]


def test_what_cannot_be_viewed():
    with pytest.raises(MaterialError, match="view: expected at least one material, found none"):
        sommerl.view()
    with pytest.raises(OptionError, match="sizes: expected 300 to 64000, found 1"):
        sommerl.view(KINDS["nodes"], sizes=[1])
    with pytest.raises(OptionError, match="clusters: expected 1 to"):
        sommerl.view(KINDS["nodes"], clusters=[0])
    with pytest.raises(SommerlError, match="did you mean nickel"):
        sommerl.view("nickle")


def test_importing_it_loads_nothing_of_it():
    code = "import sys, sommerl; assert 'view' in sommerl.__all__; print([m for m in sys.modules if 'viewer' in m])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "[]\n"
