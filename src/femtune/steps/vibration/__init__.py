"""Sweeps and random vibration tests compared with the model; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    InRun,
    Step,
)

STEP = Step(
    "vibration",
    tables=("vibration",),
    in_run=(InRun("vibration tests", "vibration.in_run:compare_vibrations", 130),),
)
