"""Ansys .full files, through ansys-mapdl-reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from femtune.errors import FemtuneError, Where
from femtune.files.ansys_process import Arrays, arrays_of
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
    found = arrays_of(path, matrices_of, "matrices.ansys", where)
    dofs, held = found["dofs"], found["held"].reshape(-1, 2)
    rows = np.stack([dofs[:, 0], dofs[:, 1] + 1], axis=1).astype(np.int64)
    K, M = (_matrix(found, one) for one in NAMES)
    _check_counts(rows, held, K, M, int(found["equations"]), where)
    chosen = K if wanted == "K" else M
    entries = Entries(chosen.row, chosen.col, chosen.data, chosen.shape, rows)
    return matrix_from(entries, wanted, where, _held_rows(rows, held))


def matrices_of(file: Any) -> Arrays:
    """DOFs, matrices and held DOFs of a .full file."""
    dofs, *matrices = file.load_km(as_sparse=True, sort=False)
    found = {"dofs": dofs, "held": np.asarray(file.const), "equations": np.asarray(file.neqn)}
    for name, matrix in zip(NAMES, map(sp.coo_array, matrices), strict=True):
        parts = {"row": matrix.row, "col": matrix.col, "data": matrix.data, "shape": np.array(matrix.shape)}
        found |= {f"{name}_{part}": values for part, values in parts.items()}
    return found


def _matrix(found: Arrays, name: str) -> sp.coo_array:
    row, col = (found[f"{name}_{part}"].astype(np.int64) for part in ("row", "col"))
    rows, columns = found[f"{name}_shape"].tolist()
    return sp.coo_array((found[f"{name}_data"], (row, col)), shape=(rows, columns))


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
    largest = int(rows[:, 1].max(initial=0))
    if not n or K.shape != (n, n) or M.shape != (n, n) or equations != n or known != len(held) or largest > 6:
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
                "largest DOF label": largest,
            },
        )
