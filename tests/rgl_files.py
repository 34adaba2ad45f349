"""Small RGL files, whole and broken on purpose."""

import io

import numpy as np

from sommerl.formats import tensor


def fields(**changes):
    """The arrays of a small isotropic material, with some of them changed; None leaves one out."""
    rng = np.random.default_rng(3)
    arrays = {
        "description": np.frombuffer(b"made up", np.uint8),
        "version": np.array([1, 0], np.uint8),
        "phi_i": np.zeros(1, np.float32),
        "theta_i": np.array([0, 0.5, 1.0, 1.5], np.float32),
        "ndf": np.tile(np.linspace(2, 0.5, 9), (2, 1)).astype(np.float32),
        "sigma": np.tile(np.linspace(1, 0.4, 7), (2, 1)).astype(np.float32),
        "vndf": (0.2 + rng.random((1, 4, 8, 9))).astype(np.float32),
        "luminance": (0.2 + rng.random((1, 4, 5, 5))).astype(np.float32),
        "rgb": (0.1 + rng.random((1, 4, 3, 5, 5))).astype(np.float32),
        "jacobian": np.ones(1, np.uint8),
    } | changes
    return {name: array for name, array in arrays.items() if array is not None}


def content(**changes):
    """The bytes of such a file."""
    out = io.BytesIO()
    tensor.write(out, fields(**changes))
    return out.getvalue()
