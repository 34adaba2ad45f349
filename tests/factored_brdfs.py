"""Factored BRDFs that are made up, and their files, which may be broken on purpose."""

import numpy as np

from sommerl.factored.file import MAGIC, VERSION
from sommerl.factored.material import COLUMNS, ELEVATIONS, ROWS, FactoredBrdf
from sommerl.system import sealed_file


def made(lobes=2, terms=3, seed=0):
    rng = np.random.default_rng(seed)
    parts = (rng.random(shape) for shape in ((ELEVATIONS, lobes, 3), (ROWS, lobes, terms), (COLUMNS, lobes, terms)))
    return FactoredBrdf(*parts, 3 * rng.random((lobes, terms)), name="made up", source_sha256="0123456789abcdef" * 4)


def even():
    """A file of few bytes."""
    lobes, rows, columns = np.ones((ELEVATIONS, 1, 3)), np.ones((ROWS, 1, 1)), np.ones((COLUMNS, 1, 1))
    return FactoredBrdf(lobes, rows, columns, np.ones((1, 1)), name="even")


def sealed(body, version=VERSION):
    """A file with a checksum that fits."""
    return sealed_file.sealed(MAGIC, version, body)


def arrays(material):
    return material.lobes, material.rows, material.columns, material.scale
