"""Quantities over the iterations of an update, as the figures of publications show them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, ORANGE, SOFT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Panel = tuple[str, Sequence[str], Sequence[Sequence[float]], Sequence[float]]
"""Title, names, a curve of each over the iterations from 0, and the value that each should reach."""


def iterations_svg(panels: Sequence[Panel]) -> str:
    """A panel beside another; dotted lines are the values that should be reached."""

    def draw(sheet: Figure) -> None:
        grid = sheet.subplots(1, len(panels), squeeze=False)[0]
        for axes, (title, names, curves, wanted) in zip(grid, panels):
            for name, colour, curve, end in zip(names, (BLUE, ORANGE, INK, SOFT), curves, wanted):
                axes.plot(range(len(curve)), curve, color=colour, linewidth=1.2, label=name)
                axes.axhline(end, color=colour, linestyle=":", linewidth=0.8)
            axes.set_title(title)
            axes.set_xlabel("iteration")
            axes.grid(True)
            axes.legend(frameon=False)

    return draw_svg(3.7 * len(panels), 2.8, draw)
