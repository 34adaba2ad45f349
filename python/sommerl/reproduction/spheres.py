"""Fig. 4 and Fig. 5: materials on a sphere in the built-in light, against the table with nearest lookup."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np

from ..compression.paper.options import Order, TrainOptions
from ..compression.paper.train import train
from ..fitting import FitOptions, fit_models
from ..reflectance.brdf import Brdf
from ..render.compare import Comparison
from ..render.metrics import exposure, psnr, to_srgb8
from .cells import Cell, Outcome, Setting
from .data import DEFAULT, PRINTED, RULES
from .printed import printed
from .runner import values
from .section import Item, Ours, Outcomes, Picture, Section, Table, compared, decibels, pictured, shown

YELLOW, BLUE = "yellow-matte-plastic", "blue-metallic-paint"
CASES = ((64, 10), (64, 30), (64, 50), (1000, 30))  # M and epochs of Fig. 4
SOM_MAN = "som-man"
EXPOSURES = (1.0, 0.5, 0.25, 0.125)  # relative to ours
NEAR = 0.5  # dB, of a printed number


def fig4(setting: Setting, clusters: int, epochs: int) -> Outcome:
    """One case of Fig. 4, learnt in both ways."""
    table = setting.data.table(YELLOW).with_interpolation("nearest")
    found = setting.both(table, clusters, epochs)
    comparisons = dict(zip(found, compared(setting, table, list(found.values())), strict=True))
    return Outcome({title: each.metrics for title, each in comparisons.items()}, shown(comparisons))


def rate(setting: Setting, order: Order, alpha: float) -> Outcome:
    """The cases of Fig. 4 by Eq. 2 as printed, with another rate or another order."""
    table = setting.data.table(YELLOW).with_interpolation("nearest")
    most = setting.extent.epochs
    options = [TrainOptions(clusters=m, epochs=min(e, most), rule="paper", alpha=alpha, order=order) for m, e in CASES]
    found = compared(setting, table, [train(table, each)[0] for each in options])
    return Outcome({case_name(*case): each.metrics["psnr_frame_db"] for case, each in zip(CASES, found, strict=True)})


def fig5(setting: Setting) -> Outcome:
    """The paper's representation and eight two-lobe fits."""
    table = setting.data.table(BLUE)
    models = setting.some((name for name in printed("fig5") if name != SOM_MAN), 2)
    options = FitOptions(samples=setting.extent.samples, starts=setting.extent.starts)
    candidates: dict[str, Brdf] = {**setting.both(table, 256, 50)}
    candidates |= {fit.model: fit.brdf for fit in fit_models(table, models, options)}
    comparisons = compared(setting, table.with_interpolation("nearest"), list(candidates.values()))
    named = dict(zip(candidates, comparisons, strict=True))
    values = {name: each.metrics | {"exposed": exposed(each)} for name, each in named.items()}
    return Outcome(values, shown(named))


def exposed(comparison: Comparison) -> list[float]:
    """PSNR over the frame at EXPOSURES."""
    a, b = comparison.reference, comparison.candidate
    scale = exposure(a.pixels, a.mask)
    scales = [np.float32(scale * factor) for factor in EXPOSURES]
    return [psnr(to_srgb8(a.pixels * each), to_srgb8(b.pixels * each)) for each in scales]


def case_name(clusters: int, epochs: int) -> str:
    return f"M = {clusters}, {epochs} epochs"


def _plan4(setting: Setting) -> Sequence[Cell]:
    cases = [
        Cell(f"fig4/{m}-{e}", fig4, {"clusters": m, "epochs": e}, (YELLOW,), 20.0 if m > 64 else 14.0)
        for m, e in setting.some(CASES)
    ]
    rates = [
        Cell(f"fig4/rates/{order}-{alpha:g}", rate, {"order": order, "alpha": alpha}, (YELLOW,), 25.0)
        for order in setting.some(get_args(Order))
        for alpha in setting.extent.rates
    ]
    return [*cases, *rates]


def _show4(setting: Setting, outcomes: Outcomes) -> Section:
    ours: dict[str, Ours] = {}
    pictures: list[Picture] = []
    rows: list[list[str]] = []
    for m, e in setting.some(CASES):
        outcome = outcomes[f"fig4/{m}-{e}"]
        frame = {title: outcome.values[title]["psnr_frame_db"] for title in RULES}
        ours[case_name(m, e)] = Ours(f"{m}-{e}", frame[DEFAULT], frame[PRINTED])
        captions = {title: f"{case_name(m, e)}, {title}: {decibels(frame[title])}" for title in RULES}
        pictures += pictured(outcome, ({"reference": "The table"} if not pictures else {}) | captions)
        rows += [
            [case_name(m, e), title, *(decibels(outcome.values[title][k]) for k in ("psnr_frame_db", "psnr_object_db"))]
            for title in RULES
        ]
    rates = values(outcomes, "fig4/rates/")
    tables = [
        Table("PSNR over the frame and over the object", ["case", "learnt by", "frame", "object"], rows),
        Table(
            "By Eq. 2 as printed, at other rates and in other orders, over the frame",
            ["order", "α", *(case_name(*case) for case in CASES)],
            [
                [*name.rsplit("-", 1), *(decibels(each[case_name(*case)]) for case in CASES)]
                for name, each in rates.items()
            ],
        ),
    ]
    return Section(ours, tables, pictures, [_where_printed(rates)])


def _where_printed(rates: Mapping[str, Mapping[str, Any]]) -> str:
    """At which rates the paper's numbers appear."""
    numbers = printed("fig4")
    near = {
        name: [case for case, value in each.items() if abs((value or 99.0) - numbers[case].value) <= NEAR]
        for name, each in rates.items()
    }
    all_of, some = (
        [name for name, found in near.items() if len(found) == len(CASES)],
        {n: f for n, f in near.items() if f},
    )
    if all_of:
        return f"All four numbers of Fig. 4 appear, within {NEAR} dB, with {', '.join(all_of)}."
    least = min(value for each in rates.values() for case, value in each.items() if case.startswith("M = 1000"))
    found = "; ".join(f"{name}: {', '.join(cases)}" for name, cases in some.items()) or "none does"
    return (
        f"No order and no rate of those tried gives all four numbers of Fig. 4 by Eq. 2 as printed. Within {NEAR} dB "
        f"appear: "
        f"{found}. M = 1000 has at least {least:.1f} dB everywhere, where the paper prints "
        f"{numbers[case_name(1000, 30)].value}."
    )


def _plan5(setting: Setting) -> Sequence[Cell]:
    return [Cell("fig5/spheres", fig5, {}, (BLUE,), 120.0)]


def _show5(setting: Setting, outcomes: Outcomes) -> Section:
    outcome = outcomes["fig5/spheres"]
    frame = {name: each["psnr_frame_db"] for name, each in outcome.values.items()}
    ours = {name: Ours("spheres", frame.get(name)) for name in printed("fig5") if name != SOM_MAN}
    ours[SOM_MAN] = Ours("spheres", frame[DEFAULT], frame[PRINTED])
    captions = {"reference": "The table"} | {
        name: f"{f'{SOM_MAN}, {name}' if name in RULES else name}: {decibels(frame[name])}" for name in outcome.values
    }
    columns = ["", "frame", "object", *(f"frame, exposure × {factor:g}" for factor in EXPOSURES[1:])]
    rows = [
        [
            captions[name].split(":")[0],
            *(decibels(each[key]) for key in ("psnr_frame_db", "psnr_object_db")),
            *(decibels(value) for value in each["exposed"][1:]),
        ]
        for name, each in outcome.values.items()
    ]
    models = {name: value for name, value in frame.items() if name not in RULES}
    best = max(models, key=lambda name: models[name])
    numbers = printed("fig5")
    gap = numbers[SOM_MAN].value - max(each.value for name, each in numbers.items() if name != SOM_MAN)
    sentence = (
        f"The representation is {frame[DEFAULT] - models[best]:.1f} dB above the best of the eight models, {best}; "
        f"in the "
        f"paper {gap:.1f} dB above the best."
    )
    where = _exposure_of(outcome.values)
    table = Table("PSNR, also at lower exposures", columns, rows)
    return Section(ours, [table], pictured(outcome, captions), [sentence, where])


def _exposure_of(values: Mapping[str, Mapping[str, Any]]) -> str:
    """At which exposure the models reach the paper's numbers."""
    numbers = printed("fig5")
    least = [
        min(each["exposed"][place] - numbers[name].value for name, each in values.items() if name not in RULES)
        for place in range(len(EXPOSURES))
    ]
    found = next((place for place, each in enumerate(least) if each >= 0), None)
    told = "The formulas' numbers hang on the exposure, which the paper does not tell: "
    if found is None:
        return told + f"at {EXPOSURES[-1]:g} times ours, they are still up to {-least[-1]:.1f} dB below the paper's."
    own = values[DEFAULT]["exposed"][found]
    return told + (
        f"at {EXPOSURES[found]:g} times ours, each has at least the paper's PSNR, and the representation {own:.1f} dB."
    )


FIG4 = Item(
    "Fig. 4: yellow-matte-plastic by M and epochs",
    "A sphere in the built-in light, with the paper's representation by two rules, and eight times the difference "
    "below.",
    _plan4,
    _show4,
)
FIG5 = Item(
    "Fig. 5: blue-metallic-paint and eight formulas",
    "The table, the paper's representation with M = 256 and 50 epochs by two rules, and eight two-lobe fits.",
    _plan5,
    _show5,
)
