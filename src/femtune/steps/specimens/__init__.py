"""Nominally identical specimens compared; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    InRun,
    ReportSection,
    Step,
)

STEP = Step(
    "specimens",
    in_run=(InRun("specimens", "specimens.in_run:compare_specimens", 140, optional="comparison of the specimens"),),
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
