"""Ansys .full files, through ansys-mapdl-reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from femtune._optional import require
from femtune.errors import FemtuneError, Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from, no_such_matrix

NAMES = ("K", "M")


def read_ansys(path: Path, name: str | None = None) -> ReadMatrix:
    """Stiffness (K, also without a name) or mass (M) of a .full file, with its nodes and held DOFs.

    Raises
    ------
    FemtuneError : ``install.missing``, ``install.broken``, ``matrices.ansys``, ``matrices.*``
    """
    wanted = (name or "K").upper()
    if wanted not in NAMES:
        raise no_such_matrix(path, name, list(NAMES))
    where = Where(str(path), None, wanted)
    if not path.is_file():
        raise FemtuneError("matrices.unreadable/missing", where=where)
    library = require("ansys.mapdl.reader", extra="ansys")
    try:
        file = library.read_binary(str(path))
        dofs, K, M = file.load_km(as_sparse=True, sort=False)
        held = np.asarray(file.const).reshape(-1, 2)
    except Exception as error:
        raise _failed(where, error) from error
    rows = np.stack([dofs[:, 0], dofs[:, 1] + 1], axis=1).astype(np.int64)
    _check_counts(rows, held, K, M, int(file.neqn), where)
    chosen = sp.coo_array(K if wanted == "K" else M)
    at = chosen.row.astype(np.int64), chosen.col.astype(np.int64)
    entries = Entries(*at, chosen.data, chosen.shape, rows)
    return matrix_from(entries, wanted, where, _held_rows(rows, held))


def _held_rows(rows: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Rows of the DOFs that the file marks as constrained."""
    marked = set(map(tuple, np.stack([held[:, 0], held[:, 1] + 1], axis=1).tolist()))
    return np.array([i for i, row in enumerate(rows.tolist()) if tuple(row) in marked], np.int64)


def _check_counts(
    rows: np.ndarray, held: np.ndarray, K: sp.sparray, M: sp.sparray, equations: int, where: Where
) -> None:
    """Header, matrices and DOF list must agree."""
    n = len(rows)
    known = len(_held_rows(rows, held))
    if K.shape != (n, n) or M.shape != (n, n) or equations != n or known != len(held) or rows[:, 1].max() > 6:
        raise FemtuneError(
            "matrices.ansys/inconsistent",
            where=where,
            values={
                "equations": equations,
                "DOFs": n,
                "stiffness": K.shape,
                "mass": M.shape,
                "constrained": len(held),
                "of these among the DOFs": known,
                "largest DOF label": rows[:, 1].max(),
            },
        )


def _failed(where: Where, error: Exception) -> FemtuneError:
    return FemtuneError("matrices.ansys", where=where, name=type(error).__name__, error=error)
