"""Records about the comparison of test and model, and about predictions on data left out."""

from __future__ import annotations

from typing import Literal

from femtune.study.results_base import Record, Stage, VerdictWord


class PairedMode(Record):
    """A test mode and the model mode that answers for it."""

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
    """Modal assurance criterion, 0 to 1; of the subspace for modes of a cluster; None where no shape was measured."""
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
    """The study's reason."""


class UnpairedTestMode(Record):
    """A test mode without a partner."""

    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency in Hz."""
    reason: str
    """Why it has no partner, in words."""


class UnpairedModelMode(Record):
    """A model mode within the range of the test without a partner."""

    model_number: int
    """Number of the model mode, from 1."""
    model_freq_hz: float
    """Frequency in Hz."""
    reason: str = ""
    """Why, in words."""


class ClusterMatch(Record):
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
    """Remark in words: how the model's vectors were rotated."""


class ComacEntry(Record):
    """COMAC of one measured DOF over the paired modes."""

    dof: str
    """Label of the DOF in the test."""
    comac: float
    """0 to 1 (no unit)."""


class Criterion(Record):
    """An acceptance criterion with the measured number beside its own."""

    name: str
    """What is asked: "frequency error, NASA-STD-5002"."""
    limit: float
    """The criterion's number, in `unit`."""
    sense: Literal["at most", "at least"]
    """Which side of the limit passes."""
    measured: float | None
    """The worst measured number, in `unit`; None where not tested."""
    unit: str
    """"%", "°" or "" (none)."""
    verdict: VerdictWord
    """Outcome."""
    remark: str = ""
    """The mode that decided, or why it was not tested."""


class CorrelationResults(Record):
    """Test against model: one configuration at one stage."""

    configuration: str
    """Name of the configuration."""
    stage: Stage
    """"before" the update, "after" it, or "after as written": with the values that the deck's fields hold."""
    pairs: tuple[PairedMode, ...]
    """Paired modes in the order of the test."""
    left_out: tuple[LeftOutMode, ...]
    """Modes left out by the study."""
    unpaired_test: tuple[UnpairedTestMode, ...]
    """Test modes without a partner."""
    unpaired_model: tuple[UnpairedModelMode, ...]
    """Model modes without a partner, all that were solved, rigid-body modes too."""
    clusters: tuple[ClusterMatch, ...]
    """Close modes that were compared as subspaces."""
    mac_key: str | None
    """Key in arrays.npz of the MAC matrix, shape (test modes, model modes); None where no shapes were measured."""
    mac_test_labels: tuple[str, ...]
    """Test modes of the rows of the MAC matrix."""
    mac_test_freq_hz: tuple[float, ...]
    """Their frequencies in Hz."""
    mac_model_numbers: tuple[int, ...]
    """Model modes of the columns of the MAC matrix, from 1."""
    mac_model_freq_hz: tuple[float, ...]
    """Their frequencies in Hz."""
    auto_mac_test_key: str | None
    """Key of the AutoMAC of the test modes (rows and columns as the rows of the MAC matrix)."""
    auto_mac_model_key: str | None
    """Key of the AutoMAC of the model modes (rows and columns as the columns of the MAC matrix)."""
    comac: tuple[ComacEntry, ...]
    """COMAC by measured DOF; empty where not tested."""
    cross_orthogonality_key: str | None
    """Key of the mass-weighted cross-orthogonality, shape of the MAC matrix; None where not tested."""
    cross_orthogonality_reason: str
    """Why it was not tested; "" where it was."""
    cross_orthogonality_dropped: tuple[str, ...] = ()
    """Sensors that it leaves out, since in the model they only repeat others (as on a rigid body)."""
    criteria: tuple[Criterion, ...]
    """Acceptance criteria."""
    rigid_body_modes: int = 0
    """How many of the model modes, from the lowest, are rigid-body motions; 0 in results of before it was kept."""
    mac_gate: float | None = None
    """Least MAC of a pair, 0 to 1, as the study asks; None where not recorded."""
