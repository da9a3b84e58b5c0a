"""Optima of many starts, in parallel coordinates between the bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.report.figures.canvas import draw_svg
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, INK, PALE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_NAMES = 24


def optima_svg(
    names: Sequence[str],
    optima: Sequence[Sequence[float]],
    counts: Sequence[int],
    as_good: Sequence[bool],
    starts: Sequence[Sequence[float]],
) -> str:
    """A line for each optimum.

    Parameters
    ----------
    optima : an entry each optimum, the best first, with each parameter's place between its bounds, 0 to 1
    counts, as_good : of each optimum
    starts : an entry each start
    """
    at = np.arange(len(names))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for start in starts:
            axes.plot(at, start, ".", color=PALE, markersize=3, zorder=1)
        for i in reversed(range(len(optima))):
            width = 0.8 + 3.2 * counts[i] / max(counts)
            colour = BLUE if i == 0 else INK if as_good[i] else PALE
            axes.plot(at, optima[i], "o-", color=colour, linewidth=width, markersize=3 + width, zorder=2 + as_good[i])
        axes.set_ylim(-0.06, 1.06)
        axes.set_yticks([0, 1], ["lower\nbound", "upper\nbound"])
        few = len(names) <= _MOST_NAMES
        axes.set_xticks(at, [cut(n, 12) for n in names] if few else [str(i + 1) for i in at], rotation=40, ha="right")
        axes.grid(axis="x")
        axes.set_axisbelow(True)

    return draw_svg(6.8, 2.8, draw)
