"""Neural BRDFs (Sztrajman, Rainer, Ritschel & Weyrich 2021, "Neural BRDF Representation and Importance Sampling",
Computer Graphics Forum 40(6)): a perceptron from the half and difference vectors to f_r."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import half_diff
from ..system.errors import MaterialError

SHAPES = ((6, 21), (21, 21), (21, 3))
WEIGHTS = sum((rows + 1) * columns for rows, columns in SHAPES)
LARGEST_WEIGHT = 1e10  # so that results of three layers stay within single precision
LARGEST_EXPONENT = 20.0  # of the output: f_r up to 5e8


class NeuralBrdf(Brdf):
    """f_r = max(0, exp(W₃ relu(W₂ relu(W₁ x + b₁) + b₂) + b₃) − 1), x = (half vector, difference vector), in the frame
    in which the half vector's azimuth is 0.

    layers: three pairs of a matrix (inputs, outputs), with SHAPES, and a bias (outputs). Raises MaterialError for other
    shapes, and for weights that are too large or not finite.
    """

    def __init__(self, layers: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]], *, name: str) -> None:
        found = [(weights.shape, bias.shape) for weights, bias in layers]
        if found != [(shape, shape[1:]) for shape in SHAPES]:
            raise MaterialError(f"{name}: expected layers of shapes {SHAPES} with biases, found {found}")
        if not all((np.abs(values) <= LARGEST_WEIGHT).all() for layer in layers for values in layer):  # False for NaN
            raise MaterialError(f"{name}: expected finite weights of at most {LARGEST_WEIGHT:g}, found others")
        self.name = name
        self._layers = layers

    @classmethod
    def from_flat(cls, weights: NDArray[np.float64], *, name: str) -> NeuralBrdf:
        """From all weights in one array: each layer's matrix, row by row, then its bias."""
        if weights.shape != (WEIGHTS,):
            raise MaterialError(f"{name}: expected {WEIGHTS} weights, found shape {weights.shape}")
        layers: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        for rows, columns in SHAPES:
            matrix, bias, weights = np.split(weights, [rows * columns, (rows + 1) * columns])
            layers.append((matrix.reshape(rows, columns), bias))
        return cls(layers, name=name)

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        f = ops(wi[0])
        theta_h, theta_d, phi_d = half_diff(wi, wo)
        sin_d = f.sin(theta_d)
        x = [f.sin(theta_h), 0.0 * theta_h, f.cos(theta_h)]
        x += [sin_d * f.cos(phi_d), sin_d * f.sin(phi_d), f.cos(theta_d)]
        first, second, third = self._layers
        for weights, bias in (first, second):
            x = [f.maximum(y, 0.0) for y in f.affine(x, weights, bias)]
        x = f.affine(x, *third)
        bounded = (f.minimum(f.maximum(y, -LARGEST_EXPONENT), LARGEST_EXPONENT) for y in x)
        r, g, b = (f.maximum(f.exp(y) - 1.0, 0.0) for y in bounded)
        return r, g, b
