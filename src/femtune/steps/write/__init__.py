"""The updated deck; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    ReportSection,
    Step,
)

STEP = Step(
    "write",
    tables=("write",),
    sections=(ReportSection("write_back", "Changes in the deck", "write.page:write_back", optional=True, place=180),),
)
