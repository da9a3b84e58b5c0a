"""Records about the model: cards, mass, supports, checks, sensors, and its modes."""

from __future__ import annotations

from femtune.study.results_base import Alert, Record, Stage, Vector3, VerdictWord
from femtune.study.results_checks import ModelCheck


class CardCount(Record):
    """A kind of card that was read and used."""

    name: str
    """Name of the card: "CBAR"."""
    count: int
    """How many there are."""


class IgnoredCard(Record):
    """A kind of card that was not used."""

    name: str
    """Name of the card."""
    count: int
    """How many there are."""
    first_file: str
    """File of the first one."""
    first_line: int
    """Line of the first one, from 1."""
    reason: str
    """Why it was not used."""


class DeckParameter(Record):
    """A PARAM of the deck."""

    name: str
    """Name: "WTMASS"."""
    value: str
    """Value as the deck writes it."""
    understood: bool
    """True where it acts as in Nastran; false where it was ignored."""
    remark: str = ""
    """What it did, or why it was ignored."""


class HeldDof(Record):
    """A DOF that AUTOSPC held because nothing stiffens it."""

    dof: str
    """Node and direction: "101RZ+"."""
    reason: str
    """Why it was held."""


class GroundedDof(Record):
    """A DOF where a rigid motion meets a force: a hidden connection to ground."""

    dof: str
    """Node and direction."""
    force: float
    """Force left at it in the worst of the six rigid motions, over the sum of what cancels there (no unit)."""


class GroundingElement(Record):
    """An element that strains when the free model moves as a rigid body."""

    card: str
    """Name of its card: "CELAS2"."""
    element: int
    """Its number."""
    motion: str
    """The rigid motion that strains it: "X" to "RZ"."""
    relative_energy: float
    """Its strain energy over the sum of the absolute values of its parts (no unit)."""


class RigidBodyCheck(Record):
    """Strain energy of six rigid motions of the model without its supports."""

    strain_energies: tuple[float, ...]
    """Of unit translations X, Y, Z and rotations RX, RY, RZ (1 rad), in units of the study."""
    relative_energies: tuple[float, ...]
    """The same, each over the sum of the absolute values of its parts (no unit); zero is perfect."""
    grounded: bool | None
    """True where at least one motion strains the model; None where not tested."""
    verdict: VerdictWord
    """Outcome; a model that only elements with an end on the ground tie to it passes."""
    sentence: str
    """Outcome in words, or why it was not tested."""
    worst_dofs: tuple[GroundedDof, ...] = ()
    """Where the largest forces are, largest first."""
    grounding_elements: tuple[GroundingElement, ...] = ()
    """Elements that tie the model to the ground, largest energy first, ten at the most."""


class ModelConfiguration(Record):
    """The model in one configuration."""

    configuration: str
    """Name of the configuration."""
    grids: int
    """Number of grid and scalar points."""
    free_dofs: int
    """Number of DOFs that are solved for."""
    supports: tuple[str, ...]
    """What holds DOFs, in words: grid points themselves, SPC set, configuration; each DOF is counted once."""
    held_dofs: tuple[HeldDof, ...]
    """Every DOF held by AUTOSPC."""
    mass: float
    """Mass of the model, in the study's unit of mass."""
    centre_of_gravity: Vector3 | None
    """In the basic system, in the study's unit of length; None where the points have no coordinates."""
    inertia: tuple[Vector3, Vector3, Vector3] | None
    """Inertia tensor about the centre of gravity, basic axes, in the study's mass·length²; None likewise."""
    weighed_mass: float | None
    """Mass that was weighed, in the study's unit of mass; None where the study gives none."""
    mass_difference_percent: float | None
    """(model − weighed)/weighed in %; None where nothing was weighed."""
    rigid_body_check: RigidBodyCheck
    """Strain energy of rigid motions."""
    constraints: tuple[str, ...] = ()
    """Multipoint constraints and rigid elements that act, in words; results of before have them among the supports."""
    overlay: tuple[str, ...] = ()
    """What this configuration changes in the deck, in words: elements off, masses added, supports."""


class NamedSet(Record):
    """A set of degrees of freedom that the deck names; it holds none of them."""

    name: str
    """ASET, OMIT, BSET, CSET, QSET, SUPORT, "SUPORT1 3" or "USET U1"."""
    dofs: int
    """Number of its DOFs."""
    effect: str
    """What it means here, in words."""


class DampingField(Record):
    """A field of a kind of card that damps; values of zero do not count."""

    kind: str
    """"loss factor" (hysteretic) or "viscous"."""
    field: str
    """Card and field: "MAT1 GE"; those of the six directions of a bush stand together."""
    cards: int
    """Cards that have a value there."""
    lowest: float
    """Smallest value, in units of the deck (loss factors have none)."""
    highest: float
    """Largest value."""
    elements: int
    """Elements that these values act in."""


class DampingFacts(Record):
    """Damping that the deck describes."""

    overall_loss_factor: float | None
    """Loss factor of all stiffness (PARAM G); None without one."""
    overall_omega_rad_s: float | None
    """Frequency at which viscous damping stands in for it (PARAM W3); None without one."""
    element_omega_rad_s: float | None
    """The same for loss factors of materials and elements (PARAM W4); None without one."""
    modal_damping: str
    """Damping of modes that case control selects (SDAMPING), in words; empty without one."""
    fields: tuple[DampingField, ...]
    """Loss factors and dashpots by card and field."""


class ModelFacts(Record):
    """What was read from the deck, and the model that came of it."""

    cards_read: tuple[CardCount, ...]
    """Cards that were used."""
    cards_ignored: tuple[IgnoredCard, ...]
    """Cards that were not used."""
    deck_parameters: tuple[DeckParameter, ...]
    """PARAMs, understood and ignored."""
    dof_sets: tuple[NamedSet, ...] = ()
    """Sets of degrees of freedom that the deck names."""
    checks: tuple[ModelCheck, ...] = ()
    """Weighed mass beside the model's; what needs modes stands in SelectionResults."""
    notices: tuple[Alert, ...]
    """Findings while reading."""
    configurations: tuple[ModelConfiguration, ...]
    """One record a configuration."""
    damping: DampingFacts | None = None
    """Damping; None in results of before it was read."""


class MatchedSensor(Record):
    """A measured DOF and the model's DOF that answers for it."""

    test_dof: str
    """Label in the test: "12X+"."""
    test_node: int
    """Node of the test."""
    model_node: int | None
    """Grid of the model; None where the sensor is a combination of several."""
    distance: float | None
    """Between the two, in the study's unit of length; None where matched without coordinates."""
    how: str
    """How it was matched, in words: "nearest grid", "same number", "by hand", "combination of 2 DOFs"."""


class UnmatchedSensor(Record):
    """A measured DOF that takes no part in the comparison."""

    test_dof: str
    """Label in the test."""
    reason: str
    """Why, in words."""


class SensorResults(Record):
    """Sensors of one configuration."""

    configuration: str
    """Name of the configuration."""
    test_file: str
    """File of the test."""
    tolerance: float | None
    """Largest distance allowed, in the study's unit of length; None where matched otherwise."""
    matched: tuple[MatchedSensor, ...]
    """Sensors that are compared, generalised ones among them."""
    unmatched: tuple[UnmatchedSensor, ...]
    """Sensors left aside."""


class EffectiveMasses(Record):
    """How much of the structure's mass each mode moves when its supports move as a rigid body.

    Six directions: translations X, Y, Z and rotations RX, RY, RZ about the centre of gravity, basic axes.
    """

    total: tuple[float, ...]
    """Mass felt in X, Y, Z (unit of mass) and inertia RX, RY, RZ (mass·length²); 0 where there is none."""
    fractions: tuple[tuple[float | None, ...], ...]
    """Six numbers for each mode of ModelModes.freq_hz, as parts of the total (no unit); None where the total is 0."""


class ModelModes(Record):
    """Solved modes of one configuration at one stage."""

    configuration: str
    """Name of the configuration."""
    stage: Stage
    """"before", "after" or "after as written"."""
    freq_hz: tuple[float, ...]
    """Natural frequencies in Hz, rising, rigid-body modes first as 0."""
    rigid_body_modes: int
    """How many of them are rigid-body motions."""
    sturm_shift_hz: float | None
    """Frequency in Hz of the Sturm check; None where not tested."""
    sturm_count: int | None
    """Number of eigenvalues below that shift by the signs of the factorisation; None where not tested."""
    modes_below_shift: int | None
    """Number of solved modes below that shift; equal to sturm_count where no mode was missed."""
    sturm_sentence: str = ""
    """Outcome in words, or why it was not tested."""
    effective_masses: EffectiveMasses | None = None
    """Modal effective masses; None in results of before they were computed."""
    solver: str = ""
    """Eigen-solver and sparse solver that found them: "block Lanczos, sparse factors by PARDISO"; "" in results of
    before it was kept."""
