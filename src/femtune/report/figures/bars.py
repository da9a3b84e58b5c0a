"""Rows of marks and bars: COMAC, singular values, combinations of parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from femtune.report.figures.labels import cut, room
from femtune.report.figures.svg import (
    BLUE,
    INK,
    LINE,
    ORANGE,
    PALE,
    circle,
    label,
    rectangle,
    stroke,
    svg_file,
)
from femtune.report.numbers import short, typeset

_ROW, _TOP, _BELOW = 14.0, 6.0, 30.0


def comac_svg(labels: Sequence[str], before: Sequence[float | None], after: Sequence[float | None]) -> str:
    """COMAC of each DOF: a hollow mark before, a full one after."""
    left, wide = room(labels), 220.0
    bottom = _TOP + _ROW * len(labels)
    parts = [*_names(labels, left, _TOP), *_grid(left, wide, _TOP, bottom, [(k / 5, f"{k / 5:.1f}") for k in range(6)])]
    for i, (old, new) in enumerate(zip(before, after, strict=True)):
        parts += _dumbbell(left, wide, _TOP + _ROW * (i + 0.5), old, new)
    parts.append(label(left + wide / 2, bottom + 26.0, "COMAC (hollow: before, full: after)", anchor="middle"))
    return svg_file(left + wide + 14.0, bottom + _BELOW, parts)


def _dumbbell(left: float, wide: float, y: float, old: float | None, new: float | None) -> Iterable[str]:
    if old is not None and new is not None:
        yield stroke(left + wide * old, y, left + wide * new, y, PALE, 1.2)
    if old is not None:
        yield circle(left + wide * old, y, 2.5, "#ffffff", ORANGE)
    if new is not None:
        yield circle(left + wide * new, y, 2.5, BLUE)


def _names(labels: Sequence[str], left: float, top: float) -> Iterable[str]:
    for i, text in enumerate(labels):
        yield label(left - 5.0, top + _ROW * (i + 0.5) + 3.0, cut(text), anchor="end")


def _grid(left: float, wide: float, top: float, bottom: float, ticks: Iterable[tuple[float, str]]) -> Iterable[str]:
    """Upright lines at places from 0 to 1 with their texts below."""
    for place, text in ticks:
        x = left + wide * place
        yield stroke(x, top, x, bottom, LINE, 0.6)
        yield label(x, bottom + 12.0, text, anchor="middle")
    yield stroke(left, bottom, left + wide, bottom, PALE, 0.7)


def singular_values_svg(values: Sequence[float], rank: int) -> str:
    """Singular values on a logarithmic axis; those beyond the rank say "undetermined"."""
    positive = [v for v in values[:rank] if v > 0]
    low = int(np.floor(np.log10(min([*positive, 1.0])) - 0.3))
    high = float(np.log10(max([*positive, 1.0]))) + 0.5
    left, wide, bottom = 34.0, 380.0, _TOP + _ROW * len(values)

    def place(x: float) -> float:
        return float((np.log10(x) - low) / (high - low))

    decades = range(low, int(np.floor(high)) + 1)
    parts = [*_names([str(i + 1) for i in range(len(values))], left, _TOP)]
    parts += _grid(left, wide, _TOP, bottom, [(place(10.0**k), short(10.0**k)) for k in decades])
    for i, number in enumerate(values):
        y = _TOP + _ROW * (i + 0.5)
        if i >= rank or number <= 0:
            parts.append(label(left + 4.0, y + 2.5, "undetermined: the data say nothing", 7.0, ORANGE))
            continue
        end = wide * place(number)
        parts.append(rectangle(left, y - 4.3, end, 8.6, BLUE if number >= 1.0 else PALE))
        parts.append(label(left + end + 4.0, y + 2.5, short(number), 7.0))
    one = left + wide * place(1.0)
    parts.append(stroke(one, _TOP, one, bottom, INK, 0.8, "4 2.5"))
    words = "singular value (dashed, 1: the data know as much as the prior)"
    parts.append(label(left + wide / 2, bottom + 26.0, words, anchor="middle"))
    parts.append(label(9.0, (_TOP + bottom) / 2, "combination", anchor="middle", turned=True))
    return svg_file(left + wide + 34.0, bottom + _BELOW, parts)


def combinations_svg(titles: Sequence[str], labels: Sequence[str], coefficients: Sequence[Sequence[float]]) -> str:
    """Coefficients of combinations: a panel each, a bar each parameter, the parameters at the left."""
    left, wide, gap, top = room(labels), 100.0, 14.0, 20.0
    bottom = top + _ROW * len(labels)
    parts = [*_names(labels, left, top)]
    for k, (title, shares) in enumerate(zip(titles, coefficients, strict=True)):
        x = left + k * (wide + gap)
        parts.append(label(x + wide / 2, 12.0, cut(title, 24), bold=True, anchor="middle"))
        parts += _grid(x, wide, top, bottom, [(0.02, typeset("-1")), (0.5, "0"), (0.98, "1")])
        parts.append(stroke(x + wide / 2, top, x + wide / 2, bottom, INK, 0.8))
        parts += [_share(x + wide / 2, 0.48 * wide, top + _ROW * (i + 0.5), c) for i, c in enumerate(shares)]
    return svg_file(left + len(titles) * (wide + gap) + 4.0, bottom + 18.0, parts)


def _share(zero: float, scale: float, y: float, coefficient: float) -> str:
    width = scale * abs(coefficient)
    start = zero - width if coefficient < 0 else zero
    return rectangle(start, y - 4.3, width, 8.6, ORANGE if coefficient < 0 else BLUE)
