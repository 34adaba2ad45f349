"""Fig. 1 and Fig. 7: global illumination, on a figure and on a scene of three materials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from ..fitting import FitOptions, fit
from ..reflectance.brdf import Brdf
from ..render.compare import Comparison
from ..render.environment import default_environment
from ..render.frame import Scene
from ..render.meshes import load_mesh
from ..render.passes import render_all
from ..render.scenes import statue, still_life
from ..sampling.half_vector import HalfVectorSampler
from .cells import Cell, Outcome, Setting
from .data import DEFAULT, PRINTED, RULES
from .section import Item, Ours, Outcomes, Section, decibels, pictured, shown

BLUE = "blue-metallic-paint"
PLACES = ("nickel", "yellow-matte-plastic", BLUE)  # of Fig. 7
CLUSTERS = {"nickel": 1000, "yellow-matte-plastic": 1000, BLUE: 256}
LAWRENCE, WARD = "Lawrence", "Ward, 3 lobes"


def fig1(setting: Setting) -> Outcome:
    """The figure, of the table, of the paper's representation and of Lawrence et al.'s."""
    table = setting.data.table(BLUE)
    candidates: dict[str, Brdf] = {**setting.both(table, 256, 50), LAWRENCE: setting.factored(table)}
    mesh = load_mesh(setting.mesh) if setting.mesh else None
    reference = table.with_interpolation("nearest")
    sampler = HalfVectorSampler.fitted(reference)
    environment = default_environment()

    def scene(brdf: Brdf) -> Scene:
        return statue(brdf, environment, mesh=mesh, sampler=sampler, size=setting.extent.size)

    return _rendered(setting, partial(scene, reference), {n: partial(scene, brdf) for n, brdf in candidates.items()})


def fig7(setting: Setting) -> Outcome:
    """Three materials in one scene, each time all three in one representation."""
    tables = {name: setting.data.table(name) for name in PLACES}
    nearest = [table.with_interpolation("nearest") for table in tables.values()]
    samplers = [HalfVectorSampler.fitted(table) for table in nearest]
    options = FitOptions(lobes=3, samples=max(setting.extent.samples // 5, 1000), starts=setting.extent.starts)
    learnt = [setting.both(table, CLUSTERS[name]) for name, table in tables.items()]
    candidates: dict[str, list[Brdf]] = {title: [forms[title] for forms in learnt] for title in RULES}
    candidates[LAWRENCE] = [setting.factored(table) for table in tables.values()]
    candidates[WARD] = [fit(table, "ward", options).brdf for table in tables.values()]

    def scene(brdfs: Sequence[Brdf]) -> Scene:
        return still_life(brdfs, samplers=samplers, size=setting.extent.size)

    return _rendered(setting, partial(scene, nearest), {n: partial(scene, brdfs) for n, brdfs in candidates.items()})


def _rendered(
    setting: Setting, reference: Callable[[], Scene], candidates: Mapping[str, Callable[[], Scene]]
) -> Outcome:
    """Scenes against the reference's, rendered with the same directions."""
    first, *others = render_all([reference, *candidates.values()], spp=setting.extent.spp)
    named = {name: Comparison.of(first, image) for name, image in zip(candidates, others, strict=True)}
    return Outcome({name: each.metrics for name, each in named.items()}, shown(named))


def _captions(outcome: Outcome, reference: str) -> dict[str, str]:
    frame = {name: each["psnr_frame_db"] for name, each in outcome.values.items()}
    return {"reference": reference} | {
        name: f"{f'som-man, {name}' if name in RULES else name}: {decibels(value)}" for name, value in frame.items()
    }


def _show1(setting: Setting, outcomes: Outcomes) -> Section:
    outcome = outcomes["fig1/statue"]
    frame = {name: each["psnr_frame_db"] for name, each in outcome.values.items()}
    ours = {
        "som-man": Ours("statue", frame[DEFAULT], frame[PRINTED]),
        "lawrence": Ours("statue", frame[LAWRENCE]),
    }
    figure = f"the mesh {setting.mesh.name}" if setting.mesh else "a built-in figure in place of the paper's Buddha"
    sentence = (
        f"On {figure}, the paper's representation is {frame[DEFAULT] - frame[LAWRENCE]:.1f} dB above Lawrence et "
        f"al.'s; over "
        f"the object alone "
        f"{outcome.values[DEFAULT]['psnr_object_db'] - outcome.values[LAWRENCE]['psnr_object_db']:.1f} dB."
    )
    return Section(ours, (), pictured(outcome, _captions(outcome, "The table")), [sentence])


def _show7(setting: Setting, outcomes: Outcomes) -> Section:
    outcome = outcomes["fig7/still-life"]
    frame = {name: each["psnr_frame_db"] for name, each in outcome.values.items()}
    sentence = (
        f"Over the frame: the paper's representation {frame[DEFAULT]:.1f} dB ({frame[PRINTED]:.1f} dB by Eq. 2 as "
        f"printed), "
        f"Lawrence et al.'s {frame[LAWRENCE]:.1f} dB, Ward with three lobes {frame[WARD]:.1f} dB. The paper prints "
        f"no numbers."
    )
    return Section({}, (), pictured(outcome, _captions(outcome, "The tables")), [sentence])


FIG1 = Item(
    "Fig. 1: blue-metallic-paint on a figure",
    "Global illumination: the table, the paper's representation with M = 256 and 50 epochs, and Lawrence et al.'s.",
    lambda setting: [Cell("fig1/statue", fig1, {}, (BLUE,), 90.0, figure=True)],
    _show1,
)
FIG7 = Item(
    "Fig. 7: a scene of three materials",
    "Nickel and yellow-matte-plastic with M = 1000, blue-metallic-paint with M = 256, in a scene of ours in the "
    "spirit of the "
    "paper's, against Lawrence et al. and Ward with three lobes.",
    lambda setting: [Cell("fig7/still-life", fig7, {}, PLACES, 250.0)],
    _show7,
)
