"""Nominally identical specimens compared; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    ReportSection,
    Step,
)

STEP = Step(
    "specimens",
    sections=(
        ReportSection(
            "specimens",
            "Specimens",
            "specimens.page:specimens",
            intro=(
                "Nominally identical structures that were measured alike. Each has its own value of an "
                "individual parameter; the joint calibration uses all tests at once, a separate one only "
                "those of the specimen."
            ),
            optional=True,
            place=120,
        ),
    ),
)
