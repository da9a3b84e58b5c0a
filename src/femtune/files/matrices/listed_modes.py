"""Natural frequencies as a solver listed them: Nastran f06, CalculiX and Abaqus .dat."""

from __future__ import annotations

import re
from pathlib import Path

from femtune.errors import FemtuneError, Where

_TITLES = ("REALEIGENVALUES", "EIGENVALUEOUTPUT")
_ROW = re.compile(r"\s*\d+(?:\s+\d+)?((?:\s+[-+]?(?:\d+\.\d*|\.\d+)(?:[ED][-+]?\d+)?){3,})\s*")
_MOST_OTHER_LINES = 12
"""Lines without numbers that may interrupt a table: headings, the head of a new page."""


def read_listed_modes(path: Path) -> tuple[float, ...]:
    """Frequencies in Hz of the first table of eigenvalues, rigid-body modes among them.

    Raises
    ------
    FemtuneError : ``matrices.no-listing``, ``matrices.unreadable``
    """
    freq_hz: list[float] = []
    inside, gap, last = False, 0, 0
    for line in _lines(path):
        if line.replace(" ", "").strip() in _TITLES:
            if freq_hz and gap > _MOST_OTHER_LINES:
                break
            inside, gap = True, 0
            continue
        match = _ROW.fullmatch(line.rstrip("\r\n")) if inside else None
        if match is None:
            gap += 1
            inside = inside and not (freq_hz and gap > _MOST_OTHER_LINES)
            continue
        number = int(line.split()[0])
        if number <= last:
            break
        # eigenvalue, radians, cycles
        freq_hz.append(float(match[1].replace("D", "E").split()[2]))
        gap, last = 0, number
    if not freq_hz:
        raise _none(path)
    return tuple(freq_hz)


def _lines(path: Path) -> list[str]:
    try:
        with path.open(encoding="latin-1") as file:
            return list(file)
    except OSError as error:
        raise FemtuneError("matrices.unreadable", where=Where(str(path)), strerror=error.strerror) from error


def _none(path: Path) -> FemtuneError:
    return FemtuneError(
        "matrices.no-listing",
        where=Where(str(path)),
        values={"known tables": "Nastran f06 (REAL EIGENVALUES), CalculiX and Abaqus dat (EIGENVALUE OUTPUT)"},
    )
