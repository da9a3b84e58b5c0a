"""Record of the model modes that are excluded from the compared FRFs, before and after the update."""

from __future__ import annotations

from femtune.study.record import Record

LEAST_CORRELATION = 0.5
"""Correlation from which a mode after the update is the same one as before."""


class ModeLeftOutOfFrfs(Record):
    """A mode of the model that FRFs are compared without."""

    configuration: str
    """Name of the configuration."""
    before: int
    """Number of the mode at the initial values, from 1."""
    before_hz: float
    """Its natural frequency there, Hz."""
    after: int
    """Number of the mode after the update."""
    after_hz: float
    """Its natural frequency, Hz."""
    correlation: float
    """(φ₀ᵀM₀φ)² of the mass-normalised shapes before and after (no unit): 1 for the same shape."""

    @property
    def resembles(self) -> bool:
        """False if the mode after the update has another shape than the one that was named."""
        return self.correlation >= LEAST_CORRELATION
