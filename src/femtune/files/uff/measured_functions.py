"""Data set 58 and 58b: functions at nodal DOFs.

Header, counts and values are read strictly: other readers turn unreadable fields of the header into zeros and return
the padding behind the declared points as data. Writers disagree whether the abscissa of the double-precision binary
form is single or double: the length decides, and only the double one is read. The order of the bytes that a header
states is wrong in some files: if the values make no sense in this order, and do in the other one, the other is taken.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DIRECTIONS, Dof
from femtune.errors import Notice, Where
from femtune.files.uff.fields import as_float, as_int, check_count, fixed, free_numbers, line_at, with_e_exponents
from femtune.files.uff.scan import DataSet

_HEADER_LINES = 11
"""Lines before the values of data set 58."""
FREQUENCY = 18
"""Specific data type of an abscissa of frequencies."""
# ordinate data types of data set 58
_REAL = (2, 4)
_COMPLEX = (5, 6)
_SINGLE_PRECISION = (2, 5)


@dataclass(frozen=True)
class FunctionHeader:
    """What the header of a data set 58 says; `kinds` are the specific data types of abscissa, ordinate
    numerator and denominator, `axis_labels` and `unit_labels` their texts."""

    id_lines: tuple[str, ...]
    function_type: int
    response: tuple[int, int]
    reference: tuple[int, int]
    value_type: int
    points: int
    even: bool
    start: float
    step: float
    kinds: tuple[int, int, int]
    unit_labels: tuple[str, str, str]
    axis_labels: tuple[str, str, str] = ("", "", "")


@dataclass(frozen=True, eq=False)
class MeasuredFunction:
    """One data set 58: `x` (k,) and `values` (k,) in the file's units, as many as its header declares."""

    header: FunctionHeader
    x: NDArray[np.float64]
    values: NDArray
    where: Where


def read_functions(sets: Iterable[DataSet]) -> tuple[tuple[MeasuredFunction, ...], tuple[Notice, ...]]:
    """All functions of a file.

    Raises
    ------
    FemtuneError : ``uff.truncated`` for fewer points than declared, ``uff.count`` for more (zeros behind the
        declared points are padding), ``uff.value``, ``uff.unreadable``
    """
    functions, padded, misstated, swapped, free = [], [], [], [], []
    for data_set in (one for one in sets if one.number == 58):
        header = read_header(data_set)
        body = _binary_body(data_set, header) if data_set.binary else _text_body(data_set, header)
        functions.append(_function(data_set, header, body))
        padded += [data_set] if len(body.numbers) > _wanted(header) else []
        swapped += [data_set] if body.swapped else []
        free += [data_set] if body.free else []
        if data_set.binary and int(data_set.binary_form[3]) != len(data_set.payload):
            misstated.append(data_set)
    told = (*_padding_notice(padded), *_length_notice(misstated), *_order_notice(swapped), *_free_notice(free))
    return tuple(functions), told


def _length_notice(misstated: list[DataSet]) -> tuple[Notice, ...]:
    if not misstated:
        return ()
    return (Notice("uff.binary-length", where=misstated[0].where(), level="info", n_misstated=len(misstated)),)


def _order_notice(swapped: list[DataSet]) -> tuple[Notice, ...]:
    if not swapped:
        return ()
    stated = "little-endian" if swapped[0].binary_form[0] == "1" else "big-endian"
    return (Notice("uff.byte-order", where=swapped[0].where(), n_swapped=len(swapped), stated=stated),)


def _free_notice(free: list[DataSet]) -> tuple[Notice, ...]:
    if not free:
        return ()
    return (Notice("uff.free-columns", where=free[0].where(), level="info", n_free=len(free)),)


def _padding_notice(padded: list[DataSet]) -> tuple[Notice, ...]:
    if not padded:
        return ()
    return (Notice("uff.padding", where=padded[0].where(), level="info", n_padded=len(padded)),)


def read_header(data_set: DataSet) -> FunctionHeader:
    """The eleven header lines, strictly (errors ``uff.value``, ``uff.truncated``)."""
    line_at(data_set, _HEADER_LINES - 1)
    names = fixed(data_set.lines[5], [5, 10, 5, 10, 11, 10, 4, 11, 10, 4])
    function_type, response, response_at, reference, reference_at = (
        as_int(names[k], data_set, 5, blank=0) for k in (0, 5, 6, 8, 9)
    )
    form = fixed(data_set.lines[6], [10, 10, 10, 13, 13, 13])
    value_type, points, spacing = (as_int(text, data_set, 6) for text in form[:3])
    start, step = (as_float(text or "0", data_set, 6) for text in form[3:5])
    axes = [fixed(data_set.lines[i], [10, 5, 5, 5, 21, 21]) for i in (7, 8, 9)]
    kinds = [as_int(axis[0], data_set, 7 + k) for k, axis in enumerate(axes)]
    header = FunctionHeader(
        id_lines=tuple(line.strip() for line in data_set.lines[:5]),
        function_type=function_type,
        response=(response, response_at),
        reference=(reference, reference_at),
        value_type=value_type,
        points=points,
        even=spacing == 1,
        start=start,
        step=step,
        kinds=(kinds[0], kinds[1], kinds[2]),
        unit_labels=(axes[0][5], axes[1][5], axes[2][5]),
        axis_labels=(axes[0][4], axes[1][4], axes[2][4]),
    )
    _check_header(data_set, header, spacing)
    return header


def _check_header(data_set: DataSet, header: FunctionHeader, spacing: int) -> None:
    if header.value_type not in _REAL + _COMPLEX or spacing not in (0, 1) or header.points < 1:
        values = {"type": header.value_type, "points": header.points, "spacing": spacing}
        raise data_set.error("uff.value/function-header", 6, values=values)


def _wanted(header: FunctionHeader) -> int:
    """How many numbers the declared points take."""
    each = (2 if header.value_type in _COMPLEX else 1) + (0 if header.even else 1)
    return each * header.points


@dataclass(frozen=True, eq=False)
class _Body:
    """Every number of a data set, padding among them.

    Parameters
    ----------
    numbers : as they stand in the file
    swapped : whether the bytes are in the other order than stated
    free : whether numbers are not in the columns of the format
    """

    numbers: NDArray[np.float64]
    swapped: bool = False
    free: bool = False


def _check_stored(data_set: DataSet, header: FunctionHeader, numbers: NDArray[np.float64]) -> None:
    """At least as many numbers as the header declares, and only padding behind them."""
    wanted, last = _wanted(header), len(data_set.lines) - 1
    if len(numbers) < wanted or np.any(numbers[wanted:] != 0.0):
        each = wanted // header.points
        check_count(data_set, "points", header.points, len(numbers) // each, last)
        check_count(data_set, "values", wanted, len(numbers), last)


def _columns(header: FunctionHeader) -> list[int]:
    if header.value_type in _SINGLE_PRECISION:
        return [13] * 6
    if header.even:
        return [20] * 4
    return [13, 20, 20] if header.value_type == 6 else [13, 20, 13, 20]


def _text_body(data_set: DataSet, header: FunctionHeader) -> _Body:
    """Every number of an ASCII body; only the last line may hold fewer than its columns."""
    columns = _columns(header)
    numbers: list[float] = []
    free = False
    last = len(data_set.lines) - 1
    for i, line in enumerate(data_set.lines[_HEADER_LINES:], start=_HEADER_LINES):
        texts = fixed(with_e_exponents(line), columns)
        found = _quick([text for text in texts if text] if i == last else texts)
        if found is None or len(line) > sum(columns):
            free_line = free_numbers(line)
            free = free or free_line is not None
            found = free_line if free_line is not None else _strict(data_set, i, texts, header, not numbers)
            if free_line is None and len(line) > sum(columns):
                check_count(data_set, "columns in a line", sum(columns), len(line), i)
        numbers += found
    body = _Body(np.array(numbers), free=free)
    _check_stored(data_set, header, body.numbers)
    return body


def _quick(texts: list[str]) -> list[float] | None:
    """The numbers of a line in the usual way, None if anything about them is odd."""
    try:
        quick = [float(text) for text in texts]
    except ValueError:
        return None
    return None if not math.isfinite(sum(quick)) or any("_" in text for text in texts) else quick


_NOT_A_NUMBER = re.compile(r"[+-]?(nan(\(\w*\))?|inf(inity)?|\d\.#\w+|\*+)", re.IGNORECASE)
"""What programs write in place of the quotient of zeros at 0 Hz."""


def _strict(data_set: DataSet, i: int, texts: list[str], header: FunctionHeader, first: bool) -> list[float]:
    """The numbers of a line as Fortran writes them; values of the first line of frequency may be undefined at 0 Hz."""
    undefined = _wanted(header) // header.points if first and _begins_at_zero(header, texts[0]) else 0
    return [
        math.nan if k < undefined and _NOT_A_NUMBER.fullmatch(text) else as_float(text, data_set, i)
        for k, text in enumerate(texts)
    ]


def _begins_at_zero(header: FunctionHeader, first: str) -> bool:
    if header.kinds[0] != FREQUENCY:
        return False
    return header.start == 0.0 if header.even else _quick([first]) == [0.0]


# ----------------------------------------------------------------------------------------------------
# Binary bodies.


_WILD = {4: 18.0, 8: 30.0}
"""Decimal exponents, by bytes of a number, that no measured value has; of bytes in the wrong order most values have
larger ones."""
_FEW_WILD = 0.02
"""Part of the values that may have such an exponent in the right order: lines that an integration has spoilt."""
_MANY_WILD = 0.25
"""Part of the values beyond which the order of the bytes is doubted."""


def _binary_body(data_set: DataSet, header: FunctionHeader) -> _Body:
    order, form = data_set.binary_form[:2]
    check_count(data_set, "header lines", _HEADER_LINES, len(data_set.lines), 0)
    wanted = _wanted(header)
    size = 4 if header.value_type in _SINGLE_PRECISION else 8
    stored, rest = divmod(len(data_set.payload), size)
    if stored < wanted or data_set.payload[size * wanted :].strip(b"\x00\r\n") or (rest and stored == wanted):
        check_count(data_set, "bytes for its points", size * wanted, len(data_set.payload), 6)
    stated, other = ("<", ">") if order == "1" else (">", "<")
    raw = data_set.payload[: size * stored]
    with np.errstate(all="ignore"):  # bytes in the wrong order are any number, signalling NaN among them
        values, opposite = (np.frombuffer(raw, f"{one}f{size}").astype(float) for one in (stated, other))
    wild, opposite_wild = (_wild(one[:wanted], size) for one in (values, opposite))
    known = order in ("1", "2") and form == "2"
    if opposite_wild <= _FEW_WILD and wild > max(_MANY_WILD, 2.0 * opposite_wild):
        return _Body(opposite, swapped=True)
    # of an unknown format the values must speak for IEEE numbers
    if not known and wild > _FEW_WILD:
        raise data_set.error("uff.value/binary-format")
    if wild > 0.5 and len(raw) > 8 * size:
        raise data_set.error("uff.value/binary-values", values={"implausible": f"{wild:.0%}"})
    return _Body(values)


def _wild(values: NDArray[np.float64], size: int) -> float:
    """Part of the values that are not finite, or of a magnitude that nobody measures."""
    with np.errstate(all="ignore"):
        exponent = np.abs(np.log10(np.abs(values)))
    # zero is measured wherever a channel is off
    odd = ~np.isfinite(values) | ((values != 0.0) & (exponent > _WILD[size]))
    return float(np.mean(odd)) if len(values) else 0.0


def _function(data_set: DataSet, header: FunctionHeader, body: _Body) -> MeasuredFunction:
    each = _wanted(header) // header.points
    table = body.numbers[: _wanted(header)].reshape(header.points, each)
    lines = header.start + header.step * np.arange(header.points) if header.even else table[:, 0]
    x = np.asarray(lines, dtype=float)
    parts = table if header.even else table[:, 1:]
    values = parts[:, 0] + 1j * parts[:, 1] if header.value_type in _COMPLEX else parts[:, 0]
    at_zero = (x == 0.0) & (header.kinds[0] == FREQUENCY)
    bad = ~np.isfinite(x) | (~np.isfinite(values) & ~at_zero)
    if bad.any():
        raise data_set.error("uff.value/function-point", point=int(np.flatnonzero(bad)[0]) + 1)
    return MeasuredFunction(header, x, np.where(np.isfinite(values), values, np.nan), data_set.where())


def dof_of(node: int, direction: int) -> Dof | None:
    """The DOF of a response or reference, or None for node 0 and unknown directions."""
    if node <= 0 or abs(direction) > 6:
        return None
    return Dof(node, DIRECTIONS[abs(direction)], -1 if direction < 0 else 1)
