"""Frequency response functions: magnitude and phase over frequency, model and test over each other."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, PALE_ORANGE, SOFT, cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS_PER_ROW = 2
"""Panels side by side."""
_MOST_POINTS = 1500
"""Points of a curve in a picture; of more lines, the highest and the lowest of neighbours are kept."""
_SMALLEST_SHOWN = 1e-6
"""Amplitude relative to the largest one down to which the axis reaches: zeros would hide the resonances."""
_LOWEST_PHASE_DEG = -165.0
"""Lowest phase in degrees: not −180°, so that noise does not make phases about ±180° jump."""
LOOKS: dict[str, dict[str, Any]] = {
    # a wide pale line under narrow ones, opaque so that colours do not mix: both stay visible if they coincide
    "test": {"color": PALE_ORANGE, "linewidth": 4.0, "zorder": 2.0, "solid_capstyle": "butt"},
    "identified": {"color": INK, "linewidth": 0.9, "linestyle": (0, (1, 1.5)), "zorder": 2.3},
    "before": {"color": SOFT, "linewidth": 1.0, "linestyle": (0, (4, 2)), "zorder": 2.1},
    "model": {"color": BLUE, "linewidth": 1.1, "zorder": 2.2},
    "after": {"color": BLUE, "linewidth": 1.1, "zorder": 2.2},
}
"""Colour, width and line style of each kind of curve."""


@dataclass(frozen=True)
class FrfCurve:
    """A function over its lines; `look` is "model", "before", "after", "identified" or "test"."""

    look: str
    freq_hz: NDArray[np.float64]
    values: NDArray[np.complex128]


@dataclass(frozen=True)
class FrfPanel:
    """Curves of one output and input."""

    title: str
    ordinate: str
    curves: tuple[FrfCurve, ...]


def frfs_svg(panels: Sequence[FrfPanel]) -> str:
    """All panels, two side by side, each with its phase below."""
    across = min(len(panels), _PANELS_PER_ROW)
    rows = -(-len(panels) // across)

    def draw(figure: Figure) -> None:
        grid = figure.add_gridspec(2 * rows, across, height_ratios=[3.0, 1.1] * rows)
        for k, panel in enumerate(panels):
            row, column = 2 * (k // across), k % across
            upper = figure.add_subplot(grid[row, column])
            lower = figure.add_subplot(grid[row + 1, column], sharex=upper)
            _panel(upper, lower, panel)
        legend(figure, [c.look for panel in panels for c in panel.curves])

    return draw_svg(3.7 * across if across > 1 else 5.6, 2.75 * rows + 0.3, draw)


def _panel(upper: Axes, lower: Axes, panel: FrfPanel) -> None:
    upper.set_title(cut(panel.title, 34), loc="left")
    largest = max((float(np.nanmax(np.abs(c.values), initial=0.0)) for c in panel.curves), default=0.0)
    smallest = largest
    for curve in panel.curves:
        freq_hz, values = thinned(curve.freq_hz, curve.values)
        size = np.abs(values)
        size = np.where(size > 0.0, size, np.nan)
        smallest = min(smallest, float(np.nanmin(size, initial=largest)))
        upper.plot(freq_hz, size, **LOOKS[curve.look])
        lower.plot(*_phase(freq_hz, values), **LOOKS[curve.look])
    _finish(upper, lower, panel, max(smallest, _SMALLEST_SHOWN * largest), largest)


def _finish(upper: Axes, lower: Axes, panel: FrfPanel, smallest: float, largest: float) -> None:
    if largest > 0.0:
        upper.set_yscale("log")
        upper.set_ylim(0.7 * smallest, 1.6 * largest)
    first, last = panel.curves[0].freq_hz[0], panel.curves[0].freq_hz[-1]
    upper.set_xlim(first, last if last > first else first + 1.0)
    upper.set_ylabel(panel.ordinate)
    upper.tick_params(labelbottom=False)
    lower.set_ylim(_LOWEST_PHASE_DEG - 20.0, _LOWEST_PHASE_DEG + 380.0)
    lower.set_yticks([-180, 0, 180])
    lower.set_ylabel("phase, °")
    lower.set_xlabel("Hz")
    for axes in (upper, lower):
        axes.grid(axis="both")
        axes.set_axisbelow(True)


def _phase(freq_hz: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
    """Phase in degrees, with a gap where the curve leaves on one side and returns on the other."""
    angle = np.degrees(np.angle(values))
    angle = np.where(angle < _LOWEST_PHASE_DEG, angle + 360.0, angle)
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > 180.0) + 1
    return np.insert(freq_hz, jumps, freq_hz[jumps]), np.insert(angle, jumps, np.nan)


def thinned(freq_hz: NDArray, values: NDArray, most: int = _MOST_POINTS) -> tuple[NDArray, NDArray]:
    """The highest and lowest point of each group of neighbours, so that no peak is lost; all points if they are few."""
    if len(freq_hz) <= most:
        return freq_hz, values
    size = np.nan_to_num(np.abs(values))
    groups = np.array_split(np.arange(len(freq_hz)), most // 2)
    kept = sorted({int(g[at(size[g])]) for g in groups for at in (np.argmax, np.argmin)})
    kept = sorted({0, *kept, len(freq_hz) - 1})
    return freq_hz[kept], values[kept]


def legend(figure: Figure, shown: Collection[str]) -> None:
    """The looks that are shown, each once; nothing for a single look."""
    looks = [look for look in LOOKS if look in shown]
    if len(looks) < 2:
        return
    words = {
        "before": "model before",
        "after": "model after",
        "model": "model",
        "test": "test",
        "identified": "identified test",
    }
    from matplotlib.lines import Line2D  # noqa: PLC0415

    lines = [Line2D([], [], label=words[look], **LOOKS[look]) for look in looks]
    figure.legend(handles=lines, loc="outside upper left", ncols=len(lines), frameon=False, fontsize=8)
