"""Measures for the selection of parameters, as records."""

from __future__ import annotations

from femtune.study.record import Record


class AlikePair(Record):
    """Two parameters with nearly the same effect on the residuals."""

    first: str
    """Name of one parameter."""
    second: str
    """Name of the other."""
    cosine: float
    """Cosine of the angle between their columns of the scaled Jacobian, −1 to 1."""


class NearDependence(Record):
    """A nearly linearly dependent combination of parameters."""

    condition_index: float | None
    """Belsley's condition index; None for an exact dependence."""
    parameters: tuple[str, ...]
    """Parameters with more than half of their variance from this combination."""


class ParameterInformation(Record):
    """Information of the data on one parameter, in units of its prior standard deviation."""

    parameter: str
    """Name of the parameter."""
    sd_alone: float | None
    """Standard deviation if all others are known; None without any effect."""
    sd_together: float | None
    """Cramér-Rao bound with all of them unknown and no prior; None if other parameters have the same effect."""
    d_rank: int
    """Place in the D-optimal order, from 1."""
    a_rank: int
    """Place in the A-optimal order, from 1."""
    cosine_distance: float | None = None
    """Distance 1 − cos of its scaled sensitivities from the leading space of the covariance of repeated tests: near 0
    for a parameter that varies; None without repeats, with fewer than four frequencies, or without any effect."""


class SubsetEntry(Record):
    """A step of the forward selection by orthogonal projection."""

    parameter: str
    """Name of the selected parameter."""
    cosine: float
    """Cosine between its contribution and the remaining residual."""
    left_percent: float
    """Norm of the remaining residual after the best fit with the parameters so far, in %."""
    chosen: bool
    """True if it, and each parameter before it, reduces the residual significantly: noise alone would give the best of
    as many candidates a larger F value in less than 5 % of cases."""
    candidates: int | None = None
    """Number of candidates of which it was the best; None in results of earlier versions."""
    p_value: float | None = None
    """Probability that noise gives the best of these candidates a larger F value, 0 to 1; None for the steps after the
    first one that is not significant, which are not tested."""


class GroupEnergy(Record):
    """Energy of one group of elements in a mode."""

    group: str
    """Name of the group: a parameter, a property card or an element."""
    strain_percent: float | None
    """Share of the mode's strain energy in %; None for a rigid-body motion."""
    kinetic_percent: float
    """Share of the mode's kinetic energy in %."""
    residual_percent: float | None
    """Share of the residual energy of the expanded mode, in %; None if not requested."""


class ModeEnergies(Record):
    """Energies of the model mode that is compared with a test mode."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode."""
    freq_hz: float
    """Frequency of the model mode, in Hz."""
    contradiction_percent: float | None
    """√(energy of the residual/strain energy of the expanded mode) in %; None if not requested."""
    groups: tuple[GroupEnergy, ...]
    """The groups with the largest shares, by falling strain or residual energy."""


class SelectionMeasures(Record):
    """Collinearity, information and order of the parameters."""

    collinearity_index: float | None
    """1 where all columns are orthogonal; None if some are linearly dependent."""
    pairs: tuple[AlikePair, ...]
    """Parameters with nearly the same effect (cosine of 0.95 or more), the most similar first."""
    dependences: tuple[NearDependence, ...]
    """Near dependences (condition index of 30 or more), the nearest first."""
    information: tuple[ParameterInformation, ...]
    """One record a free parameter."""
    subset: tuple[SubsetEntry, ...]
    """Parameters in the order of the forward selection."""
    energy_groups: str
    """Groups of the energies: "parameters", "properties", "elements" or "none"."""
    energies: tuple[ModeEnergies, ...]
    """Energies of the compared modes; empty if not requested."""
    sentences: tuple[str, ...]
    """The measures in sentences."""
