"""CalculiX: `.sti` and `.mas` of *FREQUENCY, SOLVER=MATRIXSTORAGE: row, column, value, with the DOFs in `.dof`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from femtune.arrays import Integers
from femtune.errors import FemtuneError, Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from
from femtune.files.matrices.text_blocks import Listed, read_listed

# ----------------------------------------------------------------------------------------------------
# Lists of degrees of freedom: one a line, `node.component` as CalculiX writes them, or `node component`.


_LINE = re.compile(rb"\s*(\d{1,18})[.,:;\s]+([0-6])\s*,?\s*")
_NAMES = {b"X": 1, b"Y": 2, b"Z": 3, b"RX": 4, b"RY": 5, b"RZ": 6, b"S": 0}
_NAMED = re.compile(rb"\s*(\d{1,18})[.,:;\s]*(RX|RY|RZ|X|Y|Z|S)\+?\s*,?\s*", re.IGNORECASE)
_COMMENTS = (b"#", b"*", b"%", b"$")


def read_dof_list(path: Path) -> Integers:
    """(n, 2) node and component (1 to 6; 0 of a scalar point) of each row.

    Raises
    ------
    FemtuneError : ``matrices.dof-list`` for a line that is no DOF, a DOF that stands twice, or an empty list;
        ``matrices.unreadable``
    """
    try:
        content = path.read_bytes().splitlines()
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error
    lines = [i for i, text in enumerate(content, 1) if text.strip() and not text.lstrip().startswith(_COMMENTS)]
    dofs = np.array([_dof(path, i, content[i - 1]) for i in lines], np.int64).reshape(-1, 2)
    if not len(dofs):
        raise _error(path, None, "matrices.dof-list/empty", {})
    _check_positive(path, lines, dofs, content)
    _check_once(path, lines, dofs)
    return dofs


def _dof(path: Path, line: int, text: bytes) -> tuple[int, int]:
    match = _LINE.fullmatch(text)
    if match is not None:
        return int(match[1]), int(match[2])
    match = _NAMED.fullmatch(text)
    if match is None:
        shown = {"line": f"'{text[:60].decode('latin-1')}'"}
        raise _error(path, line, "matrices.dof-list/not-a-dof", shown)
    return int(match[1]), _NAMES[match[2].upper()]


def _check_positive(path: Path, lines: list[int], dofs: Integers, content: list[bytes]) -> None:
    zero = np.flatnonzero(dofs[:, 0] == 0)
    if zero.size:
        line = lines[int(zero[0])]
        shown = {"line": f"'{content[line - 1][:60].decode('latin-1')}'"}
        raise _error(path, line, "matrices.dof-list/node-number", shown)


def _check_once(path: Path, lines: list[int], dofs: Integers) -> None:
    key = dofs[:, 0] * 8 + dofs[:, 1]
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[order]) == 0)
    if twice.size:
        first, second = int(order[twice[0]]), int(order[twice[0] + 1])
        shown = {"DOF": f"{dofs[first, 0]}:{dofs[first, 1]}", "first line": lines[first]}
        raise _error(path, lines[second], "matrices.dof-list/repeated", shown)


def _error(path: Path, line: int | None, code: str, values: Mapping[str, object], **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path), line), values=values, **facts)


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
        raise FemtuneError("matrices.missing-dof-list", where=Where(str(path)), values={"looked for": str(beside)})
    n = len(rows)
    _check_every_row(listed, n, path)
    keys = listed.keys - 1
    entries = Entries(keys[:, 0], keys[:, 1], listed.value, (n, n), rows, listed.line)
    return matrix_from(entries, name or path.suffix[1:].upper(), Where(str(path)))


def _check_every_row(listed: Listed, n: int, path: Path) -> None:
    """CalculiX writes the diagonal of every row, zero or not; one is missing in a cut file or one of another run."""
    at = listed.keys[listed.keys[:, 0] == listed.keys[:, 1], 0]
    seen = np.zeros(n, bool)
    seen[at[(at >= 1) & (at <= n)] - 1] = True
    if not seen.all() and (listed.keys <= n).all():
        missing = np.flatnonzero(~seen)
        raise FemtuneError(
            "matrices.truncated",
            where=Where(str(path)),
            values={"first row without one": int(missing[0]) + 1},
            n_missing=missing.size,
            n=n,
        )
