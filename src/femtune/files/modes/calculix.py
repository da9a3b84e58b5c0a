"""Modes of CalculiX: frequencies from a .dat file, frequencies and shapes from a .frd file.

The .frd file has frequencies of six to ten digits and shapes of six. Both files are written step by step, so that a
file of a run that was killed is recognised by its end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.files.modes.solved import SolvedModes, lines_of, no_modes, number, of_blocks, truncated

_ROW = re.compile(r"\s*(\d+)\s+([-+.\dED]+)\s+([-+.\dED]+)\s+([-+.\dED]+)\s+([-+.\dED]+)\s*")
_TITLE, _NEXT = "EIGENVALUEOUTPUT", "PARTICIPATIONFACTORS"
_END = " 9999"
_WIDTH = 12


def read_dat(path: Path) -> SolvedModes:
    """Frequencies of the last table of eigenvalues of a .dat file.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    found: list[float] = []
    inside = complete = False
    for i, line in enumerate(lines_of(path), start=1):
        title = line.replace(" ", "").strip()
        if title == _TITLE:
            found, inside, complete = [], True, False
        elif title == _NEXT:
            inside, complete = False, True
        elif inside and (row := _ROW.fullmatch(line)):
            found.append(_frequency(number(row[2], path, i), number(row[4], path, i), number(row[5], path, i)))
    if not found:
        raise no_modes(path, "E I G E N V A L U E   O U T P U T")
    if not complete:
        raise truncated(path, "P A R T I C I P A T I O N   F A C T O R S")
    return SolvedModes.of_frequencies(np.array(found))


def _frequency(eigenvalue: float, freq_hz: float, imaginary: float) -> float:
    """A negative eigenvalue is listed with an imaginary frequency."""
    return float("nan") if eigenvalue < 0.0 and imaginary > 0.0 else freq_hz


def read_frd(path: Path) -> SolvedModes:
    """Frequencies and shapes of a .frd file: ``*NODE FILE`` with U, for shells and beams with ``OUTPUT=2D``.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    lines = lines_of(path)
    if not lines or lines[-1].rstrip() != _END:
        raise truncated(path, "9999")
    freq_hz: list[float] = []
    blocks: dict[int, dict[int, Reals]] = {}
    for i, line in enumerate(lines):
        if line.startswith("  100CL") and "MODAL" in line and lines[i + 1].split()[:2] == ["-4", "DISP"]:
            freq_hz.append(number(line[12:24], path, i + 1))
            blocks[len(freq_hz)] = dict(_shape(lines, i + 2, path))
    if not freq_hz:
        raise no_modes(path, "100CL … MODAL")
    return of_blocks(np.array(freq_hz), blocks, path, None)


def _shape(lines: list[str], at: int, path: Path) -> Iterator[tuple[int, Reals]]:
    """Node and components of one block, from the lines after its heading."""
    for i in range(at, len(lines)):
        key = lines[i][:3]
        if key == " -5":
            continue
        if key != " -1":
            return
        texts = [lines[i][13 + _WIDTH * k : 13 + _WIDTH * (k + 1)] for k in range(3)]
        values = [number(text, path, i + 1) for text in texts]
        yield int(number(lines[i][3:13], path, i + 1)), np.array([*values, np.nan, np.nan, np.nan])
