"""How a stochastic update ended."""

from __future__ import annotations

from enum import Enum


class StochasticStatus(Enum):
    """Outcome; `ok` says whether mean and covariance may be used."""

    CONVERGED = "converged: the answer does not change any more"
    UNDETERMINED = "converged, but the outputs do not determine every parameter: the nearest to the start was taken"
    MEANS_LIMIT = "stopped at the iteration limit before the means converged; the last ones are kept"
    CLOUD_LIMIT = "stopped at the iteration limit before the cloud converged; the last one is kept"
    MEANS_STALLED = "no step of any length brings the means nearer; the best ones are kept"
    TOO_CURVED = "the curvature of the outputs is too strong for the second-order correction; that of (39) is kept"
    NOT_POSITIVE = "a step left no positive definite covariance; the last one that was is kept"

    @property
    def ok(self) -> bool:
        """True where the iteration ended at its goal."""
        return self in (StochasticStatus.CONVERGED, StochasticStatus.UNDETERMINED)
