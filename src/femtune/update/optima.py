"""Ends of several starts: which are the same optimum, which are as good, and what that means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, f

from femtune.status import Status

Reals = NDArray[np.float64]

SAME, SURE, EXACT = 1e-3, 0.95, 1e-16
_SPARE = 3


class StartOutcome(Enum):
    """What became of a start, beside the others."""

    BEST = "ended at the best optimum that was found"
    AS_GOOD = "ended elsewhere, at an optimum as good within the noise"
    WORSE = "ended at a worse optimum, which is not the answer"
    UNFINISHED = "did not converge"
    FAILED = "could not be solved"


@dataclass(frozen=True, eq=False)
class StartResult:
    """One start, kept whatever became of it.

    Parameters
    ----------
    start, end : (k,) normalised parameters; `end` is the start where it failed
    objective : ½ rᵀr at the end with the side constraint, NaN where it failed
    status : of the last update; None where it failed, for the reason in `problem`
    tries : how many times it set out: one, and one more for every hop from an end that was not good enough
    iterations : of all tries
    """

    number: int
    start: Reals
    end: Reals
    objective: float
    status: Status | None
    tries: int = 1
    iterations: int = 0
    problem: str = ""

    @property
    def at_optimum(self) -> bool:
        """True where the iteration converged, at whichever optimum."""
        return self.status is not None and self.status.ok


@dataclass(frozen=True, eq=False)
class Optimum:
    """Ends that are one point.

    Parameters
    ----------
    x, objective : of the best of them
    members : numbers of the starts that ended there
    as_good : whether the data cannot tell it from the best
    """

    x: Reals
    objective: float
    members: tuple[int, ...]
    as_good: bool


def noise_level(best: float, n_residuals: int, n_parameters: int) -> float:
    """By how much the objective ½rᵀr may differ from the best for the data not to tell two points apart.

    Half the 95 % quantile of χ² of as many degrees of freedom as parameters; where residuals to spare show less scatter
    than was stated, half that of F on the scatter that they show: weights that are no standard deviations must not
    make every valley as good as the best one. An exact fit has no noise, and only exact fits are as good.
    """
    stated = 0.5 * float(chi2.ppf(SURE, max(n_parameters, 1)))
    spare = n_residuals - n_parameters
    if best < EXACT or spare < _SPARE:
        return 10.0 * EXACT if best < EXACT else stated
    shown = max(n_parameters, 1) * float(f.ppf(SURE, max(n_parameters, 1), spare)) * best / spare
    return min(stated, shown)


def distinct_optima(starts: Sequence[StartResult], spread: Reals, noise: float) -> tuple[Optimum, ...]:
    """Converged ends in clusters, the best first.

    Two ends are the same where no parameter differs by more than a thousandth of its prior standard deviation.
    """
    left = sorted((s for s in starts if s.at_optimum), key=lambda s: (s.objective, s.number))
    best = left[0].objective if left else np.nan
    found = []
    while left:
        first = left[0]
        same = [s for s in left if np.abs((s.end - first.end) / spread).max(initial=0.0) <= SAME]
        numbers = tuple(sorted(s.number for s in same))
        found.append(Optimum(first.end, first.objective, numbers, first.objective - best <= noise))
        left = [s for s in left if s not in same]
    return tuple(found)


def outcomes(starts: Sequence[StartResult], optima: Sequence[Optimum]) -> dict[int, StartOutcome]:
    """What became of each start, by its number."""
    at = {number: i for i, optimum in enumerate(optima) for number in optimum.members}
    out = {}
    for s in starts:
        if s.number in at:
            i = at[s.number]
            good = StartOutcome.AS_GOOD if optima[i].as_good else StartOutcome.WORSE
            out[s.number] = StartOutcome.BEST if i == 0 else good
        else:
            out[s.number] = StartOutcome.FAILED if s.status is None else StartOutcome.UNFINISHED
    return out


def start_sentences(starts: Sequence[StartResult], optima: Sequence[Optimum]) -> tuple[str, ...]:
    """What the starts tell of the answer."""
    n, found = len(starts), outcomes(starts, optima)
    if not optima:
        return (f"None of {n} starts converged: the best point that was seen is kept, and it is no optimum.",)
    others = [o for o in optima[1:] if o.as_good]
    out = [f"{len(optima[0].members)} of {n} starts {_end(len(optima[0].members))} at the same optimum."]
    if others:
        count = sum(len(o.members) for o in others)
        out.append(
            f"{count} {_other(count)} {_end(count)} elsewhere and {'is' if count == 1 else 'are'} as good within the "
            f"noise, at {len(others)} other {'point' if len(others) == 1 else 'points'}: the answer is not unique."
        )
    elif len(optima[0].members) == 1 and n > 1:
        out.append("No second start confirms it: more starts may find a better one.")
    worse = [o for o in optima if not o.as_good]
    if worse:
        count = sum(len(o.members) for o in worse)
        text = f"{count} {_end(count)} at {len(worse)} worse {'optimum' if len(worse) == 1 else 'optima'}"
        out.append(f"{text}, which {'is' if len(worse) == 1 else 'are'} not the answer.")
    return (*out, *_lost(found))


def _lost(found: dict[int, StartOutcome]) -> list[str]:
    values = list(found.values())
    unfinished, failed = values.count(StartOutcome.UNFINISHED), values.count(StartOutcome.FAILED)
    out = [f"{unfinished} did not converge."] if unfinished else []
    return [*out, f"{failed} could not be solved."] if failed else out


def _end(count: int) -> str:
    return "ends" if count == 1 else "end"


def _other(count: int) -> str:
    return "other" if count == 1 else "others"
