"""The samplers by name."""

from __future__ import annotations

from .blinn_phong import BlinnPhongSampler
from .cosine import CosineSampler
from .half_vector import HalfVectorSampler
from .matusik import MatusikSampler
from .sampler import Sampler

OURS = HalfVectorSampler
SAMPLERS: dict[str, type[Sampler]] = {
    kind.name: kind for kind in (OURS, MatusikSampler, BlinnPhongSampler, CosineSampler)
}
