"""How much weights spread: what makes one unbiased sampler better than another, and shows a fit that went wrong."""

import numpy as np
import pytest
from helpers import must_fail
from sampled import sampler

COUNT = 20_000
CHANCE = np.random.default_rng(7).random((COUNT, 3))


def spread(name, material, degrees):
    """The standard deviation of the weights (mean of the channels) as a share of their mean."""
    viewer = np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
    weight = sampler(name, material).sample(np.broadcast_to(viewer, CHANCE.shape), CHANCE)[2].mean(axis=-1)
    return float(weight.std() / weight.mean())


# Measured, at 0°, 45° and 80°; bounds are a tenth above.
MEASURED = {
    ("half-vector", "glossy"): (0.195, 0.238, 0.256),
    ("lawrence", "glossy"): (0.399, 0.344, 0.893),
    ("matusik", "glossy"): (0.008, 0.009, 0.046),
    ("blinn-phong", "glossy"): (0.077, 0.114, 0.488),
    ("half-vector", "mirror"): (0.301, 0.305, 0.381),
    ("lawrence", "mirror"): (0.144, 0.146, 0.189),
    ("matusik", "mirror"): (0.286, 0.300, 0.761),
    ("blinn-phong", "mirror"): (0.332, 0.336, 0.358),
}


def check_spread(name, material, degrees, most):
    assert spread(name, material, degrees) < most


@pytest.mark.parametrize(("name", "material"), MEASURED)
def test_weights_spread_no_more_than_they_did(name, material):
    for degrees, measured in zip((0, 45, 80), MEASURED[name, material], strict=True):
        check_spread(name, material, degrees, 1.1 * measured + 0.001)
        must_fail(check_spread, name, material, degrees, 0.85 * measured)
    must_fail(check_spread, "cosine", material, 80, 1.1 * measured)
