"""Reasons from the updated parameters: beyond the usual range, or changed although the data do not determine them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.numbers import listed, short
from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.results import Results

_UNDETERMINED = 0.98
"""Standard deviation after the update over that of the prior, from which the data say nothing of a parameter."""
_CHANGED = 0.5
"""Change in standard deviations of the prior from which a parameter counts as changed: with the ratio above, data and
prior that agree change it by √(1 − 0.98²) = 0.2."""


def parameter_reasons(results: Results) -> Iterable[ReasonRecord]:
    """Parameters at a bound have an alert."""
    usual = results.judgement and results.judgement.usual_ranges
    if usual and usual.beyond:
        said = [f"{p.parameter} ({short(p.factor)}; {short(p.lower)} to {short(p.upper)})" for p in usual.beyond]
        yield reason("reservation", "judge.beyond-usual", parameters=listed(said))
    changed = list(_undetermined_and_changed(results))
    if changed:
        code = "judge.undetermined-changed" if len(changed) > 1 else "judge.undetermined-changed/one"
        yield reason("reservation", code, parameters=listed(changed))


def _undetermined_and_changed(results: Results) -> Iterable[str]:
    if results.update is None:
        return
    facts = {p.name: p for p in results.parameters}
    for parameter in results.update.parameters:
        fact = facts.get(parameter.name)
        prior = fact and fact.prior_sd
        if fact is None or not prior or parameter.sd is None:
            continue
        if parameter.sd >= _UNDETERMINED * prior and abs(parameter.value - fact.nominal) >= _CHANGED * prior:
            yield parameter.name
