"""A sheet to draw on: matplotlib's objects without global state, the same bytes for the same data."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune._optional import require
from femtune.document.figures.svg import FONT, INK, LINE, PALE
from femtune.document.numbers import typeset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

_MEASURED = "'DejaVu Sans'"
"""Font that matplotlib brings and measures with. Readers see a sans-serif font of their system, which is narrower."""

_SVG_DPI = 72.0
"""Dots per inch of matplotlib's SVG."""
_COLOURS = 64
"""Different colours of pixels: more than the eye tells apart would make the file larger."""

_STYLE: dict[str, Any] = {
    "svg.hashsalt": "femtune",
    "svg.fonttype": "none",  # text stays text: small files, sharp, in the font of the page
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
"""Settings of matplotlib that do not depend on those of the user."""


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
        _plain_powers(figure)
        layout = figure.get_layout_engine()
        if layout is not None:
            # saving would draw the whole figure once more to arrange it
            figure.set_dpi(_SVG_DPI)
            layout.execute(figure)
            figure.set_layout_engine(None)
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
    # matplotlib is imported only to draw a picture; numbers alone do not need it
    matplotlib, sheet = require("matplotlib"), require("matplotlib.figure")
    with matplotlib.rc_context(), warnings.catch_warnings():
        # a character that the font lacks is shown as a box, which is acceptable
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield sheet.Figure(figsize=(width_in, height_in), layout="constrained" if arrange else None)


def quiet(axes: Axes, *, sides: tuple[str, ...] = ("left",)) -> None:
    """Remove `sides` of the frame and their ticks."""
    for side in sides:
        axes.spines[side].set_visible(False)
    axes.tick_params(length=0)


def _plain_powers(figure: Figure) -> None:
    """Plain numbers along logarithmic axes, three or four of them; below two decades 1, 2 and 5 of each.

    Raised exponents would be written in the markup of matplotlib, which the page does not read.
    """
    ticker = require("matplotlib.ticker")
    for side in (side for axes in figure.axes for side in (axes.xaxis, axes.yaxis) if side.get_scale() == "log"):
        low, high = sorted(side.get_view_interval())
        within = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
        side.set_major_locator(ticker.LogLocator(base=10.0, subs=within, numticks=5))
        side.set_major_formatter(lambda value, _: typeset(f"{value:g}"))
        side.set_minor_formatter(ticker.NullFormatter())


def told_apart(side: Axis) -> None:
    """Three significant digits along an axis, or as many as the numbers need to differ."""

    def text(value: float, _: float) -> str:
        ticks = side.get_majorticklocs()
        digits = next((n for n in range(3, 12) if len({f"{t:.{n}g}" for t in ticks}) == len(ticks)), 12)
        return typeset(f"{value:.{digits}g}")

    side.set_major_formatter(text)
