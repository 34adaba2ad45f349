"""A Mitsuba BSDF for any `Brdf`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Packed16
from ..brdf import Brdf
from ..formats import scene
from ..load import interpolated, load
from ..sampling import named
from ..sampling.sampler import Sampler
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
    is not to be ours; `comment`, which is for people.
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
        brdf = interpolated(brdf, props["interpolation"])
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

    class SommerlBsdf(mi.BSDF):
        def __init__(self, props: Any, brdf: Brdf, sampler: Sampler) -> None:
            mi.BSDF.__init__(self, props)
            self._brdf = brdf
            self._buffers = {name: upload(buffer) for name, buffer in brdf.buffers().items()}
            self._sampler = sampler
            self._tables = {name: upload(buffer) for name, buffer in sampler.buffers().items()}
            self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
            self.m_flags = self.m_components[0]

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            wi, pdf = self._sampler.draw(_triple(si.wi), (sample1, sample2.x, sample2.y), self._tables)
            sample = dr.zeros(mi.BSDFSample3f)
            sample.wo = mi.Vector3f(*wi)
            sample.pdf = dr.select(active, pdf, 0.0)
            sample.eta = 1.0
            sample.sampled_type = +mi.BSDFFlags.GlossyReflection
            sample.sampled_component = 0
            drawn = sample.pdf > 0.0
            value = self.eval(ctx, si, sample.wo, active & drawn)
            return sample, dr.select(drawn, value / dr.select(drawn, sample.pdf, 1.0), 0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            above = active & (si.wi.z > 0.0) & (wo.z > 0.0)
            # Mitsuba's wi is the viewer's direction. What lies in inactive lanes may not even be a number.
            viewer = dr.select(above, si.wi, mi.Vector3f(0.0, 0.0, 1.0))
            light = dr.select(above, wo, mi.Vector3f(0.0, 0.0, 1.0))
            f_r = self._brdf.f_r(_triple(light), _triple(viewer), self._buffers)
            return dr.select(above, mi.Color3f(*f_r) * light.z, 0.0)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return dr.select(active, self._sampler.density(_triple(wo), _triple(si.wi), self._tables), 0.0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self) -> str:
            return f"SommerlBsdf[{self._brdf.name}]"

    return SommerlBsdf


def _triple(v: Any) -> Any:
    return v.x, v.y, v.z
