"""A screening of parameters as records: designed runs of the model, and the effect of each parameter on each mode.

Main effects are those of a design by levels. Elementary effects and Sobol's indices take their place if requested.
"""

from __future__ import annotations

from femtune.study.record import Alert, Record


class ScreenedParameter(Record):
    """A parameter of the design."""

    name: str
    """Name of the parameter."""
    unit: str
    """Its unit, "" for a factor."""
    values: tuple[float, ...]
    """Its value at each level of a design by levels; its bounds otherwise."""


class ScreenedMode(Record):
    """A natural frequency, followed through all runs."""

    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the mode at the initial values, from 1."""
    freq_hz: float
    """Frequency at the initial values, Hz."""
    mean_hz: float
    """Mean frequency of all runs, Hz."""
    error_contribution: float | None
    """Part of the variation that main effects do not explain, from 0 to 1; of a surrogate, the part that it does not
    predict in runs that are left out. None for elementary effects and for indices of the model itself."""
    least_mac: float | None
    """Smallest MAC, weighted by mass, between the shape at the initial values and the one that was followed; None in a
    table of finished runs, whose modes are its columns."""
    response: str = ""
    """Name of the column of a table of finished runs that is no frequency: its values, means and ranges have its unit
    in place of Hz, and `mode` counts on after the frequencies. "" for a natural frequency."""


class MainEffect(Record):
    """Effect of one parameter on one frequency."""

    parameter: str
    """Name of the parameter."""
    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the mode at the initial values, from 1."""
    contribution: float
    """Part of the variation over the runs that is due to this parameter, from 0 to 1."""
    f_value: float | None
    """F; None without degrees of freedom for the error, or if main effects explain the frequency exactly."""
    p_value: float | None
    """Probability of at least this F without an effect; None as for F."""
    range_hz: float
    """Largest mean frequency of a level minus the smallest, Hz."""
    means_hz: tuple[float, ...]
    """Mean frequency of the runs at each level, Hz."""


class ElementaryEffect(Record):
    """Elementary effects (Morris) of one parameter on one frequency: its change over the whole range, in Hz."""

    parameter: str
    """Name of the parameter."""
    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the mode at the initial values, from 1."""
    mean_hz: float
    """Mean effect μ, Hz."""
    absolute_hz: float
    """Mean μ* of the absolute effects, Hz: importance."""
    absolute_margin_hz: float | None
    """Half width of the 95 % interval of μ*, Hz; None for a single effect."""
    spread_hz: float | None
    """Standard deviation σ of the effects, Hz: curvature and interaction; None for a single effect."""


class SobolIndices(Record):
    """Parts of the variance of one frequency over the box of the bounds that one parameter explains."""

    parameter: str
    """Name of the parameter."""
    configuration: str
    """Name of the configuration."""
    mode: int
    """Number of the mode at the initial values, from 1."""
    first: float
    """Part that the parameter explains alone; an estimate, which may be slightly negative."""
    first_interval: tuple[float, float]
    """Its 95 % interval, due to the choice of points."""
    total: float
    """Part that it explains with all interactions."""
    total_interval: tuple[float, float]
    """Its 95 % interval, due to the choice of points."""


class FailedModelRun(Record):
    """A run of the design without a result."""

    run: int
    """Number of the run, from 1."""
    reason: str
    """Why."""


class ScreenResults(Record):
    """Designed runs, and the effects of the parameters on the natural frequencies."""

    design: str
    """The design: "L18", "full factorial", "Plackett-Burman 12", "finished runs", "Morris, 10 trajectories", "Sobol's
    indices by 1024 points of Kriging"."""
    runs: int
    """Number of runs."""
    failed: tuple[FailedModelRun, ...]
    """Runs that failed; they are left out."""
    error_freedom: int | None
    """Degrees of freedom left for the error; None without main effects."""
    parameters: tuple[ScreenedParameter, ...]
    """The free parameters with their levels."""
    modes: tuple[ScreenedMode, ...]
    """The elastic modes."""
    effects: tuple[MainEffect, ...]
    """For each parameter, the main effect on each mode; empty without a design by levels."""
    elementary: tuple[ElementaryEffect, ...] = ()
    """For each parameter, the elementary effects on each mode, if requested."""
    indices: tuple[SobolIndices, ...] = ()
    """For each parameter, Sobol's indices of each mode, if requested."""
    table_key: str
    """Key of the table of runs, shape (runs, parameters + modes): values of the free parameters and frequencies in Hz;
    NaN in runs that failed."""
    sentences: tuple[str, ...]
    """The result in sentences."""
    alerts: tuple[Alert, ...] = ()
    """What should be known about it."""
