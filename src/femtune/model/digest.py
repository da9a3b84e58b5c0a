"""Digests of arrays: equal ones mean equal arrays, to the last bit."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Part: TypeAlias = "NDArray[Any] | sp.sparray | str | float | None"


def digest(*parts: Part) -> str:
    """SHA-256, in hexadecimal digits, of texts, numbers and arrays with their types, shapes and order."""
    found = hashlib.sha256()
    for part in parts:
        for piece in _pieces(part):
            found.update(piece)
    return found.hexdigest()


def _pieces(part: Part) -> Iterable[bytes | memoryview]:
    if isinstance(part, np.ndarray):
        yield f"[{part.dtype.str}{part.shape}]".encode()
        yield np.ascontiguousarray(part).data
    elif sp.issparse(part):
        rows = sp.csr_array(part)
        for array in (np.array(rows.shape), rows.indptr, rows.indices, rows.data):
            yield from _pieces(array)
    else:
        plain = part.item() if isinstance(part, np.generic) else part
        yield f"[{type(plain).__name__} {plain!r}]".encode()
