"""Parameters between their bounds: prior and posterior with their standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.report.figures.canvas import draw_svg, quiet
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, INK, LINE, ORANGE, PALE, SOFT
from femtune.report.numbers import short, value, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ForestRow:
    """One parameter in its unit; `sd` is None where σ is not given."""

    name: str
    unit: str
    lower: float
    upper: float
    nominal: float
    prior_sd: float | None
    final: float
    sd: float | None
    at_bound: bool

    def place(self, x: float) -> float:
        """0 at the lower bound, 1 at the upper one."""
        return (x - self.lower) / (self.upper - self.lower)


def forest_svg(rows: Sequence[ForestRow]) -> str:
    """A row each parameter, drawn from its lower to its upper bound."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        for i, entry in enumerate(rows):
            _one(axes, i, entry)
        axes.set_yticks(range(len(rows)), [cut(r.name) for r in rows])
        axes.set_ylim(len(rows) - 0.4, -0.7)
        axes.set_xlim(-0.13, 1.5)
        axes.set_xticks([0, 0.5, 1], ["lower bound", "", "upper bound"])
        quiet(axes, sides=("left", "bottom"))

    return draw_svg(7.0, 0.6 + 0.34 * len(rows), draw)


def _one(axes: Axes, i: int, entry: ForestRow) -> None:
    axes.plot([0, 1], [i, i], color=LINE, linewidth=1.0, zorder=0)
    axes.plot([0, 0, 1, 1], [i - 0.16, i + 0.16, i + 0.16, i - 0.16], "|", color=PALE, markersize=0)
    for x, bound, side in ((-0.015, entry.lower, "right"), (1.015, entry.upper, "left")):
        axes.text(x, i, short(bound), ha=side, va="center", fontsize=6.5, color=SOFT)
    if entry.prior_sd is not None:
        _span(axes, i + 0.14, entry, entry.nominal, entry.prior_sd, PALE)
    axes.plot([entry.place(entry.nominal)], [i + 0.14], "|", color=INK, markersize=7)
    if entry.sd is not None:
        _span(axes, i - 0.1, entry, entry.final, entry.sd, BLUE)
    mark = "s" if entry.at_bound else "o"
    axes.plot([entry.place(entry.final)], [i - 0.1], mark, color=ORANGE if entry.at_bound else BLUE, markersize=5)
    axes.text(1.14, i, _words(entry), va="center", fontsize=7.5)


def _span(axes: Axes, y: float, entry: ForestRow, centre: float, sd: float, colour: str) -> None:
    """± one standard deviation, cut where the bounds are."""
    ends = [min(max(entry.place(centre + s * sd), 0.0), 1.0) for s in (-1, 1)]
    axes.plot(ends, [y, y], color=colour, linewidth=3.0, solid_capstyle="butt", alpha=0.85)


def _words(entry: ForestRow) -> str:
    spread = "at bound" if entry.at_bound else "σ not given" if entry.sd is None else f"± {short(entry.sd)}"
    return with_unit(f"{value(entry.final)} {spread}", "" if entry.sd is None else cut(entry.unit, 12))
