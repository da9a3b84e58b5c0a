"""Modes of Nastran OP2 files, through pyYeti; the columns are taken from what it returns with their own checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from femtune._optional import require
from femtune.errors import FemtuneError, Where
from femtune.files.modes.solved import SolvedModes, no_modes, truncated

_SHAPES = ("OUGV1", "BOUGV1", "OUG1")
# columns of the table LAMA
_CYCLES = 4
_MODAL_MASS = 5


def read_op2_modes(path: Path) -> SolvedModes:
    """Frequencies and shapes of an OP2 file, at grid points and without scalar points.

    Frequencies are those of the table LAMA where the file has it, and shapes then of unit modal mass.

    Raises
    ------
    FemtuneError : ``install.missing``, ``external.output`` in its variants
    """
    if not path.is_file():
        raise FemtuneError("external.output/missing", where=Where(str(path)))
    # the library changes how numpy prints numbers everywhere
    with np.printoptions():
        library = require("pyyeti.nastran.op2", extra="op2")
    try:
        with library.OP2(str(path)) as file:
            table = _frequencies(file)
            columns = _shapes(file)
    except Exception as error:
        # whatever the library raises on a file that is cut or of another kind
        reason = f"{type(error).__name__}: {error}"
        raise FemtuneError("external.output/unreadable", where=Where(str(path)), reason=reason) from error
    return _modes(table, columns, path)


def _frequencies(file: Any) -> np.ndarray | None:
    """(m, 7) the table of eigenvalues, if there is one."""
    if "LAMA" not in file.dbnames:
        return None
    file.set_position("LAMA")
    file.rdop2nt()
    return np.asarray(file._rdop2lama())


def _shapes(file: Any) -> list[tuple[float, Any]]:
    """Frequency and values of each mode; some solvers write a table for each."""
    name = next((n for n in _SHAPES if n in file.dbnames), None)
    columns: list[tuple[float, Any]] = []
    for which in range(0 if name is None else len(file.dbnames[name])):
        file.set_position(name, which)
        file.rdop2nt()
        columns += [(hz, column) for (_, hz), column in file._rdop2oug(name).items()]
    return columns


def _modes(table: np.ndarray | None, columns: list[tuple[float, Any]], path: Path) -> SolvedModes:
    if table is None and not columns:
        raise no_modes(path, "LAMA or OUGV1")
    freq_hz = np.array([hz for hz, _ in columns]) if table is None else table[:, _CYCLES]
    mass = np.ones(len(freq_hz)) if table is None else table[:, _MODAL_MASS]
    if not columns:
        return SolvedModes.of_frequencies(freq_hz)
    if len(columns) != len(freq_hz):
        raise truncated(path, f"{len(freq_hz)} mode shapes")
    nodes, shapes = _grid([column for _, column in columns], path)
    return SolvedModes(freq_hz, nodes, shapes / np.sqrt(np.where(mass > 0.0, mass, 1.0)))


def _grid(columns: list[Any], path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and (n, 6, m) shapes of the points that have six components."""
    pairs = np.array([tuple(index) for index in columns[0].index], np.int64)
    if any(len(column) != len(pairs) for column in columns):
        raise truncated(path, "shapes at the same points in all modes")
    node, component = pairs.T
    grids = np.unique(node[component > 1])
    on_grids = np.isin(node, grids)
    values = np.stack([np.asarray(column, float)[on_grids] for column in columns], axis=-1)
    shapes = np.full((len(grids), 6, len(columns)), np.nan)
    shapes[np.searchsorted(grids, node[on_grids]), component[on_grids] - 1] = values
    return grids, shapes
