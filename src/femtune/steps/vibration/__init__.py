"""Sweeps and random vibration tests compared with the model; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    Step,
)

STEP = Step(
    "vibration",
    tables=("vibration",),
)
