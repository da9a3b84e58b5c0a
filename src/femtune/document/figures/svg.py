"""Plain SVG, written directly: matrices and line drawings need no axes, and are drawn in milliseconds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.errors import printable

FONT = "'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
"""Sans-serif fonts of the common systems, in order of preference."""
INK = "#1d2733"
"""Text and the most important lines."""
SOFT = "#5b6977"
"""Text of second rank."""
PALE = "#9aa7b4"
"""Axes, and what stands in the background."""
LINE = "#d4dae0"
"""Grids and frames."""
BLUE = "#1f5a92"
"""First colour of data, mostly of the model. Colour-blind readers can tell it from orange."""
ORANGE = "#b4530f"
"""Second colour of data, and of negative values."""
PALE_ORANGE = "#f2b27e"
"""Wide lines of the test under narrow ones of the model."""

Anchor = Literal["start", "middle", "end"]
_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"})


def svg_file(width: float, height: float, parts: Iterable[str]) -> str:
    """A whole file of the given size in points."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{number(width)}pt" height="{number(height)}pt" '
        f'viewBox="0 0 {number(width)} {number(height)}" font-family="{FONT}">'
    )
    return "\n".join([head, *parts, "</svg>\n"])


def number(x: float) -> str:
    """One decimal, without a trailing zero."""
    text = f"{x:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


def label(
    x: float,
    y: float,
    text: str,
    size: float = 8.0,
    colour: str = INK,
    anchor: Anchor = "start",
    *,
    bold: bool = False,
    turned: bool = False,
) -> str:
    """Text on its baseline at (x, y); `turned` text reads upwards. Markup in the text stays text."""
    where = f'transform="translate({number(x)} {number(y)}) rotate(-90)"' if turned else _at(x, y)
    weight = ' font-weight="bold"' if bold else ""
    side = "" if anchor == "start" else f' text-anchor="{anchor}"'
    shown = printable(text).translate(_ESCAPES)
    return f'<text {where} font-size="{size:.3g}" fill="{colour}"{side}{weight}>{shown}</text>'


def _at(x: float, y: float) -> str:
    return f'x="{number(x)}" y="{number(y)}"'


def rectangle(x: float, y: float, width: float, height: float, fill: str, outline: str = "") -> str:
    """A rectangle, with an outline where a colour is given for it."""
    edge = f' stroke="{outline}" stroke-width="1.6"' if outline else ""
    return f'<rect {_at(x, y)} width="{number(width)}" height="{number(height)}" fill="{fill}"{edge}/>'


def strokes(starts: NDArray, ends: NDArray, colour: str, width: float, dashes: str = "") -> str:
    """Straight lines from `starts` to `ends`, both (lines, 2), as one path; "" without lines."""
    pieces = [f"M{_pair(a)}L{_pair(b)}" for a, b in zip(starts, ends, strict=True)]
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
    if not pieces:
        return ""
    return (
        f'<path d="{"".join(pieces)}" fill="none" stroke="{colour}" stroke-width="{width:.3g}" '
        f'stroke-linecap="round"{dashed}/>'
    )


def _pair(point: NDArray) -> str:
    return f"{number(float(point[0]))} {number(float(point[1]))}"


def dots(points: NDArray, colour: str, radius: float) -> str:
    """Full circles at `points`, (n, 2)."""
    return "".join(
        f'<circle cx="{number(float(x))}" cy="{number(float(y))}" r="{radius:.3g}" fill="{colour}"/>' for x, y in points
    )


def mixed(stops: tuple[str, ...], at: float) -> str:
    """The colour at 0 … 1 on an even scale of colours."""
    place = min(max(at, 0.0), 1.0) * (len(stops) - 1)
    i = min(int(place), len(stops) - 2)
    low, high = _channels(stops[i]), _channels(stops[i + 1])
    return "#" + "".join(f"{round(c):02x}" for c in low + (place - i) * (high - low))


def _channels(colour: str) -> NDArray[np.float64]:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)], dtype=float)


def legible_on(background: str) -> str:
    """White or ink, whichever contrasts more (relative luminance of WCAG 2.1)."""
    light = _luminance(background)
    white, dark = 1.05 / (light + 0.05), (light + 0.05) / (_luminance(INK) + 0.05)
    return "#ffffff" if white > dark else INK


def _luminance(colour: str) -> float:
    c = _channels(colour) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


# ----------------------------------------------------------------------------------------------------
# Labels that fit.


def cut(text: str, length: int = 24) -> str:
    """A label that fits: long ones are cut, line breaks and control characters removed."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return clean if len(clean) <= length else clean[: length - 1] + "…"
