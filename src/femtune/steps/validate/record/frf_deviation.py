"""The deviation δ of measured FRFs before and after the update, of the FRFs that it used and of those that it did not.

δ is the mean over the lines of |log₁₀(H/H_test)|², with the principal value of the complex logarithm of the ratio, as
in published FRF calibrations.
"""

from __future__ import annotations

from typing import Literal

from femtune.study.record import Record

DataSet = Literal["calibration", "validation"]
ComparedAs = Literal["measured", "equal damping"]


class ChannelDeviation(Record):
    """One measured FRF."""

    configuration: str
    """Name of the configuration."""
    data: DataSet
    """"calibration" if the update used it, otherwise "validation"."""
    compared: ComparedAs = "measured"
    """"measured": the measured FRF beside the model with its own damping, or with that of the identified test; "equal
    damping": test and model with the damping ratio of `[equalise]`."""
    output: str
    """Response DOF."""
    input: str
    """Reference DOF."""
    lines: int
    """Number of frequency lines."""
    before: float
    """δ before the update (no unit)."""
    after: float
    """δ after the update."""


class DeviationSum(Record):
    """FRFs of one set, each line of each FRF with the same weight."""

    data: DataSet
    """The set."""
    compared: ComparedAs = "measured"
    """What is compared, as for a single FRF."""
    configuration: str = ""
    """Name of the configuration; "" for all together."""
    frfs: int
    """Number of FRFs."""
    before: float
    """δ before the update."""
    after: float
    """δ after the update."""
    change_percent: float | None
    """Change of δ in %; None if it was zero before."""
    risen: int
    """Number of FRFs whose δ has increased."""


class FrfDeviations(Record):
    """δ of the measured FRFs before and after the update."""

    sums: tuple[DeviationSum, ...]
    """The calibration set, and the validation set if there is one, of all configurations."""
    by_configuration: tuple[DeviationSum, ...] = ()
    """The same for each configuration."""
    channels: tuple[ChannelDeviation, ...]
    """Every FRF."""
    sentences: tuple[str, ...]
    """The sums in words."""
