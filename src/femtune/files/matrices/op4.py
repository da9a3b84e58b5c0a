"""Nastran OP4 files: the matrices of a file one after the other, binary or text; each column is a record.

A column is dense (a run of values from its first row) or sparse: strings of values, each behind a word that packs
length and row (16 bits each), or behind two words of their own ("big matrix"). Lengths count words of 4 bytes in
binary files, and of single precision in text ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.entries import Entries
from femtune.files.matrices.missing import no_such_matrix
from femtune.files.matrices.op4_binary import binary_matrices
from femtune.files.matrices.op4_columns import Header, Run
from femtune.files.matrices.op4_text import text_matrices
from femtune.files.matrices.read_matrix import ReadMatrix, matrix_from

_LOWEST_TEXT = 9


def read_op4(path: Path, name: str | None = None) -> ReadMatrix:
    """A matrix of an OP4 file; the first one where no name is asked for.

    Raises
    ------
    FemtuneError : ``matrices.no-such-matrix``, ``matrices.truncated``, ``matrices.op4``, ``matrices.*``
    """
    known = []
    for header, runs in _matrices(path):
        if name is None or header.name.upper() == name.upper():
            return _read(path, header, runs)
        known.append(header.name)
        for _ in runs:
            pass
    raise no_such_matrix(path, name, known)


def op4_names(path: Path) -> tuple[Header, ...]:
    """Headers of all matrices of a file."""
    found = []
    for header, runs in _matrices(path):
        found.append(header)
        for _ in runs:
            pass
    return tuple(found)


def _matrices(path: Path) -> Iterator[tuple[Header, Iterator[Run]]]:
    try:
        with path.open("rb") as file:
            start = file.read(8)
    except OSError as error:
        what = f"the file cannot be read: {error.strerror}"
        raise FemtuneError("matrices.unreadable", what, where=Where(str(path)), hint="check path and rights") from error
    text = bool(start) and min(start) >= _LOWEST_TEXT
    return text_matrices(path) if text else binary_matrices(path)


def _read(path: Path, header: Header, runs: Iterator[Run]) -> ReadMatrix:
    row, col, value, places = [], [], [], []
    for run in runs:
        row.append(np.arange(run.row, run.row + len(run.values)))
        col.append(np.full(len(run.values), run.column))
        value.append(run.values)
        places.append(run.where)
    starts = np.cumsum([0, *(len(v) for v in value)])

    def place(i: int) -> Where:
        return places[int(np.searchsorted(starts, i, side="right")) - 1]

    values: NDArray = np.concatenate(value) if value else np.zeros(0)
    rows, cols = (np.concatenate(x).astype(np.int64) if x else np.zeros(0, np.int64) for x in (row, col))
    entries = Entries(rows, cols, values, (header.rows, header.columns), None, place)
    return matrix_from(entries, header.name, Where(str(path), None, header.name))
