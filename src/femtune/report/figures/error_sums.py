"""Error sums of a stage: a pair of bars for each mode, before and after, and one for all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from femtune.report.figures.canvas import draw_svg
from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, PALE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_sums_svg(labels: Sequence[str], before: Sequence[float], after: Sequence[float], title: str) -> str:
    """Bars in per cent of the sum before the stage; the last pair is the sum of all."""
    total = sum(before) or 1.0
    pairs = [(100.0 * a / total, 100.0 * b / total) for a, b in [*zip(before, after), (sum(before), sum(after))]]

    def draw(figure: Figure) -> None:
        axes, at = figure.add_subplot(), np.arange(len(pairs))
        axes.bar(at - 0.2, [p[0] for p in pairs], 0.38, color=PALE, label="before")
        axes.bar(at + 0.2, [p[1] for p in pairs], 0.38, color=BLUE, label="after")
        axes.set_xticks(at, [*(cut(t, 14) for t in labels), "all"])
        if len(labels) > 8:
            axes.tick_params(axis="x", rotation=60)
        axes.set_ylabel("% of the sum before")
        axes.set_title(cut(title, 60))
        axes.legend(frameon=False, fontsize=7)
        axes.grid(axis="y")
        axes.set_axisbelow(True)

    return draw_svg(min(3.0 + 0.32 * len(pairs), 9.0), 2.5, draw)
