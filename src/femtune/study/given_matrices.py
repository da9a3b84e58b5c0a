"""Matrices of a model that are given as arrays of NumPy or SciPy instead of files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.study.given_dofs import given_dofs

_DIGITS = 12
"""Hexadecimal digits of the checksum in the name of an array: no two matrices of a study share 48 bits by chance."""


class GivenMatrices:
    """Collects the entries of [[matrix]] and the arrays that are given instead of their files.

    `entries` are tables of [[matrix]]; `arrays` are the arrays by the names that stand for their files; `dofs` are node
    and component of each row.
    """

    def __init__(self) -> None:
        self.entries: list[dict[str, Any]] = []
        self.arrays: dict[str, Any] = {}
        self.dofs: tuple[tuple[int, int], ...] = ()
        self._first: tuple[str, int] | None = None

    def add(self, kind: str, name: str, given: Any) -> None:
        """A file, an array, or a list of tables whose ``file`` is either (errors ``call.argument``)."""
        if isinstance(given, str | Path):
            self.entries.append({"kind": kind, "name": name, "file": str(given)})
        elif isinstance(given, Sequence) and all(isinstance(entry, Mapping) for entry in given):
            for i, entry in enumerate(given):
                file = entry.get("file")
                if file is not None and not isinstance(file, str | Path):
                    file = self._array(file, f"{kind}[{i}]['file']", str(entry.get("name", name)))
                self.entries.append({"kind": kind, **entry, "file": file})
        else:
            self.entries.append({"kind": kind, "name": name, "file": self._array(given, kind, name)})

    def _array(self, given: Any, argument: str, name: str) -> str:
        """The name under which the study has an array."""
        array = _square(given, argument)
        if self._first is None:
            self._first = (argument, array.shape[0])
        elif array.shape[0] != self._first[1]:
            other, n = self._first
            raise FemtuneError(
                "call.argument/matrix-size", values={f"shape of {argument}": array.shape, "expected shape": (n, n)},
                name=argument, function="read_matrices", other=other,
            )  # fmt: skip
        label = f"matrix {name} in memory, {_checksum(array)}"
        self.arrays[label] = array
        return label

    def set_dofs(self, given: Any) -> None:
        """Names of the rows of the arrays (errors ``call.argument``, ``dof.syntax``, ``dof.duplicate``).

        A row along a negative direction changes its sign.
        """
        if self._first is None:
            raise FemtuneError("call.argument/dofs-without-arrays", name="dofs", function="read_matrices")
        dofs = given_dofs(given, "read_matrices")
        argument, n = self._first
        if len(dofs) != n:
            raise FemtuneError(
                "call.argument/dofs-size", values={"entries of dofs": len(dofs), f"rows of {argument}": n},
                name="dofs", function="read_matrices", other=argument,
            )  # fmt: skip
        self.dofs = tuple(zip(dofs.nodes.tolist(), dofs.components.tolist()))
        if (dofs.signs < 0.0).any():
            turn = sp.diags_array(dofs.signs)
            self.arrays = {name: sp.csr_array(turn @ sp.csr_array(a) @ turn) for name, a in self.arrays.items()}


def _square(given: Any, argument: str) -> Any:
    """A square array of numbers."""
    array = given if sp.issparse(given) else np.asarray(given) if _is_array(given) else None
    if array is None or array.dtype.kind not in "iufc":
        raise FemtuneError(
            "call.argument/matrix", values={argument: type(given).__name__}, name=argument, function="read_matrices"
        )
    if not array.size and not sp.issparse(array):
        raise FemtuneError("call.argument/matrix-empty", name=argument, function="read_matrices")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.shape[0]:
        rows = array.shape[0] if array.ndim else 1
        raise FemtuneError(
            "call.argument/matrix-shape", values={f"shape of {argument}": array.shape, "expected shape": (rows, rows)},
            name=argument, function="read_matrices",
        )  # fmt: skip
    return array if array.dtype.kind == "c" else array.astype(float)


def _is_array(given: Any) -> bool:
    """True for arrays of NumPy and for rows of numbers of equal length."""
    if isinstance(given, np.ndarray):
        return True
    if not isinstance(given, Sequence) or isinstance(given, str | bytes):
        return False
    return len({len(row) if isinstance(row, Sequence | np.ndarray) else -1 for row in given}) == 1


def _checksum(array: Any) -> str:
    """Of the shape and the entries."""
    coo = sp.coo_array(array)
    coo.sum_duplicates()
    parts: Iterable[NDArray[Any]] = (np.array(coo.shape), coo.row.astype(np.int64), coo.col.astype(np.int64), coo.data)
    digest = hashlib.sha256()
    for part in parts:
        digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()[:_DIGITS]
