"""How an iterative method ended: members are values, their text is the message."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """Outcome of an iteration; `ok` says whether the result may be used as an optimum.

    Examples
    --------
    >>> import femtune as ft
    >>> ft.Status["CONVERGED_AT_BOUNDS"].ok
    True
    """

    CONVERGED = "converged: neither the parameters nor the objective change any more"
    CONVERGED_AT_BOUNDS = "converged, with at least one parameter at its bound"
    UNDETERMINED = "converged, but the data leave combinations of parameters undetermined"
    EXACT = "the residuals vanish: the model repeats the test exactly"
    MAX_ITERATIONS = "stopped at the iteration limit before it converged; the last point is kept"
    STALLED = "no step of any length lowers the objective; the best point is kept"
    PAIRING_CYCLES = "the pairing of modes changes back and forth; the last point is kept"
    SOLVE_FAILED = "the eigen-solution failed at a trial point; the best point is kept"

    @property
    def ok(self) -> bool:
        """True where the result is an optimum."""
        return self in (Status.CONVERGED, Status.CONVERGED_AT_BOUNDS, Status.UNDETERMINED, Status.EXACT)
