"""Accepted criteria of test-analysis correlation as data, and the verdict on each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from femtune.correlate.correlation import Correlation
from femtune.correlate.reduced_mass import NotTested

Reals = NDArray[np.float64]
Measured = tuple[float, str] | NotTested
"""The worst value and where it was found."""


class Outcome(Enum):
    """What a criterion says."""

    PASS = "pass"
    FAIL = "fail"
    NOT_TESTED = "not tested"


@dataclass(frozen=True)
class Criterion:
    """One number of a standard: `quantity` must be at most (or at least) `limit`."""

    standard: str
    quantity: str
    limit: float
    at_most: bool


@dataclass(frozen=True)
class Verdict:
    """A criterion beside what was measured: the worst value over the pairs, None where it was not tested."""

    criterion: Criterion
    measured: float | None
    outcome: Outcome
    remark: str


CRITERIA = (
    Criterion("NASA-STD-5002", "frequency error", 0.05, True),
    Criterion("NASA-STD-5002", "cross-orthogonality, diagonal", 0.90, False),
    Criterion("NASA-STD-5002", "cross-orthogonality, off the diagonal", 0.10, True),
    Criterion("MIL-STD-1540C", "frequency error", 0.03, True),
    Criterion("MIL-STD-1540C", "cross-orthogonality, diagonal", 0.95, False),
    Criterion("ECSS-E-ST-32-11C", "frequency error", 0.05, True),
    Criterion("ECSS-E-ST-32-11C", "MAC", 0.90, False),
    Criterion("common practice", "self-orthogonality of the test, off the diagonal", 0.10, True),
)
"""The limits that these standards name for primary modes; a project may tailor them."""


def assess(correlation: Correlation, criteria: tuple[Criterion, ...] = CRITERIA) -> tuple[Verdict, ...]:
    """A verdict on each criterion.

    A test mode that should have a partner and has none fails every criterion that can be tested on pairs, for it
    cannot be within any limit; a mode that was left out with a reason is not counted.
    """
    return tuple(_verdict(correlation, criterion) for criterion in criteria)


def _verdict(correlation: Correlation, criterion: Criterion) -> Verdict:
    measured = _MEASURES[criterion.quantity](correlation)
    if isinstance(measured, NotTested):
        return Verdict(criterion, None, Outcome.NOT_TESTED, measured.reason)
    value, remark = measured
    passed = value <= criterion.limit if criterion.at_most else value >= criterion.limit
    missing = [correlation.test.labels[u.test] for u in correlation.pairing.unpaired_test if not u.left_out]
    if missing and not criterion.quantity.startswith("self"):
        passed, remark = False, f"{remark}; test modes without partner: {', '.join(missing)}"
    return Verdict(criterion, value, Outcome.PASS if passed else Outcome.FAIL, remark)


def _frequency(c: Correlation) -> Measured:
    return _worst_pair(c, np.abs(c.frequency_errors), largest=True)


def _mac(c: Correlation) -> Measured:
    return _worst_pair(c, c.macs, largest=False)


def _worst_pair(c: Correlation, values: Reals, *, largest: bool) -> Measured:
    if not len(values):
        return NotTested("no modes are paired")
    # an undefined value is the worst of all
    at = int(np.argmax(np.nan_to_num(values if largest else -values, nan=np.inf)))
    pair = c.pairing.pairs[at]
    return float(values[at]), f"test mode {c.test.labels[pair.test]} with model mode {c.model.labels[pair.model]}"


def _diagonal(c: Correlation) -> Measured:
    if isinstance(c.cross_orthogonality, NotTested):
        return c.cross_orthogonality
    return _worst_pair(c, np.diag(c.cross_orthogonality), largest=False)


def _off_diagonal(c: Correlation, matrix: Reals | NotTested, model_columns: bool) -> Measured:
    if isinstance(matrix, NotTested):
        return matrix
    if len(matrix) < 2:
        return NotTested("a single pair has nothing off the diagonal")
    off = matrix - np.diag(np.diag(matrix))
    i, j = np.unravel_index(int(np.argmax(off)), off.shape)
    row, column = c.pairing.pairs[int(i)], c.pairing.pairs[int(j)]
    other = f"model mode {c.model.labels[column.model]}" if model_columns else f"test mode {c.test.labels[column.test]}"
    return float(off[i, j]), f"test mode {c.test.labels[row.test]} with {other}"


_MEASURES: dict[str, Callable[[Correlation], Measured]] = {
    "frequency error": _frequency,
    "MAC": _mac,
    "cross-orthogonality, diagonal": _diagonal,
    "cross-orthogonality, off the diagonal": lambda c: _off_diagonal(c, c.cross_orthogonality, True),
    "self-orthogonality of the test, off the diagonal": lambda c: _off_diagonal(c, c.self_orthogonality, False),
}
