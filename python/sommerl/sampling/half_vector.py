"""Our sampler: half vectors from a small table for each elevation of the viewer.

For a viewer at elevation θ_o, half vectors whose light lies above the horizon fill 0 ≤ θ_h ≤ θ_max(φ_h, θ_o), where φ_h
is the azimuth from the viewer's. A unit square is stretched over them: one side is |φ_h| / π, the other

    s = log(1 + tan² θ_h / w²) / log(1 + tan² θ_max / w²),

linear in solid angle within a highlight of width w and logarithmic in its tail, so that a row of cells costs about as much
light as the next one whether the material is chrome or chalk. Every cell of that square holds the probability that the
table gives it and is drawn from uniformly; nothing is drawn below the horizon, and nothing above it is left out. Between
two elevations of the table, their densities are mixed: one of the two is chosen at random.

Tables of directions for each elevation go back to Matusik (2003), half vectors from tabulated distributions to Dupuy et
al. (2015), the domain that follows the horizon to the visible normals of Dupuy and Jakob (2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Triple, ops
from ..brdf import Brdf, Buffers
from .sampler import PI, Sampler

ROWS, COLUMNS = 20, 8  # cells in s and in φ_h
ELEVATIONS = 12  # of the viewer; dense at grazing angles, where lobes change fastest
CELLS = ROWS * COLUMNS
SLOTS = 256  # of a cell in the alias table
WHOLE = CELLS * SLOTS  # the probability 1

WIDTHS = 2.0 ** -np.arange(10)  # w to choose from, in tan θ_h
LOWEST = 8e-4  # cos θ_o that stands for 0, at which θ_max has no width left
DIFFUSE = 0.03  # share of directions that follow the cosine
NEIGHBOUR = 0.15  # a cell gets at least that share of the brightest light in or beside it
ENERGY_ERROR = 0.1  # of a width whose cells still see the whole highlight


@dataclass(frozen=True)
class HalfVectorSampler(Sampler):
    """Half vectors from a table for each elevation of the viewer.

    table: of each cell, in 32 bits from the lowest: its probability in units of 1 / WHOLE (16), another cell (8), and how
        many of its own SLOTS that one takes (8); shape (ELEVATIONS, CELLS). A cell's number is column + COLUMNS · row.
    width: w.
    """

    brdf: Brdf
    table: NDArray[np.uint32]
    width: float
    name = "half-vector"

    @classmethod
    def fitted(cls, brdf: Brdf) -> HalfVectorSampler:
        """The sampler of a BRDF, which is evaluated for about 70,000 pairs of directions."""
        width = _width(brdf)
        return cls(brdf, np.stack([_alias_table(p) for p in _probabilities(brdf, width)]), width)

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"table": self.table.reshape(-1), "width2": np.asarray(self.width**2)}

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        f = ops(wo[0])
        table = buffers["table"]
        node, t = _elevation(wo[2])
        second = u[0] < t
        again = f.where(second, u[0], u[0] - t) / f.where(second, t, 1.0 - t)
        first = CELLS * f.where(second, node + 1, node)
        slot = f.to_index(f.minimum(again * WHOLE, WHOLE - 1.0))
        cell = slot // SLOTS
        word = f.gather(table, first + cell)
        cell = f.where(slot % SLOTS < (word >> 24), (word >> 16) & 255, cell)
        row = cell // COLUMNS
        s = (1.0 * row + u[1]) * (1.0 / ROWS)
        turn = (1.0 * (cell % COLUMNS) + u[2]) * (2.0 / COLUMNS)
        wi, solid_angle = _mirrored(s, turn, wo, buffers["width2"])
        drawn = (wo[2] > 0.0) & (wi[2] > 0.0)
        return wi, f.where(drawn, _share(table, node, t, cell) / solid_angle, 0.0)
def _light(brdf: Brdf, cos_o: NDArray[np.float64], width: float, finer: int) -> tuple[NDArray[np.float64], ...]:
    """Squared light, and cosine, at places in the unit square: f_r² cos² θ_i dω_i², the mean over channels, and
    cos θ_i dω_i; of shape (elevations, ROWS, COLUMNS, places in each cell)."""
    places = [((np.arange(finer * n) + 0.5) / (finer * n)) for n in (ROWS, COLUMNS)]
    z, s, phi = np.broadcast_arrays(cos_o[:, None, None], places[0][:, None], PI * places[1])
    wo = np.sqrt(1 - z * z), np.zeros_like(z), z
    wi, solid_angle = _mirrored(s, phi, wo, np.asarray(width**2))
    f_r = brdf.eval(np.stack(wi, axis=-1), np.stack(wo, axis=-1))
    cosine = np.maximum(wi[2], 0.0) * solid_angle
    cells = (len(cos_o), ROWS, finer, COLUMNS, finer)

    def of_cells(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return values.reshape(cells).swapaxes(2, 3).reshape(len(cos_o), ROWS, COLUMNS, -1)

    return of_cells((f_r * f_r).mean(axis=-1) * cosine * cosine), of_cells(cosine)


def _width(brdf: Brdf) -> float:
    """The width whose cells vary least within, of those that see the whole highlight.

    Of a variable that is drawn uniformly within cells, the least second moment is (Σ √mean square)², for the
    probabilities √mean square.
    """
    cos_o = (np.array([1, 4, 9]) / (ELEVATIONS - 1)) ** 2
    energies, moments = [], []
    for width in WIDTHS:
        square, _ = _light(brdf, cos_o, float(width), 2)
        energies.append(np.sqrt(square).mean(axis=-1).sum(axis=(1, 2)))
        moments.append(np.sqrt(square.mean(axis=-1)).sum(axis=(1, 2)))
    energy, moment = np.array(energies), np.array(moments)
    # Wide cells may step over a narrow highlight, or count it many times.
    whole = np.median(energy[len(WIDTHS) // 2 :], axis=0)
    if not whole.all():  # black, or nearly
        return float(WIDTHS[0])
    sees = (np.abs(energy / whole - 1) <= ENERGY_ERROR).all(axis=1)
    variance = np.where(sees, ((moment / energy) ** 2).mean(axis=1), np.inf)
    return float(WIDTHS[np.argmin(variance)])


def _probabilities(brdf: Brdf, width: float) -> NDArray[np.float64]:
    """Of every cell, (ELEVATIONS, CELLS), each row with the sum 1."""
    # Each table serves the elevations about it, so that those between are looked at, too.
    cos_o = np.maximum((np.arange(2 * ELEVATIONS - 1) / (2 * ELEVATIONS - 2)) ** 2, LOWEST)
    square, cosine = _light(brdf, cos_o, width, 3)
    mean = square.mean(axis=-1)
    total = np.sqrt(mean).sum(axis=(1, 2), keepdims=True)
    unit = np.where(total > 0, total, 1.0)
    mean, brightest = mean / unit**2, np.sqrt(square.max(axis=-1)) / unit
    before, after = np.r_[1, 1 : 2 * ELEVATIONS - 2 : 2], np.r_[1 : 2 * ELEVATIONS - 2 : 2, 2 * ELEVATIONS - 3]
    near = np.maximum(brightest[::2], np.maximum(brightest[before], brightest[after]))
    light = np.maximum(np.sqrt(mean[::2]), NEIGHBOUR * _brightest_neighbour(near))
    diffuse = cosine[::2].mean(axis=-1)
    shares = [part / part.sum(axis=(1, 2), keepdims=True) for part in (light, diffuse) if part.any()]
    p = (1 - DIFFUSE) * shares[0] + DIFFUSE * shares[-1]
    return p.reshape(ELEVATIONS, CELLS)


def _brightest_neighbour(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The largest value in or beside a cell, along each axis and diagonally."""
    for axis in range(values.ndim):
        ahead, behind = (np.roll(values, step, axis) for step in (1, -1))
        for moved, end in ((ahead, 0), (behind, -1)):  # the ends are no neighbours
            edge = [slice(None)] * values.ndim
            edge[axis] = slice(end, None if end else 1)
            moved[tuple(edge)] = values[tuple(edge)]
        values = np.maximum(values, np.maximum(ahead, behind))
    return values
