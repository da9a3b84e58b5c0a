"""Picture of identified poles: all poles over the orders, the modes chosen, measured and synthesised functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE, PALE_ORANGE
from femtune.identification import Limits, possible, stable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from femtune.identification import Candidate, PoleTable
    from femtune.modal import FrfSet

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
