"""The comparison of test and model as records."""

from __future__ import annotations

from femtune.steps.correlate.record.expansion import ExpansionResults
from femtune.steps.correlate.record.placement import PlacementResults
from femtune.study.record import Alert, LimitSense, ModelVersion, Record, VerdictWord


class ModePairRecord(Record):
    """A test mode and the model mode paired with it."""

    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency of the test in Hz."""
    model_number: int
    """Number of the model mode, from 1."""
    model_freq_hz: float
    """Frequency of the model in Hz."""
    freq_error_percent: float
    """(model − test)/test in %."""
    mac: float | None
    """Modal assurance criterion, 0 to 1; of the subspace for modes of a cluster; None if the shape was measured at
    fewer than two DOFs."""
    fixed_by_hand: bool = False
    """True where the study prescribes the pair."""
    cluster: int | None = None
    """Number of the cluster of close modes that the pair belongs to; None outside clusters."""


class LeftOutMode(Record):
    """A test mode that the study leaves out."""

    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency in Hz."""
    reason: str
    """The reason stated in the study."""


class UnpairedTestMode(Record):
    """A test mode without a partner."""

    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency in Hz."""
    reason: str
    """The reason why it has no partner."""


class SuspensionMode(UnpairedTestMode):
    """A mode of the suspension of a free structure, which is set apart; the reason says how it was recognised."""


class UnpairedModelMode(Record):
    """A model mode within the range of the test without a partner."""

    model_number: int
    """Number of the model mode, from 1."""
    model_freq_hz: float
    """Frequency in Hz."""
    reason: str = ""
    """The reason."""


class ClusterRecord(Record):
    """Close or repeated modes that are compared as a subspace."""

    cluster: int
    """Number of the cluster, from 1."""
    test_labels: tuple[str, ...]
    """Test modes in it."""
    model_numbers: tuple[int, ...]
    """Model modes in it."""
    angle_deg: float
    """Largest principal angle between the two subspaces, in degrees."""
    sentence: str = ""
    """Remark on the rotation of the model modes."""


class ComacEntry(Record):
    """COMAC of one measured DOF over the paired modes."""

    dof: str
    """Label of the DOF in the test."""
    comac: float
    """0 to 1 (no unit)."""


class SensorContribution(Record):
    """Effect of one measured DOF on the agreement of the paired modes."""

    dof: str
    """Label of the DOF in the test."""
    ecomac: float | None
    """Enhanced COMAC: half the mean difference of the shapes at this DOF, relative to the largest entry of the test
    shape; 0 for agreement. None if not measured in a paired mode."""
    mac_change: float | None
    """Mean over the pairs of the MAC without this DOF minus the MAC with it: positive if the DOF lowers the MAC. None
    if fewer than two other DOFs were measured."""
    largest_change: float | None
    """The change of largest magnitude among the pairs."""
    largest_change_label: str
    """Label of the test mode of this pair; "" if there is none."""


class CriterionRecord(Record):
    """An acceptance criterion with its limit and the measured value."""

    name: str
    """Quantity and standard: "frequency error, NASA-STD-5002"."""
    limit: float
    """The limit, in `unit`."""
    sense: LimitSense
    """Which side of the limit passes."""
    measured: float | None
    """The worst measured value, in `unit`; None where not tested."""
    unit: str
    """"%", "°" or "" (none)."""
    verdict: VerdictWord
    """Outcome."""
    remark: str = ""
    """The decisive mode, or the reason why it was not tested."""
    standard: str = ""
    """The standard alone: "NASA-STD-5002"; "" in older results."""


class ForbiddenPair(Record):
    """A pair of modes that the study forbids."""

    test_label: str
    """Label of the test mode."""
    model_number: int
    """Number of the model mode, from 1."""


class CorrelationResults(Record):
    """Test against model: one configuration at one model version."""

    configuration: str
    """Name of the configuration."""
    stage: ModelVersion
    """"before" the update, "after" it, or "after as written": with the values in the fields of the written deck."""
    pairs: tuple[ModePairRecord, ...]
    """Paired modes in the order of the test."""
    left_out: tuple[LeftOutMode, ...]
    """Modes left out by the study."""
    unpaired_test: tuple[UnpairedTestMode, ...]
    """Test modes without a partner."""
    suspension: tuple[SuspensionMode, ...] = ()
    """Modes of the suspension, which have no partner and decide no criterion; empty in older results."""
    unpaired_model: tuple[UnpairedModelMode, ...]
    """Model modes without a partner, including rigid-body modes."""
    clusters: tuple[ClusterRecord, ...]
    """Close modes that were compared as subspaces."""
    mac_key: str | None
    """Key in arrays.npz of the MAC matrix, shape (test modes, model modes); None where no shapes were measured."""
    mac_test_labels: tuple[str, ...]
    """Test modes of the rows of the MAC matrix."""
    mac_test_freq_hz: tuple[float, ...]
    """Their frequencies in Hz."""
    test_damping_ratio: tuple[float | None, ...] = ()
    """Their measured damping ratios (no unit), None for a mode without one; empty if the test has none, and in older
    results."""
    mac_model_numbers: tuple[int, ...]
    """Model modes of the columns of the MAC matrix, from 1."""
    mac_model_freq_hz: tuple[float, ...]
    """Their frequencies in Hz."""
    auto_mac_test_key: str | None
    """Key of the AutoMAC of the test modes (rows and columns as the rows of the MAC matrix)."""
    auto_mac_model_key: str | None
    """Key of the AutoMAC of the model modes (rows and columns as the columns of the MAC matrix)."""
    comac: tuple[ComacEntry, ...]
    """COMAC by measured DOF; empty if not tested."""
    cross_orthogonality_key: str | None
    """Key of the mass-weighted cross-orthogonality, shape of the MAC matrix; None where not tested."""
    cross_orthogonality_reason: str
    """The reason why it was not tested; "" if it was."""
    cross_orthogonality_dropped: tuple[str, ...] = ()
    """Sensors without contribution because they are linearly dependent on others in the model (as on a rigid body)."""
    criteria: tuple[CriterionRecord, ...]
    """Acceptance criteria."""
    rigid_body_modes: int = 0
    """Number of rigid-body modes of the model; 0 in older results without this field."""
    mac_gate: float | None = None
    """Smallest MAC of a pair required by the study, 0 to 1; None if not recorded."""
    contributions: tuple[SensorContribution, ...] = ()
    """Effect of each measured DOF on the MAC of the pairs."""
    mac_without_key: str | None = None
    """Key of the MAC of each pair without one DOF, shape (DOFs, pairs): DOFs as in `contributions`, pairs as in
    `pairs`; NaN where it is not defined. None in older results and where no shapes were measured."""
    placement: PlacementResults | None = None
    """Effect of errors in the placement of the sensors; None if the study states none."""
    expansion: ExpansionResults | None = None
    """Test shapes expanded to the model; None if the study does not request it."""
    never_pairs: tuple[ForbiddenPair, ...] = ()
    """Pairs that the study forbids."""
    close_modes: tuple[tuple[int, ...], ...] = ()
    """Numbers of the model modes of each cluster of close ones, which are compared as one subspace; empty in older
    results."""
    alerts: tuple[Alert, ...] = ()
    """Findings of the comparison and of the solution of the modes, such as sensors that move against the model."""
