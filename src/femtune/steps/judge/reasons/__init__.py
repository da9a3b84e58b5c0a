"""Reasons for the verdict, by topic: each is made from the results so far."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from femtune.steps.judge.reasons.accuracy import accuracy_reasons
from femtune.steps.judge.reasons.alerts import alert_reasons
from femtune.steps.judge.reasons.compared import compared_reasons
from femtune.steps.judge.reasons.computed import computed_reasons
from femtune.steps.judge.reasons.criteria import criteria_reasons
from femtune.steps.judge.reasons.linearity import linearity_reasons
from femtune.steps.judge.reasons.minimum import minimum_reasons
from femtune.steps.judge.reasons.missing import missing_reasons
from femtune.steps.judge.reasons.parameters import parameter_reasons
from femtune.steps.judge.reasons.parts import parts_reasons
from femtune.steps.judge.reasons.update import update_reasons

if TYPE_CHECKING:
    from femtune.steps.judge.record.reason import ReasonRecord
    from femtune.steps.results import Results

TOPICS: tuple[Callable[[Results], Iterable[ReasonRecord]], ...] = (
    update_reasons,
    minimum_reasons,
    linearity_reasons,
    missing_reasons,
    parts_reasons,
    computed_reasons,
    compared_reasons,
    criteria_reasons,
    alert_reasons,
    accuracy_reasons,
    parameter_reasons,
)
"""In the order of their importance: within one weight the verdict names the first reasons first.

`results.judgement` has the records of `FACTS`; its verdict, line and reasons are not final yet.
"""
