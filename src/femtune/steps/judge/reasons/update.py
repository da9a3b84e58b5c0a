"""Reasons from the end of the update."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.results import Results


def update_reasons(results: Results) -> Iterable[ReasonRecord]:
    """The update or one of its stages did not reach an optimum."""
    update = results.update
    if update is None:
        return
    if not update.ok:
        yield reason("not accepted", "judge.no-optimum", ending=update.message)
    for stage in update.stages:
        if not stage.ok:
            yield reason(
                "not accepted", "judge.no-optimum/in-stage", stage.name, stage=stage.name, ending=stage.message
            )
    judged = results.judgement
    for failed in judged.not_computed if judged else ():
        yield reason("reservation", "judge.not-computed", failure=failed)
