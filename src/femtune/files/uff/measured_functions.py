"""Data set 58 and 58b: functions at nodal DOFs.

pyuff reads the values; header, counts and kinds are checked here, because pyuff turns unreadable header fields
into zeros and returns the padding behind the declared points as data. Writers disagree whether the abscissa of
the double-precision binary form is single or double: the length decides, and only the double one is read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.uff.fields import as_float, as_int, check_count, fixed, line_at, through_pyuff, with_e_exponents
from femtune.files.uff.scan import DataSet
from femtune.modal import FrfSet
from femtune.units import UnitSystem

_HEADER_LINES = 11
"""Lines before the values of data set 58."""
# ordinate data types of data set 58
_REAL = (2, 4)
_COMPLEX = (5, 6)
_SINGLE_PRECISION = (2, 5)


@dataclass(frozen=True)
class FunctionHeader:
    """What the header of a data set 58 says; `kinds` are the specific data types of abscissa, ordinate
    numerator and denominator, `unit_labels` their texts."""

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
    functions, padded, misstated = [], [], []
    for data_set in (one for one in sets if one.number == 58):
        header = read_header(data_set)
        stored = _stored(data_set, header)
        functions.append(_function(data_set, header, stored))
        if stored > _wanted(header):
            padded.append(data_set)
        if data_set.binary and int(data_set.head[31:43]) != len(data_set.payload):
            misstated.append(data_set)
    return tuple(functions), (*_padding_notice(padded), *_length_notice(misstated))


def _length_notice(misstated: list[DataSet]) -> tuple[Notice, ...]:
    if not misstated:
        return ()
    return (Notice("uff.binary-length", where=misstated[0].where(), level="info", n_misstated=len(misstated)),)


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


def _stored(data_set: DataSet, header: FunctionHeader) -> int:
    """How many numbers the data set holds; at least as many as it declares, and only padding behind them."""
    wanted = _wanted(header)
    if data_set.binary:
        return _stored_binary(data_set, header, wanted)
    numbers = _numbers(data_set, header)
    last = len(data_set.lines) - 1
    if len(numbers) < wanted:
        _check_points(data_set, header, wanted, len(numbers), last)
    if any(numbers[wanted:]):
        _check_points(data_set, header, wanted, len(numbers), last)
    return len(numbers)


def _check_points(data_set: DataSet, header: FunctionHeader, wanted: int, stored: int, i: int) -> None:
    each = wanted // header.points
    check_count(data_set, "points", header.points, stored // each, i)
    check_count(data_set, "values", wanted, stored, i)


def _columns(header: FunctionHeader) -> list[int]:
    if header.value_type in _SINGLE_PRECISION:
        return [13] * 6
    if header.even:
        return [20] * 4
    return [13, 20, 20] if header.value_type == 6 else [13, 20, 13, 20]


def _numbers(data_set: DataSet, header: FunctionHeader) -> list[float]:
    """Every number of an ASCII body; only the last line may hold fewer than its columns."""
    columns = _columns(header)
    numbers: list[float] = []
    last = len(data_set.lines) - 1
    for i, line in enumerate(data_set.lines[_HEADER_LINES:], start=_HEADER_LINES):
        texts = fixed(with_e_exponents(line), columns)
        numbers += _line_numbers(data_set, i, [text for text in texts if text] if i == last else texts)
        if len(line) > sum(columns):
            check_count(data_set, "columns in a line", sum(columns), len(line), i)
    return numbers


def _line_numbers(data_set: DataSet, i: int, texts: list[str]) -> list[float]:
    """The numbers of a line; read strictly, which is slow, only if the quick way finds something odd."""
    try:
        quick = [float(text) for text in texts]
    except ValueError:
        return [as_float(text, data_set, i) for text in texts]
    odd = not math.isfinite(sum(quick)) or any("_" in text for text in texts)
    return [as_float(text, data_set, i) for text in texts] if odd else quick


def _stored_binary(data_set: DataSet, header: FunctionHeader, wanted: int) -> int:
    if as_int(data_set.head[13:19], data_set, 0) != 2 or data_set.head[7:13].strip() not in ("1", "2"):
        raise data_set.error("uff.value/binary-format")
    check_count(data_set, "header lines", _HEADER_LINES, len(data_set.lines), 0)
    size = 4 if header.value_type in _SINGLE_PRECISION else 8
    stored, rest = divmod(len(data_set.payload), size)
    if stored < wanted or data_set.payload[size * wanted :].strip(b"\x00\r\n") or (rest and stored == wanted):
        check_count(data_set, "bytes for its points", size * wanted, len(data_set.payload), 6)
    return stored


def _function(data_set: DataSet, header: FunctionHeader, stored: int) -> MeasuredFunction:
    raw = through_pyuff(data_set)
    x, values = np.asarray(raw["x"], dtype=float), np.asarray(raw["data"])
    each = _wanted(header) // header.points
    if not len(x) == len(values) == stored // each:
        check_count(data_set, "points that pyuff returns", stored // each, min(len(x), len(values)))
    x, values = x[: header.points], values[: header.points]
    if not (np.isfinite(x).all() and np.isfinite(values).all()):
        bad = int(np.flatnonzero(~np.isfinite(x) | ~np.isfinite(values))[0])
        raise data_set.error("uff.value/function-point", point=bad + 1)
    return MeasuredFunction(header, x, values, data_set.where())


def dof_of(node: int, direction: int) -> Dof | None:
    """The DOF of a response or reference, or None for node 0 and unknown directions."""
    if node <= 0 or abs(direction) > 6:
        return None
    return Dof(node, DIRECTIONS[abs(direction)], -1 if direction < 0 else 1)


# ----------------------------------------------------------------------------------------------------
# Measured functions as FrfSets: which of them are FRFs, of which kind, on which lines.


_KINDS = {8: "receptance", 11: "mobility", 12: "accelerance"}
# specific data types
_FREQUENCY = 18
_FORCE = 13
# function types
_UNKNOWN = 0
_FRF = 4
_COHERENCE = 6
_LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048}
_FORCES = {"n": 1.0, "mn": 1e-3, "kn": 1e3, "lbf": 4.4482216152605, "lb": 4.4482216152605}
_UNIT_TOLERANCE = 1e-3
"""Relative difference up to which two units are the same: files round factors to four digits and more."""
_LARGEST_COHERENCE = 1.0 + 1e-3
"""Coherence above which a value is wrong; single precision and averaging leave values slightly above 1."""

Pairs = dict[tuple[Dof, Dof], MeasuredFunction]
Coherences = dict[tuple[object, ...], NDArray]


def frf_sets(
    functions: Sequence[MeasuredFunction], units: UnitSystem, source: str
) -> tuple[tuple[FrfSet, ...], tuple[Notice, ...]]:
    """The FRFs, one FrfSet for each kind and set of frequency lines, in the file's units.

    Raises
    ------
    FemtuneError : ``uff.duplicate-frf``; ``uff.units-contradict`` where a unit label contradicts `units`
    """
    groups: dict[tuple[object, ...], Pairs] = {}
    unused: dict[str, list[MeasuredFunction]] = {}
    untyped = []
    coherences = _coherences(functions)
    for function in functions:
        if _is_coherence(function):
            continue
        if why := _why_no_frf(function):
            unused.setdefault(why, []).append(function)
            continue
        _check_labels(function, units)
        untyped += [function] if function.header.function_type == _UNKNOWN else []
        _add(groups.setdefault(_group(function), {}), function)
    sets = tuple(_frf_set(str(key[0]), pairs, source, coherences) for key, pairs in groups.items())
    used = {_place(function) for pairs in groups.values() for function in pairs.values()}
    alone = [one for one in functions if _is_coherence(one) and _place(one) not in used]
    return sets, (*_unused(unused), *_untyped(untyped), *_unused_coherence(alone))


def _is_coherence(function: MeasuredFunction) -> bool:
    """True for a coherence between two DOFs over frequency, with values from 0 to 1."""
    header, values = function.header, function.values
    places = dof_of(*header.response), dof_of(*header.reference)
    right = header.function_type == _COHERENCE and header.kinds[0] == _FREQUENCY and None not in places
    return (
        right and not np.iscomplexobj(values) and bool((values >= 0.0).all() and (values <= _LARGEST_COHERENCE).all())
    )


def _coherences(functions: Sequence[MeasuredFunction]) -> Coherences:
    """By node and direction of response and reference, whatever their signs, and frequency lines."""
    return {_place(one): one.values for one in functions if _is_coherence(one)}


def _place(function: MeasuredFunction) -> tuple[object, ...]:
    (response, at), (reference, driven) = function.header.response, function.header.reference
    return response, abs(at), reference, abs(driven), function.x.tobytes()


def _why_no_frf(function: MeasuredFunction) -> str:
    header = function.header
    abscissa, numerator, denominator = header.kinds
    if header.function_type not in (_FRF, _UNKNOWN):
        return f"of function type {header.function_type}, not an FRF"
    if abscissa != _FREQUENCY or not np.iscomplexobj(function.values):
        return "not complex functions of frequency"
    if numerator not in _KINDS or denominator != _FORCE:
        return f"not motion over force (data types {numerator} over {denominator})"
    if None in (dof_of(*header.response), dof_of(*header.reference)):
        return "without response or reference node"
    return ""


def _unused(unused: dict[str, list[MeasuredFunction]]) -> Iterable[Notice]:
    for why, functions in unused.items():
        yield Notice("uff.not-an-frf", where=functions[0].where, n_functions=len(functions), reason=why)


def _unused_coherence(functions: Sequence[MeasuredFunction]) -> Iterable[Notice]:
    if functions:
        yield Notice("uff.unused-coherence", where=functions[0].where, n_functions=len(functions))


def _untyped(functions: Sequence[MeasuredFunction]) -> Iterable[Notice]:
    if functions:
        yield Notice("uff.function-type", where=functions[0].where, level="info", n_functions=len(functions))


def _group(function: MeasuredFunction) -> tuple[object, ...]:
    kind = _KINDS[function.header.kinds[1]]
    return kind, len(function.x), function.x.tobytes()


def _add(pairs: Pairs, function: MeasuredFunction) -> None:
    response, reference = dof_of(*function.header.response), dof_of(*function.header.reference)
    assert response is not None
    assert reference is not None
    first = pairs.setdefault((response, reference), function)
    if first is not function:
        raise FemtuneError(
            "uff.duplicate-frf",
            where=function.where,
            values={"first": first.where},
            reference=reference,
            response=response,
        )


def _frf_set(kind: str, pairs: Pairs, source: str, coherences: Coherences) -> FrfSet:
    responses = list(dict.fromkeys(response for response, _ in pairs))
    references = list(dict.fromkeys(reference for _, reference in pairs))
    lines = next(iter(pairs.values())).x
    values = np.full((len(responses), len(references), len(lines)), complex(np.nan, np.nan))
    coherence = np.full(values.shape, np.nan)
    for (response, reference), function in pairs.items():
        at = responses.index(response), references.index(reference)
        values[at] = function.values
        coherence[at] = np.minimum(coherences.get(_place(function), coherence[at]), 1.0)
    some = coherence if np.isfinite(coherence).any() else None
    return FrfSet(lines, values, DofSet(responses), DofSet(references), kind, some, source)


def _check_labels(function: MeasuredFunction, units: UnitSystem) -> None:
    """Unit labels such as m/s2 and N are words, but where they are understood they must not contradict."""
    _, motion, force = function.header.unit_labels
    length = _LENGTHS.get(motion.lower().split("/")[0].strip())
    if abs(function.header.response[1]) > 3:
        length = None
    _check_label(function, motion, length, units.length, "m")
    moment = abs(function.header.reference[1]) > 3
    _check_label(function, force, None if moment else _FORCES.get(force.lower().strip()), units.force, "N")
    if motion.lower().strip() == "g":
        _check_label(function, motion, 9.80665, units.length, "m")


def _check_label(function: MeasuredFunction, label: str, stated: float | None, used: float, unit: str) -> None:
    if stated is not None and abs(stated / used - 1) > _UNIT_TOLERANCE:
        raise FemtuneError(
            "uff.units-contradict",
            where=function.where,
            values={"label means": f"{stated:g} {unit}", "units of the file": f"{used:g} {unit}"},
            label=label,
        )
