"""Frequency domain assurance criterion over the lines of test and model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune._optional import require
from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import ORANGE, SOFT, cut

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS_PER_ROW = 2
"""Panels side by side."""
_BLUES = ("#f7fafd", "#c3d8ea", "#75a5cf", "#2d6ca6", "#0e3a66")
"""Colours from 0 to 1; brightness falls steadily, so that grey prints show the order."""


@dataclass(frozen=True)
class FdacPanel:
    """FDAC (test lines, model lines) of one input or output; NaN cells are empty."""

    title: str
    values: NDArray[np.float64]
    test_hz: NDArray[np.float64]
    model_hz: NDArray[np.float64]
    shift_percent: float | None = None


def fdac_svg(panels: Sequence[FdacPanel]) -> str:
    """All panels, two side by side; model lines to the right, test lines upwards."""
    across = min(len(panels), _PANELS_PER_ROW)
    rows = -(-len(panels) // across)
    colours = require("matplotlib.colors").LinearSegmentedColormap.from_list("fdac", _BLUES)

    def draw(figure: Figure) -> None:
        image = None
        axes = [figure.add_subplot(rows, across, k + 1) for k in range(len(panels))]
        for one, panel in zip(axes, panels):
            image = one.pcolormesh(
                panel.model_hz, panel.test_hz, np.ma.masked_invalid(panel.values), cmap=colours, vmin=0.0, vmax=1.0,
                shading="nearest", rasterized=True,
            )  # fmt: skip
            low, high = panel.test_hz[0], panel.test_hz[-1]
            one.plot([low, high], [low, high], color=SOFT, linewidth=0.8, linestyle=(0, (4, 2)))
            if panel.shift_percent is not None:
                factor = 1.0 + panel.shift_percent / 100.0
                one.plot([factor * low, factor * high], [low, high], color=ORANGE, linewidth=1.0)
            one.set_xlim(panel.model_hz[0], panel.model_hz[-1])
            one.set_ylim(low, high)
            one.set_title(cut(panel.title, 34), loc="left")
            one.set_xlabel("model, Hz")
            one.set_ylabel("test, Hz")
        if image is not None:
            figure.colorbar(image, ax=axes, shrink=0.8, label="FDAC")

    return draw_svg(3.6 * across + 0.7, 3.0 * rows + 0.2, draw)
