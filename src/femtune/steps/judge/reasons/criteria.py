"""Reasons from acceptance criteria: of all pairs, and of data that the update did not use."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.document.numbers import listed, short, with_unit
from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.judge.record.acceptance import AcceptanceResults
    from femtune.steps.results import Results
    from femtune.study.record import VerdictWord

OWN = "own criterion"
"""Standard of the limits that the study itself sets."""
PRACTICE = "common practice"
"""Standard of the criteria that judge the test itself; they are binding if a standard is chosen."""
_OTHER_TESTS = ("another test", "same test")
"""Kinds of held-out data of a configuration in the state of the update."""
_MOST_PLACES = 3
"""Configurations that are named; more are counted."""
_INDEPENDENT = ("modified structure", "other boundary conditions", "vibration test")
"""Kinds of held-out data that an update to one test says little of: another state of the structure, another load."""


@dataclass(frozen=True)
class _Judged:
    """A criterion in one configuration; `data` are "" for the pairs of the update."""

    quantity: str
    standard: str
    configuration: str
    data: str
    at_most: bool
    limit: float
    measured: float | None
    unit: str
    verdict: VerdictWord
    remark: str

    @property
    def beyond(self) -> bool:
        """True if the value fails; False if modes without a partner alone do, which `compared_reasons` reports."""
        if self.measured is None:
            return True
        return self.measured > self.limit if self.at_most else self.measured < self.limit

    @property
    def required(self) -> str:
        """What is required, in words."""
        return f"{'at most' if self.at_most else 'at least'} {with_unit(short(self.limit), self.unit)}"

    @property
    def looseness(self) -> float:
        """Rises from strict limits to loose ones."""
        return self.limit if self.at_most else -self.limit


def criteria_reasons(results: Results) -> Iterable[ReasonRecord]:
    """Criteria on all pairs, in the configurations that the update uses, and on data that it did not use."""
    acceptance = results.judgement and results.judgement.acceptance
    if not acceptance:
        return
    stages = [c.stage for c in results.correlations]
    validation = results.validation
    verdicts = validation.verdicts if validation else ()
    whole = (*_INDEPENDENT, *_OTHER_TESTS)
    unused = {v.configuration for v in verdicts if any(v.data.startswith(word) for word in whole)}
    last = [c for c in results.correlations if c.stage == stages[-1] and c.configuration not in unused]
    yield from reasons_of_criteria(last, acceptance)
    judged = [
        _Judged(
            v.criterion.removesuffix(f", {v.standard}"), v.standard, v.configuration, v.data, v.sense == "at most",
            v.required, v.measured, v.unit, v.verdict, v.remark,
        )
        for v in verdicts
    ]  # fmt: skip
    yield from _failed(judged, acceptance, "judge.held-out-fails")
    tested = {v.data for v in verdicts if v.verdict != "not tested"}
    deviations = validation.deviations if validation else None
    if not tested and deviations is not None and any(one.data == "validation" for one in deviations.channels):
        yield reason("reservation", "judge.nothing-held-out/no-criterion")
    elif not tested:
        yield reason("reservation", "judge.nothing-held-out")
    elif not any(word in data for data in tested for word in _INDEPENDENT):
        yield reason("reservation", "judge.not-independent", data=listed(sorted(tested)))


def reasons_of_criteria(
    correlations: Sequence[CorrelationResults], acceptance: AcceptanceResults
) -> Iterable[ReasonRecord]:
    """Criteria that failed or were not tested, and that no standard was chosen."""
    judged = [
        _Judged(
            one.name.removesuffix(f", {one.standard}"), one.standard, c.configuration, "", one.sense == "at most",
            one.limit, one.measured, one.unit, one.verdict, one.remark,
        )
        for c in correlations
        for one in c.criteria
    ]  # fmt: skip
    of_values = [one for one in judged if one.verdict != "fail" or one.beyond]
    yield from _failed(of_values, acceptance, "judge.criterion-fails")
    if not acceptance.chosen:
        yield reason("reservation", "judge.no-standard")
        judged = [j for j in judged if j.standard == OWN]
    untested = {(j.quantity, j.standard): j for j in judged if j.verdict == "not tested"}
    for j in untested.values():
        yield reason(
            "reservation", "judge.criterion-not-tested", j.configuration, quantity=j.quantity, standard=j.standard,
            why=j.remark,
        )  # fmt: skip


def _failed(judged: Sequence[_Judged], acceptance: AcceptanceResults, code: str) -> Iterable[ReasonRecord]:
    """A reason for each quantity and kind of data, with the worst value and the loosest limit that it fails.

    Without a chosen standard a quantity weighs as not accepted if it fails the limits of all standards.
    """
    groups: dict[tuple[str, str], list[_Judged]] = {}
    for one in judged:
        groups.setdefault((one.quantity, one.data), []).append(one)
    for (quantity, data), group in groups.items():
        failed = [one for one in group if one.verdict == "fail"]
        if not failed:
            continue
        standards, broken = ({one.standard for one in some} - {PRACTICE} for some in (group, failed))
        binding = acceptance.chosen or OWN in broken or (bool(broken) and broken == standards)
        worst = max(failed, key=lambda f: (f.looseness, f.measured is None, _badness(f)))
        places = list(dict.fromkeys(f.configuration for f in failed))
        yield reason(
            "not accepted" if binding else "reservation", code,
            ", ".join(places) if len(places) <= _MOST_PLACES else f"{len(places)} configurations",
            quantity=quantity, measured=_number(worst), required=worst.required, data=data,
            standard=listed(dict.fromkeys(f.standard for f in failed if f.limit == worst.limit)),
            remark=f" ({worst.remark})" if worst.remark else "",
        )  # fmt: skip


def _badness(one: _Judged) -> float:
    return 0.0 if one.measured is None else one.measured if one.at_most else -one.measured


def _number(one: _Judged) -> str:
    return "not defined" if one.measured is None else with_unit(short(one.measured), one.unit)
