"""Faces of large models as pixels: thousands of them take less room than as vectors, and as little time."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune._optional import require
from femtune.report.figures.canvas import draw_png
from femtune.report.figures.svg import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 170.0
"""Sharp on a screen of nearly twice the usual density, and in print."""
_POINTS_PER_INCH = 72.0


@dataclass(frozen=True)
class Painting:
    """Faces and lines, the farthest first: corners (n, 4, 2) in points, and colours of area and edge of each.

    A line is a face whose corners are its two ends; `smooth` ones have soft edges.
    """

    corners: NDArray[np.float64]
    fills: Sequence[str]
    edges: Sequence[str]
    widths: NDArray[np.float64]
    smooth: NDArray[np.bool_]


def rastered(painting: Painting, size: tuple[float, float]) -> str:
    """The painting as an SVG image of `size` (points) at the origin."""

    def draw(figure: Figure) -> None:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0.0, size[0])
        axes.set_ylim(size[1], 0.0)
        kind = require("matplotlib.collections").PolyCollection
        style = {
            "facecolors": _rgba(painting.fills),
            "edgecolors": _rgba(painting.edges),
            "linewidths": painting.widths,
            # shades that melt into each other at every edge of a small face would make the file four times as large
            "antialiaseds": painting.smooth,
        }
        axes.add_collection(kind(painting.corners, joinstyle="round", **style), autolim=False)

    data = draw_png(size[0] / _POINTS_PER_INCH, size[1] / _POINTS_PER_INCH, draw, _DOTS_PER_INCH)
    address = "data:image/png;base64," + base64.b64encode(data).decode()
    return f'<image width="{number(size[0])}" height="{number(size[1])}" href="{address}"/>'


def _rgba(colours: Sequence[str]) -> NDArray[np.float64]:
    """(n, 4) of few different colours; matplotlib would read each name by itself."""
    names, which = np.unique(colours, return_inverse=True)
    return np.asarray(require("matplotlib.colors").to_rgba_array(list(names))[which])
