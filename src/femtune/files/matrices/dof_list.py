"""Lists of degrees of freedom: one a line, `node.component` as CalculiX writes them, or `node component`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where

Integers = NDArray[np.int64]

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
        what = f"the file cannot be read: {error.strerror}"
        raise FemtuneError("matrices.unreadable", what, where=Where(str(path)), hint="check path and rights") from error
    lines = [i for i, text in enumerate(content, 1) if text.strip() and not text.lstrip().startswith(_COMMENTS)]
    found = np.array([_dof(path, i, content[i - 1]) for i in lines], np.int64).reshape(-1, 2)
    if not len(found):
        raise _error(path, None, "the list of DOFs is empty", {}, "write one DOF a line, node and component: 12 3")
    _check_positive(path, lines, found, content)
    _check_once(path, lines, found)
    return found


def _dof(path: Path, line: int, text: bytes) -> tuple[int, int]:
    match = _LINE.fullmatch(text)
    if match is not None:
        return int(match[1]), int(match[2])
    match = _NAMED.fullmatch(text)
    if match is None:
        shown = {"line": f"'{text[:60].decode('latin-1')}'"}
        hint = "write node and component, 1 to 6: 12 3, 12.3 or 12Z"
        raise _error(path, line, "this line is no degree of freedom", shown, hint)
    return int(match[1]), _NAMES[match[2].upper()]


def _check_positive(path: Path, lines: list[int], found: Integers, content: list[bytes]) -> None:
    zero = np.flatnonzero(found[:, 0] == 0)
    if zero.size:
        line = lines[int(zero[0])]
        shown = {"line": f"'{content[line - 1][:60].decode('latin-1')}'"}
        raise _error(path, line, "node 0 does not exist: numbers begin at 1", shown, "write the number of the node")


def _check_once(path: Path, lines: list[int], found: Integers) -> None:
    key = found[:, 0] * 8 + found[:, 1]
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[order]) == 0)
    if twice.size:
        first, second = int(order[twice[0]]), int(order[twice[0] + 1])
        shown = {"DOF": f"{found[first, 0]}:{found[first, 1]}", "first line": lines[first]}
        raise _error(path, lines[second], "a degree of freedom is listed twice", shown, "list every row once, in order")


def _error(path: Path, line: int | None, what: str, values: Mapping[str, object], hint: str) -> FemtuneError:
    return FemtuneError("matrices.dof-list", what, where=Where(str(path), line), values=dict(values), hint=hint)
