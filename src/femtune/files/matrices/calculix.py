"""CalculiX: `.sti` and `.mas` of *FREQUENCY, SOLVER=MATRIXSTORAGE: row, column, value, with the DOFs in `.dof`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.dof_list import read_dof_list
from femtune.files.matrices.entries import Entries
from femtune.files.matrices.read_matrix import ReadMatrix, matrix_from
from femtune.files.matrices.triplets import Listed, read_listed


def read_calculix(path: Path, name: str | None = None) -> ReadMatrix:
    """The matrix of a .sti or .mas file, its rows named by the .dof file beside it.

    Raises
    ------
    FemtuneError : ``matrices.*``; a missing .dof file is ``matrices.missing-dof-list``
    """
    listed = read_listed(path, 2, "row, column and value")
    beside = path.with_suffix(".dof")
    rows = read_dof_list(beside) if beside.is_file() else None
    if rows is None:
        raise FemtuneError(
            "matrices.missing-dof-list",
            "the list of DOFs that CalculiX writes beside its matrices is not here",
            where=Where(str(path)),
            values={"looked for": str(beside)},
            hint="keep the .dof file beside .sti and .mas",
        )
    n = len(rows)
    _check_every_row(listed, n, path)
    keys = listed.keys - 1
    entries = Entries(keys[:, 0], keys[:, 1], listed.value, (n, n), rows, listed.line)
    return matrix_from(entries, name or path.suffix[1:].upper(), Where(str(path)))


def _check_every_row(listed: Listed, n: int, path: Path) -> None:
    """It writes the diagonal of every row, zero or not; where one lacks, the file was cut or is of another run."""
    at = listed.keys[listed.keys[:, 0] == listed.keys[:, 1], 0]
    seen = np.zeros(n, bool)
    seen[at[(at >= 1) & (at <= n)] - 1] = True
    if not seen.all() and (listed.keys <= n).all():
        missing = np.flatnonzero(~seen)
        raise FemtuneError(
            "matrices.truncated",
            f"the file has no diagonal entry of {missing.size} of the {n} DOFs that the .dof file lists",
            where=Where(str(path)),
            values={"first row without one": int(missing[0]) + 1},
            hint="the file was cut, or the .dof file is of another run: run CalculiX again",
        )
