"""Found: all that an identification came to, before it is written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.testdata import NO_GEOMETRY

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.identification.choice import Candidate
    from femtune.identification.input_lines import InputVerdict
    from femtune.identification.pole_table import PoleTable
    from femtune.modal import FrfSet, ModeSet, StateSpace
    from femtune.testdata import WireFrame


@dataclass(frozen=True, eq=False)
class Curve:
    """What lies behind the stabilisation diagram: FRFs summed, or the first singular value of the spectra, in dB."""

    freq_hz: NDArray[np.float64]
    level_db: NDArray[np.float64]
    words: str


@dataclass(frozen=True, eq=False)
class Found:
    """Modes and what they were chosen from.

    Parameters
    ----------
    modes : the result
    table, candidates : poles of every order and their clusters; None and () for methods without orders
    by_method : frequencies (m,) of every method beside those of `modes`; NaN where it lacks the mode
    found_in : (m,) estimates that had each mode, of `estimates`; None where there is only one
    dropped : frequency and number of estimates of what too few of them had
    curve : behind the stabilisation diagram
    measured, synthesised : functions at the lines of the fit, where the input is known
    misfit_percent : (responses, references) what the synthesised functions miss of the measured ones, or None
    system : state-space model, where the input is known
    of_input : verdicts on peaks that the excitation has, where it was recorded
    notices : what a user should know
    geometry : of the test, where its file has one
    """

    modes: ModeSet
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
    geometry: WireFrame = field(default=NO_GEOMETRY, repr=False)
