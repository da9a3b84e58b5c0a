"""Nominally identical specimens as records: parameters and frequencies of each, and whether their spread is real."""

from __future__ import annotations

from typing import Literal

from femtune.study.record import CitationRecord, Record

SpreadWord = Literal["real", "explained", "not tested"]


class SpreadRecord(Record):
    """Spread of a quantity over the specimens, and the test whether all specimens have one value."""

    mean: float
    """Mean over the specimens."""
    sd: float
    """Standard deviation over the specimens, with n − 1."""
    cov_percent: float | None
    """Coefficient of variation in %; None for a mean of zero."""
    stated_sd: float | None
    """Standard deviation that the uncertainty of the values alone would give; None if the values have none."""
    real_sd: float | None
    """What is left of the standard deviation without this part, at least zero."""
    chi_square: float | None
    """Weighted sum of squares about the weighted mean."""
    degrees_of_freedom: int | None
    """Its degrees of freedom."""
    p_value: float | None
    """Probability that uncertainty alone makes it as large."""
    p_adjusted: float | None
    """The same for the number of quantities of this kind that are tested (Holm's procedure)."""
    verdict: SpreadWord
    """"real": larger than uncertainty explains; "explained" by it; "not tested"."""
    sentence: str
    """The outcome in words."""


class SpecimenValue(Record):
    """A parameter of one specimen."""

    specimen: str
    """Name of the specimen."""
    parameter: str
    """Name of the parameter in the update."""
    value: float
    """Value of the joint calibration."""
    sd: float | None
    """Its standard deviation; None if none is given."""
    at_bound: bool
    """True if it ended at a bound."""
    separate_value: float | None
    """Value of the calibration of this specimen alone; None if there was none."""
    separate_sd: float | None
    """Its standard deviation."""
    separate_at_bound: bool
    """True if it ended at a bound."""


class SpecimenParameter(Record):
    """A free parameter over the specimens."""

    name: str
    """Name in the study."""
    unit: str
    """Its unit."""
    individual: bool
    """True if each specimen has its own, False for a common parameter."""
    nominal: float
    """Initial value."""
    values: tuple[SpecimenValue, ...]
    """One record a specimen; a common parameter has the same joint value in all."""
    spread: SpreadRecord | None
    """Spread of the joint values of an individual parameter, or of the separate values of a common one, over the
    specimens that were calibrated; None for fewer than two values."""


class SpecimenMode(Record):
    """A mode of one specimen."""

    specimen: str
    """Name of the specimen."""
    configuration: str
    """Name of its configuration."""
    test_label: str
    """Label of the test mode; "" if none was measured or paired."""
    test_hz: float | None
    """Its frequency in Hz."""
    after_hz: float | None
    """Frequency of the updated model in Hz; None if no model mode is paired."""


class SpecimenFrequency(Record):
    """The frequency of one mode over the specimens, test and model."""

    configurations: tuple[str, ...]
    """The configurations that are compared, one for each specimen: those of one state of the structure."""
    mode: int
    """Number of the mode of the initial model, from 1, with rigid-body modes."""
    before_hz: float
    """Frequency of the initial model in Hz."""
    modes: tuple[SpecimenMode, ...]
    """Test and updated model of each specimen."""
    test: SpreadRecord | None
    """Spread of the measured frequencies in Hz; None for fewer than two."""
    model: SpreadRecord | None
    """Spread of the frequencies of the updated models of calibrated specimens in Hz, without a test; None for fewer
    than two."""


class SpecimenUpdate(Record):
    """The calibration of one specimen alone."""

    specimen: str
    """Name of the specimen."""
    ok: bool
    """True if it reached an optimum."""
    message: str
    """The outcome, in a sentence."""
    chi_square_joint: float
    """Sum of squares of its residuals at the end of the joint calibration."""
    chi_square: float
    """The same at the end of its own."""
    residuals: int
    """Number of its residuals."""


class CommonTestRecord(Record):
    """The test whether the common parameters are common."""

    increase: float
    """Increase of the sum of squares from the separate calibrations to the joint one; where FRFs of identified tests
    are compared, whose errors are not independent, the squared distance between the separate values by their
    covariance."""
    restrictions: int
    """Number of parameters that the joint calibration has fewer."""
    p_value: float
    """Probability that chance makes it as large."""
    scaled: bool
    """True if residuals are larger than stated and an F test takes this into account."""
    sentence: str
    """The outcome in words."""


class SpecimenResults(Record):
    """Nominally identical specimens, calibrated jointly and separately."""

    specimens: tuple[str, ...]
    """Their names."""
    not_calibrated: tuple[str, ...] = ()
    """Those without a test that the update uses: their individual parameters keep the initial values, which are left
    out of all means and spreads."""
    separate: tuple[SpecimenUpdate, ...]
    """The separate calibrations; none if all parameters are individual, since they are those of the joint calibration
    then."""
    parameters: tuple[SpecimenParameter, ...]
    """The free parameters."""
    frequencies: tuple[SpecimenFrequency, ...]
    """The modes."""
    common: CommonTestRecord | None
    """Test of the common parameters; None if there are none, or no separate calibrations."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications."""
