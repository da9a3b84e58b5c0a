"""Stabilisation diagram: every pole over frequency and order, those that come back dark, the chosen modes as lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE, PALE_ORANGE, SOFT
from femtune.identification import Limits, possible, stable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from femtune.identification import Candidate, PoleTable
    from femtune.modal import FrfSet

_MOST_POINTS = 2000
_MARKS = ("o", "s", "^", "D")


@dataclass(frozen=True, eq=False)
class StabilisationPicture:
    """What is drawn.

    Parameters
    ----------
    freq_hz, order, method : of every pole
    stable : which of them come back
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
        own = names == name
        other, firm = own & ~picture.stable, own & picture.stable
        axes.plot(picture.freq_hz[other], picture.order[other], mark, color=SOFT, markersize=1.6, alpha=0.6)
        face = BLUE if mark == _MARKS[0] else "none"
        axes.plot(
            picture.freq_hz[firm], picture.order[firm], mark, markeredgecolor=BLUE if face != "none" else INK,
            markerfacecolor=face, markersize=3.0, markeredgewidth=0.6, label=f"{name}, stable",
        )  # fmt: skip
    axes.set_ylabel("model order")
    axes.legend(frameon=False, fontsize=7, loc="upper left", bbox_to_anchor=(0.0, 1.09), ncols=4)


# ----------------------------------------------------------------------------------------------------
# Stabilisation diagram: every pole over the orders, the modes chosen, and functions of measurement and model.


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SMALLEST = 1e-6
"""Functions are drawn down to this part of their largest value."""


def identified_svg(
    table: PoleTable, candidates: Sequence[Candidate], measured: FrfSet, model: FrfSet, limits: Limits | None = None
) -> str:
    """A panel a method over one of the functions.

    Parameters
    ----------
    table, candidates : as identified
    measured, model : at the same lines; of all functions together the root mean square is drawn
    limits : that the poles were judged by
    """
    limits = limits or Limits()
    methods = list(dict.fromkeys(table.method))

    def draw(figure: Figure) -> None:
        rows = len(methods) + 1
        panels = figure.subplots(rows, 1, sharex=True, height_ratios=[1.0] * len(methods) + [1.3], squeeze=False)[:, 0]
        for axes, method in zip(panels, methods):
            _draw_poles(axes, table.select(np.array([m == method for m in table.method])), method, limits)
        _functions(panels[-1], measured, model)
        for axes in (panels[0], panels[-1]):
            # above the panel: the poles leave no free corner
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=7, frameon=False)
        for axes in panels:
            for c in candidates:
                if c.chosen:
                    axes.axvline(c.freq_hz, color=LINE, linewidth=0.7, zorder=0)
        panels[-1].set_xlim(measured.freq_hz[0], measured.freq_hz[-1])
        panels[-1].set_xlabel("Hz; lines: modes that were chosen")

    return draw_svg(9.4, 2.2 * (len(methods) + 1), draw)


def _draw_poles(axes: Axes, table: PoleTable, method: str, limits: Limits) -> None:
    """Stable poles dark, others that a structure could have pale."""
    firm, may = stable(table, limits), possible(table, limits)
    rest = may & ~firm
    axes.plot(table.freq_hz[rest], table.order[rest], ".", color=PALE, markersize=2.0, label="in this order only")
    axes.plot(table.freq_hz[firm], table.order[firm], ".", color=BLUE, markersize=3.5, label="stable")
    axes.set_ylabel(f"order, {method}")


def _functions(axes: Axes, measured: FrfSet, model: FrfSet) -> None:
    seen, made = _rms(measured), _rms(model)
    axes.semilogy(measured.freq_hz, seen, color=PALE_ORANGE, linewidth=4.0, label="measured")
    axes.semilogy(model.freq_hz, made, color=BLUE, linewidth=1.0, label="model")
    axes.semilogy(
        model.freq_hz, _rms_of(measured.values - model.values), color=ORANGE, linewidth=0.6, label="difference"
    )
    axes.set_ylim(max(_SMALLEST * np.nanmax(seen), 0.3 * np.nanmin(_positive(measured, model))), 2.0 * np.nanmax(seen))
    axes.set_ylabel(f"{measured.kind}, rms", color=INK)


def _positive(measured: FrfSet, model: FrfSet) -> NDArray[np.float64]:
    gap = _rms_of(measured.values - model.values)
    return gap[gap > 0.0] if (gap > 0.0).any() else _rms(measured)


def _rms(frfs: FrfSet) -> NDArray[np.float64]:
    return _rms_of(frfs.values)


def _rms_of(values: NDArray) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.nanmean(np.abs(values) ** 2, axis=(0, 1))), dtype=float)
