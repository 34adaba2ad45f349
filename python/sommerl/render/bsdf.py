"""A Mitsuba BSDF for any `Brdf`."""

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

    brdf: what is a Mitsuba BSDF already stays as it is, so that scenes take Mitsuba's own, to compare with.
    sampler: of directions, see `sampling`; ours, fitted to `brdf`, if None. Give the reference's to every candidate
        that it is compared with, so that all are rendered with the same directions.
    """
    if isinstance(brdf, mitsuba().BSDF):
        return brdf
    return _plugin()(mitsuba().Properties(), brdf, sampler or named.OURS.fitted(brdf))


def register() -> None:
    """Makes the plug-in `sommerl` known to scenes in Mitsuba's present variant, as Mitsuba's own Python plug-ins are.

    Properties: `filename`, a built-in's name or a path, which may be relative to the scene file; `interpolation`,
    nearest or trilinear, if it is not to be the material's own; `sampler`, one of the names in `sampling.named`, if it
    is not to be ours; `tint`, a colour or texture from 0 to 1, and `scale`, a number, which f_r is multiplied by;
    `comment`, which is for people.
    """
    mitsuba().register_bsdf("sommerl", _from_properties)


def snippet(path: str | Path) -> dict[str, Any]:
    """A material's dictionary, for `load_dict` after `register`, from a .json that `sommerl convert` wrote: the place
    of the material, in the file relative to the file, is made absolute. Raises FormatError if it is no such file."""
    return scene.read(Path(path).absolute())


def _from_properties(props: Any) -> Any:
    name = str(props["filename"])
    if "comment" in props:
        props.mark_queried("comment")  # Mitsuba refuses what nobody reads
    # Of "FILE:MEMBER", only the file is to be found; a colon may also be part of its name.
    resolve = mitsuba().file_resolver().resolve
    places = [(name, "")] + [(name[:at], name[at:]) for at, character in enumerate(name) if character == ":"]
    found = next((f"{place}{rest}" for file, rest in places if (place := Path(str(resolve(file)))).is_file()), name)
    brdf = load(found)
    if "interpolation" in props:
        brdf = brdf.with_interpolation(props["interpolation"])
    sampler = str(props["sampler"]) if "sampler" in props else named.OURS.name
    return _plugin()(props, brdf, named.fitted(sampler, brdf))


def upload(buffer: NDArray[Any]) -> Any:
    """A flat NumPy buffer as an array that Dr.Jit gathers from, one of shape () as a number."""
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
    """The class for Mitsuba's present variant."""
    return _plugin_for(mitsuba().variant())


@cache
def _plugin_for(variant: str) -> Any:
    mi, dr = mitsuba(), drjit()
    flags = mi.BSDFFlags
    upright, below, middle = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.5, 0.5, 0.5)
    scalar = variant.startswith("scalar")

    def taken(active: Any, numbers: Triple, others: Triple) -> Triple:
        """Three numbers where lanes are active; elsewhere others, since Mitsuba may have left anything there."""
        x, y, z = (dr.select(active, a, b) for a, b in zip(numbers, others, strict=True))
        return x, y, z

    def numbers(values: Any) -> Any:
        """The same, as scalar variants need it: they know nothing of NumPy's numbers."""
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
            if not scalar:  # whose numbers are Python's, which cannot be changed in place
                callback.put("scale", self._scale, +mi.ParamFlags.Differentiable)

        def parameters_changed(self, keys: Any = ()) -> None:
            dr.make_opaque(self._scale)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            active = self._seen(ctx, si, active)
            u = taken(active, (sample1, sample2.x, sample2.y), middle)
            viewer = taken(active, _triple(si.wi), upright)
            # A density of cells has no slope worth following: only f_r and the cosine are differentiated.
            wi, pdf = self._sampler.draw(dr.detach(viewer), dr.detach(u), self._tables)
            (pdf,) = numbers((pdf,))
            drawn = active & (pdf > 0.0)
            pdf = dr.select(drawn, pdf, 1.0)
            sample = dr.zeros(mi.BSDFSample3f)
            # Below, where nothing is reflected to: `blendbsdf` weighs what it is given even if the density is 0.
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
            """The share of even light that is reflected to the viewer, in [0, 1]: the albedo for denoisers."""
            above = active & (si.wi.z > 0.0)
            cosine = dr.select(above, si.wi.z, 1.0)
            share = self._tinted(numbers(albedo_at(cosine, self._albedos)), si, above)
            return mi.depolarizer(dr.clip(share, 0.0, 1.0))

        def _seen(self, ctx: Any, si: Any, active: Any) -> Any:
            """Where the front side is looked at, if what it does is asked for."""
            return active & (si.wi.z > 0.0) & ctx.is_enabled(flags.GlossyReflection, 0)

        def _reflected(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
            """f_r times the cosine, without polarisation."""
            above = self._seen(ctx, si, active) & (wo.z > 0.0)
            viewer, light = (taken(above, _triple(w), upright) for w in (si.wi, wo))
            # A path that starts at a lamp comes from the light and goes to the viewer.
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
