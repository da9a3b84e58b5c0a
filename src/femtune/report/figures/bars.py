"""Horizontal bars: COMAC, singular values, combinations of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.report.figures.canvas import draw_svg, quiet
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, INK, ORANGE, PALE
from femtune.report.numbers import short, typeset

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
        axes.xaxis.set_major_formatter(lambda x, _: short(x))
        axes.xaxis.set_minor_formatter("")
        axes.set_xlim(floor, 3.0 * max([*positive, 1.0]))
        axes.set_xlabel("singular value (dashed, 1: the data know as much as the prior)")
        axes.set_ylabel("combination")

    return draw_svg(6.4, 0.9 + 0.2 * len(values), draw)


def _singular(axes: Axes, i: int, number: float | None, floor: float) -> None:
    if number is None or number <= 0:
        axes.text(1.15 * floor, i, "undetermined: the data say nothing", va="center", fontsize=7, color=ORANGE)
        return
    axes.barh(i, number - floor, left=floor, height=0.62, color=BLUE if number >= 1.0 else PALE)
    axes.text(1.08 * number, i, short(number), va="center", fontsize=7)


def combinations_svg(titles: Sequence[str], labels: Sequence[str], coefficients: Sequence[Sequence[float]]) -> str:
    """Coefficients of combinations: a panel each, a bar each parameter, the parameters at the left."""

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
