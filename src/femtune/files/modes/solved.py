"""SolvedModes: what a solver gave out for one run, and the text of its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where

MOST_BYTES = 1 << 30
"""Size of the largest output file that is read: 1 GiB, which fits into the memory of a workstation."""


@dataclass(frozen=True, eq=False)
class SolvedModes:
    """Modes as a solver listed them.

    Parameters
    ----------
    freq_hz : (m,) natural frequencies; NaN where the solver lists a negative eigenvalue of an elastic mode
    nodes : (n,) numbers of the nodes with shapes; none where only frequencies were read
    shapes : (n, 6, m) translations and rotations in the solver's scale; NaN where it gives none
    mass : of the whole model, where the solver prints it
    participation : (6, m) participation factors φᵀMr of rigid-body translations along the axes and rotations about
        the origin, for shapes of unit modal mass, where they are known
    """

    freq_hz: Reals
    nodes: NDArray[np.int64]
    shapes: Reals
    mass: float | None = None
    participation: Reals | None = None

    @classmethod
    def of_frequencies(cls, freq_hz: Reals, mass: float | None = None) -> SolvedModes:
        """Frequencies alone."""
        values = np.asarray(freq_hz, dtype=float)
        return cls(values, np.zeros(0, np.int64), np.zeros((0, 6, len(values))), mass)

    @property
    def has_shapes(self) -> bool:
        """True where shapes were read."""
        return bool(len(self.nodes))


def of_blocks(freq_hz: Reals, blocks: Mapping[int, Mapping[int, Reals]], path: Path, mass: float | None) -> SolvedModes:
    """Frequencies with the shapes that belong to them.

    Parameters
    ----------
    blocks : by number of the mode, from 1: (6,) components by node

    Raises
    ------
    FemtuneError : ``external.output/shapes`` where a mode has no shape, or the shapes have different nodes
    """
    if not blocks:
        return SolvedModes.of_frequencies(freq_hz, mass)
    nodes = np.array(sorted(next(iter(blocks.values()))), np.int64)
    if sorted(blocks) != list(range(1, len(freq_hz) + 1)) or any(sorted(b) != nodes.tolist() for b in blocks.values()):
        raise FemtuneError("external.output/shapes", where=Where(str(path)), n_modes=len(freq_hz), n_shapes=len(blocks))
    columns = [np.array([blocks[j][int(n)] for n in nodes]) for j in sorted(blocks)]
    return SolvedModes(freq_hz, nodes, np.stack(columns, axis=-1), mass)


def lines_of(path: Path) -> list[str]:
    """The lines of an output file.

    Raises
    ------
    FemtuneError : ``external.output/missing``, ``external.output/unreadable``, ``external.output/too-large``
    """
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise FemtuneError("external.output/too-large", where=Where(str(path)), size_gib=size / 2**30)
        return path.read_text(encoding="latin-1").splitlines()
    except FileNotFoundError as error:
        raise FemtuneError("external.output/missing", where=Where(str(path))) from error
    except OSError as error:
        raise FemtuneError("external.output/unreadable", where=Where(str(path)), reason=error.strerror) from error


def number(text: str, path: Path, line: int) -> float:
    """A number of a listing, with E or D before its exponent.

    Raises
    ------
    FemtuneError : ``external.output/no-number``
    """
    try:
        return float(text.strip().upper().replace("D", "E"))
    except ValueError as error:
        raise FemtuneError("external.output/no-number", where=Where(str(path), line), text=text.strip()[:30]) from error


def truncated(path: Path, expected: str) -> FemtuneError:
    """The error that a file ends before what ends a whole one."""
    return FemtuneError("external.output/truncated", where=Where(str(path)), expected=expected)


def no_modes(path: Path, expected: str) -> FemtuneError:
    """The error that a file has no modes."""
    return FemtuneError("external.output/no-modes", where=Where(str(path)), expected=expected)
