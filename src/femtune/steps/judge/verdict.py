"""The verdict on a run from its reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from femtune.steps.judge.reasons import TOPICS
from femtune.steps.judge.reasons.alerts import reasons_of_alerts
from femtune.steps.judge.reasons.compared import reasons_of_comparisons
from femtune.steps.judge.reasons.criteria import reasons_of_criteria
from femtune.steps.judge.record.judgement import JudgementResults

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.judge.record.acceptance import AcceptanceResults
    from femtune.steps.judge.record.judgement import VerdictOfRun
    from femtune.steps.judge.record.reason import ReasonRecord
    from femtune.steps.results import Results

_MOST_REASONS = 4
"""Reasons in the line of the verdict, which must fit a few lines of a terminal; the others are counted."""

_NOTHING_FOUND = "no check failed, and nothing was left out"


def judgement(results: Results, facts: Mapping[str, Any], not_computed: Sequence[str] = ()) -> JudgementResults:
    """The verdict on a run.

    Parameters
    ----------
    results : all records of the run
    facts : records of the topics, by field of the judgement
    not_computed : topics that could not be judged, with the reason
    """
    so_far = JudgementResults(verdict="accepted", line="", not_computed=tuple(not_computed), **facts)
    results = results.model_copy(update={"judgement": so_far})
    reasons = (r for topic in TOPICS for r in topic(results))
    return _with_reasons(so_far, [_placed(r, results.study.configurations) for r in reasons])


def judgement_of_comparisons(
    correlations: Sequence[CorrelationResults], modes: Sequence[ModelModes], acceptance: AcceptanceResults
) -> JudgementResults:
    """The verdict on a comparison without an update: what was compared, the criteria, and what the
    comparison found."""
    all_reasons = [
        *reasons_of_comparisons(correlations, modes, acceptance),
        *reasons_of_criteria(correlations, acceptance),
        *reasons_of_alerts([a for c in correlations for a in c.alerts if a.code.startswith("correlate.")]),
    ]
    reasons = [_placed(r, [c.configuration for c in correlations]) for r in all_reasons]
    return _with_reasons(JudgementResults(verdict="accepted", line="", acceptance=acceptance), reasons)


def _placed(r: ReasonRecord, configurations: Sequence[str]) -> ReasonRecord:
    """Without the name of the only configuration of a study."""
    return r.model_copy(update={"place": ""}) if (r.place,) == tuple(configurations) else r


def _with_reasons(found: JudgementResults, reasons: Sequence[ReasonRecord]) -> JudgementResults:
    ordered = tuple(sorted(dict.fromkeys(reasons), key=lambda r: r.weight != "not accepted"))
    verdict = verdict_of(ordered)
    return found.model_copy(update={"verdict": verdict, "line": line_of(verdict, ordered), "reasons": ordered})


def verdict_of(reasons: Sequence[ReasonRecord]) -> VerdictOfRun:
    """Not accepted for one reason of that weight, accepted with reservations for any other.

    Examples
    --------
    >>> from femtune.steps.judge.verdict import verdict_of
    >>> verdict_of([])
    'accepted'
    """
    if any(r.weight == "not accepted" for r in reasons):
        return "not accepted"
    return "accepted with reservations" if reasons else "accepted"


def line_of(verdict: VerdictOfRun, reasons: Sequence[ReasonRecord]) -> str:
    """The verdict in a sentence, with the first reasons of its weight."""
    named = [r for r in reasons if verdict != "not accepted" or r.weight == "not accepted"]
    more = len(named) - _MOST_REASONS
    tail = [f"{more} more {'reason' if more == 1 else 'reasons'}"] if more > 0 else []
    said = "; ".join([*(r.brief or r.sentence for r in named[:_MOST_REASONS]), *tail])
    return f"{verdict[0].upper()}{verdict[1:]}: {said or _NOTHING_FOUND}."
