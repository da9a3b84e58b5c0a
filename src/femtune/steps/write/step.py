"""What the step `write` is."""

from __future__ import annotations

from femtune.steps.step import (
    Section,
    Step,
)

STEP = Step(
    "write", sections=(Section("write_back", "Changes in the deck", "write.page:write_back", optional=True, place=180),)
)
