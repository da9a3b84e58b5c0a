"""Checks of the model before it is updated, as records: updating cannot correct these errors."""

from __future__ import annotations

from femtune.study.record import Record, VerdictWord


class ModeMeshError(Record):
    """Estimated error of a frequency due to the mesh."""

    mode: int
    """Number of the mode, from 1."""
    freq_hz: float
    """Frequency of the mesh as it is, in Hz."""
    refined_hz: float | None
    """Frequency of a mesh of half the element size, in Hz; None if none of its modes resembles this mode."""
    error_percent: float | None
    """Estimated relative error of freq_hz in %; None if no refined mode resembles this one."""
    converged_hz: float | None
    """Frequency to be expected of a converged mesh, in Hz; None if no refined mode resembles this one."""


class ModelCheck(Record):
    """A modelling error that updating cannot correct, with its limit."""

    configuration: str
    """Name of the configuration."""
    check: str
    """"weighed mass", "lumped or consistent mass" or "mesh"."""
    measured: float | None
    """The error in %, with its sign; for frequencies that of the worst mode. None if not tested."""
    limit: float
    """Largest magnitude that passes, in %."""
    verdict: VerdictWord
    """Outcome."""
    sentence: str
    """Result of the check, or the reason why it was not tested."""
    modes: tuple[ModeMeshError, ...] = ()
    """For the mesh: all elastic modes that were computed; empty for other checks and if not tested."""
