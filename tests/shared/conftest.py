"""Tests on data that is not distributed with the project. Where it is not there, they are not collected."""

import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"
collect_ignore_glob = [] if (SHARED / "tools" / "np_to_merl.py").exists() else ["test_*.py"]


def pytest_report_header():
    """So that nobody takes a green run for one with these tests."""
    return None if not collect_ignore_glob else f"tests/shared: not collected, since {SHARED} is not there"


def decoded(kind, name, folder):
    """The path in `folder` of a stand-in in MERL's format. tools/KIND_to_merl.py makes it if it is not there."""
    path = folder / f"{name}.binary"
    if not path.exists():
        tool = SHARED / "tools" / f"{kind}_to_merl.py"
        with tempfile.TemporaryDirectory(dir=folder) as part:  # other processes see whole files only
            subprocess.run([sys.executable, tool, name, "--out", part], check=True, capture_output=True)
            (Path(part) / path.name).rename(path)
    return path


@pytest.fixture(scope="session")
def stand_in(pytestconfig):
    """A function from a material's name to the path of its NP stand-in in MERL's format. To decode one takes up to a
    minute, so they stay in pytest's cache, by what they are decoded from, until `pytest --cache-clear`."""
    made_with = hashlib.sha256((SHARED / "tools" / "np_to_merl.py").read_bytes())
    for path in sorted((SHARED / "data" / "np").rglob("*.*")):
        made_with.update(path.read_bytes())
    folder = pytestconfig.cache.mkdir(f"np-{made_with.hexdigest()[:12]}")
    return lambda name: decoded("np", name, folder)


@pytest.fixture(scope="session")
def nbrdf_stand_in(tmp_path_factory):
    """The same of its NBRDF stand-in."""
    folder = tmp_path_factory.mktemp("nbrdf")
    return lambda name: decoded("nbrdf", name, folder)


@pytest.fixture(scope="session")
def probe():
    """The light probe of Grace Cathedral."""
    return SHARED / "data" / "env" / "grace_cathedral_latlong.exr"


@pytest.fixture(scope="session")
def buddha():
    """The Happy Buddha, without normals."""
    return SHARED / "data" / "meshes" / "happy_buddha_100k.obj"
