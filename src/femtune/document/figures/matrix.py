"""A matrix with its values written in: MAC, correlation, sensitivities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.svg import ORANGE, cut, label, legible_on, mixed, rectangle, svg_file
from femtune.document.numbers import typeset

SIDE_BY_SIDE = 12
"""Rows or columns up to which two matrices fit side by side on a page."""
_SMALL_CELLS = 24
"""Rows or columns from which cells have their smallest size."""
_SPARSE_CELLS = 100
"""Rows or columns from which only cells of large values are drawn: files of all cells would be large."""
_BLUES = ("#f7fafd", "#c3d8ea", "#75a5cf", "#2d6ca6", "#0e3a66")
"""Colours from zero to the limit; brightness falls steadily, so that grey prints show the order."""
_ORANGES = ("#f7fafd", "#f4d6bd", "#e0a06a", "#b9601f", "#6e3208")
"""Colours of negative values, from small to large."""
_LONGEST_LABEL = 32
"""Characters of a label; longer ones are cut."""
_LETTER_WIDTH = 4.75
"""Width of a letter of the labels in points, rounded up: the font of the reader is unknown."""


@dataclass(frozen=True)
class MatrixPicture:
    """What to draw: `values` (rows, columns), labels, and cells to frame.

    `signed` matrices run from −limit to limit, others from 0 to limit; NaN is an empty cell.
    """

    values: NDArray[Any]
    row_labels: tuple[str, ...]
    column_labels: tuple[str, ...]
    row_title: str
    column_title: str
    title: str = ""
    framed: tuple[tuple[int, int], ...] = field(default=())
    signed: bool = False
    limit: float = 1.0


@dataclass(frozen=True)
class _MatrixSheet:
    """Where things are, in points."""

    left: float
    top: float
    size: float
    rows: int
    columns: int

    @property
    def right(self) -> float:
        return self.left + self.columns * self.size

    @property
    def bottom(self) -> float:
        return self.top + self.rows * self.size

    def corner(self, i: int, j: int) -> tuple[float, float]:
        return self.left + j * self.size, self.top + i * self.size


def matrix_svg(picture: MatrixPicture) -> str:
    """The matrix as a picture whose cells stay legible: it grows with their number."""
    rows, columns = picture.values.shape
    left = _room(picture.row_labels) + (16.0 if picture.row_title else 4.0)
    sheet = _MatrixSheet(left, 20.0 if picture.title else 4.0, _cell_size(picture), rows, columns)
    below = _room(picture.column_labels) + (16.0 if picture.column_title else 4.0)
    width = max(sheet.right + 4.0, 5.6 * len(picture.title) + 4.0)
    return svg_file(width, sheet.bottom + below, [*_words(picture, sheet), *_cells(picture, sheet)])


def _room(labels: tuple[str, ...]) -> float:
    return _LETTER_WIDTH * max([len(cut(t, _LONGEST_LABEL)) for t in labels], default=1) + 6.0


def _cell_size(picture: MatrixPicture) -> float:
    largest = max(picture.values.shape)
    return 27.0 if largest <= SIDE_BY_SIDE else 23.0 if largest <= _SMALL_CELLS else 19.0


def _words(picture: MatrixPicture, s: _MatrixSheet) -> Iterable[str]:
    if picture.title:
        yield label(2.0, 12.0, picture.title, 9.5, bold=True)
    if picture.row_title:
        yield label(10.0, (s.top + s.bottom) / 2, picture.row_title, anchor="middle", turned=True)
    for i, text in enumerate(picture.row_labels):
        yield label(s.left - 4.0, s.corner(i, 0)[1] + s.size / 2 + 3.0, cut(text, _LONGEST_LABEL), anchor="end")
    for j, text in enumerate(picture.column_labels):
        yield label(
            s.corner(0, j)[0] + s.size / 2 + 3.0, s.bottom + 4.0, cut(text, _LONGEST_LABEL), anchor="end", turned=True
        )
    if picture.column_title:
        y = s.bottom + _room(picture.column_labels) + 10.0
        yield label((s.left + s.right) / 2, y, picture.column_title, anchor="middle")


def _cells(picture: MatrixPicture, s: _MatrixSheet) -> Iterable[str]:
    """Coloured cells with their values; in large matrices only values that are not small, so that they stand out."""
    threshold = 0.1 * picture.limit if max(picture.values.shape) > SIDE_BY_SIDE else -1.0
    font = min(8.5, 0.3 * s.size)
    # of very many cells, only those of large values are drawn
    drawn = threshold if max(picture.values.shape) > _SPARSE_CELLS else -1.0
    for i, j in np.argwhere(np.isfinite(picture.values) & (np.abs(picture.values) >= drawn)):
        value = picture.values[i, j]
        x, y = s.corner(i, j)
        colour = _colour(float(value), picture)
        yield rectangle(x + 0.5, y + 0.5, s.size - 1.0, s.size - 1.0, colour)
        if abs(value) >= threshold:
            middle = x + s.size / 2, y + s.size / 2 + 0.36 * font
            yield label(*middle, _digits(float(value)), font, legible_on(colour), "middle")
    for i, j in picture.framed:
        x, y = s.corner(i, j)
        yield rectangle(x + 0.8, y + 0.8, s.size - 1.6, s.size - 1.6, "none", ORANGE)


def _colour(value: float, picture: MatrixPicture) -> str:
    stops = _ORANGES if picture.signed and value < 0 else _BLUES
    return mixed(stops, abs(value) / picture.limit)


def _digits(value: float) -> str:
    """Two decimals, or none of values of two digits and more."""
    return typeset(f"{value:.2f}" if abs(value) < 9.995 else f"{value:.0f}")
