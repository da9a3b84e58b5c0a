"""Parameters beyond the usual range of the fields that they set."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.init.proposed_parameters import KIND_OF_FIELD
from femtune.steps.judge.record.usual import UnusualValue, UsualRanges

if TYPE_CHECKING:
    from femtune.steps.init.proposed_parameters import ProposalKind
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.steps.update.record.update import ParameterFacts


def usual_ranges(fit: FinishedUpdate) -> UsualRanges | None:
    """Values beyond the range that a first study proposes for a property of this kind; None without such a property."""
    update = fit.results.update
    assert update is not None
    values, beyond, known = {p.name: p.value for p in update.parameters}, [], False
    for fact in fit.results.parameters:
        kind = _kind(fit, fact)
        if kind is None or fact.nominal == 0.0:
            continue
        known = True
        factor = values[fact.name] / fact.nominal
        if not kind.lower <= factor <= kind.upper:
            beyond.append(
                UnusualValue(
                    parameter=fact.name, what=kind.what, factor=factor, lower=kind.lower, upper=kind.upper
                )
            )  # fmt: skip
    return UsualRanges(beyond=tuple(beyond)) if known else None


def _kind(fit: FinishedUpdate, fact: ParameterFacts) -> ProposalKind | None:
    """The kind of the fields of a parameter; None of a tied one, or if its fields are of several kinds or none."""
    study = fit.study
    refs = [a.ref for a in study.model.assignments if a.parameter == study.in_study(fact.name)]
    kinds = {KIND_OF_FIELD.get((ref.card, ref.name)) for ref in refs}
    return kinds.pop() if len(kinds) == 1 and not fact.tie else None
