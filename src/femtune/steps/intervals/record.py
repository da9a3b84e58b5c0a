"""Intervals of frequencies and parameters as records."""

from __future__ import annotations

from femtune.study.record import Record


class BoxInterval(Record):
    """Interval of one parameter, in its unit."""

    parameter: str
    """Name of the parameter."""
    lower: float
    """Lower end."""
    upper: float
    """Upper end."""


class PredictedInterval(Record):
    """Lowest and highest value of one frequency over the box."""

    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the elastic frequency in ascending order, from 1, whatever its shape."""
    lower_hz: float
    """Lowest value, Hz."""
    upper_hz: float
    """Highest value, Hz."""
    limits_hz: tuple[float, float] | None = None
    """What the study states; None for a prediction."""
    inside: bool
    """True if the lowest or the highest value does not lie at a corner of the box."""


class IntervalPredictions(Record):
    """The box of the parameters, and the extreme frequencies of all models in it."""

    of_limits: bool
    """True if the box follows from limits of frequencies; False if it is that of the bounds."""
    ok: bool
    """True if the limits determine a box between the bounds, or it is that of the bounds."""
    proven: bool
    """True if the extremes are proven by monotony in every parameter; otherwise they were found by a search."""
    error_percent: float | None
    """Largest relative difference between limits and extremes of the box, %; None without limits."""
    solutions: int
    """Number of model solutions."""
    parameters: tuple[BoxInterval, ...]
    """The box."""
    frequencies: tuple[PredictedInterval, ...]
    """The frequencies of all configurations."""
    sentences: tuple[str, ...]
    """The result in sentences."""
