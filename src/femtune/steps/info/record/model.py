"""The model as records: cards, mass, supports, checks, sensors, damping and modes."""

from __future__ import annotations

from femtune.steps.info.record.checks import ModelCheck
from femtune.study.record import Alert, ModelVersion, Record, Vector3, VerdictWord


class UsedCard(Record):
    """A kind of card that was read and used."""

    name: str
    """Name of the card: "CBAR"."""
    count: int
    """Their number."""


class IgnoredCard(Record):
    """A kind of card that was not used."""

    name: str
    """Name of the card."""
    count: int
    """Their number."""
    first_file: str
    """File of the first one."""
    first_line: int
    """Line of the first one, from 1."""
    reason: str
    """Why it was not used."""


class DeckParameterRecord(Record):
    """A PARAM of the deck."""

    name: str
    """Name: "WTMASS"."""
    value: str
    """Value as the deck writes it."""
    understood: bool
    """True if it acts as in Nastran, false if it was ignored."""
    remark: str = ""
    """Its effect, or the reason why it was ignored."""


class HeldDof(Record):
    """A DOF that was constrained because no element gives it stiffness."""

    dof: str
    """Node and direction: "101RZ+"."""
    reason: str
    """The reason."""


class GroundedDof(Record):
    """A DOF with a residual force in a rigid-body motion: an unintended connection to ground."""

    dof: str
    """Node and direction."""
    force: float
    """Residual force in the worst of the six rigid-body motions, relative to the sum of magnitudes (no unit)."""


class GroundingElementRecord(Record):
    """An element that is strained by a rigid-body motion of the model without supports."""

    card: str
    """Name of its card: "CELAS2"."""
    element: int
    """Its number."""
    motion: str
    """The rigid-body motion that strains it: "X" to "RZ"."""
    relative_energy: float
    """Its strain energy relative to the sum of the absolute values of its terms (no unit)."""


class RigidBodyCheck(Record):
    """Strain energy of the six rigid-body motions of the model without supports."""

    strain_energies: tuple[float, ...]
    """Of unit translations X, Y, Z and rotations RX, RY, RZ (1 rad), in units of the study."""
    relative_energies: tuple[float, ...]
    """The same, relative to the sum of the absolute values of the terms (no unit); ideally zero."""
    grounded: bool | None
    """True if at least one motion strains the model; None if not tested."""
    verdict: VerdictWord
    """Outcome; connections to ground by elements with a grounded end are accepted."""
    sentence: str
    """Outcome in words, or the reason why it was not tested."""
    worst_dofs: tuple[GroundedDof, ...] = ()
    """DOFs with the largest forces, in descending order."""
    grounding_elements: tuple[GroundingElementRecord, ...] = ()
    """Elements that constrain the model to ground: the ten with the largest energy."""


class ModelConfiguration(Record):
    """The model in one configuration."""

    configuration: str
    """Name of the configuration."""
    grids: int
    """Number of grid and scalar points."""
    free_dofs: int
    """Number of free DOFs."""
    supports: tuple[str, ...]
    """Constraints by origin: grid points (PS), SPC set, configuration; each DOF is counted once."""
    held_dofs: tuple[HeldDof, ...]
    """DOFs constrained by AUTOSPC."""
    mass: float | None
    """Mass of the model, in the study's unit of mass; None for a model of runs, which does not tell it."""
    centre_of_gravity: Vector3 | None
    """In the basic system, in the study's unit of length; None where the points have no coordinates."""
    inertia: tuple[Vector3, Vector3, Vector3] | None
    """Inertia tensor about the centre of gravity, basic axes, in the study's mass·length²; None where the
    points have no coordinates."""
    weighed_mass: float | None
    """Measured mass, in the study's unit of mass; None if the study states none."""
    mass_difference_percent: float | None
    """(model − measured)/measured in %; None without a measured mass."""
    rigid_body_check: RigidBodyCheck
    """Strain energy of rigid motions."""
    constraints: tuple[str, ...] = ()
    """Active multipoint constraints and rigid elements; older results list them with the supports."""
    overlay: tuple[str, ...] = ()
    """Changes of the deck in this configuration: absent elements, added masses, supports."""


class NamedSet(Record):
    """A named set of degrees of freedom of the deck; it does not constrain them."""

    name: str
    """ASET, OMIT, BSET, CSET, QSET, SUPORT, "SUPORT1 3" or "USET U1"."""
    dofs: int
    """Number of its DOFs."""
    effect: str
    """Its effect."""


class DampingField(Record):
    """A damping field of a kind of card; zero values are not counted."""

    kind: str
    """"loss factor" (hysteretic) or "viscous"."""
    field: str
    """Card and field: "MAT1 GE"; the six directions of a bush are listed together."""
    cards: int
    """Number of cards with a value."""
    lowest: float
    """Smallest value, in units of the deck (loss factors have none)."""
    highest: float
    """Largest value."""
    elements: int
    """Number of elements with these values."""


class DampingFacts(Record):
    """Damping in the deck."""

    overall_loss_factor: float | None
    """Loss factor of all stiffness (PARAM G); None without one."""
    overall_omega_rad_s: float | None
    """Frequency for its conversion to viscous damping (PARAM W3); None without one."""
    element_omega_rad_s: float | None
    """The same for loss factors of materials and elements (PARAM W4); None without one."""
    modal_damping: str
    """Damping of modes that case control selects (SDAMPING), in words; empty without one."""
    fields: tuple[DampingField, ...]
    """Loss factors and dashpots by card and field."""


class OutOfShape(Record):
    """An element that is out of shape."""

    card: str
    """Name of its card: "CQUAD4"."""
    element: int
    """Its number."""
    value: float
    """What was measured."""


class ElementShapeTest(Record):
    """A test of the shape of elements, as Nastran's GEOMCHECK has it."""

    test: str
    """Name: "Q4_SKEW"."""
    meaning: str
    """What is measured."""
    unit: str
    """"deg", or "" for ratios."""
    limit: float
    """Limit: of the deck's GEOMCHECK statement, or the default."""
    least: bool
    """True if smaller values are out of shape, false if larger ones are."""
    tested: int
    """Number of elements that the test applies to."""
    beyond: int
    """How many of them are out of shape."""
    extreme: float
    """Worst value of all of them."""
    degenerate: bool = False
    """True if an element is turned inside out at a grid point."""
    worst: tuple[OutOfShape, ...] = ()
    """Elements that are out of shape, the worst first, at most ten."""


class ElementShapes(Record):
    """Shapes of the elements."""

    elements: int
    """Number of elements with at least one test."""
    tests: tuple[ElementShapeTest, ...]
    """All tests that apply to some element."""
    given: tuple[str, ...] = ()
    """Tests whose limit is of the deck."""
    ignored: tuple[str, ...] = ()
    """Words of GEOMCHECK statements that are no known test."""
    sentence: str = ""
    """Result in words, or the reason why it was not tested."""


class ModeBesideDeck(Record):
    """A mode of the external solver and its partner in femtune's own model of the deck."""

    number: int
    """Number of the mode of the solver, from 1."""
    freq_hz: float
    """Its frequency in Hz."""
    deck_hz: float
    """Frequency of the partner in Hz."""
    difference_percent: float | None
    """That of the deck relative to that of the solver, minus 1, in %; None for rigid-body modes."""
    mac: float | None
    """MAC of both shapes at the DOFs that both models have; None where modes are compared in their order."""
    alike: bool
    """True if both are alike enough for a derivative of one to serve the other; False for rigid-body modes."""


class BesideDeck(Record):
    """The external solver beside femtune's own model of the deck, at the initial values."""

    configuration: str
    """The first configuration with this input of the solver."""
    derivatives: bool
    """True if the update begins with the derivatives of the deck."""
    modes: tuple[ModeBesideDeck, ...]
    """The modes of the solver that move at its DOFs."""


class UpdatableField(Record):
    """A field of the deck that elements use and that can become a parameter, with usual bounds."""

    name: str
    """A name for the parameter: "I1_PBAR_1"."""
    field: str
    """The field: "PBAR 1 I1"."""
    what: str
    """What it is: "property: section"."""
    value: float
    """Its value in the deck, in units of the deck."""
    lower: float
    """Usual lower bound of a factor on it."""
    upper: float
    """Usual upper bound of a factor on it."""
    elements: tuple[tuple[int, int], ...] = ()
    """Elements that have it: first and last numbers of spans of all elements; empty with more than 400 spans, and in
    older results."""


class ModelFacts(Record):
    """Content of the deck, and the model built from it."""

    cards_read: tuple[UsedCard, ...]
    """Cards that were used."""
    cards_ignored: tuple[IgnoredCard, ...]
    """Cards that were not used."""
    deck_parameters: tuple[DeckParameterRecord, ...]
    """PARAMs, understood and ignored."""
    dof_sets: tuple[NamedSet, ...] = ()
    """Sets of degrees of freedom that the deck names."""
    checks: tuple[ModelCheck, ...] = ()
    """Check of the mass; checks that require modes are in SelectionResults."""
    notices: tuple[Alert, ...]
    """Notices of the deck reader."""
    configurations: tuple[ModelConfiguration, ...]
    """One record a configuration."""
    damping: DampingFacts | None = None
    """Damping; None in older results without this field."""
    element_shapes: ElementShapes | None = None
    """Shapes of the elements; None in older results without this field."""
    beside_deck: tuple[BesideDeck, ...] = ()
    """The external solver beside the deck, by input; empty where they were not compared."""
    fields: tuple[UpdatableField, ...] = ()
    """Fields of properties, materials, joints and masses that can become parameters; at most 200, and empty for a model
    without a deck and in older results."""


class MatchedSensor(Record):
    """A measured DOF and the model DOF matched with it."""

    test_dof: str
    """Label in the test: "12X+"."""
    test_node: int
    """Node of the test."""
    model_node: int | None
    """Grid of the model; None for a combination of several."""
    distance: float | None
    """Between the two, in the study's unit of length; None if matched without coordinates."""
    how: str
    """How it was matched: "nearest", "by id", "given" or "combination"."""
    place: tuple[float, float, float] | None = None
    """Place of the sensor in the basic coordinate system, in the study's unit of length; None without coordinates, and
    in older results."""
    grid_place: tuple[float, float, float] | None = None
    """Place of the grid point; None for a combination or without coordinates, and in older results."""


class UnmatchedSensor(Record):
    """A measured DOF that is not compared."""

    test_dof: str
    """Label in the test."""
    reason: str
    """The reason."""


class ExciterRecord(Record):
    """A degree of freedom at which the structure was excited: a reference of the measured functions."""

    test_dof: str
    """Label in the test: "12X+"."""
    place: tuple[float, float, float] | None
    """Its place in the basic coordinate system, in the study's unit of length; None without coordinates."""


class SensorResults(Record):
    """Sensors of one configuration."""

    configuration: str
    """Name of the configuration."""
    test_file: str
    """File of the test."""
    tolerance: float | None
    """Largest distance allowed, in the study's unit of length; None if matched otherwise."""
    matched: tuple[MatchedSensor, ...]
    """Sensors that are compared, generalised ones among them."""
    unmatched: tuple[UnmatchedSensor, ...]
    """Sensors that were not matched."""
    exciters: tuple[ExciterRecord, ...] = ()
    """References of the measured functions; empty for a test of modes alone, and in older results."""


class EffectiveMasses(Record):
    """Modal effective masses for rigid-body motion of the supports.

    Six directions: translations X, Y, Z and rotations RX, RY, RZ about the centre of gravity, basic axes.
    """

    total: tuple[float, ...]
    """Effective total mass in X, Y, Z (unit of mass) and inertia RX, RY, RZ (mass·length²); 0 where there is none."""
    fractions: tuple[tuple[float | None, ...], ...]
    """Six numbers for each mode of ModelModes.freq_hz, as parts of the total (no unit); None where the total is 0."""


class TestMassMode(Record):
    """Effect of the masses of the test equipment on an elastic mode."""

    __test__ = False

    number: int
    """Number of the mode, from 1."""
    share_percent: float
    """Part of the modal mass that these masses have, in %."""
    shift_percent: float
    """Change of the frequency by these masses in %, by the Rayleigh quotient."""
    node: int
    """Grid point of the mass with the largest part."""
    label: str
    """Its label."""
    largest_percent: float
    """This part of the modal mass in %."""


class TestMassEffect(Record):
    """Effect of the masses of sensors and stingers, from the modes with them."""

    __test__ = False

    count: int
    """Number of masses."""
    mass: float
    """Their sum."""
    ratio: float | None = None
    """Their sum relative to the mass of the structure without them; None where that has none, and in results of earlier
    versions."""
    modes: tuple[TestMassMode, ...]
    """The elastic modes."""
    exchanged: tuple[tuple[int, int], ...]
    """Pairs of modes whose order is another one without these masses, by the same estimate."""


class ModelModes(Record):
    """Solved modes of one configuration at one model version."""

    configuration: str
    """Name of the configuration."""
    stage: ModelVersion
    """"before", "after" or "after as written"."""
    freq_hz: tuple[float, ...]
    """Natural frequencies in Hz, rising, rigid-body modes first as 0."""
    rigid_body_modes: int
    """How many of them are rigid-body motions."""
    sturm_shift_hz: float | None
    """Frequency of the Sturm check in Hz; None if not tested."""
    sturm_count: int | None
    """Number of eigenvalues below that shift by the Sturm count; None if not tested."""
    modes_below_shift: int | None
    """Number of solved modes below that shift; equal to sturm_count where no mode was missed."""
    sturm_sentence: str = ""
    """Outcome in words, or the reason why it was not tested."""
    effective_masses: EffectiveMasses | None = None
    """Modal effective masses; None in results of before they were computed."""
    solver: str = ""
    """Eigen-solver and sparse solver that found them: "block Lanczos, sparse factors by PARDISO"; "" in results of
    before it was kept."""
    test_masses: TestMassEffect | None = None
    """Effect of the masses of the test equipment; None if the configuration has no `masses_file`."""
    alerts: tuple[Alert, ...] = ()
    """Remarks on these modes: which of them depend on the drilling stiffness of shells, or on the place of the mass of
    beams with an offset neutral axis."""
    mesh: ModelCheck | None = None
    """Errors of the frequencies due to the mesh, from the step modes; None in a run, which has them in
    SelectionResults."""
