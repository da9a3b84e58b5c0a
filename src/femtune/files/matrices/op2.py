"""Matrices of Nastran OP2 files, through pyYeti; what it returns is checked against the trailers in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femtune._optional import require
from femtune.errors import FemtuneError, Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from, no_such_matrix

_MOST_NUMBERS = 150_000_000
"""Numbers of a full matrix, zeros included, that are read: 1.2 GB."""


def read_op2(path: Path, name: str | None = None) -> ReadMatrix:
    """A matrix of an OP2 file; the first one where no name is asked for.

    Raises
    ------
    FemtuneError : ``install.missing``, ``matrices.op2``, ``matrices.no-such-matrix``, ``matrices.truncated``,
        ``matrices.*``
    """
    # the library changes how numpy prints numbers everywhere
    with np.printoptions():
        library = require("pyyeti.nastran.op2", extra="op2")
    where = Where(str(path), None, name or "")
    if not path.is_file():
        raise FemtuneError("matrices.unreadable/missing", where=where)
    try:
        with library.OP2(str(path)) as file:
            columns = _columns(file, path, name)
    except FemtuneError:
        raise
    except Exception as error:
        raise _failed(where, error) from error
    return matrix_from(*columns)


def _columns(file: Any, path: Path, name: str | None) -> tuple[Entries, str, Where]:
    """Entries of the matrix with its name, its size and number of columns checked against the trailer."""
    known = [n for n in file.dbnames if file.dbnames[n][0][2][0] > 0]
    title = _title(known, path, name)
    file.set_position(title)
    _, trailer, _ = file.rdop2nt()
    where = Where(str(path), None, title)
    _check_size(trailer, where)
    full = np.asarray(file.rdop2matrix(trailer))
    _check_trailer(full, trailer, where)
    some = sp.coo_array(full)
    row, col = some.row.astype(np.int64), some.col.astype(np.int64)
    return Entries(row, col, some.data, full.shape), title.strip(), where


def _title(known: list[str], path: Path, name: str | None) -> str:
    """The matrix as the file spells it."""
    names = [n for n in known if name is None or n.strip().upper() == name.upper()]
    if not names:
        raise no_such_matrix(path, name, known)
    return names[0]


def _check_size(trailer: Any, where: Where) -> None:
    """The library makes full matrices: those of a large model do not fit."""
    columns, rows = int(trailer[1]), int(trailer[2])
    if columns * rows > _MOST_NUMBERS:
        raise FemtuneError(
            "matrices.too-large",
            where=where,
            values={"rows": rows, "columns": columns, "it would take": f"{8e-9 * rows * columns:.1f} GB"},
        )


def _check_trailer(full: np.ndarray, trailer: Any, where: Where) -> None:
    """The trailer holds number, columns, rows, form, type, largest words of a column, and density·10000."""
    columns, rows, density = int(trailer[1]), int(trailer[2]), int(trailer[6])
    shown = {"columns": columns, "rows": rows, "read": f"{full.shape[0]} × {full.shape[1]}"}
    if full.shape != (rows, columns):
        raise _mismatch(where, shown)
    share = 1e4 * np.count_nonzero(full) / max(full.size, 1)
    # values that happen to be zero are stored too, so there may be fewer of them than stored ones, never none
    if density > 2 and share < 0.05 * density:
        raise _mismatch(where, {**shown, "density by the trailer": density / 1e4, "density as read": share / 1e4})


def _mismatch(where: Where, values: dict[str, Any]) -> FemtuneError:
    return FemtuneError("matrices.truncated/trailer", where=where, values=values)


def _failed(where: Where, error: Exception) -> FemtuneError:
    return FemtuneError("matrices.op2", where=where, name=type(error).__name__, error=error)
