"""The Mitsuba plug-ins `sommerl`, a BSDF for any `Brdf`, and `sommerl-atlas`, one for many (docs/mitsuba.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compression.atlas import Atlas
from ..formats import scene
from ..formats.load import load
from ..reflectance.arrays import Array, Packed16, Triple
from ..reflectance.brdf import Brdf, Buffers
from ..sampling import named
from ..sampling.half_vector import albedo_at, albedos
from ..sampling.sampler import Sampler
from ..system.errors import OptionError
from . import colour
from .llvm import drjit, mitsuba

MATERIAL = "material_"  # before the number of a material in the properties of an atlas


class _Alone:
    """One material and its sampler, as an `Atlas` is many: what the plug-in needs of either."""

    def __init__(self, brdf: Brdf, sampler: Sampler) -> None:
        self.name, self._brdf, self._sampler = brdf.name, brdf, sampler

    def buffers(self) -> dict[str, Any]:
        table = {"albedos": albedos(self._brdf).reshape(-1)}
        return {"brdf": self._brdf.buffers(), "sampler": self._sampler.buffers()} | table

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        return self._brdf.f_r(wi, wo, buffers["brdf"])

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        return self._sampler.draw(wo, u, buffers["sampler"])

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        return self._sampler.density(wi, wo, buffers["sampler"])


def make_bsdf(brdf: Brdf | Any, sampler: Sampler | None = None) -> Any:
    """A Mitsuba BSDF, to be put into a scene's dictionary. Only its front side reflects.

    brdf: a `Brdf`. A Mitsuba BSDF is returned unchanged, so that scenes can also show Mitsuba's own BSDFs.
    sampler: draws the directions. If None, it is a `HalfVectorSampler` fitted to `brdf`. For a comparison, pass the
        reference's sampler for all candidates, so that all are rendered with the same directions.
    """
    if isinstance(brdf, mitsuba().BSDF):
        return brdf
    return _plugin()(mitsuba().Properties(), _Alone(brdf, sampler or named.OURS.fitted(brdf)))


def make_atlas_bsdf(atlas: Atlas, number: Any) -> Any:
    """A Mitsuba BSDF of many materials. Only its front side reflects.

    number: a Mitsuba texture, whose value is the number of the material; see `register`.
    """
    props = mitsuba().Properties()
    props["number"] = number
    return _plugin()(props, atlas)


def register() -> None:
    """Registers the plug-ins `sommerl` and `sommerl-atlas` in Mitsuba's present variant, so that scenes can use them.

    Properties of `sommerl`: `filename`, the name of a built-in material or a path, which may be relative to the scene
    file; `interpolation`, nearest or trilinear (default: the material's own); `sampler`, a name in `sampling.named`
    (default: half-vector); `tint`, a colour or texture from 0 to 1, and `scale`, a number of at least 0, both of which
    multiply f_r; `comment`, which is ignored.

    `sommerl-atlas` has many compact materials: `material_0`, `material_1`, …, each as `filename` is; `number`, a
    texture, whose value times `number_scale` (default: 1), rounded, is the number of the material; and `tint`, `scale`
    and `comment`.
    """
    mitsuba().register_bsdf("sommerl", _from_properties)
    mitsuba().register_bsdf("sommerl-atlas", _atlas_from_properties)


def snippet(path: str | Path) -> dict[str, Any]:
    """The dictionary in a .json file that `sommerl convert` wrote, for Mitsuba's `load_dict` after `register`.

    The path of the material, which is relative to the file, is made absolute. Raises FormatError for other files.
    """
    return scene.read(Path(path).absolute())


def _from_properties(props: Any) -> Any:
    _ignore_comment(props)
    brdf = _loaded(str(props["filename"]))
    if "interpolation" in props:
        brdf = brdf.with_interpolation(props["interpolation"])
    sampler = str(props["sampler"]) if "sampler" in props else named.OURS.name
    return _plugin()(props, _Alone(brdf, named.fitted(sampler, brdf)))


def _atlas_from_properties(props: Any) -> Any:
    _ignore_comment(props)
    numbers = sorted(int(name[len(MATERIAL) :]) for name in props.keys() if re.fullmatch(rf"{MATERIAL}\d+", name))  # noqa: SIM118
    if numbers != list(range(len(numbers))) or not numbers:
        missing = next(number for number in range(len(numbers) + 1) if number not in numbers)
        raise OptionError(f"sommerl-atlas: expected {MATERIAL}0, {MATERIAL}1, …, found no {MATERIAL}{missing}")
    if "number" not in props:
        raise OptionError("sommerl-atlas: expected a texture `number`, which says where each material is, found none")
    return _plugin()(props, Atlas(_loaded(str(props[f"{MATERIAL}{number}"])) for number in numbers))


def _ignore_comment(props: Any) -> None:
    if "comment" in props:
        props.mark_queried("comment")  # Mitsuba refuses properties that are not read


def _loaded(name: str) -> Brdf:
    """The material that a scene names."""
    # Of "FILE:MEMBER", only FILE is a path to resolve; but a colon may also be part of a file's name.
    resolve = mitsuba().file_resolver().resolve
    places = [(name, "")] + [(name[:at], name[at:]) for at, character in enumerate(name) if character == ":"]
    return load(
        next((f"{place}{rest}" for file, rest in places if (place := Path(str(resolve(file)))).is_file()), name)
    )


def upload(buffer: NDArray[Any] | Mapping[str, Any]) -> Any:
    """A flat NumPy array as a Dr.Jit array, to gather from; one of shape () as a number; each of several by name."""
    if isinstance(buffer, Mapping):
        return {name: upload(each) for name, each in buffer.items()}
    mi, dr = mitsuba(), drjit()
    if mi.variant().startswith("scalar"):
        return buffer if buffer.ndim else float(buffer)
    if not buffer.ndim:
        # Opaque, so that materials which differ in these numbers alone share one compiled kernel.
        return dr.opaque(mi.Float, float(buffer))
    match buffer.dtype:
        case np.uint8:
            return dr.uint8_array_t(mi.Float)(buffer)
        case np.uint16:
            return Packed16(mi.UInt32(np.append(buffer, np.zeros(len(buffer) % 2, np.uint16)).view("<u4")))
        case np.uint32:
            return mi.UInt32(buffer)
        case _:
            array = mi.Float(buffer.astype(np.float32))
            dr.make_opaque(array)
            return array


def _plugin() -> Any:
    """The plug-in's class for Mitsuba's present variant."""
    return _plugin_for(mitsuba().variant())


@cache
def _plugin_for(variant: str) -> Any:
    mi, dr = mitsuba(), drjit()
    flags = mi.BSDFFlags
    upright, below, middle = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.5, 0.5, 0.5)
    scalar = variant.startswith("scalar")

    def taken(active: Any, numbers: Triple, others: Triple) -> Triple:
        """`numbers` in active lanes and `others` in all others, where Mitsuba may have left any values."""
        x, y, z = (dr.select(active, a, b) for a, b in zip(numbers, others, strict=True))
        return x, y, z

    def numbers(values: Any) -> Any:
        """Values as Python numbers in scalar variants, which do not accept NumPy's numbers."""
        return tuple(map(float, values)) if scalar else values

    class SommerlBsdf(mi.BSDF):
        def __init__(self, props: Any, materials: _Alone | Atlas) -> None:
            mi.BSDF.__init__(self, props)
            self._materials = materials
            self._buffers = upload(materials.buffers())
            several = isinstance(materials, Atlas)
            self._number: Any = props.get_texture("number") if several else None
            self._number_scale = _at_least_0(props, "number_scale") if several else 1.0
            self._coloured = colour.converter(upload)
            self._tint = props.get_texture("tint", 1.0)
            self._scale = upload(np.array(_at_least_0(props, "scale")))
            varying = flags.SpatiallyVarying if several or self._tint.is_spatially_varying() else flags.Empty
            self.m_components = [flags.GlossyReflection | flags.FrontSide | varying]
            self.m_flags = self.m_components[0]

        def traverse(self, callback: Any) -> None:
            callback.put("tint", self._tint, +mi.ParamFlags.Differentiable)
            if self._number is not None:
                callback.put("number", self._number, +mi.ParamFlags.NonDifferentiable)
            if not scalar:  # scalar variants use Python's numbers, which cannot be changed in place
                callback.put("scale", self._scale, +mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys: Any = ()) -> None:
            dr.make_opaque(self._scale)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            active = self._seen(ctx, si, active)
            u = taken(active, (sample1, sample2.x, sample2.y), middle)
            viewer = taken(active, _triple(si.wi), upright)
            # The density is constant in each cell, so only f_r and the cosine are differentiated.
            wi, pdf = self._materials.draw(dr.detach(viewer), dr.detach(u), self._here(si, active))
            (pdf,) = numbers((pdf,))
            drawn = active & (pdf > 0.0)
            pdf = dr.select(drawn, pdf, 1.0)
            sample = dr.zeros(mi.BSDFSample3f)
            # A direction below the horizon, where f_r is 0: `blendbsdf` uses it even if the density is 0.
            sample.wo = mi.Vector3f(*taken(drawn, numbers(wi), below))
            sample.pdf = dr.select(drawn, pdf, 0.0)
            sample.eta = 1.0
            sample.sampled_type = +flags.GlossyReflection
            sample.sampled_component = 0
            return sample, mi.depolarizer(self._reflected(ctx, si, sample.wo, drawn) / pdf)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return mi.depolarizer(self._reflected(ctx, si, wo, active))

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            above = self._seen(ctx, si, active) & (wo.z > 0.0)
            viewer, light = (dr.detach(taken(above, _triple(w), upright)) for w in (si.wi, wo))
            (pdf,) = numbers((self._materials.density(light, viewer, self._here(si, above)),))
            return dr.select(above, pdf, 0.0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
            """The albedo for denoisers, in [0, 1]: of uniform light, the share that the viewer gets."""
            above = active & (si.wi.z > 0.0)
            cosine = dr.select(above, si.wi.z, 1.0)
            share = self._tinted(numbers(albedo_at(cosine, self._here(si, above)["albedos"])), si, above)
            return mi.depolarizer(dr.clip(share, 0.0, 1.0))

        def _seen(self, ctx: Any, si: Any, active: Any) -> Any:
            """The lanes in which the viewer sees the front side, and glossy reflection is asked for."""
            return active & (si.wi.z > 0.0) & ctx.is_enabled(flags.GlossyReflection, 0)

        def _here(self, si: Any, active: Any) -> Any:
            """What is read in each lane: the buffers of its material."""
            materials = self._materials
            if not isinstance(materials, Atlas):
                return self._buffers
            number = self._number.eval_1(si, active) * self._number_scale
            return materials.of(dr.detach(dr.select(active, number, 0.0)), self._buffers)

        def _reflected(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
            """f_r times the cosine, without polarisation."""
            above = self._seen(ctx, si, active) & (wo.z > 0.0)
            viewer, light = (taken(above, _triple(w), upright) for w in (si.wi, wo))
            # In paths that start at a lamp, Mitsuba's `si.wi` is the light, and `wo` the viewer.
            swapped = ctx.mode == mi.TransportMode.Importance
            pair = (viewer, light) if swapped else (light, viewer)
            return self._tinted(numbers(self._materials.f_r(*pair, self._here(si, above))), si, above) * light[2]

        def _tinted(self, rgb: Triple, si: Any, active: Any) -> Any:
            """Linear RGB in the variant's colours, times `tint` and `scale`; 0 in lanes that are not active."""
            value = self._coloured(rgb, si.wavelengths) * self._tint.eval(si, active) * self._scale
            return dr.select(active, value, 0.0)

        def to_string(self) -> str:
            return f"SommerlBsdf[{self._materials.name}]"

    return SommerlBsdf


def _at_least_0(props: Any, name: str) -> float:
    value = float(props.get(name, 1.0))
    if not 0 <= value < math.inf:
        raise OptionError(f"{name}: expected a number of at least 0, found {value:g}")
    return value


def _triple(v: Any) -> Triple:
    return v.x, v.y, v.z
