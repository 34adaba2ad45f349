"""What a blend in the cube-root domain is worth, beside the linear one, (1 − w) f_a + w f_b, which is what a surface
reflects of which a share w is covered by the second material.

    uv run python benchmarks/blends.py

For pairs of built-in materials: how far the cube-root blend of equal shares is from the linear one (PSNR as a `Judge`
sees it, and the albedo at 45° in parts of the linear blend's), and how even steps of w look: four steps from 0 to 1,
each the mean difference in Oklab of pictures of a sphere in soft light at the second material's exposure; the largest
step over the smallest one, 1 if all are alike.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from sommerl import blend, builtin
from sommerl.library.finding import oklab
from sommerl.reflectance.arrays import Triple
from sommerl.reflectance.blend import BlendedBrdf
from sommerl.reflectance.brdf import Brdf, Buffers
from sommerl.render.judge import Judge, softly_lit

PAIRS = (
    ("red-fabric", "beige-fabric"),
    ("red-fabric", "nickel"),
    ("purple-paint", "gold-metallic-paint"),
    ("yellow-matte-plastic", "chrome"),
    ("nickel", "blue-metallic-paint"),
)
WEIGHTS = (0.0, 0.25, 0.5, 0.75, 1.0)
SIDE, SKY, OF_A_LIGHT = 24, 32, 8
EXPOSED = 0.6, 90  # the linear value that this percentile of the pixels' mean channels becomes


class Linear(BlendedBrdf):
    """The linear blend."""

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        first = self._first.f_r(wi, wo, {k[6:]: v for k, v in buffers.items() if k.startswith("first_")})
        second = self._second.f_r(wi, wo, {k[7:]: v for k, v in buffers.items() if k.startswith("second_")})
        r, g, b = ((1 - self._weight) * x + self._weight * y for x, y in zip(first, second, strict=True))
        return r, g, b


def seen(brdf: Brdf) -> np.ndarray:
    """The pixels of a sphere, linear."""
    at = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    x, y = (c.reshape(-1) for c in np.meshgrid(at, -at))
    x, y = x[x * x + y * y < 0.98], y[x * x + y * y < 0.98]
    return softly_lit(brdf, np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1), SKY, OF_A_LIGHT)


def unevenness(pictures: list[np.ndarray]) -> float:
    """The largest step over the smallest one."""
    scale = EXPOSED[0] / np.percentile(pictures[-1].mean(axis=-1), EXPOSED[1])
    looks = [np.stack([oklab(c) for c in np.clip(picture * scale, 0, 1)]) for picture in pictures]
    steps = [float(np.linalg.norm(b - a, axis=-1).mean()) for a, b in pairwise(looks)]
    return max(steps) / min(steps)


def main() -> None:
    print(f"{'pair':44} {'soft [dB]':>10} {'lamp [dB]':>10} {'albedo':>7} {'steps: cube root':>17} {'linear':>7}")
    for names in PAIRS:
        first, second = map(builtin, names)
        linear, ours = Linear(first, second, 0.5), blend(first, second, 0.5)
        judged = Judge(linear).metrics(ours)
        albedo = float((ours.albedo(np.pi / 4) / linear.albedo(np.pi / 4)).mean())
        uneven = [
            unevenness([seen(kind(first, second, weight)) for weight in WEIGHTS]) for kind in (BlendedBrdf, Linear)
        ]
        figures = f"{judged['psnr_soft_db']:10.1f} {judged['psnr_lamp_db']:10.1f} {albedo:7.2f}"
        print(f"{' + '.join(names):44} {figures} {uneven[0]:17.1f} {uneven[1]:7.1f}", flush=True)


if __name__ == "__main__":
    main()
