"""What the paper claims in words, tested."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..compression.compact.search import CompactOptions, compress
from ..fitting import FitOptions, fit_models
from ..fitting.data import samples_of
from ..models.builtin import noisy
from ..reflectance.brdf import Brdf
from ..reflectance.distance import asymmetry, table_metrics
from ..reflectance.samples import Samples
from ..reflectance.table import BrdfTable
from ..render.judge import Judge
from . import field, fits, times
from .cells import Cell, Outcome, Setting
from .data import DEFAULT, PRINTED, RULES
from .methods import METHODS
from .printed import printed
from .section import Item, Ours, Outcomes, Section, Table

BLUE = "blue-metallic-paint"
NOISY = (BLUE, "nickel", "beige-fabric")
TRUTH, NOISE, OURS = "the noisy table", "noise", "ours"
COUNTS = (1, 10, 100, 1000)  # of materials in memory
SEED = 1  # of the noise
SAMPLES = 300_000  # of fits to noisy tables
SIZES = (2700, 8000)  # of compact files, in bytes


def noise(setting: Setting, material: str) -> Outcome:
    """How far a noisy table, and what is made of it, is from the table without noise."""
    clean = setting.data.table(material)
    table, judge = noisy(clean, SEED), Judge(clean)
    found: dict[str, Brdf] = {TRUTH: table}
    for m in setting.extent.clusters:
        found[f"M = {m}"] = setting.learnt(table, m).with_interpolation("trilinear")
        found[f"M = {m}, {PRINTED}"] = setting.learnt(table, m, **RULES[PRINTED]).with_interpolation("trilinear")
    for size in setting.some(SIZES):
        found[f"compact, {size:,} B"] = compress(table, CompactOptions(target_size=size))[0]
    return Outcome({name: _distance(clean, judge, brdf) for name, brdf in found.items()})


def _distance(clean: BrdfTable, judge: Judge, brdf: Brdf) -> dict[str, float]:
    metrics = judge.metrics(brdf)
    cells = table_metrics(clean.values, BrdfTable.of(brdf).values, clean.lattice)
    return {"soft": metrics["psnr_soft_db"], "lamp": metrics["psnr_lamp_db"], "log": cells["log_error_cosine"]}


def reciprocity(setting: Setting) -> Outcome:
    """How far the representations are from reciprocal."""
    table = setting.data.table(BLUE)
    found: dict[str, Brdf] = {"the table": table, **setting.both(table, 256), "Lawrence": setting.factored(table)}
    return Outcome({name: _asymmetry(brdf) for name, brdf in found.items()})


def _asymmetry(brdf: Brdf) -> float:
    buffers = brdf.buffers()
    return asymmetry(lambda wi, wo: brdf.f_r(wi, wo, buffers))


def memory(setting: Setting) -> Outcome:
    """Bytes of a material in memory."""
    table = setting.data.table(BLUE)
    compact = compress(table, CompactOptions(target_size=SIZES[0]))[0]
    return Outcome(
        {
            "table": table.values.nbytes,
            "table in single precision": table.values.nbytes // 2,
            "paper, M = 256": setting.learnt(table, 256).bytes_memory,
            f"compact, {SIZES[0]:,} B": compact.bytes_memory,
        }
    )


def proper(setting: Setting, material: str) -> Outcome:
    """Fits to a noisy table and to its compressed form with M = 1000, both judged against the table without noise."""
    clean = setting.data.table(material)
    table = noisy(clean, SEED)
    models = setting.some(dict.fromkeys(key.split("/")[1] for key in printed("table1")), 2)
    options = FitOptions(samples=min(setting.extent.samples, SAMPLES), starts=setting.extent.starts)
    truth = samples_of(clean, options)
    forms = {NOISE: table, OURS: setting.learnt(table, 1000).with_interpolation("trilinear")}
    errors = {
        name: {fit.model: _error(fit.brdf, truth) for fit in fit_models(brdf, models, options)}
        for name, brdf in forms.items()
    }
    return Outcome(errors)


def _error(fitted: Brdf, truth: Samples) -> float:
    """Of f_r cos θ_i, as the loss `cosine-l2`."""
    differences = (fitted.eval(truth.wi, truth.wo) - truth.f_r) * truth.wi[:, 2:]
    return float(np.sqrt((differences**2).mean()))


def _plan(setting: Setting) -> Sequence[Cell]:
    own = [Cell(f"claims/noise/{name}", noise, {"material": name}, (name,), 70.0) for name in setting.some(NOISY)]
    own += [Cell("claims/reciprocity", reciprocity, {}, (BLUE,), 20.0), Cell("claims/memory", memory, {}, (BLUE,), 8.0)]
    materials = list(dict.fromkeys(key.split("/")[0] for key in printed("table1")))
    own += [Cell(f"claims/fits/{name}", proper, {"material": name}, (name,), 90.0) for name in setting.some(materials)]
    any_material = [cell for cell in field.BENCHMARK.plan(setting) if cell.name.endswith("/paper")]
    return [*own, *any_material, *times.TABLE2.plan(setting), *fits.TABLE1.plan(setting)]


def _show(setting: Setting, outcomes: Outcomes) -> Section:
    noises, rows = _of_noise(outcomes)
    asymmetries = outcomes["claims/reciprocity"].values
    sentences = [
        noises,
        f"“Reciprocal”: the paper's representation differs from itself with both directions swapped by "
        f"{100 * asymmetries[DEFAULT]:.2g} % of its energy, Lawrence et al.'s by {100 * asymmetries['Lawrence']:.1f} "
        f"%. It is so by "
        "the lattice, which holds one value for both orders: of a measurement that is not reciprocal, it holds the "
        "mean.",
        *_of_memory(outcomes),
        *(
            f"“Always faster than the raw table”: {text}"
            for text in times.TABLE2.show(setting, outcomes).sentences
            if "raw" in text
        ),
        _of_fits(outcomes),
        _of_any(outcomes),
    ]
    ours = {key: Ours("reciprocity", None) for key in printed("claims")}
    columns = ["material", "", "soft light", "one lamp", "log error of cells"]
    return Section(
        ours,
        [Table("Noise: how far from the table without noise", columns, rows), _memory_table(outcomes)],
        (),
        sentences,
    )


def _of_noise(outcomes: Outcomes) -> tuple[str, list[list[str]]]:
    rows: list[list[str]] = []
    better: dict[str, list[bool]] = {"the paper's representation": [], "compact": []}
    for name, outcome in outcomes.items():
        if not name.startswith("claims/noise/"):
            continue
        before = outcome.values[TRUTH]
        for form, each in outcome.values.items():
            rows.append(
                [name.rpartition("/")[2], form, *(f"{each[k]:.1f} dB" for k in ("soft", "lamp")), f"{each['log']:.4f}"]
            )
            if form != TRUTH:
                kind = "compact" if form.startswith("compact") else "the paper's representation"
                better[kind] += [
                    each["soft"] > before["soft"],
                    each["lamp"] > before["lamp"],
                    each["log"] < before["log"],
                ]
    counted = ", ".join(f"{sum(found)} of {len(found)} for {kind}" for kind, found in better.items())
    return (
        "“Regularises noise”: figures in which what was made of a noisy table is nearer to the table without noise "
        "than the noisy "
        f"one is: {counted}."
    ), rows


def _of_memory(outcomes: Outcomes) -> list[str]:
    found = outcomes["claims/memory"].values
    names = list(found)
    return [
        f"“Hundreds or thousands of materials”: {COUNTS[-1]:,} of them need {COUNTS[-1] * found[names[0]] / 1e9:.1f} "
        f"GB as tables, "
        f"{COUNTS[-1] * found[names[2]] / 1e9:.2f} GB in the paper's representation, and "
        f"{COUNTS[-1] * found[names[3]] / 1e6:.0f} MB "
        "compact."
    ]


def _memory_table(outcomes: Outcomes) -> Table:
    found = outcomes["claims/memory"].values
    rows = [[name, *(_megabytes(count * each) for count in COUNTS)] for name, each in found.items()]
    return Table("Memory, calculated from one material's", ["", *(f"{count:,}" for count in COUNTS)], rows)


def _megabytes(count: float) -> str:
    return f"{count / 1e6:,.2f} MB" if count < 1e7 else f"{count / 1e6:,.0f} MB"


def _of_fits(outcomes: Outcomes) -> str:
    ratios = [
        each.values[OURS][model] / each.values[NOISE][model]
        for name, each in outcomes.items()
        if name.startswith("claims/fits/")
        for model in each.values[OURS]
    ]
    below = sum(ratio < 1 for ratio in ratios)
    return (
        f"“More proper for analytic models”: of fits to a noisy table and to its compressed form, the latter is "
        f"nearer to the "
        f"truth in {below} of {len(ratios)} cases; the geometric mean of the ratios of errors is "
        f"{np.exp(np.mean(np.log(ratios))):.4f}, single ones are {min(ratios):.3f} to {max(ratios):.3f}."
    )


def _of_any(outcomes: Outcomes) -> str:
    found = {
        name.split("/")[1]: each.values["psnr_soft_db"]
        for name, each in outcomes.items()
        if name.endswith("/paper") and each.values.get("psnr_soft_db") is not None
    }
    worst = min(found, key=lambda name: found[name])
    return (
        f"“Any material”: of {len(found)}, {METHODS['paper'].label} has {np.mean(list(found.values())):.1f} dB in "
        f"soft light in the "
        f"mean, and {found[worst]:.1f} dB on the worst, {worst}."
    )


CLAIMS = Item("Claims", "What the paper says in words, each tested, each answered with a figure.", _plan, _show)
