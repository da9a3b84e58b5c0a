"""Measured damping on the modes of a model that was calibrated with equalised damping, and its FRFs.

An update with equalised damping pairs no modes and does not determine their damping. Afterwards the identified modes of
the test are paired with those of the model, which receive their damping ratios; then the FRFs of the model can be
compared with the measured ones directly.
"""

from __future__ import annotations

from femtune.study.record import Alert, Record


class MappedMode(Record):
    """A mode of the updated model, or of the test alone."""

    test_hz: float | None
    """Identified natural frequency, Hz; None for a mode of the model without partner."""
    mode: int | None
    """Number of the mode of the model, from 1; None for a mode of the test without partner."""
    model_hz: float | None
    """Its natural frequency, Hz."""
    mac: float | None
    """MAC of the pair."""
    measured_percent: float | None
    """Identified damping ratio, in %."""
    mapped_percent: float | None
    """Damping ratio of the mode of the model, in %: the measured one, without partner the median of the paired ones."""
    reason: str = ""
    """Why a mode of the test has no partner."""
    above_noise: float | None = None
    """Of a mode of the model without partner: its largest height over the noise of a measured FRF at its resonance, by
    the model (no unit)."""
    seen_in: int | None = None
    """Number of FRFs in which it should stand out of the noise by a factor of three."""
    heights_key: str | None = None
    """Key of its height over the noise in each FRF, shape (outputs, inputs); None of a mode of the test."""
    found_hz: float | None = None
    """Natural frequency of a mode of the test that the identification had missed, and that was found near the mode of
    the model, Hz; None for other modes."""


class MappedDamping(Record):
    """Measured damping on the modes of the updated model of one configuration."""

    configuration: str
    """Name of the configuration."""
    equalised_percent: float
    """Damping ratio of test and model during the update, in %."""
    modes: tuple[MappedMode, ...]
    """Modes of the test, then those of the model inside the band of the test that have no partner."""
    alerts: tuple[Alert, ...] = ()
    """Remarks on the pairing of the modes."""
    missing_before: tuple[MappedMode, ...] = ()
    """Modes of the model before the update, inside the band of the test, without a partner."""
    deviation_before: float | None
    """Mean δ of the measured FRFs and those of the model before the update, with mapped damping; None if no mode of
    that model is paired."""
    deviation_after: float
    """The same after the update."""
    deviation_identified: float
    """The same of the identified test: what the identification leaves."""
    kind: str
    """Kind of the FRFs."""
    outputs: tuple[str, ...]
    """DOFs of the first axis of the values."""
    inputs: tuple[str, ...]
    """DOFs of the second axis."""
    freq_key: str
    """Key of the measured frequency lines, shape (lines,), Hz."""
    test_values_key: str
    """Key of the measured FRFs, complex, shape (outputs, inputs, lines)."""
    identified_values_key: str
    """Key of those of the identified test with its own damping, of the same shape."""
    before_values_key: str | None
    """Key of those of the model before the update, with mapped damping; None if no mode is paired there."""
    after_values_key: str
    """Key of those of the updated model, with mapped damping."""
