"""Which reader reads a file: by the name that the study gives, by content, by extension."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from femtune.errors import FemtuneError, Where, did_you_mean
from femtune.files.matrices.abaqus import read_abaqus
from femtune.files.matrices.ansys import read_ansys
from femtune.files.matrices.calculix import read_calculix
from femtune.files.matrices.dmig import read_dmig
from femtune.files.matrices.matrix_market import is_matrix_market, read_matrix_market
from femtune.files.matrices.op2 import read_op2
from femtune.files.matrices.op4 import read_op4
from femtune.files.matrices.read_matrix import ReadMatrix

Reader = Callable[[Path, str | None], ReadMatrix]

READERS: dict[str, Reader] = {
    "op4": read_op4,
    "op2": read_op2,
    "dmig": read_dmig,
    "abaqus": read_abaqus,
    "calculix": read_calculix,
    "matrix-market": read_matrix_market,
    "ansys": read_ansys,
}
"""Readers by the name of their format."""

_BY_EXTENSION = {
    ".op4": "op4", ".op2": "op2", ".pch": "dmig", ".bdf": "dmig", ".dat": "dmig", ".nas": "dmig", ".dmig": "dmig",
    ".mtx": "abaqus", ".sti": "calculix", ".mas": "calculix", ".mm": "matrix-market", ".full": "ansys",
}  # fmt: skip


def read_matrix(path: Path | str, name: str | None = None, format: str | None = None) -> ReadMatrix:
    """A symmetric matrix of another solver.

    Parameters
    ----------
    path : the file
    name : the matrix in a file that holds several; its first one without a name
    format : a key of `READERS`; found by content and extension where None

    Raises
    ------
    FemtuneError : ``matrices.unknown-format``, ``matrices.unreadable``, and whatever is wrong with the file
    """
    path = Path(path)
    _check_regular(path)
    return READERS[format or format_of(path)](path, name)


def _check_regular(path: Path) -> None:
    """Refuse directories and devices, which may have no end."""
    if path.exists() and not path.is_file():
        code = "matrices.unreadable/directory" if path.is_dir() else "matrices.unreadable/device"
        raise FemtuneError(code, where=Where(str(path)))
    if not path.exists():
        raise FemtuneError("matrices.unreadable/missing", where=Where(str(path)))


def format_of(path: Path) -> str:
    """Name of a file's format (error ``matrices.unknown-format``)."""
    try:
        with path.open("rb") as file:
            start = file.read(64)
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error
    if is_matrix_market(start):
        return "matrix-market"
    if path.suffix.lower() in _BY_EXTENSION:
        return _BY_EXTENSION[path.suffix.lower()]
    raise FemtuneError(
        "matrices.unknown-format",
        where=Where(str(path)),
        values={"formats": ", ".join(READERS)},
        suffix=path.suffix,
        did_you_mean=did_you_mean(path.suffix, _BY_EXTENSION),
    )
