"""Errors of predicted frequencies beside what scatter gives, and beside the limit that is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.report.figures.canvas import draw_svg, quiet
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, INK, LINE, ORANGE, PALE, SOFT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PredictedMode:
    """Errors in % before and after the update; `sd` of the difference, None where it is not known."""

    label: str
    before: float | None
    after: float
    sd: float | None


def predictions_svg(modes: Sequence[PredictedMode], limit: float | None) -> str:
    """A row each mode: ± 2 σ around zero, the errors before and after, the limit on both sides."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        axes.axvline(0.0, color=LINE, linewidth=1.0, zorder=0)
        for side in (-1.0, 1.0) if limit else ():
            axes.axvline(side * (limit or 0.0), color=ORANGE, linewidth=1.0, linestyle=(0, (4, 2)), zorder=0)
        for i, mode in enumerate(modes):
            _one(axes, i, mode)
        axes.set_yticks(range(len(modes)), [cut(m.label, 34) for m in modes])
        axes.set_ylim(len(modes) - 0.4, -0.6)
        axes.set_xlabel("(model − test)/test, %", color=INK)
        quiet(axes, sides=("left",))

    return draw_svg(7.0, 0.75 + 0.26 * len(modes), draw)


def _one(axes: Axes, i: int, mode: PredictedMode) -> None:
    if mode.sd is not None:
        axes.plot([-2.0 * mode.sd, 2.0 * mode.sd], [i, i], color=PALE, linewidth=6.0, solid_capstyle="butt", zorder=1)
    if mode.before is not None:
        axes.plot([mode.before], [i], "o", markerfacecolor="none", markeredgecolor=SOFT, markersize=5, zorder=2)
    axes.plot([mode.after], [i], "o", color=BLUE, markersize=5, zorder=3)
