"""Responses in vibration tests over frequency or time: test, and model before and after the update."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.document.figures.canvas import draw_svg, told_apart
from femtune.document.figures.frfs import LOOKS, legend, thinned
from femtune.document.figures.svg import PALE, cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS_PER_ROW = 2
"""Panels side by side."""
_SMALLEST_SHOWN = 1e-5
"""Amplitude relative to the largest one down to which the axis reaches."""


@dataclass(frozen=True, eq=False)
class VibrationCurve:
    """A response over frequencies or times; `look` is "before", "after" or "test"."""

    look: str
    lines: Reals
    values: Reals


@dataclass(frozen=True)
class VibrationPanel:
    """Curves of one point, and the band that is compared; time histories have linear axes."""

    title: str
    ordinate: str
    curves: tuple[VibrationCurve, ...]
    band_hz: tuple[float, float] | None = None
    in_time: bool = False


def vibration_svg(panels: Sequence[VibrationPanel]) -> str:
    """All panels, two side by side; curves over frequency in double logarithmic axes."""
    across = min(len(panels), _PANELS_PER_ROW)
    rows = -(-len(panels) // across)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(rows, across, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, panel in zip(grid.flat, panels, strict=False):
            _panel(axes, panel)
        legend(figure, [c.look for panel in panels for c in panel.curves])

    return draw_svg(3.7 * across if across > 1 else 5.6, 2.4 * rows + 0.3, draw)


def _panel(axes: Axes, panel: VibrationPanel) -> None:
    axes.set_title(cut(panel.title, 34), loc="left")
    for curve in panel.curves:
        axes.plot(*thinned(curve.lines, curve.values), **LOOKS[curve.look])
    first, last = (f(f(c.lines) for c in panel.curves) for f in (min, max))
    axes.set_xlim(first, last)
    if panel.in_time:
        told_apart(axes.xaxis)
        told_apart(axes.yaxis)
    else:
        _logarithmic(axes, panel)
    for edge in panel.band_hz or ():
        if first < edge < last:
            axes.axvline(edge, color=PALE, linewidth=1.0, zorder=0.5)
    axes.set_xlabel("s" if panel.in_time else "Hz")
    axes.set_ylabel(panel.ordinate)
    axes.grid(axis="both")
    axes.set_axisbelow(True)


def _logarithmic(axes: Axes, panel: VibrationPanel) -> None:
    largest = max(float(np.max(c.values)) for c in panel.curves)
    smallest = min(float(np.min(c.values[c.values > 0.0], initial=largest)) for c in panel.curves)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(0.7 * max(smallest, _SMALLEST_SHOWN * largest), 1.6 * largest)
