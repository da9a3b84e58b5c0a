"""The L-curve and the paths of the parameters over the weight of a side constraint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune._optional import require
from femtune.report.figures.canvas import draw_svg
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, INK, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

_DASHES = ("-", "--", "-.", ":")
_MOST, _SHOWN = 8, 300.0


def weight_path_svg(
    weights: Sequence[float],
    residual_norms: Sequence[float],
    constraint_norms: Sequence[float],
    names: Sequence[str],
    paths: Sequence[Sequence[float]],
    chosen: float | None,
) -> str:
    """L-curve on the left, parameters on the right.

    Parameters
    ----------
    paths : an entry each weight, the change of each parameter in %
    chosen : the weight that was found; None where none was
    """

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
        at = None if chosen is None else int(np.argmin(np.abs(np.log(np.array(weights) / chosen))))
        _curve(left, np.array(residual_norms), np.array(constraint_norms), at)
        _paths(right, np.array(weights), names, np.array(paths, dtype=float), at)

    return draw_svg(6.8, 2.9, draw)


def _curve(axes: Axes, rho: np.ndarray, eta: np.ndarray, at: int | None) -> None:
    good = (rho > 0.0) & (eta > 0.0)
    axes.loglog(rho[good], eta[good], color=BLUE, linewidth=1.4)
    if at is not None:
        axes.loglog([rho[at]], [eta[at]], "o", color=INK, markersize=6, fillstyle="none")
    axes.set_xlabel("norm of the residuals")
    axes.set_ylabel("norm of the side constraint")
    axes.set_ylim(max(float(eta[good].min()), float(eta[good].max()) / _SHOWN), 1.3 * float(eta[good].max()))
    axes.grid(which="major")
    _plain(axes.xaxis, axes.yaxis)


def _plain(*sides: Axis) -> None:
    """Powers of ten as plain numbers, three or four of them: raised exponents would need mathematical type."""
    ticker = require("matplotlib.ticker")
    for side in sides:
        side.set_major_locator(ticker.LogLocator(base=10.0, numticks=5))
        side.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        side.set_minor_formatter(ticker.NullFormatter())


def _paths(axes: Axes, weights: np.ndarray, names: Sequence[str], paths: np.ndarray, at: int | None) -> None:
    for k, name in enumerate(names):
        label = cut(name, 18) if len(names) <= _MOST else None
        shade = str(0.62 * (k % 5) / 4)
        axes.semilogx(weights, paths[:, k], color=shade, linestyle=_DASHES[k % 4], linewidth=1.2, label=label)
    if at is not None:
        axes.axvline(weights[at], color=PALE, linewidth=1.0)
        axes.semilogx(np.full(len(names), weights[at]), paths[at], "o", color=INK, markersize=5, fillstyle="none")
    axes.set_xlabel("weight")
    axes.set_ylabel("change in %")
    _plain(axes.xaxis)
    axes.grid(axis="y")
    if len(names) <= _MOST:
        axes.legend(frameon=False, fontsize=7, loc="best")
