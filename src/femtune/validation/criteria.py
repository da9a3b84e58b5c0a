"""Accepted criteria of test-analysis correlation as data, profiles of them, and the verdict on each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from femtune.validation.kinds import PROFILES


class Outcome(Enum):
    """Outcome of a criterion."""

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

    @property
    def percent(self) -> bool:
        """True if the quantity is given in per cent."""
        return self.quantity in IN_PERCENT

    @property
    def unit(self) -> str:
        """ "%", "dB" or "" (none)."""
        return "%" if self.percent else "dB" if self.quantity in IN_DECIBELS else ""

    def text(self, value: float) -> str:
        """A value of this quantity as text."""
        return f"{100.0 * value if self.percent else value:.3g} {self.unit}".rstrip()

    def passed(self, value: float) -> bool:
        """True if the limit is satisfied; an undefined value fails."""
        return value <= self.limit if self.at_most else value >= self.limit


@dataclass(frozen=True)
class Verdict:
    """A criterion beside what was measured.

    Parameters
    ----------
    criterion : what is asked
    measured : the worst value; None if it was not tested
    outcome : pass, fail or not tested
    remark : where the worst value is, or why it was not tested
    noise : whether noise explains a failure, in words; "" if not known, or without failure
    """

    criterion: Criterion
    measured: float | None
    outcome: Outcome
    remark: str
    noise: str = ""

    @property
    def required(self) -> float:
        """The limit."""
        return self.criterion.limit

    @property
    def sentence(self) -> str:
        """Outcome, measured and required value, the place, and whether noise explains a failure."""
        c = self.criterion
        asked = f"{'at most' if c.at_most else 'at least'} {c.text(c.limit)} required by {c.standard}"
        if self.measured is None:
            return f"not tested: {c.quantity}, {asked}: {self.remark}"
        tail = "".join(f"; {part}" for part in (self.remark, self.noise) if part)
        return f"{self.outcome.value}: {c.quantity} {c.text(self.measured)}, {asked}{tail}"


@dataclass(frozen=True)
class CriteriaProfile:
    """Criteria under one name, of a standard or of a project.

    `tailored` replaces single numbers.
    """

    name: str
    criteria: tuple[Criterion, ...]

    def tailored(self, limits: Mapping[str, float]) -> CriteriaProfile:
        """With user-defined limits by quantity: they replace those of this profile, or are added.

        Raises
        ------
        KeyError : for a quantity that nothing measures
        """
        user_criteria = tuple(Criterion(OWN, quantity, limit, _AT_MOST[quantity]) for quantity, limit in limits.items())
        kept = tuple(c for c in self.criteria if c.quantity not in limits)
        if not user_criteria:
            return self
        return CriteriaProfile(f"{self.name}, tailored" if self.criteria else OWN, (*kept, *user_criteria))


FREQUENCY, MAC, SHAPE = "frequency error", "MAC", "shape error at held-out sensors"
DIAGONAL, OFF_DIAGONAL = "cross-orthogonality, diagonal", "cross-orthogonality, off the diagonal"
SELF = "self-orthogonality of the test, off the diagonal"
FRAC, FDAC = "FRAC", "FDAC at equal frequencies, mean over the lines"
MEAN_LEVEL, MAX_LEVEL = "level error of an FRF, mean over the lines", "level error of an FRF, largest"
RESONANCE = "resonance frequency error in the FRFs"
OF_FRFS = (FRAC, FDAC, MEAN_LEVEL, MAX_LEVEL, RESONANCE)
"""Quantities that are measured on FRFs."""
SWEEP_FREQUENCY, SWEEP_AMPLITUDE = "resonance frequency error in a sweep", "error of the largest response in a sweep"
RMS = "RMS error in random vibration"
TRANSIENT_PEAK = "error of the largest response to a transient"
OF_VIBRATION = (SWEEP_FREQUENCY, SWEEP_AMPLITUDE, RMS, TRANSIENT_PEAK)
"""Quantities that are measured in vibration tests."""
OWN = "own criterion"

IN_PERCENT = (FREQUENCY, SHAPE, RESONANCE, *OF_VIBRATION)
IN_DECIBELS = (MEAN_LEVEL, MAX_LEVEL)
_AT_MOST = {FREQUENCY: True, MAC: False, SHAPE: True, DIAGONAL: False, OFF_DIAGONAL: True, SELF: True,
            FRAC: False, FDAC: False, MEAN_LEVEL: True, MAX_LEVEL: True, RESONANCE: True,
            **dict.fromkeys(OF_VIBRATION, True)}  # fmt: skip

CRITERIA = (
    Criterion("NASA-STD-5002", FREQUENCY, 0.05, True),
    Criterion("NASA-STD-5002", DIAGONAL, 0.90, False),
    Criterion("NASA-STD-5002", OFF_DIAGONAL, 0.10, True),
    Criterion("MIL-STD-1540C", FREQUENCY, 0.03, True),
    Criterion("MIL-STD-1540C", DIAGONAL, 0.95, False),
    Criterion("ECSS-E-ST-32-11C", FREQUENCY, 0.05, True),
    Criterion("ECSS-E-ST-32-11C", MAC, 0.90, False),
    Criterion("common practice", SELF, 0.10, True),
)
"""The limits that these standards name for primary modes; a project may tailor them."""


def all_standards(name: str) -> tuple[Criterion, ...]:
    """Criteria of all standards."""
    return CRITERIA


def of_standard(name: str) -> tuple[Criterion, ...]:
    """Criteria of one standard, and of common practice."""
    return tuple(c for c in CRITERIA if c.standard in (name, "common practice"))


def no_standard(name: str) -> tuple[Criterion, ...]:
    """None: the user's limits alone."""
    return ()


def profile(word: str, limits: Mapping[str, float] | None = None) -> CriteriaProfile:
    """A profile with user-defined limits by quantity (KeyError for words that are not in `PROFILES`)."""
    kind = PROFILES[word]
    criteria: tuple[Criterion, ...] = kind.load()(kind.label)
    return CriteriaProfile(kind.label, criteria).tailored(limits or {})


def judge(criterion: Criterion, value: float, remark: str, noise: str = "") -> Verdict:
    """The verdict on a measured value; noise is stated for a failure only."""
    passed = criterion.passed(value)
    outcome = Outcome.PASS if passed else Outcome.FAIL
    return Verdict(criterion, value, outcome, remark, "" if passed else noise)


def not_tested(criterion: Criterion, reason: str) -> Verdict:
    """The verdict "not tested", and why."""
    return Verdict(criterion, None, Outcome.NOT_TESTED, reason)
