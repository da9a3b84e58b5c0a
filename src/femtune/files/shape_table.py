"""Modes of a test in tables: text with a line for each DOF or one line in all, lists of frequencies without shapes, and
arrays of MATLAB or NumPy."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Where, each
from femtune.files.frequency_table import is_frequency_heading, read_frequency_table
from femtune.files.records.arrays import open_mat, open_npy
from femtune.files.table_text import NotATable, TableText, read_table_text
from femtune.modal import ModeSet
from femtune.testdata import NO_GEOMETRY, ModalTest, WireFrame, sensors_at
from femtune.units import UnitSystem

_TEXT = (".csv", ".txt", ".tsv")
_ARRAYS = (".mat", ".npz")
_FREQUENCY = re.compile(r"([0-9.eE+-]+)\s*(?:hz)?", re.IGNORECASE)
_OF_MODE = re.compile(r"f(?:req)?_?(\d+)(?:_hz)?", re.IGNORECASE)
_SHAPE = re.compile(r"shape(\d+)_(\d+R?[XYZ][+-]?)", re.IGNORECASE)
_GAPS = {"", "-", "nan", "na", "n/a"}
_PLACE = ("x", "y", "z")
_LARGEST = 10_000_000
"""Bytes of a table of shapes: a hundred modes at a thousand points take a tenth."""


def is_shape_table(path: Path) -> bool:
    """Whether a file is a table of modes: by the headings of a text, or the names of arrays."""
    suffix = path.suffix.lower()
    if suffix in _ARRAYS:
        try:
            with _opened(path) as arrays:
                return "shapes" in arrays and "freq_hz" in arrays
        except FemtuneError:
            return False
    if suffix not in _TEXT:
        return False
    heads = _headings(path)
    if is_frequency_heading(heads):
        return True
    return heads[:2] == ["node", "direction"] or heads[0] == "dof" or any(_SHAPE.fullmatch(h) for h in heads)


def _headings(path: Path) -> list[str]:
    """Headings of a text in small letters; one without letters if the file cannot be read."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as stream:
            first = next((line for line in stream if line.strip()), "")
    except OSError:
        return [""]
    return [head.strip().strip('"').lower() for head in re.split("[,;\t]", first)]


def read_shape_table(path: Path, units: UnitSystem, name: str = "") -> ModalTest:
    """The modes of a table, with its points where it gives coordinates.

    Parameters
    ----------
    path : a text (.csv, .txt, .tsv) with a line for each DOF under the headings
        ``node,direction,x,y,z,27.08 Hz,44.7 Hz`` (or ``dof`` for the first two; x, y, z may be absent) or with one line
        under ``f1_hz,f2_hz,shape1_1Z+,shape2_1Z+``; or arrays (.mat, .npz) ``freq_hz`` (m,), ``shapes`` (s, m) and
        ``dofs`` (s labels "12Z+", or (s, 2) nodes and components from 1 to 6), and ``nodes`` (n,) with ``xyz`` (n, 3);
        or a list of frequencies, see `read_frequency_table`
    units : of coordinates
    name : of the test; else the name of the file

    Raises
    ------
    FemtuneError : ``test.shapes`` in its variants, with the line; ``record.file``; ``test.frequencies``
    """
    if path.suffix.lower() in _TEXT and is_frequency_heading(_headings(path)):
        return read_frequency_table(path, units, name)
    if path.suffix.lower() in _ARRAYS:
        with _opened(path) as arrays:
            freq_hz, shapes, dofs, frame = _of_arrays(path, arrays)
    else:
        try:
            text = read_table_text(path, _LARGEST)
        except NotATable as error:
            raise _error(path, "test.shapes", error.line, reason=str(error)) from error
        freq_hz, shapes, dofs, frame = _of_text(path, text)
    if not len(freq_hz) or not np.isfinite(freq_hz).all() or (freq_hz <= 0.0).any():
        raise _error(path, "test.shapes", None, reason="frequencies must be positive numbers in Hz")
    modes = ModeSet(freq_hz, shapes, DofSet(dofs), source=str(path))
    return ModalTest(
        name=name or path.stem,
        units=units,
        geometry=frame,
        sensors=sensors_at(frame, modes.dofs),
        modes=modes,
        source=str(path),
    )


_Read = tuple[Reals, np.ndarray, list[Dof], WireFrame]


def _of_text(path: Path, text: TableText) -> _Read:
    if len(text.rows) < 2:
        raise _error(path, "test.shapes", None, reason="it has a heading and no values")
    heads = [head.strip() for head in text.rows[0]]
    lower = [head.lower() for head in heads]
    for line, row in zip(text.lines[1:], text.rows[1:]):
        if len(row) != len(heads):
            raise _error(path, "test.shapes/fields", line, fields=len(row), headings=len(heads))
    if lower[0] != "dof" and lower[:2] != ["node", "direction"]:
        return _of_one_line(path, text, heads)
    first = 1 if lower[0] == "dof" else 2
    placed = tuple(lower[first : first + 3]) == _PLACE
    start = first + 3 * placed
    freq_hz = np.array([_frequency(path, text, head) for head in heads[start:]])
    numbered = list(zip(text.lines[1:], text.rows[1:]))
    dofs = each(lambda one: _dof(path, one[0], "".join(one[1][:first])), numbered)
    shapes = np.array(each(lambda one: [_value(path, one[0], c, text) for c in one[1][start:]], numbered))
    shapes = shapes.reshape(len(dofs), -1)
    if not placed:
        return freq_hz, shapes, dofs, NO_GEOMETRY
    places: dict[int, tuple[float, ...]] = {}
    for (line, row), dof in zip(numbered, dofs):
        place = tuple(_value(path, line, cell, text) for cell in row[first:start])
        if not np.isfinite(place).all() or places.setdefault(dof.node, place) != place:
            raise _error(path, "test.shapes/place", line, node=dof.node)
    return freq_hz, shapes, dofs, WireFrame(np.array(list(places)), np.array(list(places.values())))


def _of_one_line(path: Path, text: TableText, heads: Sequence[str]) -> _Read:
    """The columns of a table of runs, with a single line."""
    if len(text.rows) > 2:
        raise _error(path, "test.shapes/lines", text.lines[2], lines=len(text.rows) - 1)
    line, row = text.lines[1], text.rows[1]
    freq: dict[int, float] = {}
    cells: dict[tuple[int, str], float] = {}
    for head, cell in zip(heads, row):
        if match := _OF_MODE.fullmatch(head):
            freq[int(match[1])] = _value(path, line, cell, text)
        elif match := _SHAPE.fullmatch(head):
            cells[int(match[1]), match[2].upper()] = _value(path, line, cell, text)
        else:
            raise _error(path, "test.shapes/heading", text.lines[0], head=head[:40])
    labels = list(dict.fromkeys(label for _, label in cells))
    modes = sorted(freq)
    unknown = sorted({mode for mode, _ in cells} - set(modes))
    if unknown:
        raise _error(path, "test.shapes/no-frequency", text.lines[0], mode=unknown[0])
    shapes = np.array([[cells.get((mode, label), math.nan) for mode in modes] for label in labels])
    dofs = [_dof(path, text.lines[0], label) for label in labels]
    return np.array([freq[mode] for mode in modes]), shapes.reshape(len(labels), -1), dofs, NO_GEOMETRY


def _of_arrays(path: Path, arrays: Mapping[str, Any]) -> _Read:
    missing = [name for name in ("freq_hz", "shapes", "dofs") if name not in arrays]
    cells = any(name.startswith("dofs{") for name in arrays)
    if [name for name in missing if name != "dofs" or not cells]:
        raise _error(path, "test.shapes/arrays", None, missing=", ".join(missing), names=", ".join(list(arrays)[:20]))
    freq_hz = np.real(np.asarray(arrays["freq_hz"])).astype(float).ravel()
    shapes = np.atleast_2d(np.asarray(arrays["shapes"]))
    dofs = _dofs_of(path, arrays)
    if shapes.shape != (len(dofs), len(freq_hz)):
        raise _error(path, "test.shapes/sizes", None, shapes=str(shapes.shape), dofs=len(dofs), modes=len(freq_hz))
    if "nodes" not in arrays or "xyz" not in arrays:
        return freq_hz, shapes, dofs, NO_GEOMETRY
    nodes, xyz = np.asarray(arrays["nodes"]).ravel(), np.asarray(arrays["xyz"], float)
    if xyz.shape != (len(nodes), 3):
        raise _error(path, "test.shapes/points", None, xyz=str(xyz.shape), nodes=len(nodes))
    return freq_hz, shapes, dofs, WireFrame(nodes.astype(np.int64), xyz)


def _dofs_of(path: Path, arrays: Mapping[str, Any]) -> list[Dof]:
    """Labels of a text array or of cells, or nodes and components."""
    if "dofs" not in arrays:
        keys = sorted((k for k in arrays if k.startswith("dofs{")), key=lambda k: int(re.sub(r"\D", "", k) or 0))
        return [_dof(path, None, str(np.asarray(arrays[k]).ravel()[0])) for k in keys]
    values = np.asarray(arrays["dofs"])
    if values.dtype.kind in "US":
        return [_dof(path, None, str(label)) for label in values.ravel()]
    if values.dtype.kind not in "iuf" or values.ndim != 2 or values.shape[1] != 2:
        raise _error(path, "test.shapes/dofs", None, shape=str(values.shape))
    names = ("X", "Y", "Z", "RX", "RY", "RZ")
    rows = values.astype(np.int64)
    if (rows != values).any() or (rows[:, 0] < 1).any() or not np.isin(rows[:, 1], range(1, 7)).all():
        raise _error(path, "test.shapes/dofs", None, shape=str(values.shape))
    return [Dof(int(node), names[component - 1], 1) for node, component in rows]


def _opened(path: Path) -> Any:
    return open_mat(path) if path.suffix.lower() == ".mat" else open_npy(path)


def _frequency(path: Path, text: TableText, head: str) -> float:
    match = _FREQUENCY.fullmatch(head)
    value = text.number(match[1]) if match else math.inf
    if not 0.0 < value < math.inf:
        raise _error(path, "test.shapes/frequency", text.lines[0], head=head[:40])
    return value


def _value(path: Path, line: int, cell: str, text: TableText) -> float:
    if cell.lower() in _GAPS:
        return math.nan
    value = text.number(cell)
    if not math.isfinite(value):
        raise _error(path, "test.shapes/number", line, text=cell[:40])
    return value


def _dof(path: Path, line: int | None, label: str) -> Dof:
    label = label.strip().upper()
    try:
        return parse_dof(label if label.endswith(("+", "-")) else f"{label}+")
    except FemtuneError as error:
        raise _error(path, "test.shapes/label", line, text=label[:40]) from error


def _error(path: Path, code: str, line: int | None, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), **facts)
