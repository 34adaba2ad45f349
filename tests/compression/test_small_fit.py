"""The compact preset from source to file, with fewer directions and lines than usual: every step, in some seconds."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl import builtin
from sommerl.compression.compact import effort as efforts
from sommerl.compression.compact.lattice_fit import Fitter
from sommerl.compression.compact.quantise import quantise
from sommerl.compression.compact.search import CompactOptions, compress
from sommerl.compression.smrl.file import encode

A, B = (w[w[:, 2] > 0.2][:3000] for w in (random_directions(5000, s) for s in (1, 2)))
PAINT = builtin("blue-metallic-paint")


@pytest.fixture(scope="module")
def fitter():
    return Fitter(PAINT, seed=1, effort=replace(efforts.of(1), directions=20_000, lines=150))


@pytest.fixture(scope="module")
def problem(fitter):
    return fitter.problem(500)


def log_error(brdf):
    return float(np.sqrt(np.mean((np.log(brdf.eval(A, B) + 1e-3) - np.log(PAINT.eval(A, B) + 1e-3)) ** 2)))


def check_near(brdf, worst):
    assert log_error(brdf) < worst


def test_the_source_comes_back_and_better_from_more_nodes(fitter):
    few, more = fitter.fit(300), fitter.fit(1500)
    assert 240 <= few.lattice.size <= 300
    assert 1200 <= more.lattice.size <= 1500
    check_near(few, 0.03)
    check_near(more, 0.013)
    must_fail(check_near, few, log_error(more))


def check_solved(problem, values):
    """H z = b, to the tolerance of the conjugate gradients."""
    assert np.linalg.norm(problem.equations.product(values) - problem.equations.right) < 1e-4 * np.linalg.norm(
        problem.equations.right
    )


def test_best_values_solve_the_normal_equations(problem):
    check_solved(problem, problem.best)
    must_fail(check_solved, problem, problem.best * 1.001)
    assert problem.error > 0


def check_palette(problem, found, stream, size, worst):
    """worst: the share of black's error, which is the sum of all squares."""
    assert len(stream) <= size
    assert problem.excess(found.values()) < worst * problem.excess(0 * problem.best)


def test_palettes_within_a_size(problem):
    found, stream = quantise(problem, 60, 40, 450)
    check_palette(problem, found, stream, 450, 6e-5)
    must_fail(check_palette, problem, found, stream, len(stream) - 1, 6e-5)
    rolled = replace(found, gain_index=np.roll(found.gain_index, 1))
    must_fail(check_palette, problem, rolled, stream, 450, 6e-5)


def test_a_file_of_a_size():
    material, report = compress(PAINT, CompactOptions(target_size=600, effort=1))
    assert len(encode(material)) <= 600
    assert report.tried[0][0] == len(encode(material))
    check_near(material, 0.023)
