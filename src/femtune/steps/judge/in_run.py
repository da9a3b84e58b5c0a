"""The verdict in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.judge.finished_update import FinishedUpdate
from femtune.steps.judge.run import JudgedTopics, judged_topics
from femtune.steps.run.outcomes import Initial, Made, Outcomes, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def judge(run: Run, outcomes: Outcomes, made: Made) -> JudgedTopics:
    """The topics of the verdict."""
    updated = outcomes.of(Updated)
    study, result, results = updated.study(run.study), updated.parameters.result, run.results(outcomes)
    made.arrays.update(outcomes.arrays)
    initial, search = outcomes.of(Initial).at, updated.parameters.search
    return judged_topics(FinishedUpdate(study, initial, result, results, made.arrays, run.progress, search))
