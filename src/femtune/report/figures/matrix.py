"""A matrix with its values written in: MAC, correlation, sensitivities."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from femtune.report.figures.canvas import INK, ORANGE, cut, draw_svg
from femtune.report.numbers import typeset

SIDE_BY_SIDE = 12
"""Matrices with more rows or columns than this don't stand side by side."""
_MANY = 24


@dataclass(frozen=True)
class MatrixPicture:
    """What to draw: `values` (rows, columns), labels, and cells to frame.

    `signed` matrices run from −limit to limit, others from 0 to limit.
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


def matrix_svg(picture: MatrixPicture) -> str:
    """The matrix as a picture whose cells stay legible: it grows with their number."""
    rows, columns = picture.values.shape
    size = _cell_inches(picture)
    left, below = _room(picture.row_labels, picture.row_title), _room(picture.column_labels, picture.column_title)
    width, height = left + columns * size + 0.06, below + rows * size + (0.3 if picture.title else 0.06)
    place = (left / width, below / height, columns * size / width, rows * size / height)
    return draw_svg(width, height, lambda f: _draw(f, picture, size, place), arrange=False)


def _room(labels: tuple[str, ...], title: str) -> float:
    """Inches that labels and their title take."""
    return 0.071 * max([len(cut(t)) for t in labels], default=1) + (0.3 if title else 0.12)


def _cell_inches(picture: MatrixPicture) -> float:
    largest = max(picture.values.shape)
    return 0.46 if largest <= 6 else 0.38 if largest <= SIDE_BY_SIDE else 0.32 if largest <= _MANY else 0.26


def _draw(figure: Figure, picture: MatrixPicture, size: float, place: tuple[float, float, float, float]) -> None:
    axes = figure.add_axes(place)
    low = -picture.limit if picture.signed else 0.0
    colours = "RdBu_r" if picture.signed else "Blues"
    axes.imshow(np.ma.masked_invalid(picture.values), cmap=colours, vmin=low, vmax=picture.limit, aspect="equal")
    _labels(axes, picture)
    _numbers(axes, picture, font=min(8.0, 72.0 * size * 0.27))
    for i, j in picture.framed:
        axes.add_patch(Rectangle((j - 0.48, i - 0.48), 0.96, 0.96, fill=False, edgecolor=ORANGE, linewidth=1.6))


def _labels(axes: Axes, picture: MatrixPicture) -> None:
    rows, columns = picture.values.shape
    axes.set_xticks(range(columns), [cut(t) for t in picture.column_labels], rotation=90)
    axes.set_yticks(range(rows), [cut(t) for t in picture.row_labels])
    axes.set_xlabel(picture.column_title)
    axes.set_ylabel(picture.row_title)
    axes.set_title(picture.title)
    axes.tick_params(length=0)
    axes.set_xticks(np.arange(0.5, columns - 1), minor=True)
    axes.set_yticks(np.arange(0.5, rows - 1), minor=True)
    axes.grid(which="minor", color="white", linewidth=1.0)
    axes.tick_params(which="minor", length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _numbers(axes: Axes, picture: MatrixPicture, font: float) -> None:
    """Values in the cells; in large matrices only those that are not small, so that they stand out."""
    threshold = 0.1 * picture.limit if max(picture.values.shape) > SIDE_BY_SIDE else -1.0
    for (i, j), value in np.ndenumerate(picture.values):
        if np.isfinite(value) and abs(value) >= threshold:
            dark = abs(value) > (0.7 if picture.signed else 0.6) * picture.limit
            axes.text(j, i, _digits(value), ha="center", va="center", fontsize=font, color="white" if dark else INK)


def _digits(value: float) -> str:
    """Two decimals without the leading zero."""
    text = typeset(f"{value:.2f}" if abs(value) < 9.995 else f"{value:.0f}")
    return text.replace("0.", ".", 1) if text.lstrip("−").startswith("0.") else text
