"""FRFs that the update did not use, compared with those of the updated model, as records with verdicts."""

from __future__ import annotations

from femtune.modal.kinds import FrfKind
from femtune.study.record import Record


class PredictedFrf(Record):
    """A measured FRF that the update did not use, beside that of the updated model."""

    configuration: str
    """Name of the configuration."""
    data: str
    """Kind of data: "unused FRFs", "modified structure" …"""
    output: str
    """Response DOF."""
    input: str
    """Reference DOF."""
    frac: float | None
    """Frequency response assurance criterion; None for fewer than two lines."""
    mean_db: float
    """Mean of |20 lg |H|/|H_test|| over the lines, dB."""
    max_db: float
    """Largest value of it, dB."""
    max_hz: float
    """Frequency line of the largest value, Hz."""


class PredictedResonance(Record):
    """A resonance peak of the measured FRFs of one input, beside that of the updated model."""

    configuration: str
    """Name of the configuration."""
    input: str
    """Reference DOF."""
    test_hz: float
    """Frequency of the peak of the sum of squares of the measured FRFs, Hz."""
    model_hz: float | None
    """That of the nearest peak of the model; None if there is none within 20 %."""


class PredictedCurves(Record):
    """Measured FRFs of a configuration that the update did not use, line by line, and those of the updated model."""

    configuration: str
    """Name of the configuration."""
    data: str
    """Kind of data: "unused FRFs", "modified structure" …"""
    kind: FrfKind
    """Motion over force: displacement, velocity or acceleration."""
    outputs: tuple[str, ...]
    """DOFs of the first axis of the values."""
    inputs: tuple[str, ...]
    """DOFs of the second axis."""
    freq_key: str
    """Key of the frequency lines, shape (lines,), Hz."""
    values_key: str
    """Key of the values of the model, complex, shape (outputs, inputs, lines)."""
    test_values_key: str
    """Key of the measured values, of the same shape; NaN where the update used them or nothing was measured."""
