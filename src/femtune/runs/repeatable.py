"""Whether a solver gives the same numbers for the same input: one run more than needed, before hundreds."""

from __future__ import annotations

import numpy as np

from femtune.errors import FemtuneError
from femtune.runs.external import Solver, Values
from femtune.runs.outcome import RunOutcome

_RIGID = 1e-3
"""Frequency relative to the highest below which a difference is relative to this part of the highest."""


def check_repeatable(solver: Solver, values: Values, known: RunOutcome, tolerance: float = 1e-6) -> float:
    """Run a point that is known once more; the largest relative difference of its frequencies.

    Rigid-body modes, whose frequencies are rounding, are compared with the largest frequency.

    Parameters
    ----------
    known : its outcome
    tolerance : relative difference that is allowed

    Raises
    ------
    FemtuneError : ``external.not-repeatable``
    """
    return compare_repeated(values, known, solver.run(values), tolerance)


def compare_repeated(values: Values, known: RunOutcome, again: RunOutcome, tolerance: float) -> float:
    """See `check_repeatable`, for two runs that were made."""
    if known.modes is None or again.modes is None:
        bad = known if known.modes is None else again
        raise FemtuneError("external.failed", values={"point": described(values)}, failure=str(bad.failures[-1]))
    one, other = known.modes.freq_hz, again.modes.freq_hz
    if len(one) != len(other):
        raise FemtuneError(
            "external.not-repeatable/count", values={"point": described(values)}, one=len(one), other=len(other)
        )
    scale = np.maximum(np.abs(one), _RIGID * np.abs(one).max(initial=0.0))
    noise = np.abs(other - one) / np.where(scale > 0.0, scale, 1.0)
    worst = int(np.argmax(noise))
    if noise[worst] > tolerance:
        raise FemtuneError(
            "external.not-repeatable",
            values={"point": described(values), "tolerance": tolerance},
            mode=worst + 1, one=float(one[worst]), other=float(other[worst]),
        )  # fmt: skip
    return float(noise[worst])


def described(values: Values) -> str:
    """A point in words."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
