"""Tests on data that is not distributed with the project. Where it is not there, they are not collected."""

import subprocess
import sys
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"
collect_ignore_glob = [] if (SHARED / "tools" / "nbrdf_to_merl.py").exists() else ["test_*.py"]


def pytest_report_header():
    """So that nobody takes a green run for one with these tests."""
    return None if not collect_ignore_glob else f"tests/shared: not collected, since {SHARED} is not there"


@pytest.fixture(scope="session")
def stand_in(tmp_path_factory):
    """A function from a material's name to the path of its NBRDF stand-in in MERL's format."""
    folder = tmp_path_factory.mktemp("merl")

    def write(name):
        path = folder / f"{name}.binary"
        if not path.exists():
            tool = SHARED / "tools" / "nbrdf_to_merl.py"
            subprocess.run([sys.executable, tool, name, "--out", folder], check=True, capture_output=True)
        return path

    return write


@pytest.fixture(scope="session")
def probe():
    """The light probe of Grace Cathedral."""
    return SHARED / "data" / "env" / "grace_cathedral_latlong.exr"


@pytest.fixture(scope="session")
def buddha():
    """The Happy Buddha, without normals."""
    return SHARED / "data" / "meshes" / "happy_buddha_100k.obj"
