"""The live model of the report; a part of a run."""

from __future__ import annotations

from femtune.steps.step import InRun, ReportSection, Step

STEP = Step(
    "live",
    in_run=(InRun("live model", "live.in_run:make_live", 166, optional="live model of the report"),),
    sections=(
        ReportSection(
            "live", "Live model", "live.page:live",
            intro=(
                "A model small enough for this page: change the parameters, and frequencies, MAC and shapes follow. It "
                "needs a browser with scripts."
            ), optional=True, place=95,
        ),
    ),
)  # fmt: skip
