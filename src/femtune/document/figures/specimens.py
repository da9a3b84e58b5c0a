"""Parameters of nominally identical specimens, a small diagram each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.document.figures.canvas import draw_svg, quiet, told_apart
from femtune.document.figures.svg import BLUE, INK, cut
from femtune.document.numbers import with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS_PER_ROW = 4
"""Panels side by side."""


@dataclass(frozen=True)
class SpecimenRow:
    """One parameter: its values and standard deviations (None if not given), and its initial value."""

    name: str
    unit: str
    values: Sequence[float]
    sd: Sequence[float | None]
    nominal: float


def specimens_svg(specimens: Sequence[str], rows: Sequence[SpecimenRow]) -> str:
    """A diagram of each parameter: its value in each specimen with two standard deviations."""
    lines = -(-len(rows) // _PANELS_PER_ROW)
    across = min(len(rows), _PANELS_PER_ROW)

    def draw(figure: Figure) -> None:
        for i, entry in enumerate(rows):
            _one(figure.add_subplot(lines, across, i + 1), specimens, entry)

    return draw_svg(1.9 * across + 0.3, 1.7 * lines, draw)


def _one(axes: Axes, specimens: Sequence[str], entry: SpecimenRow) -> None:
    axes.axhline(entry.nominal, color=INK, linewidth=0.8, linestyle="--")
    for i, (number, sd) in enumerate(zip(entry.values, entry.sd)):
        axes.errorbar([i], [number], yerr=[2.0 * (sd or 0.0)], fmt="o", color=BLUE, markersize=4, capsize=2.5)
    axes.set_xticks(range(len(specimens)), [cut(s) for s in specimens])
    axes.set_xlim(-0.5, len(specimens) - 0.5)
    told_apart(axes.yaxis)
    axes.set_title(with_unit(cut(entry.name), f"[{entry.unit}]" if entry.unit else ""))
    quiet(axes)
