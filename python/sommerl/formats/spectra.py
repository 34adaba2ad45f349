"""Reflectance spectra to linear sRGB: CIE 1931 2° observer, illuminant D65."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

NANOMETRES = np.arange(380.0, 781.0, 5.0)

# 1000 × the contribution of each nanometre to r, g and b of a reflectance under D65, every 5 nm: the observer's
# matching functions times the illuminant (CIE 15), through IEC 61966-2-1's matrix. Restated from colour-science's data,
# against which a test holds it; importing that package takes longer than reading a file.
_RESPONSE = (
    (0.00547, -0.00466, 0.03257),
    (0.00934, -0.00796, 0.05577),
    (0.01845, -0.01579, 0.11071),
    (0.04163, -0.03577, 0.25136),
    (0.09346, -0.08071, 0.56735),
    (0.15846, -0.13763, 0.97007),
    (0.30933, -0.27079, 1.91711),
    (0.55199, -0.48748, 3.46847),
    (0.94984, -0.84791, 6.09361),
    (1.42061, -1.28915, 9.4508),
    (1.73342, -1.60611, 12.12635),
    (2.07952, -1.98784, 15.68529),
    (2.20501, -2.20094, 18.47465),
    (2.02941, -2.17674, 19.92396),
    (1.63326, -2.00317, 20.86584),
    (0.99315, -1.62618, 20.57502),
    (0.19925, -1.1141, 19.71804),
    (-0.68032, -0.45413, 17.7732),
    (-1.61727, 0.37838, 14.71305),
    (-2.53441, 1.27506, 11.8636),
    (-3.39095, 2.21412, 9.17543),
    (-4.03751, 3.05161, 6.59414),
    (-4.61285, 3.89713, 4.64523),
    (-5.43017, 5.01136, 3.31937),
    (-6.37732, 6.33723, 2.29657),
    (-7.44096, 7.91637, 1.45361),
    (-8.38525, 9.5999, 0.66448),
    (-9.01615, 11.23828, -0.04412),
    (-9.17676, 12.63051, -0.58127),
    (-8.97477, 13.91407, -0.95723),
    (-8.25229, 14.86077, -1.24419),
    (-6.92072, 15.03807, -1.43046),
    (-5.29122, 14.908, -1.55129),
    (-3.43192, 14.70381, -1.63541),
    (-1.27176, 14.24369, -1.66998),
    (1.15164, 13.32178, -1.63581),
    (3.73874, 12.21222, -1.56876),
    (6.43552, 10.94705, -1.47679),
    (9.1638, 9.5483, -1.3635),
    (12.01912, 8.18896, -1.25391),
    (14.78612, 6.74559, -1.13055),
    (16.72179, 5.08939, -0.96501),
    (18.14157, 3.57201, -0.80667),
    (19.91713, 2.3647, -0.69212),
    (21.05364, 1.31585, -0.58538),
    (21.38839, 0.42613, -0.48239),
    (20.99107, -0.23636, -0.39356),
    (19.82051, -0.68453, -0.3145),
    (18.11848, -0.93931, -0.24844),
    (15.7077, -1.01849, -0.19036),
    (13.1972, -0.98778, -0.14368),
    (11.23952, -0.93226, -0.11105),
    (9.3658, -0.8372, -0.08501),
    (7.41198, -0.69983, -0.06265),
    (5.71191, -0.56017, -0.04573),
    (4.42249, -0.44605, -0.03386),
    (3.34462, -0.34421, -0.02474),
    (2.49288, -0.25991, -0.01802),
    (1.82227, -0.19197, -0.01293),
    (1.29487, -0.13753, -0.00904),
    (0.92922, -0.09946, -0.00639),
    (0.61832, -0.06665, -0.0042),
    (0.40209, -0.0435, -0.00271),
    (0.28443, -0.03084, -0.00191),
    (0.20672, -0.02244, -0.00138),
    (0.15043, -0.01633, -0.00101),
    (0.10941, -0.01188, -0.00073),
    (0.07099, -0.00771, -0.00048),
    (0.04539, -0.00493, -0.0003),
    (0.03424, -0.00372, -0.00023),
    (0.02557, -0.00278, -0.00017),
    (0.01842, -0.002, -0.00012),
    (0.01317, -0.00143, -0.00009),
    (0.00839, -0.00091, -0.00006),
    (0.00537, -0.00058, -0.00004),
    (0.00328, -0.00036, -0.00002),
    (0.00196, -0.00021, -0.00001),
    (0.00169, -0.00018, -0.00001),
    (0.00141, -0.00015, -0.00001),
    (0.00097, -0.00011, -0.00001),
    (0.00067, -0.00007, 0),
)


def srgb_weights(wavelengths: NDArray[Any]) -> NDArray[np.float64]:
    """The matrix (n, 3) that takes reflectances at n increasing wavelengths [nm] to linear sRGB.

    Between the wavelengths a spectrum is linear, beyond them constant. A spectrum of ones becomes (1, 1, 1).
    """
    fine = np.arange(380.0, 781.0)
    channels: list[NDArray[np.float64]] = [np.interp(fine, NANOMETRES, channel) for channel in np.transpose(_RESPONSE)]
    parts: list[NDArray[np.float64]] = [np.interp(fine, wavelengths, part) for part in np.eye(len(wavelengths))]
    weights = np.stack(parts) @ np.stack(channels, axis=-1)
    return weights / weights.sum(axis=0)


def to_rgb(values: NDArray[np.float64], wavelengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear sRGB (n, 3) of reflectances (n, m) at m different wavelengths [nm], in any order; one alone is grey."""
    if len(wavelengths) == 1:
        return np.repeat(values, 3, axis=1)
    order = np.argsort(wavelengths)
    with np.errstate(over="ignore", invalid="ignore"):  # whoever takes them refuses what is not finite
        return values[:, order] @ srgb_weights(wavelengths[order])


def from_xyz(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear sRGB of CIE XYZ, (…, 3)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return values @ FROM_XYZ.T


# IEC 61966-2-1, from CIE XYZ whose white, D65, has Y = 1.
FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])

# Reflectance spectra of linear sRGB's primaries, at every 20 nm: the smoothest ones (least squares of the differences
# of neighbours) from 0 to 1 that are 1 in sum and that `srgb_weights` takes back to the primaries, within 3·10⁻⁷.
WRITTEN = np.arange(390.0, 731.0, 20.0)
PRIMARIES = np.array([
    (0.041368, 0, 0.958632),
    (0.040798, 0, 0.959202),
    (0.034415, 0, 0.965585),
    (0.01655, 0, 0.98345),
    (0.009993, 0.067331, 0.922676),
    (0, 0.508755, 0.491245),
    (0, 0.923484, 0.076516),
    (0, 1, 0),
    (0, 1, 0),
    (0, 0.973022, 0.026978),
    (0.470434, 0.487541, 0.042025),
    (0.957952, 0.037916, 0.004132),
    (1, 0, 0),
    (1, 0, 0),
    (1, 0, 0),
    (1, 0, 0),
    (1, 0, 0),
    (1, 0, 0),
])  # fmt: skip
