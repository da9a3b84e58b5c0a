"""Frequencies of Abaqus/Standard: the table of eigenvalues of a *FREQUENCY step in the .dat file.

Limits: real eigenvalues, five digits, no shapes. Of several steps the last one counts. The file is written step by
step: a whole one says at its end that the analysis has been completed.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from femtune.files.modes.solved import SolvedModes, lines_of, no_modes, number, truncated

_REAL = r"[-+]?\d*\.\d*(?:[EeDd][-+]?\d+)?"
_ROW = re.compile(rf"\s*(\d+)\s+({_REAL})\s+({_REAL})\s+({_REAL})(?:\s+{_REAL}){{0,2}}\s*")
_TITLE = "EIGENVALUEOUTPUT"
_END = "ANALYSISHASBEENCOMPLETED"
_NEGATIVE = 1e-6
"""Negative eigenvalue, relative to the largest one listed, that is more than rounding of a rigid-body mode: the listing
has five digits."""


def read_abaqus_dat(path: Path) -> SolvedModes:
    """Frequencies of the last table of eigenvalues of a .dat file.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    values: list[float] = []
    freq_hz: list[float] = []
    inside = complete = False
    for i, line in enumerate(lines_of(path), start=1):
        packed = line.replace(" ", "").strip()
        if packed == _TITLE:
            values, freq_hz, inside = [], [], True
        elif inside and (row := _ROW.fullmatch(line)) and int(row[1]) == len(values) + 1:
            values.append(number(row[2], path, i))
            freq_hz.append(number(row[4], path, i))
        elif inside and values and packed:
            inside = False
        complete = complete or _END in packed
    if not complete:
        raise truncated(path, "THE ANALYSIS HAS BEEN COMPLETED")
    if not values:
        raise no_modes(path, "E I G E N V A L U E    O U T P U T")
    # rounding makes rigid-body modes slightly negative
    eigenvalues = np.array(values)
    negative = eigenvalues < -_NEGATIVE * np.abs(eigenvalues).max()
    return SolvedModes.of_frequencies(np.where(negative, np.nan, freq_hz))
