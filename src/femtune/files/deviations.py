"""Standard deviations of measured modes in a file of their own, because Universal Files have none."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Where, each
from femtune.files.table_text import NotATable, TableText, read_table_text
from femtune.modal import ModeSet, entry_deviations, largest_entries

_SAME_FREQUENCY = 1e-4
"""Relative difference up to which modes are the same: Universal Files keep six digits of a frequency."""
_LARGEST_BYTES = 50_000_000
"""Size of a file; a thousand modes at a thousand sensors take 20 MB."""
_NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_SdOrNone = _NotNegative | None


class _File(BaseModel):
    """One entry a mode; of shapes one row a mode with an entry each DOF, in units of the shape's largest entry."""

    model_config = ConfigDict(extra="forbid", strict=True)

    freq_hz: list[_NotNegative]
    dofs: list[str]
    freq_sd_hz: list[_SdOrNone] | None = None
    damping_sd: list[_SdOrNone] | None = None
    shape_sd: list[list[_SdOrNone]] | None = None
    covariance: list[list[_Finite]] | None = None


def deviations_text(modes: ModeSet) -> str | None:
    """The file's text; None where the modes have no standard deviations."""
    if modes.freq_sd_hz is None and modes.shapes_sd is None:
        return None
    shapes = None
    if modes.shapes_sd is not None:
        shapes = [_listed(sd) for sd in (modes.shapes_sd / largest_entries(modes.shapes)).T]
    known = modes.covariance is not None and bool(np.isfinite(modes.covariance).all())
    content = {
        "freq_hz": modes.freq_hz.tolist(),
        "dofs": [str(dof) for dof in modes.dofs],
        "freq_sd_hz": None if modes.freq_sd_hz is None else _listed(modes.freq_sd_hz),
        "damping_sd": None if modes.damping_sd is None else _listed(modes.damping_sd),
        "shape_sd": shapes,
        "covariance": modes.covariance.tolist() if known and modes.covariance is not None else None,
    }
    return json.dumps(content, indent=1, allow_nan=False)


def _listed(values: Reals) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


def with_deviations(modes: ModeSet, path: Path, labels: Sequence[str] | None = None) -> ModeSet:
    """The modes of a test with the standard deviations of a file: JSON as `deviations_text` writes it, or a table.

    Parameters
    ----------
    labels : of the modes, by which a table names them; their own without

    Raises
    ------
    FemtuneError : ``test.deviations`` for a file that cannot be read, has another form, or is of other modes;
        ``test.deviations-table``, with the line
    FemtuneErrors : of several lines of a table
    """
    if path.suffix.lower() != ".json":
        return _with_table(modes, path, modes.labels if labels is None else labels)
    file = _read(path)
    m, n = len(file.freq_hz), len(file.dofs)
    if m != len(modes) or not np.allclose(file.freq_hz, modes.freq_hz, rtol=_SAME_FREQUENCY, atol=0.0):
        raise _other(path, "frequencies in Hz", file.freq_hz, modes.freq_hz)
    shapes_sd = None
    if file.shape_sd is not None:
        if any(len(row) != n for row in file.shape_sd) or len(file.shape_sd) != m:
            raise _bad(path, f"shape_sd must have {m} rows of {n} entries")
        at = _positions(path, file.dofs, modes.dofs)
        shapes_sd = entry_deviations(np.array([_numbers(row) for row in file.shape_sd]).T[at], modes.shapes)
    for key, values in (("freq_sd_hz", file.freq_sd_hz), ("damping_sd", file.damping_sd)):
        if values is not None and len(values) != m:
            raise _bad(path, f"{key} must have {m} entries")
    covariance = file.covariance
    if covariance is not None and (len(covariance) != 2 * m or any(len(row) != 2 * m for row in covariance)):
        raise _bad(path, f"covariance must have {2 * m} rows of {2 * m} entries")
    try:
        return replace(
            modes,
            freq_sd_hz=None if file.freq_sd_hz is None else _numbers(file.freq_sd_hz),
            damping_sd=None if file.damping_sd is None else _numbers(file.damping_sd),
            shapes_sd=shapes_sd,
            covariance=None if covariance is None else np.array(covariance),
        )
    except FemtuneError as error:
        raise _bad(path, error.what) from error


def _numbers(values: list[float | None]) -> Reals:
    return np.array([np.nan if v is None else v for v in values])


def _positions(path: Path, labels: list[str], dofs: DofSet) -> list[int]:
    """Of the DOFs of the modes in the file; the sign of a DOF does not matter to a standard deviation."""
    try:
        given = {(d.node, d.direction): i for i, d in enumerate(DofSet.parse(labels))}
    except FemtuneError as error:
        raise _bad(path, error.what) from error
    missing = [str(d) for d in dofs if (d.node, d.direction) not in given]
    if missing:
        raise _other(path, "sensors", labels[:8], missing[:8])
    return [given[d.node, d.direction] for d in dofs]


def _read(path: Path) -> _File:
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise _bad(path, f"it is larger than {_LARGEST_BYTES // 1_000_000} MB")
        return _File.model_validate_json(path.read_bytes())
    except OSError as error:
        raise FemtuneError("test.deviations/unreadable", where=Where(str(path)), reason=error.strerror or "") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        raise _bad(path, f"{place}: {first['msg']}") from error


def _bad(path: Path, reason: str) -> FemtuneError:
    return FemtuneError("test.deviations", where=Where(str(path)), reason=reason)


def _other(path: Path, what: str, of_file: object, of_test: object) -> FemtuneError:
    return FemtuneError(
        "test.deviations/other-test",
        where=Where(str(path)),
        values={f"{what} of the file": _shown(of_file), f"{what} of the test": _shown(of_test)},
    )


def _shown(values: object) -> str:
    entries = list(values)  # type: ignore[call-overload]
    text = ", ".join(v if isinstance(v, str) else f"{v:.5g}" for v in entries[:8])
    return text + (" …" if len(entries) > 8 else "")


# ----------------------------------------------------------------------------------------------------
# A table: a line for each standard deviation.


_COLUMNS = ("mode", "dof", "sigma")
_FREQUENCY = "frequency"
_DAMPING = "damping"
_MOST_LINES = 1_000_000
"""Lines of a table; a thousand modes at a thousand sensors have as many."""


def _with_table(modes: ModeSet, path: Path, labels: Sequence[str]) -> ModeSet:
    """The modes with the standard deviations of a table; those that it does not state are unknown (NaN)."""
    rows = {(dof.node, dof.direction): i for i, dof in enumerate(modes.dofs)}
    measured = ~np.isnan(modes.shapes)
    deviations: dict[str | tuple[int, str], Reals] = {}
    lines: dict[tuple[str, str | tuple[int, str]], int] = {}
    entry = _table(path)

    def value(row: tuple[int, tuple[str, ...]]) -> tuple[str | tuple[int, str], int, float]:
        line, (mode, dof, cell) = row[0], entry.of(*row)
        if mode not in labels:
            raise _of_line(path, line, "test.deviations-table/mode", {"test modes": _shown(labels)}, mode=mode[:40])
        at = dof if dof in (_FREQUENCY, _DAMPING) else _place(path, line, dof, modes.dofs)
        column = labels.index(mode)
        if isinstance(at, tuple) and not measured[rows[at], column]:
            raise _of_line(path, line, "test.deviations-table/not-measured", mode=mode, dof=dof)
        if (mode, at) in lines:
            raise _of_line(path, line, "test.deviations-table/twice", mode=mode, dof=dof, first=lines[mode, at])
        lines[mode, at] = line
        return at, column, _sigma(path, line, cell, entry.text)

    for at, column, sigma in each(value, entry.rows):
        deviations.setdefault(at, np.full(len(modes), np.nan))[column] = sigma
    shapes = np.array([deviations.get(at, np.full(len(modes), np.nan)) for at in rows])
    of_shapes = any(at in rows for at in deviations)
    return replace(
        modes,
        freq_sd_hz=deviations.get(_FREQUENCY, modes.freq_sd_hz),
        damping_sd=deviations.get(_DAMPING, modes.damping_sd),
        shapes_sd=entry_deviations(shapes, modes.shapes) if of_shapes else modes.shapes_sd,
    )


@dataclass(frozen=True)
class _Table:
    """Lines below the heading, and the columns in which mode, DOF and standard deviation are."""

    path: Path
    text: TableText
    order: tuple[int, ...]

    @property
    def rows(self) -> Iterable[tuple[int, tuple[str, ...]]]:
        """Number and cells of each line."""
        return zip(self.text.lines[1:], self.text.rows[1:])

    def of(self, line: int, row: tuple[str, ...]) -> tuple[str, str, str]:
        """Mode, DOF and standard deviation of a line."""
        if len(row) != len(_COLUMNS):
            raise _of_line(self.path, line, "test.deviations-table/fields", fields=len(row))
        mode, dof, sigma = (row[i] for i in self.order)
        return mode, dof, sigma


def _table(path: Path) -> _Table:
    try:
        text = read_table_text(path, _LARGEST_BYTES)
    except NotATable as error:
        raise _of_line(path, error.line, "test.deviations/unreadable", reason=str(error)) from error
    if not 2 <= len(text.rows) <= _MOST_LINES:
        raise _of_line(path, None, "test.deviations-table", lines=len(text.rows))
    heads = text.rows[0]
    if sorted(heads) != sorted(_COLUMNS):
        raise _of_line(path, text.lines[0], "test.deviations-table/heading", heads=", ".join(heads)[:80])
    order = tuple(heads.index(name) for name in _COLUMNS)
    return _Table(path, text, order)


def _place(path: Path, line: int, text: str, dofs: DofSet) -> tuple[int, str]:
    """Node and direction of a sensor of the test; the sign does not matter to a standard deviation."""
    try:
        (dof,) = DofSet.parse([text])
    except FemtuneError:
        dof = None
    if dof is None or (dof.node, dof.direction) not in {(d.node, d.direction) for d in dofs}:
        values = {"sensors of the test": _shown([str(d) for d in dofs])}
        raise _of_line(path, line, "test.deviations-table/sensor", values, dof=text[:40])
    return dof.node, dof.direction


def _sigma(path: Path, line: int, cell: str, text: TableText) -> float:
    value = text.number(cell)
    if not 0.0 < value < math.inf:
        raise _of_line(path, line, "test.deviations-table/number", text=cell[:40])
    return value


def _of_line(
    path: Path, line: int | None, code: str, values: Mapping[str, object] | None = None, **facts: Any
) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), values=dict(values or {}), **facts)
