"""The comparison of test and model as records."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from femtune.correlation import NotTested, correlate, reduce_mass
from femtune.residuals import modes_at_sensors
from femtune.results.base import Alert, ModelVersion, Record, VerdictWord
from femtune.results.expansion import ExpansionResults
from femtune.results.model import alert_of
from femtune.results.placement import PlacementResults
from femtune.validation import assess

if TYPE_CHECKING:
    from femtune.correlation import Correlation, Pair
    from femtune.errors import Notice
    from femtune.model import EigenSolution
    from femtune.residuals import ComparedCase
    from femtune.validation import Criterion, Verdict


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
    sense: Literal["at most", "at least"]
    """Which side of the limit passes."""
    measured: float | None
    """The worst measured value, in `unit`; None where not tested."""
    unit: str
    """"%", "°" or "" (none)."""
    verdict: VerdictWord
    """Outcome."""
    remark: str = ""
    """The decisive mode, or the reason why it was not tested."""


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
    alerts: tuple[Alert, ...] = ()
    """Findings of the comparison and of the solution of the modes, such as sensors that move against the model."""


# ----------------------------------------------------------------------------------------------------
# How the records are made.


Arrays = dict[str, NDArray]

_NOT_IN_KEYS = re.compile(r"[^\w +-]")


def correlate_case(case: ComparedCase, solution: EigenSolution) -> Correlation:
    """All comparisons of a case at its solved modes."""
    model = modes_at_sensors(case, solution)
    point = solution.point
    # a static reduction, with the stiffness at rest
    point = point.at_frequency(0.0) if point.depends_on_frequency else point
    mass = reduce_mass(point.stiffness, point.mass, case.sensors, model)
    return correlate(
        case.test,
        model,
        mass=mass,
        frequency_gate=case.rules.frequency_gate,
        mac_gate=case.rules.mac_gate,
        relative_gap=case.rules.relative_gap,
        fixed=case.fixed,
        left_out=case.left_out,
    )


def array_prefix(version: ModelVersion, name: str, number: int) -> str:
    """Head of the keys of a configuration's arrays: its name, with its number where the name cannot be a key."""
    # keys are names of files in an archive; brackets tell a changed name from every unchanged one
    safe = _NOT_IN_KEYS.sub("_", name)
    return f"{version.replace(' ', '_')}/{safe if safe == name else f'{safe}({number})'}"


def correlation_results(
    name: str,
    version: ModelVersion,
    c: Correlation,
    prefix: str,
    arrays: Arrays,
    criteria: Sequence[Criterion],
    rigid: int = 0,
    notices: Sequence[Notice] = (),
) -> CorrelationResults:
    """The record; its matrices are put into `arrays` under keys that begin with `prefix`.

    `criteria` are those requested in the study, `rigid` is the number of rigid-body modes of the model, `notices` are
    those of the solution.
    """
    crossed = not isinstance(c.cross_orthogonality, NotTested)
    if crossed:
        arrays[f"{prefix}/cross_orthogonality"] = _spread(c)
    arrays[f"{prefix}/mac"] = c.mac
    arrays[f"{prefix}/mac_without"] = c.mac_without
    arrays[f"{prefix}/auto_mac_test"] = c.auto_mac_test
    arrays[f"{prefix}/auto_mac_model"] = c.auto_mac_model
    return CorrelationResults(
        configuration=name,
        stage=version,
        pairs=tuple(_pair(c, p) for p in c.pairing.pairs),
        left_out=tuple(LeftOutMode(**_unpaired(c, u.test, u.reason)) for u in c.pairing.unpaired_test if u.left_out),
        unpaired_test=tuple(
            UnpairedTestMode(**_unpaired(c, u.test, u.reason)) for u in c.pairing.unpaired_test if not u.left_out
        ),
        unpaired_model=tuple(_unpaired_model(c, rigid)),
        rigid_body_modes=rigid,
        clusters=tuple(_clusters(c)),
        mac_key=f"{prefix}/mac",
        mac_test_labels=c.test.labels,
        mac_test_freq_hz=tuple(float(f) for f in c.test.freq_hz),
        mac_model_numbers=tuple(range(1, len(c.model) + 1)),
        mac_model_freq_hz=tuple(float(f) for f in c.model.freq_hz),
        auto_mac_test_key=f"{prefix}/auto_mac_test",
        auto_mac_model_key=f"{prefix}/auto_mac_model",
        comac=tuple(ComacEntry(dof=str(d), comac=float(v)) for d, v in zip(c.dofs, c.comac) if np.isfinite(v)),
        cross_orthogonality_key=f"{prefix}/cross_orthogonality" if crossed else None,
        cross_orthogonality_reason=c.cross_orthogonality.reason if isinstance(c.cross_orthogonality, NotTested) else "",
        cross_orthogonality_dropped=c.orthogonality_dropped,
        criteria=tuple(_criterion(v) for v in assess(c, criteria)),
        contributions=tuple(_contributions(c)),
        mac_without_key=f"{prefix}/mac_without",
        alerts=tuple(alert_of(notice) for notice in (*notices, *c.notices)),
    )


def _contributions(c: Correlation) -> Iterable[SensorContribution]:
    changes = c.mac_without - np.diag(c.paired_mac)
    for dof, ecomac, change in zip(c.dofs, c.enhanced_comac, changes):
        known = np.isfinite(change)
        most = int(np.nanargmax(np.abs(change))) if known.any() else None
        yield SensorContribution(
            dof=str(dof),
            ecomac=float(ecomac) if np.isfinite(ecomac) else None,
            mac_change=float(change[known].mean()) if known.any() else None,
            largest_change=None if most is None else float(change[most]),
            largest_change_label="" if most is None else c.test.labels[c.pairing.pairs[most].test],
        )


def _spread(c: Correlation) -> NDArray:
    """Cross-orthogonality of the pairs at its places among all modes; NaN elsewhere."""
    out = np.full(c.mac.shape, np.nan)
    tests, models = [p.test for p in c.pairing.pairs], [p.model for p in c.pairing.pairs]
    out[np.ix_(tests, models)] = c.cross_orthogonality
    return out


def _pair(c: Correlation, p: Pair) -> ModePairRecord:
    return ModePairRecord(
        test_label=c.test.labels[p.test],
        test_freq_hz=float(c.test.freq_hz[p.test]),
        model_number=p.model + 1,
        model_freq_hz=float(c.model.freq_hz[p.model]),
        freq_error_percent=100.0 * p.frequency_error,
        mac=float(p.mac) if np.isfinite(p.mac) and not c.one_dof(p.test) else None,
        fixed_by_hand=p.fixed,
        cluster=None if p.cluster is None else p.cluster + 1,
    )


def _unpaired(c: Correlation, i: int, reason: str) -> dict:
    return {"test_label": c.test.labels[i], "test_freq_hz": float(c.test.freq_hz[i]), "reason": reason}


def _unpaired_model(c: Correlation, rigid: int) -> Iterable[UnpairedModelMode]:
    for j in c.pairing.unpaired_model:
        reason = "no test mode was paired with it" if j >= rigid else "rigid-body mode"
        yield UnpairedModelMode(model_number=j + 1, model_freq_hz=float(c.model.freq_hz[j]), reason=reason)


def _clusters(c: Correlation) -> Iterable[ClusterRecord]:
    for i, match in enumerate(c.clusters, start=1):
        if len(match.model) > 1:
            angles = match.rotation.principal_angles_deg
            yield ClusterRecord(
                cluster=i,
                test_labels=tuple(c.test.labels[k] for k in match.test),
                model_numbers=tuple(j + 1 for j in match.model),
                angle_deg=float(np.nanmax(angles)) if np.isfinite(angles).any() else 0.0,
                sentence=f"the model modes were rotated by {match.rotation.angle_deg:.1f}° within their subspace",
            )


def _criterion(v: Verdict) -> CriterionRecord:
    c = v.criterion
    percent = c.quantity == "frequency error"
    scale = 100.0 if percent else 1.0
    return CriterionRecord(
        name=f"{c.quantity}, {c.standard}",
        limit=scale * c.limit,
        sense="at most" if c.at_most else "at least",
        measured=None if v.measured is None or not np.isfinite(v.measured) else scale * v.measured,
        unit="%" if percent else "",
        verdict=v.outcome.value,
        remark=v.remark,
    )
