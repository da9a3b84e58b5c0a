"""The update with measured FRFs after one with equal damping, as a record."""

from __future__ import annotations

from femtune.study.record import Record


class RawValue(Record):
    """A parameter after the update with equal damping, beside its final value."""

    parameter: str
    """Name of the parameter."""
    equalised: float
    """Its value after the update with equal damping, in its unit."""
    equalised_sd: float | None
    """Its standard deviation there, in its unit; None if none is given."""
    moved: float | None
    """Change by the measured FRFs, in this standard deviation (no unit); None without it."""


class RawResults(Record):
    """The update with measured FRFs, which began at the result of the update with equal damping."""

    values: tuple[RawValue, ...]
    """Free parameters."""
    iterations: int
    """Number of iterations with equal damping; those that follow in the history are of the measured FRFs."""
    paired: int
    """Number of modes of the model with the measured damping ratio of a partner, in all configurations."""
    others_percent: float
    """Damping ratio of the other modes, in %: the median of the paired ones, of the first configuration."""
