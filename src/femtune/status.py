"""Outcome of an iterative method; the text of a member is the message that a user reads."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """Outcome of an iteration; `ok` states whether the result is an optimum.

    Examples
    --------
    >>> import femtune as ft
    >>> ft.Status["CONVERGED_AT_BOUNDS"].ok
    True
    """

    CONVERGED = "converged; parameters and objective are stationary"
    CONVERGED_AT_BOUNDS = "converged, with at least one parameter at its bound"
    UNDETERMINED = "converged, but the data do not determine all combinations of the parameters"
    EXACT = "converged; all residuals are zero, so that the model reproduces the test exactly"
    MAX_ITERATIONS = "stopped at the iteration limit before it converged; the best point is kept"
    STALLED = "stopped because no step of any length reduces the objective; the best point is kept"
    SHORT_STEPS = (
        "stopped because the side constraint on the change of each iteration makes the steps shorter than the "
        "tolerance; the data are not at their minimum"
    )
    PAIRING_CYCLES = "stopped because the pairing of modes alternates between iterations; the best point is kept"
    KNOWN_MINIMUM = "stopped because the steps lead back to a minimum that is known"
    SOLVE_FAILED = "stopped because the eigen-solution failed at a trial point; the best point is kept"

    @property
    def ok(self) -> bool:
        """True where the result is an optimum."""
        return self in (Status.CONVERGED, Status.CONVERGED_AT_BOUNDS, Status.UNDETERMINED, Status.EXACT)
