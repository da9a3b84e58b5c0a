"""Parameters between their bounds: prior and posterior with their standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.canvas import draw_svg, quiet
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE, SOFT, cut
from femtune.document.numbers import short, value, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from femtune.arrays import Reals


@dataclass(frozen=True)
class ForestRow:
    """One parameter in its unit; `sd` is None where σ is not given."""

    name: str
    unit: str
    lower: float
    upper: float
    nominal: float
    prior_sd: float | None
    final: float
    sd: float | None
    at_bound: bool
    interval: tuple[float, float] | None = None

    def place(self, x: float) -> float:
        """0 at the lower bound, 1 at the upper one."""
        return (x - self.lower) / (self.upper - self.lower)


def forest_svg(rows: Sequence[ForestRow]) -> str:
    """A row for each parameter, drawn from its lower to its upper bound."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        for i, entry in enumerate(rows):
            _one(axes, i, entry)
        axes.set_yticks(range(len(rows)), [cut(r.name) for r in rows])
        axes.set_ylim(len(rows) - 0.4, -0.7)
        axes.set_xlim(-0.13, 1.5)
        axes.set_xticks([0, 0.5, 1], ["lower bound", "", "upper bound"])
        quiet(axes, sides=("left", "bottom"))

    return draw_svg(7.0, 0.6 + 0.34 * len(rows), draw)


def _one(axes: Axes, i: int, entry: ForestRow) -> None:
    axes.plot([0, 1], [i, i], color=LINE, linewidth=1.0, zorder=0)
    axes.plot([0, 0, 1, 1], [i - 0.16, i + 0.16, i + 0.16, i - 0.16], "|", color=PALE, markersize=0)
    for x, bound, side in ((-0.015, entry.lower, "right"), (1.015, entry.upper, "left")):
        axes.text(x, i, short(bound), ha=side, va="center", fontsize=6.5, color=SOFT)
    if entry.prior_sd is not None:
        _span(axes, i + 0.14, entry, entry.nominal, entry.prior_sd, PALE)
    axes.plot([entry.place(entry.nominal)], [i + 0.14], "|", color=INK, markersize=7)
    if entry.interval is not None:
        ends = [min(max(entry.place(x), 0.0), 1.0) for x in entry.interval]
        axes.plot(ends, [i - 0.1, i - 0.1], color=BLUE, linewidth=1.0, solid_capstyle="butt")
    if entry.sd is not None:
        _span(axes, i - 0.1, entry, entry.final, entry.sd, BLUE)
    mark = "s" if entry.at_bound else "o"
    axes.plot([entry.place(entry.final)], [i - 0.1], mark, color=ORANGE if entry.at_bound else BLUE, markersize=5)
    axes.text(1.14, i, _words(entry), va="center", fontsize=7.5)


def _span(axes: Axes, y: float, entry: ForestRow, centre: float, sd: float, colour: str) -> None:
    """± one standard deviation, cut at the bounds."""
    ends = [min(max(entry.place(centre + s * sd), 0.0), 1.0) for s in (-1, 1)]
    axes.plot(ends, [y, y], color=colour, linewidth=3.0, solid_capstyle="butt", alpha=0.85)


def _words(entry: ForestRow) -> str:
    spread = "at bound" if entry.at_bound else "σ not given" if entry.sd is None else f"± {short(entry.sd)}"
    return with_unit(f"{value(entry.final)} {spread}", "" if entry.sd is None else cut(entry.unit, 12))


# ----------------------------------------------------------------------------------------------------
# Optima of many starts, in parallel coordinates between the bounds.


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_NAMES = 24
"""Parameters that are named on the axis; of more, names would overlap, and numbers take their place."""


def optima_svg(
    names: Sequence[str],
    optima: Sequence[Sequence[float]],
    counts: Sequence[int],
    as_good: Sequence[bool],
    starts: Sequence[Sequence[float]],
) -> str:
    """A line for each optimum.

    Parameters
    ----------
    optima : for each optimum, the best first, the position of each parameter between its bounds, 0 to 1
    counts, as_good : of each optimum
    starts : for each start, likewise
    """
    at = np.arange(len(names))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for start in starts:
            axes.plot(at, start, ".", color=PALE, markersize=3, zorder=1)
        for i in reversed(range(len(optima))):
            width = 0.8 + 3.2 * counts[i] / max(counts)
            colour = BLUE if i == 0 else INK if as_good[i] else PALE
            axes.plot(at, optima[i], "o-", color=colour, linewidth=width, markersize=3 + width, zorder=2 + as_good[i])
        axes.set_ylim(-0.06, 1.06)
        axes.set_yticks([0, 1], ["lower\nbound", "upper\nbound"])
        few = len(names) <= _MOST_NAMES
        axes.set_xticks(at, [cut(n, 12) for n in names] if few else [str(i + 1) for i in at], rotation=40, ha="right")
        axes.grid(axis="x")
        axes.set_axisbelow(True)

    return draw_svg(6.8, 2.8, draw)


# ----------------------------------------------------------------------------------------------------
# The L-curve and the paths of the parameters over the weight of a side constraint.


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DASHES = ("-", "--", "-.", ":")
"""Line styles in turn, so that neighbouring curves differ in print without colours, too."""
_MOST_CURVES_NAMED = 8
"""Parameters with a legend; a longer one would hide the curves."""
_CONSTRAINT_RANGE = 300.0
"""Largest over smallest norm of the side constraint that the L-curve shows. Smaller norms, which belong to
large weights, would compress the part with the corner."""


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
    paths : for each weight, the change of each parameter in %
    chosen : the weight that was chosen; None if none was
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
    axes.set_ylim(max(float(eta[good].min()), float(eta[good].max()) / _CONSTRAINT_RANGE), 1.3 * float(eta[good].max()))
    axes.grid(which="major")


def _paths(axes: Axes, weights: np.ndarray, names: Sequence[str], paths: np.ndarray, at: int | None) -> None:
    for k, name in enumerate(names):
        label = cut(name, 18) if len(names) <= _MOST_CURVES_NAMED else None
        shade = str(0.62 * (k % 5) / 4)
        axes.semilogx(weights, paths[:, k], color=shade, linestyle=_DASHES[k % 4], linewidth=1.2, label=label)
    if at is not None:
        axes.axvline(weights[at], color=PALE, linewidth=1.0)
        axes.semilogx(np.full(len(names), weights[at]), paths[at], "o", color=INK, markersize=5, fillstyle="none")
    axes.set_xlabel("weight")
    axes.set_ylabel("change in %")
    axes.grid(axis="y")
    if len(names) <= _MOST_CURVES_NAMED:
        axes.legend(frameon=False, fontsize=7, loc="best")


# ----------------------------------------------------------------------------------------------------
# Clouds of outputs or parameters in pairs, with their covariance ellipses.


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_MOST_PANELS = 6
"""Pairs of outputs that are drawn: two rows of a page."""
_PANELS_PER_ROW = 3
"""Panels side by side; with more, the labels of the axes become illegible."""
_MOST_POINTS = 400
"""Points of a cloud; more make files larger and hide each other."""
_COLOURS = (ORANGE, BLUE, PALE)
"""Colours of the clouds in turn; the measured one is first."""


@dataclass(frozen=True)
class Cloud:
    """Points (n, m) and their distribution; no points if only the moments are known."""

    name: str
    points: Reals
    mean: Reals
    covariance: Reals


def clouds_svg(labels: Sequence[str], clouds: Sequence[Cloud], probability: float = 0.95) -> str:
    """A panel for each pair of outputs, the first six pairs; up to three clouds, points and ellipses.

    Parameters
    ----------
    labels : (m,) of the axes
    clouds : the measured one first
    probability : share of a normal distribution inside an ellipse
    """
    pairs = list(combinations(range(len(labels)), 2))[:_MOST_PANELS]
    across = min(_PANELS_PER_ROW, len(pairs))
    down = -(-len(pairs) // across)

    def draw(sheet: Figure) -> None:
        panels = sheet.subplots(down, across, squeeze=False).ravel()
        for axes, (i, j) in zip(panels, pairs):
            for k, cloud in enumerate(clouds):
                _cloud(axes, cloud, [i, j], _COLOURS[k % len(_COLOURS)], probability, first=k == 0)
            axes.set_xlabel(cut(labels[i]))
            axes.set_ylabel(cut(labels[j]))
        for axes in panels[len(pairs) :]:
            axes.set_visible(False)
        sheet.legend(*panels[0].get_legend_handles_labels(), frameon=False, loc="outside upper left", ncols=len(clouds))

    return draw_svg(0.4 + 2.7 * across, 0.5 + 2.3 * down, draw)


def _cloud(axes: Axes, cloud: Cloud, at: list[int], colour: str, probability: float, *, first: bool) -> None:
    from femtune.uncertainty import ellipse  # noqa: PLC0415  the other pictures do without

    edge = ellipse(cloud.mean[at], cloud.covariance[np.ix_(at, at)], probability)
    points = cloud.points[:_MOST_POINTS, at]
    size, alpha, order = (3, 0.8, 3) if first else (2, 0.3, 2)
    mark = "o" if first else "."
    axes.plot(*points.T, mark, color=colour, markersize=size, alpha=alpha, markeredgewidth=0.0, zorder=order)
    axes.plot(*edge.T, color=colour, linewidth=1.2, linestyle="-" if first else "--", label=cloud.name, zorder=4)
    axes.plot(*cloud.mean[at], "+", color=colour, markersize=8, zorder=5)
