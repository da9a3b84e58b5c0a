"""What the data of an FRF study can tell of the parameters, before or after the update, as a record."""

from __future__ import annotations

from femtune.study.record import EndOfUpdate, Record


class KnownParameter(Record):
    """What the data tell of one parameter."""

    parameter: str
    """Name of the parameter."""
    value: float
    """Its value at this stage, in its unit."""
    sd_percent: float | None
    """Expected standard deviation from the data alone, all parameters unknown, in % of the value; None if the data
    leave it open or the value is zero."""
    sd_alone_percent: float | None
    """The same if all others were known; None without effect."""
    known: bool
    """Whether the standard deviation is below a third of the prior's."""


class FisherResults(Record):
    """Fisher information of the FRFs: which parameters the data determine, how well, and which ones only together."""

    stage: EndOfUpdate
    """Values of the parameters: before or after the update."""
    measured: bool
    """Whether the noise is that of the measured FRFs, followed through identification and equalised damping; otherwise
    that of the stated standard deviations of the residuals."""
    misfit: float = 1.0
    """After an update with an identified test: residuals over those that its noise makes, by which the standard
    deviations are increased; 1 where the noise explains them."""
    parameters: tuple[KnownParameter, ...]
    """The free parameters."""
    groups: tuple[tuple[str, ...], ...]
    """Parameters that are correlated by more than 0.9: a combination is known much better than each."""
    open: tuple[tuple[str, ...], ...]
    """Parameters of each combination that the data do not determine."""
    sentences: tuple[str, ...]
    """The same in words."""
