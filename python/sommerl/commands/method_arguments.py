"""How materials are to be compressed, as commands are asked for it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from ..compression.compact.effort import DEFAULT as EFFORT
from ..compression.compact.search import DEFAULT_PSNR, LARGEST_SIZE, SMALLEST_SIZE, CompactOptions
from ..compression.paper.options import Order, Rule, Topology, TrainOptions
from ..system.errors import OptionError
from .arguments import WritingArguments, byte_count, flag, library_options, option

DEFAULTS = TrainOptions()

Preset = Literal["paper", "compact"]


@dataclass(frozen=True, kw_only=True)
class MethodArguments(WritingArguments):
    """How whatever compresses materials is asked to do it."""

    preset: Preset | None = option(
        default=None,
        help="paper: MERL's lattice, nearest lookup; compact: a lattice fitted to the material, interpolated, in a "
        "file of some kilobytes (paper; compact if there is a target)",
    )
    target_size: int | None = option(
        default=None,
        metavar="BYTES",
        read=byte_count,
        instead_of="target",
        help=f"compact: the best file of at most that size, {SMALLEST_SIZE} to {LARGEST_SIZE} bytes, also as 8kB",
    )
    target_psnr: float | None = option(
        default=None,
        metavar="DB",
        instead_of="target",
        help=f"compact: the smallest file of at least that PSNR on a sphere in soft light ({DEFAULT_PSNR:g})",
    )
    effort: int = option(
        default=EFFORT,
        metavar="N",
        help="compact: how much work goes into a file, from 1 (quick) to 9 (thorough) (%(default)s)",
    )
    reciprocal: bool = option(
        default=False, help="compact: the mean of both orders of the directions, which a file holds with fewer nodes"
    )
    clusters: int = option(
        default=DEFAULTS.clusters, metavar="M", help="paper: the number of entries in the palette (%(default)s)"
    )
    epochs: int = option(
        default=DEFAULTS.epochs, metavar="E", help="paper: how often the table is presented (%(default)s)"
    )
    seed: int = option(default=DEFAULTS.seed, metavar="S", help="of directions, first weights and order (%(default)s)")
    rule: Rule = option(
        default=DEFAULTS.rule,
        help="paper: Eq. 2 as printed (paper), or without its factor x (kohonen) (%(default)s)",
    )
    alpha: float = option(
        default=DEFAULTS.alpha, metavar="A", help="paper: first learning rate, above 0, at most 1 (%(default)s)"
    )
    order: Order = option(default=DEFAULTS.order, help="paper: of presentation (%(default)s)")
    radius: float = option(
        default=DEFAULTS.radius,
        metavar="R",
        help="paper: of the neighbourhood in the first epoch, in units; 0: the winner learns alone (%(default)s)",
    )
    topology: Topology = option(
        default=DEFAULTS.topology, help="paper: how the units are arranged for that (%(default)s)"
    )
    distinct: bool = option(
        default=DEFAULTS.distinct, help="paper: a unit stores a cell once at most, and not again in a later epoch"
    )


def chosen_method(options: MethodArguments) -> CompactOptions | TrainOptions:
    """The options of the preset that is asked for. Raises OptionError for those of the other one."""
    targets = options.target_size, options.target_psnr
    preset = options.preset or ("paper" if targets == (None, None) else "compact")
    if preset == "compact":
        for each in fields(TrainOptions):
            if each.name != "seed" and getattr(options, each.name) != getattr(DEFAULTS, each.name):
                raise OptionError(f"{flag(each.name)}: expected --preset paper, found compact")
        return library_options(CompactOptions, options)
    for name in ("target_size", "target_psnr", "effort", "reciprocal"):
        if getattr(options, name) not in (None, False, EFFORT):
            raise OptionError(f"{flag(name)}: expected --preset compact, found paper")
    return library_options(TrainOptions, options)
