"""Stabilisation diagram: every pole over frequency and order, those that come back dark, the chosen modes as lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE, SOFT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_MOST_POINTS = 2000
"""Points of the curve behind the poles; of more lines, each n-th is drawn."""
_MARKS = ("o", "s", "^", "D")
"""Marks of the methods in turn."""


@dataclass(frozen=True, eq=False)
class StabilisationPicture:
    """What is drawn.

    Parameters
    ----------
    freq_hz, order, method : of every pole
    stable : True for stable poles
    curve_hz, curve_db : behind them, none where empty
    modes_hz : chosen; `input_hz` are lines of the excitation among them
    band_hz : what is shown
    """

    freq_hz: NDArray[np.float64]
    order: NDArray[np.int64]
    method: Sequence[str]
    stable: NDArray[np.bool_]
    curve_hz: NDArray[np.float64]
    curve_db: NDArray[np.float64]
    modes_hz: Sequence[float]
    input_hz: Sequence[float]
    band_hz: tuple[float, float]


def stabilisation_svg(picture: StabilisationPicture) -> str:
    """The diagram as SVG."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        _lines(axes, picture)
        _curve(axes.twinx(), picture)
        _poles(axes, picture)
        axes.set_xlim(*picture.band_hz)
        axes.set_xlabel("Hz")

    return draw_svg(7.6, 4.2, draw)


def _lines(axes: Axes, picture: StabilisationPicture) -> None:
    for freq in picture.modes_hz:
        axes.axvline(freq, color=LINE, linewidth=0.8, zorder=0)
    for freq in picture.input_hz:
        axes.axvline(freq, color=ORANGE, linewidth=0.9, linestyle="--", zorder=0)


def _curve(axes: Axes, picture: StabilisationPicture) -> None:
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)
    if not len(picture.curve_hz):
        return
    step = max(1, len(picture.curve_hz) // _MOST_POINTS)
    count = len(picture.curve_hz) // step
    highest = picture.curve_db[: count * step].reshape(count, step).max(axis=1)
    axes.plot(picture.curve_hz[: count * step : step], highest, color=PALE, linewidth=0.9)
    axes.set_zorder(-1)


def _poles(axes: Axes, picture: StabilisationPicture) -> None:
    axes.patch.set_visible(False)
    if not len(picture.freq_hz):
        axes.set_yticks([])
        return
    names = np.array(picture.method)
    for mark, name in zip(_MARKS, dict.fromkeys(picture.method)):
        of_method = names == name
        other, firm = of_method & ~picture.stable, of_method & picture.stable
        axes.plot(picture.freq_hz[other], picture.order[other], mark, color=SOFT, markersize=1.6, alpha=0.6)
        face = BLUE if mark == _MARKS[0] else "none"
        axes.plot(
            picture.freq_hz[firm], picture.order[firm], mark, markeredgecolor=BLUE if face != "none" else INK,
            markerfacecolor=face, markersize=3.0, markeredgewidth=0.6, label=f"{name}, stable",
        )  # fmt: skip
    axes.set_ylabel("model order")
    axes.legend(frameon=False, fontsize=7, loc="upper left", bbox_to_anchor=(0.0, 1.09), ncols=4)
