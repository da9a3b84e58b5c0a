"""The result of an identification, before it is written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.identification.choice import Limits, stable
from femtune.modal.frf_set import KINDS
from femtune.testdata import NO_GEOMETRY

if TYPE_CHECKING:
    from femtune.arrays import Flags
    from femtune.errors import Notice
    from femtune.identification.choice import Candidate
    from femtune.identification.harmonics import Line
    from femtune.identification.input_lines import InputVerdict
    from femtune.identification.mode_checks import ModeRemark
    from femtune.identification.pole_table import PoleTable
    from femtune.modal import FrfSet, ModeSet, StateSpace
    from femtune.testdata import WireFrame


@dataclass(frozen=True, eq=False)
class Curve:
    """What lies behind the stabilisation diagram: FRFs summed, or the first singular value of the spectra, in dB.

    `singular_db` (s, lines) are the largest singular values of the functions or spectra, in dB of the same reference;
    `power` (lines,) is the sum of the auto spectra, relative to its largest value, and empty for functions.
    """

    freq_hz: NDArray[np.float64]
    level_db: NDArray[np.float64]
    words: str
    singular_db: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    power: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


MOST_SINGULAR = 4
"""Singular values behind the diagram: as many close modes as can be told apart there by eye."""


MOST_ROWS = 40
"""Rows or columns, whichever are fewer, up to which singular values are computed at each line."""


def singular_levels(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """(s, lines) largest singular values of matrices (lines, n, m), in dB; none of large ones, which take long."""
    known = np.nan_to_num(values)
    wide = known if known.shape[1] <= known.shape[2] else known.conj().transpose(0, 2, 1)
    if wide.shape[1] > MOST_ROWS:
        return np.zeros((0, len(values)))
    squares = np.linalg.eigvalsh(wide @ wide.conj().transpose(0, 2, 1))[:, ::-1][:, :MOST_SINGULAR]
    return np.asarray(10.0 * np.log10(np.maximum(squares, 1e-300))).T


@dataclass(frozen=True, eq=False)
class Found:
    """Modes and what they were chosen from.

    Parameters
    ----------
    modes : the result
    table, candidates : poles of every order and their clusters; None and () for methods without orders
    by_method : frequencies (m,) by every method for each of `modes`; NaN where the method did not find the mode
    found_in : (m,) estimates that had each mode, of `estimates`; None where there is only one
    dropped : frequency and number of estimates of what too few of them had
    curve : behind the stabilisation diagram
    measured, synthesised : functions at the lines of the fit, where the input is known
    measured_sd : (responses, references, lines) √E|error|² of the measured functions, where their estimate gives it
    misfit_percent : (responses, references) what the synthesised functions miss of the measured ones, or None
    system : state-space model, where the input is known
    of_input : verdicts on peaks that the excitation has, where it was recorded
    notices : what a user should know
    remarks : those of them that belong to one mode
    collinearity : (m,) phase collinearity of the complex shapes, also where `modes` has real ones
    geometry : of the test, where its file has one
    lines : of machines and of the mains in a record of responses, which are no modes
    of_whole_record : whether the functions are those of a whole record, whose coherence is that of the fit
    decay : 1/τ of an exponential window, in 1/s, by which the functions decay faster than the poles of `table`
    """

    modes: ModeSet
    collinearity: NDArray[np.float64]
    table: PoleTable | None
    candidates: tuple[Candidate, ...]
    by_method: dict[str, NDArray[np.float64]]
    curve: Curve
    found_in: NDArray[np.int64] | None = None
    estimates: int = 1
    dropped: tuple[tuple[float, int], ...] = ()
    measured: FrfSet | None = None
    synthesised: FrfSet | None = None
    misfit_percent: NDArray[np.float64] | None = None
    system: StateSpace | None = None
    of_input: tuple[InputVerdict, ...] = ()
    notices: tuple[Notice, ...] = ()
    remarks: tuple[ModeRemark, ...] = ()
    lines: tuple[Line, ...] = ()
    measured_sd: NDArray[np.float64] | None = field(default=None, repr=False)
    geometry: WireFrame = field(default=NO_GEOMETRY, repr=False)
    of_whole_record: bool = False
    decay: float = 0.0

    @property
    def derivatives(self) -> int:
        """Derivatives of the measured functions: 0 receptance, 1 mobility, 2 accelerance; −1 without functions."""
        return -1 if self.measured is None else KINDS.index(self.measured.kind)

    def stable_poles(self) -> Flags:
        """Which poles of `table` are stable from order to order; empty without a table."""
        return np.zeros(0, dtype=bool) if self.table is None else stable(self.table, Limits())

    def of_structure(self, i: int) -> bool:
        """False for a peak of the excitation."""
        return not (self.of_input and self.of_input[i].of_input)

    def only_method(self, i: int) -> str | None:
        """The method that alone has a mode, None where several have it or only one was used."""
        having = [name for name, freq in self.by_method.items() if np.isfinite(freq[i])]
        return having[0] if len(having) == 1 < len(self.by_method) else None
