"""Course of the update: objective and parameters by iteration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, PALE, cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DASHES = ("-", "--", "-.", ":")
"""Line styles in turn, so that neighbouring curves differ in print without colours, too."""


def convergence_svg(
    iterations: Sequence[int],
    objective: Sequence[float],
    names: Sequence[str],
    places: Sequence[Sequence[float]],
    events: Sequence[int],
) -> str:
    """Objective in % above, parameters between their bounds below.

    Parameters
    ----------
    places : for each iteration, the position of each parameter between its bounds, 0 to 1
    events : iterations after which the pairing changed
    """
    lower_in = max(2.0, 0.15 * len(names))

    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.9, lower_in])
        _objective(upper, iterations, objective)
        _parameters(lower, iterations, names, np.array(places, dtype=float).reshape(len(iterations), len(names)))
        for axes in (upper, lower):
            axes.grid(axis="y")
            axes.set_axisbelow(True)
            for event in events:
                axes.axvline(event, color=PALE, linewidth=1.0, linestyle=":")

    return draw_svg(6.8, 2.5 + lower_in, draw)


def _objective(axes: Axes, iterations: Sequence[int], objective: Sequence[float]) -> None:
    axes.plot(iterations, objective, "o-", color=BLUE, markersize=4, linewidth=1.4)
    axes.set_ylim(0.0, 1.1 * max([*objective, 1e-12]))
    axes.set_ylabel("weighted mean error in %")


def _parameters(axes: Axes, iterations: Sequence[int], names: Sequence[str], places: np.ndarray) -> None:
    for k in range(len(names)):
        shade = str(0.62 * (k % 5) / 4)
        axes.plot(iterations, places[:, k], color=shade, linestyle=_DASHES[k % 4], linewidth=1.2)
    axes.set_ylim(-0.06, 1.06)
    axes.set_yticks([0, 1], ["lower\nbound", "upper\nbound"])
    axes.set_xlabel("iteration")
    axes.locator_params(axis="x", integer=True)
    last, gap = iterations[-1], 1.12 / max(15.0, len(names))
    width = max(iterations[-1] - iterations[0], 1)
    for k, y in enumerate(_apart(places[-1], gap)):
        axes.annotate(
            cut(names[k], 18), (last, places[-1, k]), (last + 0.04 * width, y), annotation_clip=False,
            fontsize=7, va="center", color=INK, arrowprops={"arrowstyle": "-", "color": PALE, "linewidth": 0.5},
        )  # fmt: skip


def _apart(heights: np.ndarray, gap: float) -> np.ndarray:
    """Heights moved so that neighbours keep a distance `gap`, in the same order and centred as a whole."""
    order = np.argsort(heights, kind="stable")
    placed = heights[order].copy()
    for i in range(1, len(placed)):
        placed[i] = max(placed[i], placed[i - 1] + gap)
    overflow = max(0.0, float(placed[-1] - 1.06)) if len(placed) else 0.0
    placed -= overflow
    for i in range(len(placed) - 2, -1, -1):
        placed[i] = min(placed[i], placed[i + 1] - gap)
    out = np.empty_like(placed)
    out[order] = placed
    return out
