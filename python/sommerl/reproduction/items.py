"""The table of items: what `sommerl paper` makes."""

from __future__ import annotations

from .claims import CLAIMS
from .drawn import FIG2, FIG3
from .field import BENCHMARK, BEYOND
from .fits import FIG6, TABLE1
from .scenes import FIG1, FIG7
from .section import Item
from .sizes import SIZES
from .spheres import FIG4, FIG5
from .times import TABLE2

ITEMS: dict[str, Item] = {
    "fig1": FIG1,
    "fig2": FIG2,
    "fig3": FIG3,
    "fig4": FIG4,
    "fig5": FIG5,
    "table1": TABLE1,
    "fig6": FIG6,
    "table2": TABLE2,
    "fig7": FIG7,
    "sizes": SIZES,
    "claims": CLAIMS,
    "beyond": BEYOND,
    "benchmark": BENCHMARK,
}
ALL = tuple(name for name in ITEMS if name != "benchmark")  # the report of the paper
