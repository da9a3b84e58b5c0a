"""Drawing of a mesh whose elements are coloured by a value: faces of shells, lines of bars, dots of others."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.figures.shapes import (
    COLOURS,
    VECTOR_FACES,
    Painting,
    direction,
    fitted,
    painted,
    rastered,
)
from femtune.document.figures.svg import INK, SOFT, dots, label, mixed, rectangle, strokes, svg_file

if TYPE_CHECKING:
    from femtune.arrays import Reals

_WIDTH = 330.0
"""Width of the drawing in points."""
_MARGIN = 6.0
"""Space around the mesh in points."""
_STRIP_HEIGHT = 26.0
"""Height of the strip with the scale of colours in points."""
_SCALE_SIZE = (90.0, 6.0)
"""Width and height of the scale of colours in points."""
_SHADES = 24
"""Distinguishable shades."""


def elements_svg(corners: Reals, values: Reals, least: str, most: str) -> str:
    """The mesh in one view, elements of larger values in front of the others where they are lines or dots.

    Parameters
    ----------
    corners : (e, 4, 3) of each element; a triangle repeats its third corner, a line its second, a dot its only one
    values : (e,) from zero
    least, most : what the ends of the scale of colours mean
    """
    points = np.where(np.isfinite(corners), corners, 0.0)
    view, height = fitted(direction(points.reshape(-1, 3)), [points.reshape(-1, 3)], _WIDTH, 0.0, _MARGIN)
    flat = view.flat(points.reshape(-1, 3)).reshape(-1, 4, 2)
    largest = float(values.max(initial=0.0)) or 1.0
    shades = np.clip(np.rint(values / largest * (_SHADES - 1)), 0, _SHADES - 1).astype(int)
    scale = [mixed(COLOURS, k / (_SHADES - 1)) for k in range(_SHADES)]
    dot = (points == points[:, :1]).all(axis=(1, 2))
    line = ~dot & (points[:, 1:] == points[:, 1:2]).all(axis=(1, 2))
    faces = np.flatnonzero(~dot & ~line)
    order = faces[np.argsort(view.depth(points[faces]).mean(axis=1), kind="stable")]
    colours = [scale[k] for k in shades[order]]
    parts = []
    if len(order) > VECTOR_FACES:
        none = np.zeros(len(order))
        parts.append(rastered(Painting(flat[order], colours, colours, none, none > 0.0), (_WIDTH, height)))
    elif len(order):
        parts.append(painted(flat[order], colours, INK, 0.3, 0.4))
    for k in range(_SHADES):
        own = line & (shades == k)
        parts.append(strokes(flat[own, 0], flat[own, 1], scale[k], 2.4))
    for k in range(_SHADES):
        parts.append(dots(flat[dot & (shades == k), 0], scale[k], 3.2))
    return svg_file(_WIDTH, height + _STRIP_HEIGHT, [*parts, *_legend(height, least, most)])


def _legend(top: float, least: str, most: str) -> Iterable[str]:
    wide, high = _SCALE_SIZE
    x, y = 0.5 * (_WIDTH - wide), top + 0.5 * _STRIP_HEIGHT
    for k in range(_SHADES):
        # a little wider than its share: no gaps between cells
        yield rectangle(x + k * wide / _SHADES, y, wide / _SHADES + 0.3, high, mixed(COLOURS, k / (_SHADES - 1)))
    yield label(x - 4.0, y + 5.4, least, 6.5, SOFT, "end")
    yield label(x + wide + 4.0, y + 5.4, most, 6.5, SOFT)
