"""Makes a folder of a thousand materials that a library can be built of, from the stand-ins of MERL's materials.

    uv run python benchmarks/stand_in_library.py OUT [--count 1000] [--seed 0] [--data NP_FOLDER] [--bases B,C]

Each material is a stand-in of Zheng et al.'s neural processes, or a mixture of two, tinted, and two in three times
roughened: blurred along θ_h, weighted by solid angle, so that highlights keep their energy. All are drawn by the seed
and the material's number: the same command makes the same bytes, and goes on where it was stopped.

They are written as .smrl of cells whose palette holds each cell's own value in single precision, on 90 × 24 × 36 cells
with trilinear lookup: exact, 0.8 MB each, 0.8 GB for a thousand. MERL's tables would be 35 GB; RGL's
files of such a table would be 1.5 MB each, and are evaluated by NumPy, three times as slowly as tables are by the core,
so that a build would measure that. The lattice has a nineteenth of the cells of MERL's: decoding is arithmetic, 1.6
million operations a cell, which no order of the work makes less; cells below the horizon, a quarter, are left out.
What was decoded stays in OUT.bases.npz.
"""

from __future__ import annotations

import argparse
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sommerl import Lattice, SomManBrdf, save

LATTICE = Lattice(90, 24, 36)
NP = Path(__file__).resolve().parents[2] / "shared" / "data" / "np"
SCALE = 0.15  # of what the network gives, before its four logarithms are undone
LOGARITHMS, LARGEST_EXPONENT = 4, 20.0
LATENT = 7  # numbers of a material
AT_ONCE = 2048  # cells: the activations stay in the cache
LARGEST_BLUR = 0.25  # [rad], a standard deviation
Values = NDArray[np.float32]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, default=NP)
    parser.add_argument("--bases", help="names of stand-ins, between commas (all)")
    options = parser.parse_args()
    cache = options.out.with_name(f"{options.out.name}.bases.npz")
    found = bases(options.data, cache, options.bases.split(",") if options.bases else None)
    for number in range(options.count):
        rng = np.random.Generator(np.random.PCG64([options.seed, number]))
        name, values = _made(rng, found)
        path = options.out / name / f"{number:04}.smrl"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            save(material(f"{name} {number:04} (NP stand-in, changed)", values), path)
        _tell("written", number + 1, options.count)
    return 0


def _tell(what: str, done: int, total: int) -> None:
    print(f"\r{what}: {done} of {total}", end="" if done < total else "\n", file=sys.stderr, flush=True)


def _made(rng: np.random.Generator, bases: dict[str, Values]) -> tuple[str, Values]:
    """The name of the stand-in that a material is made of, and its values above the horizon, (cells, 3)."""
    names = list(bases)
    one, other = (names[at] for at in rng.integers(len(names), size=2))
    share = float(rng.uniform(0.2, 0.8)) if rng.random() < 0.5 else 1.0
    tint = rng.uniform(0.3, 1.0, 3)  # no more is reflected than by what it is made of
    blur = float(rng.uniform(0.0, LARGEST_BLUR)) if rng.random() < 2 / 3 else 0.0
    values = (share * bases[one] + (1 - share) * bases[other]) * tint
    return one, (_blurred(values, blur) if blur > 0.01 else values).astype(np.float32)


def _blurred(values: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Weighted means along θ_h, of cells above the horizon."""
    above, weight = LATTICE.above_horizon, LATTICE.solid_angles()
    theta_h = _theta_h(0.5)
    kernel = np.exp(-0.5 * ((theta_h[:, None] - theta_h) / width) ** 2)
    whole = np.zeros((*LATTICE.shape, 3))
    whole[above] = values
    weighed = np.where(above, np.broadcast_to(weight, LATTICE.shape), 0.0)
    total = np.einsum("hk,kdp->hdp", kernel, weighed)
    means = np.einsum("hk,kdpc->hdpc", kernel, weighed[..., None] * whole) / np.maximum(total, 1e-300)[..., None]
    return means[above]


def _theta_h(place: float) -> NDArray[np.float64]:
    """θ_h of cells [rad], at a place in each from 0 to 1."""
    count = LATTICE.shape[0]
    return ((np.arange(count) + place) / count) ** 2 * np.pi / 2


def bases(data: Path, cache: Path, some: list[str] | None = None) -> dict[str, Values]:
    """The stand-ins' values above the horizon, (cells, 3) each: of all, or of those with some names."""
    names = sorted(path.name.removesuffix("_latentVector.npy") for path in (data / "latent").glob("*.npy"))
    names = [name for name in names if some is None or name in some]
    if cache.exists():
        with np.load(cache) as held:
            if list(held) == names:
                return dict(held)
    layers = _layers(data / "decoder.pt")
    # The network was trained with θ_h at the lower edge of each cell.
    centres = [(np.arange(count) + 0.5) / count for count in LATTICE.shape[1:]]
    angles = np.meshgrid(_theta_h(0.0), centres[0] * np.pi / 2, centres[1] * np.pi, indexing="ij")
    theta_h, theta_d, phi_d = (each[LATTICE.above_horizon] for each in angles)
    place = [np.cos(2 * phi_d) / 2 + 0.5, np.sin(2 * phi_d) / 2 + 0.5, theta_h / (np.pi / 2), theta_d / (np.pi / 2)]
    inputs = np.stack(place, axis=-1).astype(np.float32)
    found: dict[str, Values] = {}
    for name in names:
        latent = np.load(data / "latent" / f"{name}_latentVector.npy").reshape(-1)[:LATENT].astype(np.float32)
        found[name] = _evaluated(layers, inputs, latent)
        _tell("decoded", len(found), len(names))
    cache.parent.mkdir(parents=True, exist_ok=True)
    part = cache.with_suffix(".part.npz")
    np.savez(part, **found)
    part.replace(cache)
    return found


def _layers(path: Path) -> list[tuple[Values, Values]]:
    """Weights (inputs, outputs) and biases of the decoder's layers, in an archive of PyTorch's."""
    with zipfile.ZipFile(path) as archive:
        arrays = [np.frombuffer(archive.read(f"decoder/data/{number}"), "<f4") for number in range(14)]
    return [(weights.reshape(-1, len(bias)), bias) for weights, bias in zip(arrays[::2], arrays[1::2], strict=True)]


def _evaluated(layers: list[tuple[Values, Values]], inputs: Values, latent: Values) -> Values:
    # What the first layer makes of the latent numbers is the same for all cells.
    (first, bias), *rest = layers
    folded: list[tuple[Any, Any]] = [(first[: inputs.shape[1]], bias + latent @ first[inputs.shape[1] :]), *rest]
    parts: list[Any] = []
    for start in range(0, len(inputs), AT_ONCE):
        x = inputs[start : start + AT_ONCE]
        for weights, bias in folded:
            x = x @ weights
            x += bias
            np.maximum(x, 0.0, out=x)
        y = x.astype(np.float64) * SCALE
        for _ in range(LOGARITHMS):
            y = np.expm1(np.minimum(y, LARGEST_EXPONENT))
        parts.append(y.astype(np.float32))
    return np.concatenate(parts)


def material(name: str, values: Values) -> SomManBrdf:
    """A material of cells with these values above the horizon, (cells, 3): each cell has an entry of its own."""
    above = LATTICE.above_horizon
    index = np.zeros(LATTICE.shape, np.uint16)
    index[above] = np.arange(int(above.sum()))
    return SomManBrdf(values.astype(np.float64), index, LATTICE, name=name, interpolation="trilinear")


if __name__ == "__main__":
    sys.exit(main())
