"""The comparison of test and model in one configuration, as records."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.correlation import NotTested, correlate, reduce_mass
from femtune.residuals import modes_at_sensors
from femtune.steps.info.facts import alert_of
from femtune.study.record import ModelVersion
from femtune.validation import assess

if TYPE_CHECKING:
    from femtune.correlation import Correlation, Pair
    from femtune.errors import Notice
    from femtune.model import EigenSolution
    from femtune.residuals import ComparedCase
    from femtune.validation import Criterion, Verdict
from femtune.steps.correlate.record.correlation import (
    ClusterRecord,
    ComacEntry,
    CorrelationResults,
    CriterionRecord,
    ForbiddenPair,
    LeftOutMode,
    ModePairRecord,
    SensorContribution,
    SuspensionMode,
    UnpairedModelMode,
    UnpairedTestMode,
)

Arrays = dict[str, NDArray]


_NOT_IN_KEYS = re.compile(r"[^\w +-]")


def correlate_case(case: ComparedCase, solution: EigenSolution, rigid: int = 0) -> Correlation:
    """All comparisons of a case at its solved modes, of which the first `rigid` are rigid-body modes."""
    model = modes_at_sensors(case, solution)
    point = solution.point
    # a static reduction, with the stiffness at rest
    point = point.at_frequency(0.0) if point.depends_on_frequency else point
    none = NotTested("no mode shapes were measured")
    mass = reduce_mass(point.stiffness, point.mass, case.sensors, model) if len(case.test.dofs) else none
    return correlate(
        case.test,
        model,
        mass=mass,
        frequency_gate=case.rules.frequency_gate,
        mac_gate=case.rules.mac_gate,
        relative_gap=case.rules.relative_gap,
        fixed=case.fixed,
        never=case.never,
        left_out=case.left_out,
        rigid=rigid,
    )


def array_prefix(version: ModelVersion, name: str, number: int) -> str:
    """Head of the keys of a configuration's arrays: its name, with its number where the name cannot be a key."""
    # keys are names of files in an archive; brackets distinguish a changed name from every unchanged one
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
    keys: dict[str, str | None] = dict.fromkeys(("mac", "mac_without", "auto_mac_test", "auto_mac_model"))
    if len(c.dofs):
        keys = {name: f"{prefix}/{name}" for name in keys}
        arrays |= {f"{prefix}/{name}": getattr(c, name) for name in keys}
    return CorrelationResults(
        configuration=name,
        stage=version,
        pairs=tuple(_pair(c, p) for p in c.pairing.pairs),
        never_pairs=tuple(ForbiddenPair(test_label=c.test.labels[i], model_number=j + 1) for i, j in c.pairing.never),
        close_modes=tuple(tuple(j + 1 for j in group) for group in c.pairing.groups),
        left_out=tuple(LeftOutMode(**_unpaired(c, u.test, u.reason)) for u in c.pairing.unpaired_test if u.left_out),
        unpaired_test=tuple(
            UnpairedTestMode(**_unpaired(c, u.test, u.reason))
            for u in c.pairing.unpaired_test
            if not u.left_out and not u.suspension
        ),
        suspension=tuple(
            SuspensionMode(**_unpaired(c, u.test, u.reason)) for u in c.pairing.unpaired_test if u.suspension
        ),
        unpaired_model=tuple(_unpaired_model(c, rigid)),
        rigid_body_modes=rigid,
        clusters=tuple(_clusters(c)),
        mac_key=keys["mac"],
        mac_test_labels=c.test.labels,
        mac_test_freq_hz=tuple(float(f) for f in c.test.freq_hz),
        test_damping_ratio=_damping(c),
        mac_model_numbers=tuple(range(1, len(c.model) + 1)),
        mac_model_freq_hz=tuple(float(f) for f in c.model.freq_hz),
        auto_mac_test_key=keys["auto_mac_test"],
        auto_mac_model_key=keys["auto_mac_model"],
        comac=tuple(ComacEntry(dof=str(d), comac=float(v)) for d, v in zip(c.dofs, c.comac) if np.isfinite(v)),
        cross_orthogonality_key=f"{prefix}/cross_orthogonality" if crossed else None,
        cross_orthogonality_reason=c.cross_orthogonality.reason if isinstance(c.cross_orthogonality, NotTested) else "",
        cross_orthogonality_dropped=c.orthogonality_dropped,
        criteria=tuple(_criterion(v) for v in assess(c, criteria)),
        contributions=tuple(_contributions(c)),
        mac_without_key=keys["mac_without"],
        alerts=tuple(alert_of(notice) for notice in (*notices, *c.notices)),
    )


def _damping(c: Correlation) -> tuple[float | None, ...]:
    ratios = c.test.damping_ratio
    if ratios is None or not np.isfinite(ratios).any():
        return ()
    return tuple(float(ratio) if np.isfinite(ratio) else None for ratio in ratios)


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
        standard=c.standard,
    )
