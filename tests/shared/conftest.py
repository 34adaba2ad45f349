"""Tests on data that is not distributed with the project. Where it is not there, they are not collected."""

import hashlib
import runpy
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"
collect_ignore_glob = [] if (SHARED / "tools" / "np_to_merl.py").exists() else ["test_*.py"]


def pytest_report_header():
    """So that nobody takes a green run for one with these tests."""
    return None if not collect_ignore_glob else f"tests/shared: not collected, since {SHARED} is not there"


def made_once(path, make):
    """The path of a file, which `make` writes into a folder if it is not there."""
    if not path.exists():
        with tempfile.TemporaryDirectory(dir=path.parent) as part:  # other processes see whole files only
            make(Path(part))
            (Path(part) / path.name).rename(path)
    return path


def decode_np(name, folder):
    """What tools/np_to_merl.py does, but that the network is asked for cells above the horizon only, of which there
    are three in four, and for as many at a time as stay in a processor's cache."""
    tool = runpy.run_path(str(SHARED / "tools" / "np_to_merl.py"))
    shape = np.array([90, 90, 180], "<i4")
    theta_h, theta_d, phi_d = ((np.arange(steps) + 0.5) / steps for steps in shape)
    theta_h, theta_d, phi_d = np.meshgrid(theta_h**2 * np.pi / 2, theta_d * np.pi / 2, phi_d * np.pi, indexing="ij")
    tilt, up = np.sin(theta_d) * np.cos(phi_d) * np.sin(theta_h), np.cos(theta_d) * np.cos(theta_h)
    above = up > np.abs(tilt)
    edge = np.broadcast_to(
        ((np.arange(90) / 90) ** 2 * np.pi / 2)[:, None, None], shape
    )  # the network is trained on it
    parts = (np.array_split(angle[above], above.sum() // 1024) for angle in (edge, theta_d, phi_d))
    network = tool["layers"]()
    stored = np.full((*shape, 3), -1.0)
    stored[above] = np.concatenate([tool["decode"](name, network, *each) for each in zip(*parts, strict=True)])
    stored[above] /= tool["SCALE"]
    with open(folder / f"{name}.binary", "wb") as out:
        shape.tofile(out)
        np.moveaxis(stored, -1, 0).astype("<f8").tofile(out)


def decode_nbrdf(name, folder):
    """The same with an NBRDF, by the tool itself."""
    tool = SHARED / "tools" / "nbrdf_to_merl.py"
    subprocess.run([sys.executable, tool, name, "--out", folder], check=True, capture_output=True)


@pytest.fixture(scope="session")
def stand_in(pytestconfig):
    """A function from a material's name to the path of its NP stand-in in MERL's format. To decode one takes half a
    minute, so they stay in pytest's cache, by what they are decoded from, until `pytest --cache-clear`."""
    made_with = hashlib.sha256((SHARED / "tools" / "np_to_merl.py").read_bytes())
    for path in (Path(__file__), *sorted((SHARED / "data" / "np").rglob("*.*"))):
        made_with.update(path.read_bytes())
    folder = pytestconfig.cache.mkdir(f"np-{made_with.hexdigest()[:12]}")
    return lambda name: made_once(folder / f"{name}.binary", partial(decode_np, name))


@pytest.fixture(scope="session")
def nbrdf_stand_in(tmp_path_factory):
    """The same of its NBRDF stand-in."""
    folder = tmp_path_factory.mktemp("nbrdf")
    return lambda name: made_once(folder / f"{name}.binary", partial(decode_nbrdf, name))


@pytest.fixture(scope="session")
def probe():
    """The light probe of Grace Cathedral."""
    return SHARED / "data" / "env" / "grace_cathedral_latlong.exr"


@pytest.fixture(scope="session")
def buddha():
    """The Happy Buddha, without normals."""
    return SHARED / "data" / "meshes" / "happy_buddha_100k.obj"
