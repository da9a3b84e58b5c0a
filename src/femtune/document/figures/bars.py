"""Horizontal bars: COMAC, singular values, combinations of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.canvas import draw_svg, quiet
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE, SOFT, cut
from femtune.document.numbers import short, typeset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def comac_svg(labels: Sequence[str], before: Sequence[float | None], after: Sequence[float | None]) -> str:
    """COMAC of each DOF: a hollow mark before, a full one after."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        _rows(axes, labels)
        for i, (old, new) in enumerate(zip(before, after, strict=True)):
            _dumbbell(axes, i, old, new)
        axes.set_xlim(0.0, 1.02)
        axes.set_xlabel("COMAC (hollow: before, full: after)")

    return draw_svg(4.2, 0.7 + 0.19 * len(labels), draw)


def _dumbbell(axes: Axes, i: int, old: float | None, new: float | None) -> None:
    if old is not None and new is not None:
        axes.plot([old, new], [i, i], color=PALE, linewidth=1.2, zorder=1)
    if old is not None:
        axes.plot([old], [i], "o", markersize=5, markerfacecolor="white", markeredgecolor=ORANGE)
    if new is not None:
        axes.plot([new], [i], "o", markersize=5, color=BLUE)


def _rows(axes: Axes, labels: Sequence[str]) -> None:
    axes.set_yticks(range(len(labels)), [cut(t) for t in labels])
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(axis="x")
    axes.set_axisbelow(True)
    quiet(axes)


def singular_values_svg(values: Sequence[float], rank: int) -> str:
    """Singular values on a logarithmic axis; those beyond the rank are hollow and say "undetermined"."""
    kept = np.array(values[:rank], dtype=float)
    positive = kept[kept > 0]
    floor = 10.0 ** np.floor(np.log10(min(positive.min(), 1.0) if positive.size else 1.0) - 0.3)

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        axes.set_xscale("log")
        _rows(axes, [str(i + 1) for i in range(len(values))])
        for i, number in enumerate(values):
            _singular(axes, i, number if i < rank else None, floor)
        axes.axvline(1.0, color=INK, linewidth=0.8, linestyle="--")
        axes.set_xlim(floor, 3.0 * max([*positive, 1.0]))
        axes.set_xlabel("singular value (dashed line at 1: data as informative as the prior)")
        axes.set_ylabel("combination")

    return draw_svg(6.4, 0.9 + 0.2 * len(values), draw)


def _singular(axes: Axes, i: int, number: float | None, floor: float) -> None:
    if number is None or number <= 0:
        axes.text(1.15 * floor, i, "undetermined by the data", va="center", fontsize=7, color=ORANGE)
        return
    axes.barh(i, number - floor, left=floor, height=0.62, color=BLUE if number >= 1.0 else PALE)
    axes.text(1.08 * number, i, short(number), va="center", fontsize=7)


def combinations_svg(titles: Sequence[str], labels: Sequence[str], coefficients: Sequence[Sequence[float]]) -> str:
    """Coefficients of combinations: a panel for each combination, a bar for each parameter, with names on the left."""

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(titles), sharey=True, squeeze=False)[0]
        for axes, title, shares in zip(panels, titles, coefficients, strict=True):
            _rows(axes, labels)
            axes.barh(range(len(labels)), shares, height=0.62, color=[ORANGE if c < 0 else BLUE for c in shares])
            axes.axvline(0.0, color=INK, linewidth=0.8)
            axes.set_xlim(-1.05, 1.05)
            axes.set_xticks([-1, 0, 1], [typeset("-1"), "0", "1"])
            axes.set_title(cut(title, 30), fontsize=8)

    return draw_svg(1.4 + 1.5 * len(titles), 0.9 + 0.2 * len(labels), draw)


# ----------------------------------------------------------------------------------------------------
# Error sums of a stage: a pair of bars for each mode, before and after, and one for all.


if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_sums_svg(labels: Sequence[str], before: Sequence[float], after: Sequence[float], title: str) -> str:
    """Bars in per cent of the sum before the stage; the last pair is the sum of all."""
    total = sum(before) or 1.0
    pairs = [(100.0 * a / total, 100.0 * b / total) for a, b in [*zip(before, after), (sum(before), sum(after))]]

    def draw(figure: Figure) -> None:
        axes, at = figure.add_subplot(), np.arange(len(pairs))
        axes.bar(at - 0.2, [p[0] for p in pairs], 0.38, color=PALE, label="before")
        axes.bar(at + 0.2, [p[1] for p in pairs], 0.38, color=BLUE, label="after")
        axes.set_xticks(at, [*(cut(t, 14) for t in labels), "all"])
        if len(labels) > 8:
            axes.tick_params(axis="x", rotation=60)
        axes.set_ylabel("% of the sum before")
        axes.set_title(cut(title, 60))
        axes.legend(frameon=False, fontsize=7)
        axes.grid(axis="y")
        axes.set_axisbelow(True)

    return draw_svg(min(3.0 + 0.32 * len(pairs), 9.0), 2.5, draw)


# ----------------------------------------------------------------------------------------------------
# Errors of predicted frequencies with their standard deviations and the required limit.


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PredictedMode:
    """Errors in % before and after the update; `sd` of the difference, None if it is not known."""

    label: str
    before: float | None
    after: float
    sd: float | None


def predictions_svg(modes: Sequence[PredictedMode], limit: float | None) -> str:
    """A row for each mode: ± 2 σ around zero, the errors before and after, and the limit on both sides."""

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
