"""Files between femtune and SLEPc's processes: matrices and a request in, results out."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.linear.symmetric import SymmetricMatrix

FOLDER = "FEMTUNE_SLEPC_FOLDER"
_MARGIN_BYTES = 1 << 20
"""Room on the disk beyond the matrices and shapes, for the small files."""


@contextmanager
def exchange_folder(needed_bytes: int) -> Iterator[Path]:
    """A folder for the files, removed at the end; where the environment names its parent, all machines must see it.

    Raises
    ------
    FemtuneError : ``slepc.files`` where it cannot be made, is full, or will be
    """
    parent = os.environ.get(FOLDER, "").strip() or None
    try:
        with tempfile.TemporaryDirectory(prefix="femtune-slepc-", dir=parent, ignore_cleanup_errors=True) as folder:
            check_room(Path(folder), needed_bytes)
            yield Path(folder)
    except OSError as failed:
        raise FemtuneError("slepc.files/unusable", reason=failed, folder=FOLDER) from failed


def check_room(folder: Path, needed_bytes: int) -> None:
    free = shutil.disk_usage(folder).free
    if needed_bytes + _MARGIN_BYTES > free:
        raise FemtuneError(
            "slepc.files",
            values={"folder": folder.parent, "needed_bytes": needed_bytes, "free_bytes": free},
            folder=FOLDER,
        )


def write_matrices(folder: Path, K: SymmetricMatrix, M: SymmetricMatrix) -> None:
    """Upper triangles; a pattern that both share is written once."""
    _write(folder, "K", K, True)
    _write(folder, "M", M, M.indices is not K.indices)


def _write(folder: Path, name: str, matrix: SymmetricMatrix, pattern: bool) -> None:
    np.save(folder / f"{name}_data.npy", np.asarray(matrix.data, float))
    if pattern:
        np.save(folder / f"{name}_indices.npy", matrix.indices)
        np.save(folder / f"{name}_indptr.npy", matrix.indptr)


def write_request(folder: Path, **request: Any) -> None:
    """What is to be done."""
    (folder / "request.json").write_text(json.dumps(request), encoding="utf-8")


def read_result(folder: Path) -> dict[str, Any]:
    """What rank 0 wrote.

    Raises
    ------
    FemtuneError : ``slepc.no-result``
    """
    try:
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as missing:
        raise no_result("slepc.no-result/unreadable", reason=missing) from missing
    if not isinstance(result, dict):
        raise no_result("slepc.no-result/no-table")
    return result


def read_shapes(folder: Path, ranks: int, size: tuple[int, int]) -> NDArray[np.float64]:
    """(n, m) shapes, put together from the rows of each rank.

    Raises
    ------
    FemtuneError : ``slepc.no-result`` for a file that is missing, damaged or of another size
    """
    shapes, filled = np.empty(size), 0
    for rank in range(ranks):
        try:
            first = int(np.load(folder / f"first_{rank}.npy", allow_pickle=False))
            part = np.load(folder / f"rows_{rank}.npy", allow_pickle=False)
        except (OSError, ValueError, EOFError, TypeError) as damaged:
            raise no_result("slepc.no-result/unreadable-rows", rank=rank, reason=damaged) from damaged
        if first != filled or part.ndim != 2 or part.shape[1] != size[1] or first + len(part) > size[0]:
            raise no_result("slepc.no-result/rows-of-rank", rank=rank, first=first, shape=part.shape, expected=size)
        shapes[first : first + len(part)] = part
        filled += len(part)
    if filled != size[0]:
        raise no_result("slepc.no-result/number-of-rows", rows=filled, dofs=size[0])
    return shapes


def no_result(code: str, **facts: Any) -> FemtuneError:
    """SLEPc's processes ended well, but what they left cannot be used."""
    return FemtuneError(code, folder=FOLDER, **facts)
