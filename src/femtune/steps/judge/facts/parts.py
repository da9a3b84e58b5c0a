"""The residuals at the end of an update in parts: from the fit to a record."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc

from femtune.judge.mac_noise import mac_parts
from femtune.judge.neighbours import neighbour_tests
from femtune.judge.parts import holm, only_prior_contradicts, parts
from femtune.judge.scales import FEWEST_DEGREES, scales
from femtune.judge.whitened import whitened
from femtune.kinds import loaded
from femtune.residuals.mac import MacResidual
from femtune.steps.judge.record.parts import (
    NOT_ACCEPTED,
    SHARE_OF_NEIGHBOURS,
    SHARE_OF_PARTS,
    KindOfErrors,
    NeighbourRecord,
    PartRecord,
    PartsResults,
    UntestedKind,
)

if TYPE_CHECKING:
    from femtune.files.study_file.residual import Comparison
    from femtune.judge.neighbours import NeighbourTest
    from femtune.judge.parts import ResidualPart
    from femtune.judge.whitened import Whitened
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

_SHORT_KEYS = {"frequency": "frequency_sd", "shape": "shape_sd", "mac": "shape_sd"}
_FEW = "fewer than three degrees of freedom are left to estimate the size of the errors, which is an assumption"


def parts_of_fit(fit: FinishedUpdate) -> PartsResults | None:
    """The record of a finished update; None without derivatives at its end."""
    return parts_results(fit.study, fit.result)


def parts_results(study: Study, result: UpdateResult) -> PartsResults | None:
    """The parts, by the stated standard deviations; by estimated ones of kinds where they are assumptions."""
    record = whitened(result)
    if record is None:
        return None
    side = result.side
    opinion = bool(len(side.held)) or not np.all(np.broadcast_to(side.informative, len(side.target)))
    scaled, estimated = scaled_by_residuals(record, assumed_kinds(study))
    of_macs = mac_parts(result)
    tested = parts(scaled, opinion, estimated, of_macs)
    untested = dict(scaled.untested)
    if len(of_macs) == sum(b.kind == MacResidual.label for b in result.after.blocks):
        untested.pop(MacResidual.label, None)
    return PartsResults(
        parts=tuple(_part(p) for p in tested),
        neighbours=tuple(_neighbour(t, result) for t in neighbour_tests(result.after)),
        kinds=tuple(_kinds(study, record, tested)),
        only_prior=only_prior_contradicts(scaled, NOT_ACCEPTED),
        untested=tuple(UntestedKind(kind=k, reason=why) for k, why in untested.items()),
    )


def assumed_kinds(study: Study) -> frozenset[str]:
    """Labels of the kinds whose standard deviations are assumptions."""
    table = study.file.residuals
    stated, assumed = set[str](), set[str]()
    for comparison in study.file.comparisons:
        entry = comparison.entry
        guess = table.is_assumed(_SHORT_KEYS[entry.kind]) if comparison.short else entry.is_assumed
        (assumed if guess or table.scatter == "estimated" else stated).add(_label(comparison))
    return frozenset(assumed - stated)


def _label(comparison: Comparison) -> str:
    """What reports call the kind of a comparison."""
    return str(loaded(comparison.entry.made_by).label)


def scaled_by_residuals(record: Whitened, assumed: frozenset[str]) -> tuple[Whitened, frozenset[str]]:
    """The record in which kinds of assumed errors have the size that the residuals show, and these kinds."""
    while True:
        present = frozenset(record.kinds) & assumed
        if not present:
            return record, present
        every = record.of_all_parameters
        factors = scales(record, [k for k in record.kinds if k not in assumed])
        few = {k for k in present if every.degrees(every.of_kind(k))[0] < FEWEST_DEGREES}
        # the weights of the other kinds decide too how much the parameters leave of a kind
        few |= {k.kind for k in factors.kinds if not k.estimated}
        if not few:
            return factors.weighted, present
        record = record.without_kinds(dict.fromkeys(few, _FEW))


def _part(p: ResidualPart) -> PartRecord:
    return PartRecord(
        family=p.family,
        kind=p.kind,
        configuration=p.configuration,
        mode=p.mode,
        sensor=p.sensor,
        values=p.values,
        chi_square=p.chi_square,
        degrees_of_freedom=p.degrees,
        p_value=p.p_large,
        p_family_wise=min(1.0, p.p_family_wise / SHARE_OF_PARTS),
    )


def _neighbour(t: NeighbourTest, result: UpdateResult) -> NeighbourRecord:
    state = next(s for s in result.after.states if s.case.name == t.configuration)
    labels = [
        state.case.test.labels[tests[0]] for tests, models in state.groups if t.other in models and len(tests) == 1
    ]
    return NeighbourRecord(
        configuration=t.configuration,
        test_label=t.mode,
        model_number=t.model_mode + 1,
        neighbours=tuple(i + 1 for i in t.neighbours),
        other_number=t.other + 1,
        other_label=labels[0] if labels else "",
        share=t.share,
        F=t.F,
        degrees_of_freedom=t.degrees,
        p_value=t.p_value,
        p_family_wise=min(1.0, t.p_family_wise / SHARE_OF_NEIGHBOURS),
        scatter=t.scatter,
    )


def _kinds(study: Study, record: Whitened, tested: tuple[ResidualPart, ...]) -> Iterator[KindOfErrors]:
    """The factor of each kind: of all kinds together, so that one that is wrong does not falsify the others."""
    assumed = assumed_kinds(study)
    of_kind = {p.kind: p for p in tested if p.family == "kinds" and p.kind}
    small = dict(zip(of_kind, holm([p.p_small for p in of_kind.values()])))
    every = record.of_all_parameters
    for scale in scales(every).kinds:
        keys = [_key(c) for c in study.file.comparisons if _label(c) == scale.kind]
        key, stated = keys[0] if len(set(keys)) == 1 else ("", None)
        rows = every.of_kind(scale.kind)
        q, degrees = float(np.sum(every.left[rows] ** 2)), every.degrees(rows)[0]
        yield KindOfErrors(
            kind=scale.kind,
            factor=scale.factor if scale.estimated else _by_itself(q, degrees),
            degrees_of_freedom=scale.degrees,
            key=key,
            stated=stated,
            assumed=scale.kind in assumed,
            p_small=small.get(scale.kind),
            p_large=float(chdtrc(degrees, q)) if scale.kind in assumed and degrees > 0.0 else None,
        )


def _by_itself(q: float, degrees: float) -> float | None:
    """The factor of a kind with the stated weights of all others, where it cannot be told with estimated ones."""
    return float(np.sqrt(q / degrees)) if degrees >= 1.0 else None


def _key(comparison: Comparison) -> tuple[str, float | None]:
    """The key with the standard deviation, and its value if that is a number."""
    key = _SHORT_KEYS[comparison.entry.kind] if comparison.short else "sd"
    value = getattr(comparison.entry, "sd", None)
    number = float(value) if isinstance(value, int | float) else None
    return ("" if number is None else key), number
