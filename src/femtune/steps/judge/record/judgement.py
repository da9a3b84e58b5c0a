"""The verdict on a run."""

from __future__ import annotations

from typing import Literal

from femtune.steps.judge.record.acceptance import AcceptanceResults
from femtune.steps.judge.record.coverage import CoverageResults
from femtune.steps.judge.record.linearity import ValleyResults
from femtune.steps.judge.record.missing import MissingResults
from femtune.steps.judge.record.parts import PartsResults
from femtune.steps.judge.record.reason import ReasonRecord
from femtune.steps.judge.record.scatter import FrequencyScatter
from femtune.steps.judge.record.usual import UsualRanges
from femtune.study.record import Record

VerdictOfRun = Literal["accepted", "accepted with reservations", "not accepted"]


class JudgementResults(Record):
    """The verdict on a run, with its reasons; the records of its topics, each None if it does not apply."""

    verdict: VerdictOfRun
    """"accepted", "accepted with reservations" or "not accepted"."""
    line: str
    """The verdict with its most important reasons, in one sentence."""
    reasons: tuple[ReasonRecord, ...] = ()
    """All reasons, those not to accept the run first."""
    acceptance: AcceptanceResults | None = None
    """What the study asks of an accepted model; None in older results."""
    scatter: FrequencyScatter | None = None
    """Frequency errors beside the repeatability of the test; None if that is not known."""
    usual_ranges: UsualRanges | None = None
    """Parameters beyond their usual range; None if no parameter has one."""
    linearity: ValleyResults | None = None
    """Whether χ² is a parabola over the distribution of the parameters; None in older results."""
    missing: MissingResults | None = None
    """Fields of the deck that no parameter represents and that the residuals ask for; None in older results."""
    not_computed: tuple[str, ...] = ()
    """Topics that could not be judged because their computation failed, with the reason."""
    parts: PartsResults | None = None
    """The residuals in parts, the shapes beside their neighbours, and the errors by kind."""
    coverage: CoverageResults | None = None
    """The end of the update in the runs of its model; None for other models."""
