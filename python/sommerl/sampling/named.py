"""All samplers, by the names that users write."""

from __future__ import annotations

from ..reflectance.brdf import Brdf
from ..system.errors import OptionError
from .blinn_phong import BlinnPhongSampler
from .cosine import CosineSampler
from .half_vector import HalfVectorSampler
from .lawrence import LawrenceSampler
from .matusik import MatusikSampler
from .sampler import Sampler

OURS = HalfVectorSampler
SAMPLERS: dict[str, type[Sampler]] = {
    kind.name: kind for kind in (OURS, LawrenceSampler, MatusikSampler, BlinnPhongSampler, CosineSampler)
}


def fitted(name: str, brdf: Brdf) -> Sampler:
    """The sampler of a name, fitted to a BRDF. Raises OptionError if there is no sampler of that name."""
    if name not in SAMPLERS:
        raise OptionError(f"sampler: expected {' or '.join(SAMPLERS)}, found {name}")
    return SAMPLERS[name].fitted(brdf)
