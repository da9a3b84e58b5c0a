"""The topics of the verdict computed at the end of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError
from femtune.steps.judge.facts import FACTS

if TYPE_CHECKING:
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.study.record import Record


@dataclass(frozen=True)
class JudgedTopics:
    """Records of the topics by field of the judgement, and the topics whose computation failed, with the reason."""

    records: dict[str, Record]
    not_computed: tuple[str, ...] = ()


def judged_topics(fit: FinishedUpdate) -> JudgedTopics:
    """The records of all topics; a topic that fails does not end the run, but is a reservation of the verdict."""
    records, failed = dict[str, "Record"](), list[str]()
    for topic, make in FACTS.items():
        try:
            record = make(fit)
        except FemtuneError as problem:
            failed.append(f"{topic.replace('_', ' ')}: {problem.what}")
        else:
            if record is not None:
                records[topic] = record
    return JudgedTopics(records, tuple(failed))
