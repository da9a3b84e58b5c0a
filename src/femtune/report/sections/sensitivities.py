"""The scaled Jacobian as pictures, a row each residual."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Block, Cell, Figure, Paragraph, Table, columns, row
from femtune.report.figures.matrix import MatrixPicture, matrix_svg
from femtune.report.numbers import counted, sensitivity, short
from femtune.report.source import Source
from femtune.study.results_update import SelectionResults

_MOST, _A_PAGE = 60, 30
_TABLE_COLUMNS, _TABLE_ROWS = 12, 40
_CAPTION = (
    "Scaled sensitivities: change of each residual over one prior standard deviation of a parameter. Residuals of "
    "several numbers, such as a shape, are shown by the root of their sum of squares."
)


def sensitivities(source: Source, selection: SelectionResults) -> list[Block]:
    """Pictures that fit a page; of many residuals the strongest."""
    values = source.array(selection.jacobian_key)
    if values is None or not values.size:
        return [Paragraph("Sensitivities: not tested.")]
    labels, joined = joined_rows(selection.row_labels, values)
    strongest = np.sort(np.argsort(-np.linalg.norm(joined, axis=1), kind="stable")[:_MOST])
    limit = float(np.abs(joined).max()) or 1.0
    parts = [strongest[i : i + _A_PAGE] for i in range(0, len(strongest), _A_PAGE)]
    some = f" The {_MOST} strongest of {len(joined)}." if len(joined) > _MOST else ""
    captions = [*[""] * (len(parts) - 1), _CAPTION + some]
    names = selection.column_labels
    return [
        _figure(joined[rows], tuple(labels[i] for i in rows), names, limit, caption)
        for rows, caption in zip(parts, captions, strict=True)
    ]


def page_table(selection: SelectionResults) -> list[Block]:
    """The table of the frequencies where it fits a page; the pictures show the others."""
    fits = len(selection.column_labels) <= _TABLE_COLUMNS and len(selection.sensitivities) <= _TABLE_ROWS
    return [frequency_table(selection, selection.column_labels)] if fits and selection.sensitivities else []


def frequency_table(selection: SelectionResults, names: Sequence[str]) -> Table:
    """Change of each compared frequency in % for 1 % of the parameters `names`."""
    heads = columns("Configuration", "Mode", *(f">{name}" for name in names))
    places = [selection.column_labels.index(name) for name in names]
    rows = [
        row(s.configuration, s.test_label, *(_number(s.percent_per_percent[i]) for i in places))
        for s in selection.sensitivities
    ]
    return Table("Change of the model's frequencies in % for a change of 1 % of the parameter", heads, tuple(rows))


def _number(value: float) -> Cell:
    text = sensitivity(value)
    return Cell(text, tone="muted" if text == "0" else "")


def joined_rows(labels: tuple[str, ...], values: NDArray[Any]) -> tuple[list[str], NDArray[np.float64]]:
    """Rows of one label joined: a single one as it is, several by the root of their sum of squares."""
    rows: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        rows.setdefault(label, []).append(i)
    found = [values[at[0]] if len(at) == 1 else np.linalg.norm(values[at], axis=0) for at in rows.values()]
    return list(rows), np.array(found)


def _figure(
    values: NDArray[np.float64], rows: tuple[str, ...], columns: tuple[str, ...], limit: float, caption: str
) -> Figure:
    picture = MatrixPicture(values, rows, columns, "", "", signed=True, limit=limit)
    i, j = np.unravel_index(int(np.abs(values).argmax()), values.shape)
    alt = (
        f"Scaled sensitivities, {counted(len(rows), 'row')}; the largest is {short(float(values[i, j]))}, "
        f"{rows[i]} to {columns[j]}"
    )
    return Figure(partial(matrix_svg, picture), caption, alt, wide=True)
