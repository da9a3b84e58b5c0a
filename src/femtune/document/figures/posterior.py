"""Pictures of a sampled distribution: histograms of weighted samples, and pairs of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.canvas import draw_svg, quiet, told_apart
from femtune.document.figures.frfs import LOOKS, legend, thinned
from femtune.document.figures.svg import BLUE, ORANGE, PALE, SOFT, cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from femtune.arrays import Reals

_PANELS_PER_ROW = 4
"""Panels side by side: their labels are still legible on a page."""
_BINS = 30
"""Bars of a histogram of some thousand samples; with more their heights would be noise."""
_MOST_POINTS = 600
"""Points of a cloud: more are not told apart, and make the page long."""


def marginals_svg(
    labels: Sequence[str], samples: Reals, weights: Reals, linear: Reals, marks: Sequence[float],
    limits: Sequence[tuple[float, float]],
) -> str:  # fmt: skip
    """A panel for each column of weighted samples (n, k), with samples to compare (c, k), a mark and shaded limits."""
    rows, in_row = -(-len(labels) // _PANELS_PER_ROW), min(len(labels), _PANELS_PER_ROW)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, in_row, squeeze=False).ravel()
        for unused in panels[len(labels) :]:
            unused.set_axis_off()
        for i, label in enumerate(labels):
            axes: Axes = panels[i]
            low = float(min(samples[:, i].min(), np.quantile(linear[:, i], 0.001)))
            high = float(max(samples[:, i].max(), np.quantile(linear[:, i], 0.999)))
            axes.axvspan(*limits[i], color=PALE, alpha=0.5, linewidth=0)
            if high > low:
                edges = np.linspace(low, high, _BINS + 1)
                axes.hist(samples[:, i], bins=list(edges), weights=weights, color=BLUE)
                share = np.full(len(linear), 1.0 / len(linear))
                axes.hist(linear[:, i], bins=list(edges), weights=share, histtype="step", color=SOFT, linewidth=1.0)
            axes.axvline(marks[i], color=ORANGE, linewidth=1.2)
            axes.set_title(cut(label, 22), fontsize=8)
            axes.set_yticks([])
            axes.locator_params(axis="x", nbins=3)
            told_apart(axes.xaxis)
            quiet(axes)

    return draw_svg(0.2 + 1.75 * in_row, 0.2 + 1.45 * rows, draw)


def pairs_svg(
    names: Sequence[tuple[str, str]], columns: Sequence[tuple[int, int]], samples: Reals, linear: Reals
) -> str:
    """A cloud for each pair of columns of the samples (n, k), with samples to compare (c, k)."""

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(names), squeeze=False).ravel()
        for axes, (first, second), (i, j) in zip(panels, names, columns):
            for points, colour in ((linear, SOFT), (samples, BLUE)):
                some = points[:: max(1, len(points) // _MOST_POINTS)]
                axes.plot(some[:, i], some[:, j], ".", color=colour, markersize=1.5)
            axes.set_xlabel(cut(first, 22), fontsize=8)
            axes.set_ylabel(cut(second, 22), fontsize=8)
            axes.locator_params(nbins=4)
            told_apart(axes.xaxis)
            quiet(axes)

    return draw_svg(0.2 + 2.2 * len(names), 2.2, draw)


@dataclass(frozen=True)
class BandPanel:
    """A band of magnitudes (3, f) over its lines, from the lowest to the highest; measured lines and magnitudes (g,) if
    known."""

    title: str
    ordinate: str
    freq_hz: Reals
    band: Reals
    measured: tuple[Reals, Reals] | None


def bands_svg(panels: Sequence[BandPanel]) -> str:
    """All bands, two side by side, the measured magnitudes under them."""
    across = min(len(panels), 2)
    rows = -(-len(panels) // across)

    def draw(figure: Figure) -> None:
        axes_of = figure.subplots(rows, across, squeeze=False).ravel()
        for unused in axes_of[len(panels) :]:
            unused.set_axis_off()
        for axes, panel in zip(axes_of, panels):
            hz = panel.freq_hz
            if panel.measured is not None:
                axes.plot(*thinned(*panel.measured), **LOOKS["test"])
            # the lines at which the median has its peaks; the ends of the band have theirs there or nearby
            lines, _ = thinned(hz, panel.band[1])
            some = np.isin(hz, lines)
            low, median, high = panel.band[:, some]
            axes.fill_between(hz[some], low, high, color=BLUE, alpha=0.35, linewidth=0, zorder=2.1)
            axes.plot(hz[some], median, **LOOKS["model"])
            axes.set_yscale("log")
            axes.set_title(cut(panel.title, 34), loc="left")
            axes.set_ylabel(panel.ordinate)
            axes.set_xlabel("Hz")
            axes.set_xlim(hz[0], hz[-1] if hz[-1] > hz[0] else hz[0] + 1.0)
            axes.grid(axis="both")
            axes.set_axisbelow(True)
        if any(panel.measured is not None for panel in panels):
            legend(figure, ("model", "test"))

    return draw_svg(3.7 * across if across > 1 else 5.6, 2.2 * rows + 0.3, draw)
