"""Error of the FRFs of residuals by their truncated set of modes, as records."""

from __future__ import annotations

from femtune.study.record import EndOfUpdate, Record


class FrfTruncation(Record):
    """FRFs of a residual by superposition, compared with direct solutions (K + iωC − ω²M)u = f at a few lines."""

    configuration: str
    """Name of the configuration."""
    stage: EndOfUpdate
    """Start or end of the update."""
    modes: int | None
    """Number of modes that are superposed; None if the method needs none."""
    modes_to_hz: float | None
    """Natural frequency of the last one, Hz; None if the method needs none."""
    highest_line_hz: float
    """Highest frequency line of the residual, Hz."""
    lines_hz: tuple[float, ...]
    """Lines at which the two were compared, Hz; empty for the direct method, which has no truncation."""
    largest_sd: float | None
    """Largest error of the FRFs, in standard deviations of the measured values (no unit); None without truncation."""
    rms_sd: float | None
    """Root mean square of the errors, in the same standard deviations; None without truncation."""
    largest_percent: float | None
    """Largest relative error of an FRF value, in %."""
    function: str
    """Function with the largest error: "5Y+ / 3Y+"; "" without truncation."""
    line_hz: float | None
    """Frequency line of this error, Hz."""
    small: bool
    """True if the largest error is at most a tenth of the standard deviation."""
    missing: str
    """The modes that are missing, in words; "" if the error is small."""
    limit: str
    """Key of the residual that limits the number of modes: "count = 4"; "" if the highest line determines it."""
    sentence: str
    """Outcome in a sentence."""
    reduced_order: int | None = None
    """Order of the reduced model that the FRFs are computed with; None for modes of the full model."""
