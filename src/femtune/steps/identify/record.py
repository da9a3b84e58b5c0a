"""Records of an identification, as ``identified.json`` holds them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.identify.levels import LinearityResults
from femtune.study.record import Alert, InputFile, Record

if TYPE_CHECKING:
    pass


class IdentifiedMode(Record):
    """One mode."""

    label: str
    """Its name."""
    freq_hz: float
    """Natural frequency."""
    freq_sd_hz: float | None
    """Standard deviation of it, None if the method gives none."""
    damping_ratio: float | None
    """Fraction of critical damping, None if the method gives none."""
    damping_sd: float | None
    """Standard deviation of it."""
    by_method: dict[str, float | None]
    """Frequency by each method, None if it did not find the mode."""
    phase_collinearity: float | None
    """Phase collinearity of the complex shape: 1 if it is real except for a factor; None if it is not known."""
    estimates: int | None
    """Number of estimates (methods and fragments) that contain it, None with only one estimate."""
    of_input: bool | None
    """True if the excitation has the same peak, None if it was not recorded."""
    doubtful: bool
    """True if its damping or its modal mass is not that of a mode of a structure."""
    remark: str
    """Remarks on its origin, its damping, modal mass and shape, and on the methods that found it."""


class PoleCluster(Record):
    """Poles that are stable from order to order."""

    freq_hz: float
    """Median."""
    damping_ratio: float
    """Median."""
    chosen: bool
    """True if it was chosen as a mode."""
    reason: str
    """The reason."""


class Identification(Record):
    """An identification without its arrays."""

    femtune_version: str
    """Version that wrote it."""
    title: str
    """Its title."""
    source: InputFile
    """The record or the functions."""
    units: str
    """length-mass-s."""
    dofs: tuple[str, ...]
    """Rows of the shapes."""
    normalisation: str
    """Of the shapes: mass, unit-norm or unit-max."""
    modes: tuple[IdentifiedMode, ...]
    """The identified modes."""
    clusters: tuple[PoleCluster, ...]
    """The clusters from which the modes were chosen."""
    largest_misfit_percent: float | None
    """Relative error of the synthesised function with the poorest fit; None if the input is not known."""
    alerts: tuple[Alert, ...]
    """Alerts."""
    linearity: LinearityResults | None = None
    """Comparison of tests at several levels of force; None if only one level was measured."""
