"""What the step `vibration` is."""

from __future__ import annotations

from femtune.steps.step import (
    Step,
)

STEP = Step(
    "vibration",
)
