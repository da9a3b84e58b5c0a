"""A sheet to draw on: matplotlib's objects without global state, the same bytes for the same data."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune._optional import require
from femtune.reporting.figures.svg import FONT, INK, LINE, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# matplotlib measures with the font that it brings; readers see a sans-serif of their own, which is narrower
_MEASURED = "'DejaVu Sans'"

_COLOURS = 64
"""Different colours of pixels: more of them than shades that an eye tells apart would make the file larger."""

_STYLE: dict[str, Any] = {
    "svg.hashsalt": "femtune",
    "svg.fonttype": "none",  # text stays text: small, sharp, in the type of the page
    "text.parse_math": False,  # a "$" in a name is a dollar
    "font.family": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.edgecolor": PALE,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.unicode_minus": True,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}


def draw_svg(width_in: float, height_in: float, draw: Callable[[Figure], None], *, arrange: bool = True) -> str:
    """What `draw` draws on a figure of the given size in inches, as SVG.

    A reader's own matplotlib settings have no influence. With `arrange` matplotlib makes room for labels; without,
    `draw` places its axes itself.
    """
    buffer = io.StringIO()
    canvas = require("matplotlib.backends.backend_svg")
    with _figure(width_in, height_in, arrange) as figure:
        canvas.FigureCanvasSVG(figure)
        draw(figure)
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
    return buffer.getvalue().replace(_MEASURED, FONT)


def draw_png(width_in: float, height_in: float, draw: Callable[[Figure], None], dots_per_inch: float) -> bytes:
    """As `draw_svg`, as the bytes of a PNG with a transparent ground: for what has too many parts for SVG."""
    buffer = io.BytesIO()
    sheet = require("matplotlib.backends.backend_agg")
    with _figure(width_in, height_in, False) as figure:
        figure.set_dpi(dots_per_inch)
        figure.patch.set_alpha(0.0)
        canvas = sheet.FigureCanvasAgg(figure)
        draw(figure)
        canvas.draw()
        images = require("PIL.Image")
        image = images.fromarray(np.asarray(canvas.buffer_rgba()))
        few = image.quantize(_COLOURS, method=images.Quantize.FASTOCTREE, dither=images.Dither.NONE)
        few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


@contextmanager
def _figure(width_in: float, height_in: float, arrange: bool) -> Iterator[Figure]:
    # matplotlib is imported where a picture is drawn: who only looks at numbers does not wait for it
    matplotlib, sheet = require("matplotlib"), require("matplotlib.figure")
    with matplotlib.rc_context(), warnings.catch_warnings():
        # a letter that the font lacks is shown as a box: no reason to stop
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield sheet.Figure(figsize=(width_in, height_in), layout="constrained" if arrange else None)


def quiet(axes: Axes, *, sides: tuple[str, ...] = ("left",)) -> None:
    """Take away the frame's `sides` and the ticks there."""
    for side in sides:
        axes.spines[side].set_visible(False)
    axes.tick_params(length=0)
