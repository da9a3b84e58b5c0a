"""Frequency response functions and spectra from arrays and tables: NumPy, MATLAB, HDF5, CSV and other text.

Such files do not state what their axes mean. The user states it; only axes that fit in one order alone are found by
their lengths.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.files.records.arrays import named
from femtune.files.records.read import format_named, position_of
from femtune.files.records.table import COMPLEX_KINDS, NUMBER_KINDS, REAL_KINDS, RecordTable, problem
from femtune.modal import FrfSet

_LARGEST_COHERENCE = 1.0 + 1e-3
"""Coherence above which a value is wrong; single precision and averaging leave values slightly above 1."""
_SAME_LINES = 1e-6
"""Relative difference up to which frequency lines of two files are the same: text has six digits and more."""


@dataclass(frozen=True)
class FunctionColumn:
    """One function: its column in a text, or its position from 1 along the axis ``function`` of an array.

    Parameters
    ----------
    response, reference : its DOFs
    column : number from 1 or, in a text, name; of the real part where `imaginary` is given
    imaginary, coherence : columns of a text
    """

    response: Dof
    reference: Dof
    column: int | str
    imaginary: int | str | None = None
    coherence: int | str | None = None


@dataclass(frozen=True)
class FunctionLayout:
    """What the user states about a file of functions.

    Parameters
    ----------
    kind : receptance, mobility or accelerance; "" for auto and cross spectra, whose auto spectra may be real
    responses, references : DOFs along these axes of an array
    functions : of a text, or along the axis ``function``
    axes : names of the axes of the array, from `AXES`; () where their lengths decide
    variable : complex array, or its real part where `imaginary` names the other one
    coherence : array of the same axes
    frequency : array or column of the frequency lines in Hz
    start_hz, step_hz : instead of `frequency`
    factor : factor of the values
    format : of the file; by extension where None
    """

    kind: str
    responses: tuple[Dof, ...] = ()
    references: tuple[Dof, ...] = ()
    functions: tuple[FunctionColumn, ...] = ()
    axes: tuple[str, ...] = ()
    variable: str | None = None
    imaginary: str | None = None
    coherence: str | None = None
    frequency: int | str | None = None
    start_hz: float | None = None
    step_hz: float | None = None
    factor: float = 1.0
    format: str | None = None


@dataclass(frozen=True, eq=False)
class FunctionValues:
    """Functions of frequency as a file has them.

    Parameters
    ----------
    freq_hz : (k,) lines
    values : (responses, references, k) complex; NaN for pairs that were not measured
    coherence : likewise, or None
    responses, references : DOFs of the first two axes
    source : names of the files
    """

    freq_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    coherence: NDArray[np.float64] | None
    responses: DofSet
    references: DofSet
    source: str

    def frfs(self, kind: str) -> FrfSet:
        """The functions as FRFs of a kind."""
        return FrfSet(self.freq_hz, self.values, self.responses, self.references, kind, self.coherence, self.source)


def read_frfs(path: Path, layout: FunctionLayout) -> FrfSet:
    """The FRFs of a file (errors of `read_values`)."""
    return read_values(path, layout).frfs(layout.kind)


def read_function_files(files: Sequence[Path], layout: FunctionLayout) -> FrfSet:
    """The FRFs of several files (errors of `read_values_of_files`)."""
    return read_values_of_files(files, layout).frfs(layout.kind)


def read_values(path: Path, layout: FunctionLayout) -> FunctionValues:
    """The functions of a file.

    Raises
    ------
    FemtuneError : ``record.*`` for a file that cannot be read; ``frf.layout`` where the file and what is stated of it
        do not fit
    """
    if not path.is_file():
        raise problem(path, "record.missing")
    format = format_named(path, layout.format)
    if format.has == "columns":
        return _of_text(format.read_table(path), layout, path)
    if format.has != "arrays":
        raise problem(path, "frf.layout/format", format=format.key)
    named_functions = any(isinstance(one.column, str) for one in layout.functions)
    with format.open_arrays(path) as arrays:
        return (_of_vectors if named_functions else _of_arrays)(arrays, layout, path)


def read_values_of_files(files: Sequence[Path], layout: FunctionLayout) -> FunctionValues:
    """The functions of several files with the same frequency lines; `files` has that of each function of the layout.

    Raises
    ------
    FemtuneError : as `read_values`; ``frf.layout/other-lines`` where the frequency lines of two files differ
    """
    sets = []
    for path in dict.fromkeys(files):
        own = tuple(one for one, file in zip(layout.functions, files) if file == path)
        sets.append(read_values(path, replace(layout, functions=own)))
    first = sets[0]
    for path, other in zip(dict.fromkeys(files), sets):
        own_hz, first_hz = other.freq_hz, first.freq_hz
        if len(own_hz) != len(first_hz) or not np.allclose(own_hz, first_hz, rtol=_SAME_LINES, atol=0.0):
            both = {"first": first_hz, "here": own_hz}
            lines = {name: f"{len(x)}, {x[0]:g} to {x[-1]:g} Hz" for name, x in both.items()}
            raise problem(path, "frf.layout/other-lines", values=lines)
    at = {(a, b): (s, i, j) for s in sets for i, a in enumerate(s.responses) for j, b in enumerate(s.references)}
    rows, coherences = [], []
    for one in layout.functions:
        s, i, j = at[one.response, one.reference]
        rows.append(s.values[i, j])
        coherences.append(np.full(len(first.freq_hz), np.nan) if s.coherence is None else s.coherence[i, j])
    values, coherence = np.array(rows), np.array(coherences)
    some = coherence if np.isfinite(coherence).any() else None
    made = _by_function(first.freq_hz, values, some, replace(layout, factor=1.0), files[0])
    return replace(made, source=", ".join(dict.fromkeys(map(str, files))))


# ----------------------------------------------------------------------------------------------------
# Text: one column for each real or imaginary part.


def _of_text(table: RecordTable, layout: FunctionLayout, path: Path) -> FunctionValues:
    if not layout.functions:
        raise problem(path, "frf.layout/functions", columns=len(table.values))
    if not np.isfinite(table.values).all():
        raise problem(path, "frf.layout/values")

    def column(name: int | str) -> NDArray:
        return table.values[position_of(table, name)]

    lines = len(table.values[0])
    freq = column(layout.frequency) if layout.frequency is not None else _even_lines(layout, lines, path)
    real = [column(one.column) for one in layout.functions]
    _check_columns(table, layout, path)
    if real_only := [one.column for one in layout.functions if one.imaginary is None and not _is_auto(one, layout)]:
        raise problem(path, "frf.layout/real", values={"without imaginary: column": real_only[0]})
    other = [np.zeros(lines) if one.imaginary is None else column(one.imaginary) for one in layout.functions]
    values = np.array([a + 1j * b for a, b in zip(real, other)])
    some = any(one.coherence is not None for one in layout.functions)
    unknown = np.full(lines, np.nan)
    coherence = [unknown if one.coherence is None else column(one.coherence) for one in layout.functions]
    return _by_function(freq, values, np.array(coherence) if some else None, layout, path)


def _is_auto(one: FunctionColumn, layout: FunctionLayout) -> bool:
    """Whether a function is an auto spectrum, which is real."""
    return not layout.kind and one.response == one.reference


def _check_columns(table: RecordTable, layout: FunctionLayout, path: Path) -> None:
    """Every column means one thing."""
    named = [("frequency", layout.frequency)]
    for one in layout.functions:
        dofs = f"{one.response}, {one.reference}"
        named += [
            (f"{dofs} real", one.column),
            (f"{dofs} imaginary", one.imaginary),
            (f"{dofs} coherence", one.coherence),
        ]
    seen: dict[int, str] = {}
    for meaning, name in named:
        if name is None:
            continue
        at = position_of(table, name)
        if at in seen:
            both = {"first": seen[at], "second": meaning}
            raise problem(path, "frf.layout/column-twice", values=both, column=name)
        seen[at] = meaning


def _by_function(
    freq: NDArray, values: NDArray, coherence: NDArray | None, layout: FunctionLayout, path: Path
) -> FunctionValues:
    """Functions (f, k) put in their places; a pair that was not measured is NaN."""
    responses = list(dict.fromkeys(one.response for one in layout.functions))
    references = list(dict.fromkeys(one.reference for one in layout.functions))
    at = [(responses.index(one.response), references.index(one.reference)) for one in layout.functions]
    if twice := next((pair for pair in at if at.count(pair) > 1), None):
        raise problem(path, "frf.layout/twice", response=responses[twice[0]], reference=references[twice[1]])
    placed = [np.full((len(responses), len(references), len(freq)), np.nan, dtype=complex) for _ in range(2)]
    for source, target in zip((values, coherence), placed):
        for row, pair in zip(() if source is None else source, at):
            target[pair] = row
    return _made(freq, placed[0], None if coherence is None else placed[1].real, responses, references, layout, path)


# ----------------------------------------------------------------------------------------------------
# Arrays of up to three axes, and perhaps one for real and imaginary part.


def _of_arrays(arrays: Mapping[str, Any], layout: FunctionLayout, path: Path) -> FunctionValues:
    values = _array(path, arrays, layout.variable or _only_name(arrays, path))
    freq = None if layout.frequency is None else _array(path, arrays, str(layout.frequency)).real.ravel()
    axes = layout.axes or _axes_by_length(values.shape, layout, freq, path)
    values = _with_axes(values, axes, path)
    if layout.imaginary is not None:
        other = _with_axes(_array(path, arrays, layout.imaginary), axes, path)
        if other.shape != values.shape or np.iscomplexobj(values) or np.iscomplexobj(other):
            raise problem(path, "frf.layout/parts", values={"real": values.shape, "imaginary": other.shape})
        values = values + 1j * other
    elif "part" in axes:
        values, axes = _joined_parts(values, axes, path)
    if not np.iscomplexobj(values):
        raise problem(path, "frf.layout/real")
    coherence = None
    if layout.coherence is not None:
        coherence = _with_axes(_array(path, arrays, layout.coherence), axes, path)
        if coherence.shape != values.shape or np.iscomplexobj(coherence):
            sizes = {"functions": values.shape, "coherence": coherence.shape}
            raise problem(path, "frf.layout/coherence", values=sizes)
    lines = values.shape[axes.index("frequency")]
    freq = _even_lines(layout, lines, path) if freq is None else freq
    _check_length("frequency", lines, len(freq), path)
    if "function" in axes:
        order = [axes.index(name) for name in ("function", "frequency")]
        rows, more = values.transpose(order), None if coherence is None else coherence.transpose(order)
        keep = _numbers_of(layout, len(rows), path)
        return _by_function(freq, rows[keep], None if more is None else more[keep], layout, path)
    for name, dofs in (("response", layout.responses), ("reference", layout.references)):
        if not dofs:
            raise problem(path, "frf.layout/no-dofs", key=f"{name}s")
        _check_length(name, values.shape[axes.index(name)] if name in axes else 1, len(dofs), path)
    bounded = None if coherence is None else _in_order(coherence, axes)
    return _made(freq, _in_order(values, axes), bounded, layout.responses, layout.references, layout, path)


def _of_vectors(arrays: Mapping[str, Any], layout: FunctionLayout, path: Path) -> FunctionValues:
    """An array for each function, which `column` names; another one for its imaginary part if it is real."""

    def vector(name: int | str) -> NDArray:
        return _array(path, arrays, str(name)).ravel()

    rows: list[NDArray] = []
    for one in layout.functions:
        row = vector(one.column)
        if one.imaginary is not None:
            other = vector(one.imaginary)
            if np.iscomplexobj(row) or np.iscomplexobj(other) or len(row) != len(other):
                raise problem(path, "frf.layout/parts", values={"real": row.shape, "imaginary": other.shape})
            row = row + 1j * other
        if not np.iscomplexobj(row) and not _is_auto(one, layout):
            raise problem(path, "frf.layout/real", values={"without imaginary: column": one.column})
        _check_length("frequency", len(row), len(rows[0]) if rows else len(row), path)
        rows.append(row)
    lines = len(rows[0])
    freq = _even_lines(layout, lines, path) if layout.frequency is None else vector(layout.frequency).real
    _check_length("frequency", lines, len(freq), path)
    coherence = np.full((len(rows), lines), np.nan)
    for i, one in enumerate(layout.functions):
        if one.coherence is not None:
            known = vector(one.coherence)
            if np.iscomplexobj(known) or len(known) != lines:
                raise problem(path, "frf.layout/coherence", values={"functions": lines, "coherence": known.shape})
            coherence[i] = known
    return _by_function(freq, np.array(rows), coherence if np.isfinite(coherence).any() else None, layout, path)


def _array(path: Path, arrays: Mapping[str, Any], name: str) -> NDArray:
    array = np.asarray(named(path, arrays, name))
    if array.dtype.kind not in (*REAL_KINDS, *COMPLEX_KINDS) or not array.size:
        raise problem(path, "frf.layout/no-numbers", name=name, found=f"{array.shape} of type {array.dtype}")
    values = array.astype(complex if array.dtype.kind in COMPLEX_KINDS else float)
    return np.atleast_1d(values)


def _only_name(arrays: Mapping[str, Any], path: Path) -> str:
    """The only complex array, or the only array."""
    distinct = {n: a for n, a in arrays.items() if "." not in n or n.replace(".", "/") not in arrays}
    kinds = {name: getattr(a, "dtype", np.dtype(object)).kind for name, a in distinct.items()}
    candidates = [n for n, kind in kinds.items() if kind in COMPLEX_KINDS] or [
        n for n, kind in kinds.items() if kind in NUMBER_KINDS
    ]
    if len(candidates) != 1:
        shown = ", ".join(f"{name} {getattr(a, 'shape', '')}" for name, a in sorted(distinct.items())[:20]) or "none"
        raise problem(path, "frf.layout/several", values={"variables": shown}, n_found=len(candidates))
    return candidates[0]


def _axes_by_length(
    shape: tuple[int, ...], layout: FunctionLayout, freq: NDArray | None, path: Path
) -> tuple[str, ...]:
    """The one order of the axes that fits the lengths that are known.

    Raises
    ------
    FemtuneError : ``frf.layout/axes`` where several fit, or none
    """
    known = {"response": len(layout.responses), "reference": len(layout.references)}
    if layout.functions:
        known = {"function": len(layout.functions)}
    known = {"frequency": _lines_of(shape, known, path) if freq is None else len(freq), **known}
    squeezed = tuple(n for n in shape if n > 1)
    wanted = {name: n for name, n in known.items() if n != 1}
    fitting = [p for p in itertools.permutations(wanted) if tuple(wanted[name] for name in p) == squeezed]
    if len(fitting) != 1:
        lengths = ", ".join(f"{name} {n}" for name, n in known.items())
        reason = "several orders fit" if fitting else "no order fits"
        raise problem(path, "frf.layout/axes", values={"shape": shape, "lengths": lengths}, reason=reason)
    names = iter(fitting[0])
    single = iter([name for name, n in known.items() if n == 1])
    out = [next(names) if n > 1 else next(single, "") for n in shape]
    return tuple(out)


def _lines_of(shape: tuple[int, ...], known: Mapping[str, int], path: Path) -> int:
    """Number of lines of the array if the file does not contain them: its size without the DOFs."""
    functions, size = math.prod(known.values()), math.prod(shape)
    if not functions or size % functions:
        lengths = ", ".join(f"{name} {n}" for name, n in known.items())
        reason = "the array cannot be divided into the stated DOFs"
        raise problem(path, "frf.layout/axes", values={"shape": shape, "lengths": lengths}, reason=reason)
    return size // functions


def _with_axes(values: NDArray, axes: tuple[str, ...], path: Path) -> NDArray:
    """The array with as many axes as are named: MATLAB drops the last ones of length 1, and makes vectors columns."""
    shape = list(values.shape)
    while len(shape) < len(axes):
        shape.append(1)
    for at in reversed(range(len(shape))):
        if len(shape) > len(axes) and shape[at] == 1:
            del shape[at]
    if len(shape) != len(axes):
        raise problem(path, "frf.layout/shape", values={"shape": values.shape, "axes": ", ".join(axes)})
    return values.reshape(shape)


def _joined_parts(values: NDArray, axes: tuple[str, ...], path: Path) -> tuple[NDArray, tuple[str, ...]]:
    at = axes.index("part")
    if values.shape[at] != 2 or np.iscomplexobj(values):
        raise problem(path, "frf.layout/part-axis", length=values.shape[at])
    real, imaginary = np.moveaxis(values, at, 0)
    return real + 1j * imaginary, tuple(name for name in axes if name != "part")


def _in_order(values: NDArray, axes: tuple[str, ...]) -> NDArray:
    """(responses, references, lines)."""
    missing = [name for name in ("response", "reference") if name not in axes]
    spread = values.reshape(values.shape + (1,) * len(missing))
    names = (*axes, *missing)
    return spread.transpose([names.index(name) for name in ("response", "reference", "frequency")])


def _numbers_of(layout: FunctionLayout, length: int, path: Path) -> list[int]:
    numbers = [one.column for one in layout.functions]
    wrong = [n for n in numbers if not isinstance(n, int) or not 1 <= n <= length]
    if wrong or not numbers:
        raise problem(path, "frf.layout/function-number", number=wrong[0] if wrong else "none", length=length)
    return [int(n) - 1 for n in numbers]


def _even_lines(layout: FunctionLayout, lines: int, path: Path) -> NDArray:
    if layout.step_hz is None:
        raise problem(path, "frf.layout/no-lines")
    return (layout.start_hz or 0.0) + layout.step_hz * np.arange(lines)


def _check_length(name: str, length: int, stated: int, path: Path) -> None:
    if length != stated:
        raise problem(path, "frf.layout/length", axis=name, length=length, stated=stated)


def _made(
    freq: NDArray, values: NDArray, coherence: NDArray | None, responses: Sequence[Dof], references: Sequence[Dof],
    layout: FunctionLayout, path: Path,
) -> FunctionValues:  # fmt: skip
    if not len(freq) or not np.isfinite(freq).all() or (np.diff(freq) <= 0.0).any() or freq[0] < 0.0:
        raise problem(path, "frf.layout/frequencies")
    if coherence is not None and ((coherence < 0.0) | (coherence > _LARGEST_COHERENCE)).any():
        raise problem(path, "frf.layout/coherence-range")
    missing = np.isnan(values)
    # a function that was not measured is NaN at all lines
    if np.isinf(values).any() or (missing.any(axis=2) & ~missing.all(axis=2)).any():
        raise problem(path, "frf.layout/values")
    bounded = None if coherence is None else np.minimum(coherence, 1.0)
    scaled = np.asarray(layout.factor * values, dtype=complex)
    return FunctionValues(freq, scaled, bounded, DofSet(responses), DofSet(references), str(path))
