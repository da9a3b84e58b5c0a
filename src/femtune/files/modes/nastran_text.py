"""Modes of Nastran from its listing (F06) and from its punch file (PCH)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
from femtune.files.modes.solved import SolvedModes, lines_of, no_modes, number, of_blocks, truncated

_REAL = r"[-+]?\d*\.\d*(?:[EeDd]?[-+]?\d+)?"
_EIGENVALUE = re.compile(rf"\s*(\d+)\s+(\d+)((?:\s+{_REAL}){{3,5}})\s*")
_MASS = re.compile(rf"\s*X\s+({_REAL})(?:\s+{_REAL}){{3}}\s*")
_TOTAL_MASS = re.compile(rf"\s*Total mass\s*=\s*({_REAL})\s*")
_VECTOR = re.compile(rf"\s*(\d+)(?:\s+(?:[GS]|\d+))?((?:\s+{_REAL}){{1,6}})\s*")
_SHAPE_TITLE = re.compile(r"REALEIGENVECTORNO\.(\d+)|OUTPUTFOREIGENVECTOR(\d+)")
_ENDS = ("ENDOFJOB", "MYSTRANEND", "MYSTRANTERMINATED")
_TABLE = "REALEIGENVALUES"
_MOST_OTHER_LINES = 12
"""Lines without numbers that may interrupt a table: headings, the head of a new page."""
_END_LINES = 40
"""Lines at the end of a listing among which one says that the job has ended."""


def read_f06(path: Path) -> SolvedModes:
    """Frequencies, shapes where DISPLACEMENT(PRINT) lists them, and the mass of the grid point weight generator.

    Shapes are of unit modal mass, whatever their normalisation in the listing, if it has generalised masses.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    lines = lines_of(path)
    if not any(end in line.upper().replace(" ", "") for line in lines[-_END_LINES:] for end in _ENDS):
        raise truncated(path, "END OF JOB")
    listing = _Listing(path)
    for i, line in enumerate(lines, start=1):
        listing.take(line, i)
    if not listing.freq_hz:
        raise no_modes(path, "R E A L   E I G E N V A L U E S")
    scale = (
        1.0 / np.sqrt(listing.modal_mass) if all(m > 0.0 for m in listing.modal_mass) else np.ones(len(listing.freq_hz))
    )
    freq_hz = np.array(listing.freq_hz)
    shapes = {
        j: {n: v * scale[j - 1] for n, v in block.items()} for j, block in listing.blocks.items() if j <= len(scale)
    }
    return of_blocks(freq_hz, shapes, path, listing.mass)


class _Listing:
    """The tables of a listing as its lines go by."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.freq_hz: list[float] = []
        self.modal_mass: list[float] = []
        self.blocks: dict[int, dict[int, Reals]] = {}
        self.mass: float | None = None
        self._table = ""
        self._gap = 0
        self._block: dict[int, Reals] = {}

    def take(self, line: str, at: int) -> None:
        """The next line."""
        packed = line.upper().replace(" ", "")
        if packed.startswith(_TABLE) and not packed.startswith("REALEIGENVECTOR"):
            self._table = "values"
        elif title := _SHAPE_TITLE.search(packed):
            self._table = "shape"
            # a long table goes on under the same title on the next page
            self._block = self.blocks.setdefault(int(title[1] or title[2]), {})
        elif "MASSAXISSYSTEM" in packed:
            self._table = "mass"
        else:
            self._row(line, at)
            return
        self._gap = 0

    def _row(self, line: str, at: int) -> None:
        if self.mass is None and (total := _TOTAL_MASS.fullmatch(line)):
            self.mass = number(total[1], self.path, at)
        known = {"values": self._value, "shape": self._vector, "mass": self._mass_of}.get(self._table)
        if known is not None and known(line, at):
            self._gap = 0
            return
        self._gap += 1
        if self._gap > _MOST_OTHER_LINES:
            self._table = ""

    def _value(self, line: str, at: int) -> bool:
        row = _EIGENVALUE.fullmatch(line)
        if row is None:
            return False
        if int(row[1]) == len(self.freq_hz) + 1:
            values = [number(text, self.path, at) for text in row[3].split()]
            self.freq_hz.append(values[2])
            self.modal_mass.append(values[3] if len(values) > 3 else 0.0)
        return True

    def _vector(self, line: str, at: int) -> bool:
        row = _VECTOR.fullmatch(line)
        if row is None:
            return False
        values = [number(text, self.path, at) for text in row[2].split()]
        if len(values) == 6:
            self._block[int(row[1])] = np.array(values)
        return True

    def _mass_of(self, line: str, at: int) -> bool:
        row = _MASS.fullmatch(line)
        if row is not None and self.mass is None:
            self.mass = number(row[1], self.path, at)
        return row is not None


_NEGATIVE = 1e-6
"""Negative eigenvalue, relative to the largest one, that is more than rounding of a rigid-body mode."""
_HEAD = re.compile(rf"\$EIGENVALUE\s*=\s*({_REAL})\s+MODE\s*=\s*(\d+)")


def read_punch(path: Path) -> SolvedModes:
    """Frequencies and shapes of a punch file: DISPLACEMENT(PUNCH) of a modes solution.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    values: dict[int, float] = {}
    blocks: dict[int, dict[int, Reals]] = {}
    block: dict[int, Reals] | None = None
    node = 0
    for i, line in enumerate(lines_of(path), start=1):
        if line.startswith("$"):
            head = _HEAD.match(line)
            if head is not None:
                values[int(head[2])] = number(head[1], path, i)
                block = blocks.setdefault(int(head[2]), {})
            elif line.startswith("$TITLE"):
                block = None
        elif block is not None:
            if len(line) < 72:
                raise truncated(path, "the end of a line")
            three = [number(line[18 * k : 18 * (k + 1)], path, i) for k in (1, 2, 3)]
            if line.startswith("-CONT-"):
                if node not in block:
                    raise truncated(path, "the first line of a grid point")
                block[node][3:] = three
            else:
                node = int(number(line[:10], path, i))
                block[node] = np.array([*three, np.nan, np.nan, np.nan])
    if not values:
        raise no_modes(path, "$EIGENVALUE = … MODE = …")
    _check_whole(blocks, path)
    eigenvalues = np.array([values[j] for j in sorted(values)])
    # rounding makes rigid-body modes slightly negative
    negative = eigenvalues < -_NEGATIVE * np.abs(eigenvalues).max()
    freq_hz = np.where(negative, np.nan, np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi))
    return of_blocks(freq_hz, blocks, path, None)


def _check_whole(blocks: dict[int, dict[int, Reals]], path: Path) -> None:
    """A file that was cut has modes with fewer points; one that was cut in a point has no rotations there."""
    sizes = {len(block) for block in blocks.values()}
    if len(sizes) > 1 or any(np.isnan(v).any() for block in blocks.values() for v in block.values()):
        raise FemtuneError("external.output/truncated", where=Where(str(path)), expected="all points of all modes")
