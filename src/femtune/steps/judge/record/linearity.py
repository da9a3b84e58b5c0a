"""True beside linear χ² along the principal axes of the covariance, as a record."""

from __future__ import annotations

from femtune.study.record import Record


class AxisFacts(Record):
    """A point on a principal axis of the covariance."""

    axis: str
    """The combination of parameters, with its largest parts."""
    step: float
    """Distance from the result in standard deviations, negative to the other side."""
    linear: float
    """Increase of χ² by the linearised residuals (no unit)."""
    true: float | None
    """Increase of χ² of the model over the same comparisons; None where it could not be solved."""
    curved: bool
    """True if both differ so much that the standard deviations do not apply there."""


class ValleyResults(Record):
    """Whether χ² is a parabola over the distribution of the parameters."""

    reason: str = ""
    """Why it was not tested; "" if it was."""
    points: tuple[AxisFacts, ...] = ()
    """Points on the principal axes, the widest axis first, on both sides of the result."""
    axes_left: int = 0
    """Further axes that were not evaluated because of the limit of solutions."""
