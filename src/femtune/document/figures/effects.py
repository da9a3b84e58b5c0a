"""Designed experiments: main effects of parameters, convergence and front of a global search."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, PALE, cut
from femtune.document.numbers import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MAIN_EFFECTS_PER_ROW = 6
"""Panels of main effects side by side; narrow ones suffice for a few levels."""
_PANELS_PER_ROW = 3
"""Other panels side by side."""
_DASHES = ("-", "--", "-.", ":")
"""Line styles in turn, so that neighbouring curves differ in print without colours, too."""


def main_effects_svg(
    parameters: Sequence[str],
    responses: Sequence[str],
    values: Sequence[Sequence[float]],
    changes: Sequence[Sequence[Sequence[float]]],
) -> str:
    """A panel for each parameter: the mean of each response at each level, in % of its mean over all runs.

    Parameters
    ----------
    values : of each parameter, its value at each level
    changes : of each parameter and level, of each response, in %
    """
    rows, in_row = -(-len(parameters) // _MAIN_EFFECTS_PER_ROW), min(len(parameters), _MAIN_EFFECTS_PER_ROW)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, in_row, squeeze=False, sharey=True).ravel()
        for axes in panels[len(parameters) :]:
            axes.set_axis_off()
        for i, name in enumerate(parameters):
            _effect(panels[i], name, values[i], np.array(changes[i], dtype=float))
        for axes in panels[::in_row]:
            axes.set_ylabel("change in %")
        figure.legend(
            handles=panels[0].lines[1:], labels=[cut(r, 24) for r in responses], loc="outside right upper", fontsize=7,
            frameon=False,
        )  # fmt: skip

    return draw_svg(1.6 + 1.1 * in_row, 0.3 + 1.8 * rows, draw)


def _effect(axes: Axes, name: str, values: Sequence[float], changes: np.ndarray) -> None:
    axes.axhline(0.0, color=PALE, linewidth=0.8)
    places = np.arange(len(values))
    for j, column in enumerate(changes.T):
        shade = BLUE if j == 0 else str(0.62 * (j % 5) / 4)
        axes.plot(places, column, marker="o", markersize=2.5, color=shade, linestyle=_DASHES[j % 4], linewidth=1.1)
    axes.set_xticks(places, [short(v) for v in values], fontsize=7)
    axes.set_title(cut(name, 16), fontsize=8)


def beside_svg(
    parameters: Sequence[str],
    responses: Sequence[str],
    values: Sequence[Sequence[Sequence[Sequence[float]]]],
    legend: tuple[str, str],
    unit: str,
) -> str:
    """A panel for each response: two bars for each parameter, each with its interval.

    Parameters
    ----------
    values : of each response and parameter, two values with their lower and upper limits
    legend : what the two values are
    """
    in_row = min(len(responses), _PANELS_PER_ROW)
    rows = -(-len(responses) // in_row)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(rows, in_row, squeeze=False, sharey=True).ravel()
        for axes in panels[len(responses) :]:
            axes.set_axis_off()
        for axes, name, of_response in zip(panels, responses, values):
            _bars(axes, np.array(of_response, dtype=float), legend)
            axes.set_yticks(range(len(parameters)), [cut(p, 16) for p in parameters], fontsize=7)
            axes.set_ylim(len(parameters) - 0.4, -0.6)
            axes.set_title(cut(name, 24), fontsize=8)
            axes.set_xlabel(unit, fontsize=7)
        figure.legend(handles=list(panels[0].containers), labels=list(legend), loc="outside right upper", fontsize=7,
                      frameon=False)  # fmt: skip

    return draw_svg(1.9 + 1.7 * in_row, rows * (0.8 + 0.25 * len(parameters)), draw)


def _bars(axes: Axes, values: np.ndarray, legend: tuple[str, str]) -> None:
    places = np.arange(len(values))
    for k, (label, color) in enumerate(zip(legend, (BLUE, PALE), strict=True)):
        middle, low, high = values[:, k].T
        at = places + (k - 0.5) * 0.36
        axes.barh(at, middle, height=0.34, color=color, label=label)
        axes.hlines(at, low, high, color=INK, linewidth=0.8)


def search_svg(histories: Sequence[tuple[str, Sequence[float], Sequence[float]]], ends: Sequence[float] = ()) -> str:
    """The best value of each search against the number of evaluations; `ends` are where least squares ended.

    Parameters
    ----------
    histories : label, evaluations and best value after each generation
    """

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for j, (label, evaluations, best) in enumerate(histories):
            shade = BLUE if j == 0 else str(0.62 * (j % 5) / 4)
            dashes = _DASHES[j % 4]
            axes.step(
                evaluations, best, where="post", color=shade, linestyle=dashes, linewidth=1.2, label=cut(label, 30)
            )
        for end in sorted({float(f"{e:.4g}") for e in ends}):
            axes.axhline(end, color=INK, linewidth=0.6, linestyle=":")
        axes.set_yscale("log")
        axes.set_xlabel("evaluations")
        axes.set_ylabel("objective")
        axes.grid(axis="y")
        axes.legend(fontsize=7, frameon=False)

    return draw_svg(5.6, 2.6, draw)


def front_svg(
    front: Sequence[tuple[float, float]],
    confirmed: Sequence[tuple[float, float]],
    initial: tuple[float, float],
    label: str,
) -> str:
    """A front of two objectives, points of it on the model, and the initial values."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(*np.array(front).reshape(-1, 2).T, color=BLUE, linewidth=1.2)
        axes.plot(*np.array(confirmed).reshape(-1, 2).T, color=INK, marker="o", markersize=3.0, linestyle="none")
        axes.plot(*initial, color=INK, marker="x", markersize=5.0, linestyle="none")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("sum of squared relative frequency errors")
        axes.set_ylabel(label)
        axes.grid()

    return draw_svg(5.6, 3.0, draw)
