"""The updated deck; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    InRun,
    ReportSection,
    Step,
)

STEP = Step(
    "write",
    tables=("write",),
    in_run=(
        InRun("write back", "write.in_run:write_deck", 170, with_deck=True),
        InRun("compare the deck as written", "write.in_run:verify", 190, with_deck=True),
    ),
    sections=(ReportSection("write_back", "Changes in the deck", "write.page:write_back", optional=True, place=180),),
)
