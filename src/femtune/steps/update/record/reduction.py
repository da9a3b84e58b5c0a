"""The reduced models of an update, as records."""

from __future__ import annotations

from femtune.study.record import Record


class ReducedComponentResults(Record):
    """A Craig-Bampton component of a reduced model."""

    name: str
    """Name; "other elements" for those that no component has."""
    dofs: int
    """Free degrees of freedom that it alone has."""
    interface_dofs: int
    """Free degrees of freedom that it shares with other components."""
    max_hz: float
    """Frequency in Hz up to which its modes with fixed interface were computed."""
    modes: int
    """Number of these modes where the training began."""
    coordinates: int
    """Its generalised coordinates at the end, without the interface: these modes, those at other points, and the parts
    that modes of the full model have in it."""
    builds: int
    """Number of points at which its modes and static shapes were computed."""


class ReducedModelResults(Record):
    """The reduced model of one configuration."""

    configuration: str
    """Name of the configuration."""
    order: int
    """Its final order."""
    full_solutions: int
    """How many times the full model was solved for its modes to train the model, and where each search ended. The modes
    of the comparison before the update and of the written deck, and derivatives at the end, come on top."""
    estimate_percent: float
    """Largest estimated error of a frequency in the box of the parameters when the search began, in %."""
    certified_error_percent: float
    """Largest true error of a frequency at the end of the search, in %, for the model used in the search."""
    training: str
    """The outcome of the training, in a sentence."""
    interface_dofs: int | None = None
    """Degrees of freedom of all interfaces; None for a reduced model that is not assembled from components."""
    truncation_percent: float | None = None
    """Largest true error of a frequency at the initial values, in %, before parts of modes of the full model are added:
    the effect of the modes of the components that are left out. None without components."""
    components: tuple[ReducedComponentResults, ...] = ()
    """The components; none for a reduced model of the whole configuration."""
    frf_residuals: int = 0
    """Number of FRF residuals whose functions are those of the reduced model; others use the full model."""


class ReducedFrfResults(Record):
    """Change of the FRF residuals by the modes and static responses of the full model at the final point."""

    mean_difference: float
    """Root mean square of the change, in standard deviations of the measured values."""
    largest_difference: float
    """The largest change, in the same standard deviations."""
    shift: float
    """How far the change moves the combination of parameters that it moves most, in its standard deviation."""
    tolerance: float
    """Largest shift that the study allows."""
    compared: bool = True
    """False if the full model had nothing there that the reduced models did not have, so that there is no change."""


class ReductionResults(Record):
    """An update with reduced models."""

    tolerance_percent: float
    """Largest error of a frequency that the study allows at the end, in %."""
    certified: bool
    """True if full and reduced models agree at the final point."""
    models: tuple[ReducedModelResults, ...]
    """One per configuration of the update."""
    rounds: tuple[str, ...]
    """The comparison with the full model at the end of each search, a sentence each."""
    frfs: ReducedFrfResults | None = None
    """The comparison of FRFs; None if the reduced models served no FRF residual."""
