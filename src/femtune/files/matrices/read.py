"""Read a matrix of another solver: the format is named, or found by content or extension."""

from __future__ import annotations

from pathlib import Path

from femtune.errors import FemtuneError, Where, did_you_mean
from femtune.files.formats import MATRIX_FORMATS
from femtune.files.matrices.read_matrix import ReadMatrix

_SIGNATURE_BYTES = 64
"""Bytes that are read to find a signature; the longest one has 14."""


def read_matrix(path: Path | str, name: str | None = None, format: str | None = None) -> ReadMatrix:
    """A symmetric matrix of another solver.

    Parameters
    ----------
    path : the file
    name : the matrix in a file that holds several; its first one without a name
    format : key of one of `MATRIX_FORMATS`; found by content and extension where None

    Raises
    ------
    FemtuneError : ``matrices.unknown-format``, ``matrices.unreadable``, and whatever is wrong with the file
    """
    path = Path(path)
    _check_regular(path)
    return MATRIX_FORMATS[format or format_of(path)].read(path, name)


def _check_regular(path: Path) -> None:
    """Refuse directories and devices, which may have no end."""
    if path.exists() and not path.is_file():
        code = "matrices.unreadable/directory" if path.is_dir() else "matrices.unreadable/device"
        raise FemtuneError(code, where=Where(str(path)))
    if not path.exists():
        raise FemtuneError("matrices.unreadable/missing", where=Where(str(path)))


def format_of(path: Path) -> str:
    """Key of a file's format (error ``matrices.unknown-format``)."""
    try:
        with path.open("rb") as file:
            start = file.read(_SIGNATURE_BYTES).lower()
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error
    for format in MATRIX_FORMATS:
        if format.signature and start.startswith(format.signature):
            return format.key
    if by_suffix := MATRIX_FORMATS.of_suffix(path):
        return by_suffix.key
    raise FemtuneError(
        "matrices.unknown-format",
        where=Where(str(path)),
        values={"formats": ", ".join(MATRIX_FORMATS.keys)},
        suffix=path.suffix,
        did_you_mean=did_you_mean(path.suffix, MATRIX_FORMATS.suffixes),
    )
