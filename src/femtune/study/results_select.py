"""Records of measures that help to choose parameters."""

from __future__ import annotations

from femtune.study.results_base import Record


class AlikePair(Record):
    """Two parameters that do nearly the same to what is compared."""

    first: str
    """Name of one parameter."""
    second: str
    """Name of the other."""
    cosine: float
    """Cosine of the angle between their columns of the scaled Jacobian, −1 to 1."""


class NearDependence(Record):
    """A combination of three or more parameters, or two, that is hardly told from nothing."""

    condition_index: float | None
    """Belsley's condition index; None for an exact dependence."""
    parameters: tuple[str, ...]
    """Parameters more than half of whose variance comes from it."""


class ParameterInformation(Record):
    """What the data know of one parameter, in units of its prior standard deviation."""

    parameter: str
    """Name of the parameter."""
    sd_alone: float | None
    """Standard deviation if all others were known; None without any effect."""
    sd_together: float | None
    """Cramér-Rao bound with all of them unknown and no prior; None where the others can replace it."""
    d_rank: int
    """Place in the D-optimal order, from 1."""
    a_rank: int
    """Place in the A-optimal order, from 1."""


class SubsetEntry(Record):
    """A step of the forward selection by orthogonal projection."""

    parameter: str
    """Name of the parameter that was taken."""
    cosine: float
    """Cosine of what it adds with what was left of the residual."""
    left_percent: float
    """What is left of the residual after the best fit with all taken so far, in % of its length."""
    chosen: bool
    """True where it lessens the residual by more than chance (F test, 5 %)."""


class GroupEnergy(Record):
    """Energy of one group of elements in a mode."""

    group: str
    """Name of the group: a parameter, a property card or an element."""
    strain_percent: float | None
    """Share of the mode's strain energy in %; None for a rigid-body motion."""
    kinetic_percent: float
    """Share of the mode's kinetic energy in %."""
    residual_percent: float | None
    """Share of the energy of what contradicts the measured mode, in %; None where not asked for."""


class ModeEnergies(Record):
    """Energies of the model mode that is compared with a test mode."""

    configuration: str
    """Name of the configuration."""
    test_label: str
    """Label of the test mode."""
    freq_hz: float
    """Frequency of the model mode, in Hz."""
    contradiction_percent: float | None
    """√(energy of the residual/strain energy of the expanded mode) in %; None where not asked for."""
    groups: tuple[GroupEnergy, ...]
    """The groups with the largest shares, by falling strain or residual energy."""


class SelectionMeasures(Record):
    """Which parameters are alike, which are known, and which explain the residual."""

    collinearity_index: float | None
    """1 where all columns are orthogonal; None where some depend on others."""
    pairs: tuple[AlikePair, ...]
    """Parameters that do nearly the same (cosine of .95 or more), the most alike first."""
    dependences: tuple[NearDependence, ...]
    """Near dependences (condition index of 30 or more), the nearest first."""
    information: tuple[ParameterInformation, ...]
    """One record a free parameter."""
    subset: tuple[SubsetEntry, ...]
    """Parameters in the order in which they explain most of the residual."""
    energy_groups: str
    """What the groups of the energies are: "parameters", "properties", "elements" or "none"."""
    energies: tuple[ModeEnergies, ...]
    """Energies of the compared modes; empty where not asked for."""
    sentences: tuple[str, ...]
    """What the measures say, in words."""
