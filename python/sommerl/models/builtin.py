"""The built-in materials: stand-ins for ten measured ones, so that everything works without a download.

Each is the Shifted Gamma fit of a material in the MERL database (parameters published with Bagher et al. 2012; see
`models/sgd.py`). They are smooth approximations, not measurements, and are called SGD stand-ins everywhere.
"""

from __future__ import annotations

import numpy as np

from ..reflectance.cells import MERL, Lattice
from ..reflectance.table import BrdfTable
from ..system.errors import MaterialError
from ..system.near import did_you_mean
from .sgd import PARAMETERS, ShiftedGamma

NAMES = (
    "blue-metallic-paint",
    "yellow-matte-plastic",
    "purple-paint",
    "beige-fabric",
    "green-metallic-paint",
    "nickel",
    "chrome",
    "red-fabric",
    "gold-metallic-paint",
    "pearl-paint",
)


def builtin(name: str) -> ShiftedGamma:
    """A built-in material, as a formula. Raises MaterialError, with the most similar name or all, for other names.

    >>> builtin("nickel").kind
    'model'
    """
    if name not in _FITS:
        hint = did_you_mean(name, NAMES) or f"; built-in are {', '.join(NAMES)}"
        raise MaterialError(f"{name}: expected a file or a built-in material, found neither{hint}")
    return ShiftedGamma(f"{name} (SGD stand-in)", dict(zip(PARAMETERS, _FITS[name], strict=True)))


def builtin_table(name: str, *, noise: int | None = None, lattice: Lattice = MERL) -> BrdfTable:
    """A built-in material as a table: its formula at the cell centres of a lattice.

    noise: None for no noise, or a seed: see `noisy`.

    >>> builtin_table("nickel", lattice=Lattice(8, 8, 12)).values.shape
    (8, 8, 12, 3)
    """
    table = BrdfTable.sampled(builtin(name), lattice)
    return table if noise is None else noisy(table, noise)


def noisy(table: BrdfTable, seed: int) -> BrdfTable:
    """A table with noise of the size that the paper quotes for MERL's measurements (deviations from reciprocity of
    10-15 % near normal incidence and 60-70 % at grazing angles).

    Each cell is multiplied by a log-normal factor, the same for all channels, with mean 1 and σ = 0.12 + 0.5
    (1 - cos θ)⁴, where θ is the larger of θ_i and θ_o.
    """
    lattice = table.lattice
    cosine = np.clip(np.minimum(*lattice.cosines()), 0, 1)
    sigma = 0.12 + 0.5 * (1 - cosine) ** 4
    # Box-Muller on the raw stream of the generator: NumPy's own normal numbers may change between versions.
    u = (np.random.PCG64(seed).random_raw(2 * lattice.size).reshape(2, *lattice.shape) + 0.5) / 2.0**64
    normal = np.sqrt(-2 * np.log(u[0])) * np.cos(2 * np.pi * u[1])
    factor = np.exp(sigma * normal - sigma**2 / 2)
    return BrdfTable(table.values * factor[..., None], lattice, name=f"{table.name}, noise seed {seed}")


# ρ_d, ρ_s, α, p, f0, f1, κ, λ, c, k, θ0, each for r, g, b.
_FITS: dict[str, tuple[tuple[float, float, float], ...]] = {
    "blue-metallic-paint": (
        (0.00390446, 0.00337319, 0.00848198),
        (0.0706771, 0.0415082, 0.104423),
        (0.155564, 0.139, 0.15088),
        (1.01719, 1.02602, 1.16153),
        (0.149347, 0.153181, 1.87241e-14),
        (-0.487331, -0.76557, -1.0),
        (4.4222, 4.59265, 3.93929),
        (2.54345, 2.33884, 2.24405),
        (6.04906e-08, 5.81858e-08, 1.2419e-07),
        (23.9533, 25.0641, 24.6856),
        (-0.34053, -0.294595, -0.258117),
    ),
    "yellow-matte-plastic": (
        (0.276745, 0.108557, 0.0203686),
        (0.806628, 1.99624, 0.977002),
        (0.0237573, 0.0265756, 0.0305873),
        (0.558101, 0.537647, 0.710679),
        (0.0624565, 0.0605404, 0.0541077),
        (0.049915, 0.0567466, 0.0473569),
        (26.7398, 24.8437, 17.6137),
        (2.1481, 2.32064, 1.65758),
        (5.99553e-08, 5.96103e-08, 6.38097e-08),
        (41.7723, 39.7008, 40.1979),
        (0.11569, 0.0891281, 0.0886802),
    ),
    "purple-paint": (
        (0.290743, 0.0347118, 0.0339802),
        (0.301308, 0.205258, 0.280717),
        (0.0339173, 0.00839425, 0.0378011),
        (0.703279, 0.20083, 0.797376),
        (0.0654958, 0.0786512, 0.0696424),
        (0.0299494, 0.0467651, 0.0373649),
        (16.3705, 104.698, 13.2101),
        (1.72814, 6.77684, 1.54679),
        (1.10548e-07, 0.177314, 6.66798e-08),
        (38.0847, 41.1712, 38.2781),
        (0.0789738, 0.576929, 0.0587144),
    ),
    "beige-fabric": (
        (0.20926, 0.160666, 0.145337),
        (0.121663, 0.0501577, 0.00177279),
        (0.39455, 0.15975, 0.110706),
        (0.474725, 0.0144728, 1.70871e-12),
        (0.0559459, 0.222268, 8.4764),
        (-0.318718, -0.023826, 7.4764),
        (3.8249, 7.32453, 10.0904),
        (2.26283, 2.97144, 3.55311),
        (0.0375346, 0.073481, 0.0740222),
        (7.52635, 9.05672, 10.6185),
        (0.217453, 0.407084, 0.450203),
    ),
    "green-metallic-paint": (
        (0.00368935, 0.0155555, 0.022272),
        (0.185621, 0.436002, 0.322925),
        (0.131402, 0.146271, 0.154061),
        (1.28366, 0.865104, 0.944013),
        (0.12483, 0.0443223, 0.0955612),
        (0.028874, -0.118581, -0.139373),
        (3.62502, 5.13725, 4.71161),
        (1.97389, 2.72437, 2.63239),
        (5.5607e-08, 1.1239e-07, 9.76666e-08),
        (27.5467, 23.1688, 23.2911),
        (-0.204638, -0.326555, -0.334024),
    ),
    "nickel": (
        (0.0144009, 0.0115339, 0.00989042),
        (0.157696, 0.293022, 0.450103),
        (0.00556292, 0.00627392, 0.00660563),
        (0.171288, 0.168324, 0.161023),
        (2.21884, 1.61986, 0.931645),
        (1.21884, 1.22103, 0.698939),
        (160.907, 143.234, 136.933),
        (6.76252, 6.76447, 6.76278),
        (16179.3, 3451.04, 3453.27),
        (36.1378, 35.1378, 33.614),
        (0.846825, 0.821209, 0.830948),
    ),
    "chrome": (
        (0.00697189, 0.00655268, 0.0101854),
        (0.0930656, 0.041946, 0.104558),
        (0.000155335, 0.000156872, 7.39851e-05),
        (0.353854, 0.3327, 0.300437),
        (0.256314, 0.819565, 3.22085e-13),
        (-0.743686, -0.180435, -1.0),
        (4642.1, 4726.66, 10421.9),
        (3.8545, 4.44817, 5.40959),
        (5.30781e-08, 1.04045e-07, 1.79834e66),
        (354.965, 349.356, 272.736),
        (0.526796, 0.528469, 1.00293),
    ),
    "red-fabric": (
        (0.201899, 0.0279008, 0.0103965),
        (0.168669, 0.0486346, 0.040485),
        (0.324447, 0.228455, 0.109436),
        (0.787411, 0.821197, 0.279212),
        (0.0718348, 0.0644687, 0.0206123),
        (-0.0585917, -0.0062547, -0.050402),
        (3.88129, 4.32067, 9.16355),
        (3.59825, 3.93046, 4.66379),
        (0.000130047, 1.04152e-07, 4.59182e-05),
        (13.0776, 19.649, 17.8852),
        (-0.209387, -0.530789, -0.0242035),
    ),
    "gold-metallic-paint": (
        (0.0178625, 0.00995704, 0.00335044),
        (0.17127, 0.120714, 0.115473),
        (0.127954, 0.127825, 0.109623),
        (0.781093, 0.795517, 0.661313),
        (1.00776e-12, 1.22243e-15, 6.18432e-13),
        (-1.0, -1.0, -0.334497),
        (5.90039, 5.83556, 7.14985),
        (2.7548, 2.7057, 2.94348),
        (9.46481e-08, 1.06951e-07, 1.10733e-07),
        (23.8811, 23.9059, 24.2972),
        (-0.303345, -0.293778, -0.267019),
    ),
    "pearl-paint": (
        (0.181967, 0.159068, 0.143348),
        (0.105133, 0.0928717, 0.0802367),
        (0.0724063, 0.0808503, 0.0596139),
        (0.194454, 0.203296, 0.091958),
        (0.168966, 0.297431, 0.401185),
        (-0.831034, -0.702569, -0.226546),
        (13.6335, 12.3113, 17.1256),
        (5.07525, 4.9097, 4.92468),
        (0.000252814, 0.000258641, 0.0180128),
        (18.9547, 18.2047, 16.1366),
        (0.156731, 0.135808, 0.415562),
    ),
}
