"""Clouds of outputs or parameters in pairs, with their covariance ellipses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.quantify import ellipse
from femtune.report.figures.canvas import draw_svg
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, ORANGE, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Reals = NDArray[np.float64]

_MOST_PANELS, _ACROSS, _MOST_POINTS = 6, 3, 400
_COLOURS = (ORANGE, BLUE, PALE)


@dataclass(frozen=True)
class Cloud:
    """Points (n, m) and the distribution that they are of; no points where only the moments are known."""

    name: str
    points: Reals
    mean: Reals
    covariance: Reals


def clouds_svg(labels: Sequence[str], clouds: Sequence[Cloud], probability: float = 0.95) -> str:
    """A panel for each pair of outputs, the first six pairs; up to three clouds, points and ellipses.

    Parameters
    ----------
    labels : (m,) of the axes
    clouds : the measured one first
    probability : share of a normal distribution inside an ellipse
    """
    pairs = list(combinations(range(len(labels)), 2))[:_MOST_PANELS]
    across = min(_ACROSS, len(pairs))
    down = -(-len(pairs) // across)

    def draw(sheet: Figure) -> None:
        panels = sheet.subplots(down, across, squeeze=False).ravel()
        for axes, (i, j) in zip(panels, pairs):
            for k, cloud in enumerate(clouds):
                _cloud(axes, cloud, [i, j], _COLOURS[k % len(_COLOURS)], probability, first=k == 0)
            axes.set_xlabel(cut(labels[i]))
            axes.set_ylabel(cut(labels[j]))
        for axes in panels[len(pairs) :]:
            axes.set_visible(False)
        sheet.legend(*panels[0].get_legend_handles_labels(), frameon=False, loc="outside upper left", ncols=len(clouds))

    return draw_svg(0.4 + 2.7 * across, 0.5 + 2.3 * down, draw)


def _cloud(axes: Axes, cloud: Cloud, at: list[int], colour: str, probability: float, *, first: bool) -> None:
    edge = ellipse(cloud.mean[at], cloud.covariance[np.ix_(at, at)], probability)
    points = cloud.points[:_MOST_POINTS, at]
    size, alpha, order = (3, 0.8, 3) if first else (2, 0.3, 2)
    mark = "o" if first else "."
    axes.plot(*points.T, mark, color=colour, markersize=size, alpha=alpha, markeredgewidth=0.0, zorder=order)
    axes.plot(*edge.T, color=colour, linewidth=1.2, linestyle="-" if first else "--", label=cloud.name, zorder=4)
    axes.plot(*cloud.mean[at], "+", color=colour, markersize=8, zorder=5)
