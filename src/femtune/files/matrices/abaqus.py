"""Abaqus *MATRIX GENERATE / *MATRIX OUTPUT as text (.mtx), matrix-input and coordinate form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.files.matrices.read_matrix import Entries, ReadMatrix, matrix_from, numbered
from femtune.files.matrices.text_blocks import Listed, check_text, empty, read_listed


def read_abaqus(path: Path, name: str | None = None) -> ReadMatrix:
    """The matrix of a .mtx file.

    Five numbers a line are node, DOF, node, DOF and value (FORMAT=MATRIX INPUT: rows are named; a lower triangle is
    usual); three are row, column and value (FORMAT=COORDINATE: rows are numbers, named by a list of DOFs).

    Raises
    ------
    FemtuneError : ``matrices.*``
    """
    keys = _columns(path) - 1
    if keys not in (2, 4):
        raise FemtuneError("matrices.text", where=Where(str(path), 1), n_numbers=keys + 1)
    what = "row, column and value" if keys == 2 else "node, dof, node, dof and value"
    listed = read_listed(path, keys, what)
    entries = _by_number(listed) if keys == 2 else _by_name(listed)
    return matrix_from(entries, name or path.stem, Where(str(path)))


def _columns(path: Path) -> int:
    """How many numbers the first line of data holds."""
    try:
        with path.open("rb") as file:
            check_text(path, file.read(4096))
            file.seek(0)
            for line in file:
                if line.strip() and not line.lstrip().startswith(b"*"):
                    return len(line.replace(b",", b" ").split())
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error
    raise empty(path)


def _by_number(listed: Listed) -> Entries:
    keys = listed.keys - 1
    n = int(keys.max(initial=-1)) + 1
    return Entries(keys[:, 0], keys[:, 1], listed.value, (n, n), None, listed.line)


def _by_name(listed: Listed) -> Entries:
    """Rows in the order of nodes and components; node 0 or a negative one is an internal node of Abaqus."""
    bad = np.flatnonzero((listed.keys[:, [1, 3]] < 1).any(axis=1) | (listed.keys[:, [1, 3]] > 6).any(axis=1))
    if bad.size:
        raise FemtuneError(
            "matrices.index",
            where=listed.line(int(bad[0])),
            values={"node, dof, node, dof": " ".join(map(str, listed.keys[bad[0]]))},
        )
    _check_external(listed)
    first, second = (listed.keys[:, i] * np.int64(8) + listed.keys[:, i + 1] for i in (0, 2))
    names, at = numbered(first, second)
    rows = np.stack([names // 8, names % 8], axis=1)
    return Entries(at[0], at[1], listed.value, (len(rows), len(rows)), rows, listed.line)


def _check_external(listed: Listed) -> None:
    if listed.keys[:, [0, 2]].min(initial=1) < 1:
        at = int(np.flatnonzero((listed.keys[:, [0, 2]] < 1).any(axis=1))[0])
        raise FemtuneError(
            "matrices.index/internal-node", where=listed.line(at), values={"node": int(listed.keys[at, [0, 2]].min())}
        )
