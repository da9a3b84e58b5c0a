"""Histograms of samples, a panel for each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.canvas import draw_svg, quiet, told_apart
from femtune.document.figures.svg import BLUE, ORANGE, PALE, cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from femtune.arrays import Reals

_PANELS_PER_ROW = 4
"""Histograms side by side."""
_MOST_BINS = 40
"""Bins of a histogram; narrower ones would not be seen."""


def histograms_svg(
    labels: Sequence[str], samples: Reals, marks: Sequence[float], limits: Sequence[tuple[float, float]]
) -> str:
    """A panel for each column of the samples (n, k), with a mark and shaded limits."""
    rows = -(-len(labels) // _PANELS_PER_ROW)
    in_row = min(len(labels), _PANELS_PER_ROW)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, in_row, squeeze=False).ravel()
        for axes in panels[len(labels) :]:
            axes.set_axis_off()
        for i, label in enumerate(labels):
            _panel(panels[i], label, samples[:, i], marks[i], limits[i])

    return draw_svg(0.2 + 1.75 * in_row, 0.2 + 1.45 * rows, draw)


def _panel(axes: Axes, label: str, samples: Reals, mark: float, limits: tuple[float, float]) -> None:
    axes.axvspan(*limits, color=PALE, alpha=0.5, linewidth=0)
    if np.ptp(samples) > 0.0:
        bins = min(_MOST_BINS, max(5, int(np.sqrt(len(samples)))))
        axes.hist(samples, bins=bins, color=BLUE)
    axes.axvline(mark, color=ORANGE, linewidth=1.2)
    axes.set_title(cut(label, 22), fontsize=8)
    axes.set_yticks([])
    axes.locator_params(axis="x", nbins=3)
    told_apart(axes.xaxis)
    quiet(axes)
