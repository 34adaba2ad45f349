"""The Mitsuba plug-in `sommerl`: a BSDF for any `Brdf` (docs/mitsuba.md)."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..formats import scene
from ..formats.load import load
from ..reflectance.arrays import Packed16, Triple
from ..reflectance.brdf import Brdf
from ..sampling import named
from ..sampling.half_vector import albedo_at, albedos
from ..sampling.sampler import Sampler
from ..system.errors import OptionError
from . import colour
from .llvm import drjit, mitsuba


def make_bsdf(brdf: Brdf | Any, sampler: Sampler | None = None) -> Any:
    """A Mitsuba BSDF, to be put into a scene's dictionary. Only its front side reflects.

    brdf: a `Brdf`. A Mitsuba BSDF is returned unchanged, so that scenes can also show Mitsuba's own BSDFs.
    sampler: draws the directions. If None, it is a `HalfVectorSampler` fitted to `brdf`. For a comparison, pass the
        reference's sampler for all candidates, so that all are rendered with the same directions.
    """
    if isinstance(brdf, mitsuba().BSDF):
        return brdf
    return _plugin()(mitsuba().Properties(), brdf, sampler or named.OURS.fitted(brdf))


def register() -> None:
    """Registers the plug-in `sommerl` in Mitsuba's present variant, so that scenes can use it.

    Properties: `filename`, the name of a built-in material or a path, which may be relative to the scene file;
    `interpolation`, nearest or trilinear (default: the material's own); `sampler`, a name in `sampling.named` (default:
    half-vector); `tint`, a colour or texture from 0 to 1, and `scale`, a number of at least 0, both of which multiply
    f_r; `comment`, which is ignored.
    """
    mitsuba().register_bsdf("sommerl", _from_properties)


def snippet(path: str | Path) -> dict[str, Any]:
    """The dictionary in a .json file that `sommerl convert` wrote, for Mitsuba's `load_dict` after `register`.

    The path of the material, which is relative to the file, is made absolute. Raises FormatError for other files.
    """
    return scene.read(Path(path).absolute())


def _from_properties(props: Any) -> Any:
    name = str(props["filename"])
    if "comment" in props:
        props.mark_queried("comment")  # Mitsuba refuses properties that are not read
    # Of "FILE:MEMBER", only FILE is a path to resolve; but a colon may also be part of a file's name.
    resolve = mitsuba().file_resolver().resolve
    places = [(name, "")] + [(name[:at], name[at:]) for at, character in enumerate(name) if character == ":"]
    found = next((f"{place}{rest}" for file, rest in places if (place := Path(str(resolve(file)))).is_file()), name)
    brdf = load(found)
    if "interpolation" in props:
        brdf = brdf.with_interpolation(props["interpolation"])
    sampler = str(props["sampler"]) if "sampler" in props else named.OURS.name
    return _plugin()(props, brdf, named.fitted(sampler, brdf))


def upload(buffer: NDArray[Any]) -> Any:
    """A flat NumPy array as a Dr.Jit array, to gather from; one of shape () as a number."""
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
        def __init__(self, props: Any, brdf: Brdf, sampler: Sampler) -> None:
            mi.BSDF.__init__(self, props)
            self._brdf = brdf
            self._buffers = {name: upload(buffer) for name, buffer in brdf.buffers().items()}
            self._sampler = sampler
            self._tables = {name: upload(buffer) for name, buffer in sampler.buffers().items()}
            self._albedos = upload(albedos(brdf).reshape(-1))
            self._coloured = colour.converter(upload)
            self._tint = props.get_texture("tint", 1.0)
            self._scale = upload(np.array(_scale(props)))
            varying = flags.SpatiallyVarying if self._tint.is_spatially_varying() else flags.Empty
            self.m_components = [flags.GlossyReflection | flags.FrontSide | varying]
            self.m_flags = self.m_components[0]

        def traverse(self, callback: Any) -> None:
            callback.put("tint", self._tint, +mi.ParamFlags.Differentiable)
            if not scalar:  # scalar variants use Python's numbers, which cannot be changed in place
                callback.put("scale", self._scale, +mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys: Any = ()) -> None:
            dr.make_opaque(self._scale)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            active = self._seen(ctx, si, active)
            u = taken(active, (sample1, sample2.x, sample2.y), middle)
            viewer = taken(active, _triple(si.wi), upright)
            # The density is constant in each cell, so only f_r and the cosine are differentiated.
            wi, pdf = self._sampler.draw(dr.detach(viewer), dr.detach(u), self._tables)
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
            (pdf,) = numbers((self._sampler.density(light, viewer, self._tables),))
            return dr.select(above, pdf, 0.0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
            """The albedo for denoisers, in [0, 1]: of uniform light, the share that the viewer gets."""
            above = active & (si.wi.z > 0.0)
            cosine = dr.select(above, si.wi.z, 1.0)
            share = self._tinted(numbers(albedo_at(cosine, self._albedos)), si, above)
            return mi.depolarizer(dr.clip(share, 0.0, 1.0))

        def _seen(self, ctx: Any, si: Any, active: Any) -> Any:
            """The lanes in which the viewer sees the front side, and glossy reflection is asked for."""
            return active & (si.wi.z > 0.0) & ctx.is_enabled(flags.GlossyReflection, 0)

        def _reflected(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
            """f_r times the cosine, without polarisation."""
            above = self._seen(ctx, si, active) & (wo.z > 0.0)
            viewer, light = (taken(above, _triple(w), upright) for w in (si.wi, wo))
            # In paths that start at a lamp, Mitsuba's `si.wi` is the light, and `wo` the viewer.
            swapped = ctx.mode == mi.TransportMode.Importance
            pair = (viewer, light) if swapped else (light, viewer)
            return self._tinted(numbers(self._brdf.f_r(*pair, self._buffers)), si, above) * light[2]

        def _tinted(self, rgb: Triple, si: Any, active: Any) -> Any:
            """Linear RGB in the variant's colours, times `tint` and `scale`; 0 in lanes that are not active."""
            value = self._coloured(rgb, si.wavelengths) * self._tint.eval(si, active) * self._scale
            return dr.select(active, value, 0.0)

        def to_string(self) -> str:
            return f"SommerlBsdf[{self._brdf.name}]"

    return SommerlBsdf


def _scale(props: Any) -> float:
    scale = float(props.get("scale", 1.0))
    if not 0 <= scale < math.inf:
        raise OptionError(f"scale: expected a number of at least 0, found {scale:g}")
    return scale


def _triple(v: Any) -> Triple:
    return v.x, v.y, v.z
