"""Verdicts on a correlation, for all pairs or for those of some test modes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Reals
from femtune.correlation import Correlation, NotTested
from femtune.validation.criteria import (
    CRITERIA,
    DIAGONAL,
    FREQUENCY,
    MAC,
    OFF_DIAGONAL,
    SELF,
    SHAPE,
    Criterion,
    Outcome,
    Verdict,
    judge,
    not_tested,
)
from femtune.validation.prediction import FrequencyMiss, HeldOutSensors

Measured = tuple[float, str, str] | NotTested
"""The worst value, its place, and whether noise explains it."""


@dataclass(frozen=True)
class Evidence:
    """Data from which verdicts are derived.

    Parameters
    ----------
    correlation : test against model
    tests : positions of the test modes that count; None for all
    misses : by position of the test mode, the frequency error with its standard deviation
    sensors : of the held-out sensors, or None
    """

    correlation: Correlation
    tests: frozenset[int] | None = None
    misses: tuple[tuple[int, FrequencyMiss], ...] = ()
    sensors: HeldOutSensors | None = None

    @property
    def rows(self) -> list[int]:
        """Positions of the pairs that are judged."""
        pairs = self.correlation.pairing.pairs
        return [k for k, pair in enumerate(pairs) if self.tests is None or pair.test in self.tests]

    def label(self, row: int) -> str:
        """The two modes of a pair, in words."""
        c, pair = self.correlation, self.correlation.pairing.pairs[row]
        return f"test mode {c.test.labels[pair.test]} with model mode {c.model.labels[pair.model]}"

    def missing(self) -> list[str]:
        """Labels of the test modes that should have a partner and have none."""
        c = self.correlation
        unpaired = [u for u in c.pairing.unpaired_test if not (u.left_out or u.suspension)]
        return [c.test.labels[u.test] for u in unpaired if self.tests is None or u.test in self.tests]


def assess(
    correlation: Correlation,
    criteria: Sequence[Criterion] = CRITERIA,
    tests: Collection[int] | None = None,
    misses: Sequence[tuple[int, FrequencyMiss]] = (),
    sensors: HeldOutSensors | None = None,
) -> tuple[Verdict, ...]:
    """A verdict on each criterion.

    A test mode that should have a partner and has none fails every criterion that can be tested on pairs, for it
    cannot be within any limit; a mode that was left out with a reason, and a mode of the suspension, are not counted.

    Parameters
    ----------
    correlation : test against model
    criteria : what is asked
    tests : positions of the test modes that count; None for all
    misses : by position of a test mode, its frequency error with the standard deviation
    sensors : held-out sensors, for criteria on them
    """
    evidence = Evidence(correlation, None if tests is None else frozenset(tests), tuple(misses), sensors)
    return tuple(_verdict(evidence, criterion) for criterion in criteria)


def _verdict(evidence: Evidence, criterion: Criterion) -> Verdict:
    measured = _MEASURES[criterion.quantity](evidence)
    if isinstance(measured, NotTested):
        return not_tested(criterion, measured.reason)
    verdict = judge(criterion, *measured)
    missing = evidence.missing()
    if missing and criterion.quantity not in (SELF, SHAPE):
        remark = f"{verdict.remark}; test modes without a partner: {', '.join(missing)}"
        return replace(verdict, outcome=Outcome.FAIL, remark=remark)
    return verdict


def _frequency(e: Evidence) -> Measured:
    worst = _worst_pair(e, np.abs(e.correlation.frequency_errors), e.rows, largest=True)
    if isinstance(worst, NotTested):
        return worst
    row, value = worst
    test = e.correlation.pairing.pairs[row].test
    return value, e.label(row), str(dict(e.misses).get(test, ""))


_ONE_DOF = "with one measured DOF all shapes are proportional"


def _mac(e: Evidence) -> Measured:
    c = e.correlation
    if not len(c.dofs):
        return NotTested("no mode shapes were measured")
    trivial = [row for row in e.rows if c.one_dof(c.pairing.pairs[row].test) and np.isfinite(c.macs[row])]
    rows = [row for row in e.rows if row not in trivial]
    if trivial and not rows:
        return NotTested(f"{_ONE_DOF}, so that the MAC is 1 for any model")
    worst = _worst_pair(e, c.macs, rows, largest=False)
    if isinstance(worst, NotTested):
        return worst
    row, value = worst
    place = e.label(row)
    if trivial:
        few = ", ".join(c.test.labels[c.pairing.pairs[k].test] for k in trivial)
        place += f"; not tested for test modes with one measured DOF: {few}"
    return value, place, "" if isinstance(c.noise, NotTested) else str(c.noise[row])


def _of_one_dof(c: Correlation) -> NotTested | None:
    """Why an orthogonality is fixed by the number of DOFs at which it is evaluated, or None."""
    if len(c.dofs) - len(c.orthogonality_dropped) > 1:
        return None
    return NotTested(f"{_ONE_DOF}, so that the normalised product of two shapes is 1 for any model")


def _worst_pair(e: Evidence, values: Reals, rows: Sequence[int], *, largest: bool) -> tuple[int, float] | NotTested:
    if not rows:
        return NotTested("no modes are paired")
    # an undefined value is the worst of all
    among = values[rows] if largest else -values[rows]
    row = rows[int(np.argmax(np.nan_to_num(among, nan=np.inf)))]
    return row, float(values[row])


def _diagonal(e: Evidence) -> Measured:
    matrix = e.correlation.cross_orthogonality
    if isinstance(matrix, NotTested):
        return matrix
    if trivial := _of_one_dof(e.correlation):
        return trivial
    worst = _worst_pair(e, np.diag(matrix), e.rows, largest=False)
    if isinstance(worst, NotTested):
        return worst
    (row, value), sd = worst, e.correlation.orthogonality_sd
    return value, e.label(row), "" if isinstance(sd, NotTested) else _loss_by_noise(1.0 - value, float(sd[row, row]))


def _loss_by_noise(loss: float, mean: float) -> str:
    word = "could explain" if loss <= 2.0 * mean else "does not explain"
    return f"noise of the measured shape reduces it by {mean:.2g} on average; this {word} the loss of {loss:.2g}"


def _off_diagonal(e: Evidence, matrix: Reals | NotTested, sd: Reals | NotTested, model_columns: bool) -> Measured:
    if isinstance(matrix, NotTested):
        return matrix
    if trivial := _of_one_dof(e.correlation):
        return trivial
    rows = e.rows
    if len(matrix) < 2 or not rows:
        return NotTested("a single pair has no off-diagonal terms" if rows else "no modes are paired")
    off = (matrix - np.diag(np.diag(matrix)))[rows]
    i, j = (int(k) for k in np.unravel_index(int(np.argmax(off)), off.shape))
    c = e.correlation
    row, column = c.pairing.pairs[rows[i]], c.pairing.pairs[j]
    other = f"model mode {c.model.labels[column.model]}" if model_columns else f"test mode {c.test.labels[column.test]}"
    noise = "" if isinstance(sd, NotTested) else _orthogonality_noise(float(off[i, j]), float(sd[rows[i], j]))
    return float(off[i, j]), f"test mode {c.test.labels[row.test]} with {other}", noise


def _orthogonality_noise(value: float, sd: float) -> str:
    if value <= 2.0 * sd:
        return f"noise of the measured shapes (σ {sd:.2g}) could explain it"
    return f"noise of the measured shapes (σ {sd:.2g}) does not explain it"


def _shape(e: Evidence) -> Measured:
    if e.sensors is None:
        return NotTested("no sensor was held out")
    return e.sensors.worst()


_MEASURES: dict[str, Callable[[Evidence], Measured]] = {
    FREQUENCY: _frequency,
    MAC: _mac,
    SHAPE: _shape,
    DIAGONAL: _diagonal,
    OFF_DIAGONAL: lambda e: _off_diagonal(
        e, e.correlation.cross_orthogonality, e.correlation.orthogonality_sd, model_columns=True
    ),
    SELF: lambda e: _off_diagonal(e, e.correlation.self_orthogonality, e.correlation.self_sd, model_columns=False),
}
