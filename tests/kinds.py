"""A small material of every kind that can be evaluated, sampled and rendered."""

import numpy as np
from factored_brdfs import made
from helpers import SMALL, compact_material
from rgl_files import fields
from sampled import HANDED, NODES, lobe

from sommerl import BrdfTable, SomManBrdf, builtin
from sommerl.compression.compact.fitted_table import FittedTable
from sommerl.formats import texture
from sommerl.formats.rgl import RglBrdf
from sommerl.models.multi_lobe import FAMILIES, MultiLobe
from sommerl.models.nbrdf import WEIGHTS, NeuralBrdf
from sommerl.models.standard import Surface
from sommerl.models.standards import STANDARDS
from sommerl.reflectance.grid import GridBrdf

RNG = np.random.default_rng(1)
VALUES = 0.3 * RNG.random((*SMALL.shape, 3)) ** 4


def cells(interpolation):
    index = RNG.integers(0, 40, SMALL.shape).astype(np.uint8)
    return SomManBrdf(0.3 * RNG.random((40, 3)), index, SMALL, name="cells", interpolation=interpolation)


def rgl():
    a = fields()
    return RglBrdf(a["theta_i"], a["vndf"][0], 0.3 * a["rgb"][0], a["ndf"], a["sigma"], name="rgl")


def grid(phi, about_mirror):
    theta_o = np.array([0.0, 0.1, 0.3, 0.7, 1.2])
    values = 0.3 * RNG.random((4, len(theta_o), len(phi), 3))
    return GridBrdf([0.2, 0.5, 1.0, 1.5], theta_o, phi, values, about_mirror=about_mirror, name="grid")


def one_lobe(name):
    family = FAMILIES[name]
    return MultiLobe(name, [lobe(name, (0.3, 0.2, 0.1), **{p.name: p.start for p in family.parameters})])


def surface(model):
    return Surface(model.name, model, model.by_name([float(chosen.start) for chosen in model.places]))


KINDS = {
    "table-nearest": BrdfTable(VALUES, SMALL, interpolation="nearest", name="table"),
    "table-trilinear": BrdfTable(VALUES, SMALL, name="table"),
    "table-handed": BrdfTable(0.3 * RNG.random((*HANDED.shape, 3)), HANDED, name="handed"),
    "cells-nearest": cells("nearest"),
    "cells-trilinear": cells("trilinear"),
    "nodes": compact_material(NODES),
    "fitted": FittedTable(NODES, RNG.random((NODES.size, 3)), 0.02, signed=False, name="fitted"),
    "rgl": rgl(),
    "grid": grid(np.pi * (np.arange(6) + 0.5) / 6, False),
    "grid-turn": grid(np.array([0.2, 1.0, 3.0, 4.0, 5.5]), False),
    "grid-mirror": grid(np.linspace(0, np.pi, 7), True),
    "neural": NeuralBrdf.from_flat(0.3 * RNG.standard_normal(WEIGHTS), name="neural"),
    "sgd": builtin("red-fabric"),
    "factored": made(),
    "texture": texture.of(compact_material(NODES)),
    **{name: one_lobe(name) for name in FAMILIES},
    **{name: surface(model) for name, model in STANDARDS.items()},
}
