"""Vibration tests that the update did not use, beside the initial and the updated model, with verdicts."""

from __future__ import annotations

from femtune.study.record import Record


class VibrationPoint(Record):
    """A point of a vibration test: the model at the initial and the updated values beside what was measured."""

    output: str
    """Degree of freedom."""
    peak: float | None
    """Largest amplitude of the updated model in a sweep, or magnitude in a transient; None for random vibration."""
    peak_hz: float | None
    """Its frequency, Hz."""
    rms: float | None
    """Root mean square of the updated model in random vibration, over the band that is compared; None for others."""
    test_peak: float | None = None
    """Largest measured amplitude or magnitude; None if nothing was measured."""
    test_peak_hz: float | None = None
    """Its frequency, Hz."""
    test_rms: float | None = None
    """Measured root mean square; None if nothing was measured."""
    peak_at_end: bool = False
    """True if the peak of a sweep lies at an end of the band, which then contains no resonance."""
    test_peak_at_end: bool = False
    """The same of the measured one."""
    before_peak_at_end: bool = False
    """The same of the model at the initial values."""
    before_peak: float | None = None
    """Largest amplitude of the model at the initial values; None for random vibration."""
    before_peak_hz: float | None = None
    """Its frequency, Hz."""
    before_rms: float | None = None
    """Root mean square of the model at the initial values; None for other kinds."""
    peak_s: float | None = None
    """Time of the largest magnitude of the updated model, s; only for a transient."""
    test_peak_s: float | None = None
    """Time of the largest measured magnitude, s."""
    before_peak_s: float | None = None
    """Time of the largest magnitude of the model at the initial values, s."""


class VibrationCurves(Record):
    """Responses in a vibration test: amplitudes of a sweep, power spectral densities, or time histories."""

    before_lines_key: str
    """Key of the frequencies in Hz, or times in s, of the model at the initial values, shape (lines,)."""
    before_key: str
    """Key of its responses, shape (outputs, lines)."""
    after_lines_key: str
    """The same of the updated model."""
    after_key: str
    """The same of the updated model."""
    test_lines_key: str | None
    """Key of the measured frequencies or times; None if nothing was measured."""
    test_key: str | None
    """Key of what was measured."""


class VibrationResults(Record):
    """A sine sweep, random vibration or a transient of the model, beside what was measured."""

    name: str
    """Name of the test."""
    kind: str
    """"sweep", "random" or "transient"."""
    configuration: str
    """Name of the configuration."""
    excitation: str
    """Excitation in words."""
    points: tuple[VibrationPoint, ...]
    """One record a point; none if it could not be computed."""
    problem: str = ""
    """Why it could not be computed; "" otherwise."""
    damping: str = ""
    """Damping of the model, in words."""
    damping_source: str = ""
    """Where the damping is from, as the study states it; "" if it does not."""
    compared_hz: tuple[float, float] | None = None
    """Band over which the largest amplitudes or the root mean squares are taken; None for a transient."""
    compared_s: tuple[float, float] | None = None
    """Times over which the largest magnitudes are taken; only for a transient."""
    curves: VibrationCurves | None = None
    """Responses over frequency; None if they could not be computed."""

    modes: int | None = None
    """Number of modes that the response of the updated model is made of."""
    modes_to_hz: float | None = None
    """Natural frequency of the highest of them, Hz."""
    highest_hz: float | None = None
    """Highest frequency that is excited, Hz; of a transient the one below which nearly all its energy lies."""
    chosen_modes: bool = True
    """True if all modes that the excitation needs were computed; a solver computes what its input requests."""
    truncation_percent: float | None = None
    """Largest change of a level, in %, by the upper quarter of the modes' range: an estimate of what is left out."""

    @property
    def compared(self) -> bool:
        """True if something was measured, and the model is beside it."""
        return self.curves is not None and self.curves.test_key is not None
