"""Candidate models side by side: mean error, and distance of the parameters from one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from femtune.document.figures.canvas import draw_svg, quiet
from femtune.document.figures.svg import BLUE, ORANGE, cut
from femtune.document.numbers import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def candidates_svg(
    names: Sequence[str], counts: Sequence[int], errors: Sequence[float], distances: Sequence[float], best: str
) -> str:
    """Two panels with a bar for each model; `counts` are numbers of parameters, errors and distances are in %."""

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        labels = [f"{cut(name, 24)} ({count})" for name, count in zip(names, counts)]
        _bars(left, labels, errors, "mean error, %", [BLUE] * len(names))
        colours = [ORANGE if name == best else BLUE for name in names]
        _bars(right, labels, distances, f"distance from {cut(best, 24)}, %", colours)
        left.invert_yaxis()

    return draw_svg(7.2, 0.8 + 0.22 * len(names), draw)


def _bars(axes: Axes, labels: Sequence[str], values: Sequence[float], title: str, colours: Sequence[str]) -> None:
    axes.barh(range(len(labels)), values, height=0.62, color=colours)
    axes.set_yticks(range(len(labels)), labels)
    for i, number in enumerate(values):
        axes.annotate(short(number), (number, i), (3, 0), textcoords="offset points", va="center", fontsize=7)
    axes.set_xlim(0.0, 1.15 * max([*values, 1e-12]))
    axes.set_xlabel(title)
    axes.grid(axis="x")
    axes.set_axisbelow(True)
    quiet(axes)
