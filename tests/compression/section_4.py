"""§4 of the paper (Kurt & Cinsdikici 2008) once more, whole, in plain Python: what training is held to.

It shares no line with the package. Where the paper leaves something open, it does what docs/method.md says.
"""

from math import exp, inf, sqrt

import numpy as np

F = np.float32


def distance(a, b):
    r, g, b = a - b
    return (r * r + g * g) + b * b


def falloff(steps, sigma):
    if steps == 0 or sigma == 0:
        return F(steps == 0)
    return F(round(exp(-steps * steps / (2 * sigma * sigma)) * 65536) / 65536)


def som_man(rgb, *, clusters, epochs, seed, rule, alpha, order, radius, columns, distinct=False):
    """Weights; three stored cells a unit, None for none; LUT; the entry of each cell; quantisation error an epoch.

    rgb: a list of triples, of the cells above the horizon. columns: units in a row of the sheet.
    """
    cells, largest = range(len(rgb)), max(map(max, rgb))
    x = [np.array([value / largest for value in triple], F) for triple in rgb]
    raw = np.random.PCG64(seed).random_raw(2 * len(x)).tolist()
    sequence = sorted(cells, key=lambda p: raw[p]) if order == "seeded" else cells
    c = []
    for p in sorted(cells, key=lambda p: raw[len(x) + p]):
        if len(c) < clusters and not any((x[p] == unit).all() for unit in c):
            c.append(x[p])
    s, errors, alpha = [[None] * 3 for _ in c], [], F(alpha)

    def step(weight, towards, rate):
        return weight + (rate * towards if rule == "paper" else rate) * (towards - weight)

    for epoch in range(epochs):
        sigma, total = radius * 0.6**epoch, 0.0
        for p in sequence:
            near = [distance(x[p], unit) for unit in c]
            won = near.index(min(near))  # Eq. 1
            total += sqrt(near[won])
            for unit in range(clusters):  # Eq. 2, weaker for neighbours
                rows, across = abs(unit // columns - won // columns), abs(unit % columns - won % columns)
                c[unit] = step(c[unit], x[p], alpha * (falloff(rows, sigma) * falloff(across, sigma)))
            far = [inf if q is None else distance(x[q], c[won]) for q in s[won]]
            slot = s[won].index(p) if distinct and p in s[won] else far.index(max(far))  # Eq. 3
            if distance(x[p], c[won]) <= far[slot]:  # Eq. 5
                s[won][slot] = p  # Eq. 4
            c[won] = step(c[won], x[s[won][slot]], alpha)  # Eq. 6
        errors.append(total / len(x))
        alpha = alpha * F(0.6)  # Eq. 7

    lut = []
    for unit, stored in zip(c, s, strict=True):  # §4.3
        far = [distance(x[q], unit) for q in stored if q is not None]
        lut += [stored[far.index(min(far))]] if far else []  # a unit that never won stores nothing
    lut.sort(key=lambda q: (rgb[q][0] + rgb[q][1]) + rgb[q][2])
    index = []
    for p in cells:
        near = [distance(x[p], x[q]) for q in lut]
        index.append(near.index(min(near)))
    return c, s, [rgb[q] for q in lut], index, errors
