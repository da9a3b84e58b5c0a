"""Measured damping on the modes of the updated model; a part of a run."""

from __future__ import annotations

from femtune.steps.step import (
    InRun,
    ReportSection,
    Step,
)

STEP = Step(
    "equalise",
    tables=("equalise",),
    in_run=(
        InRun(
            "measured damping",
            "equalise.in_run:map_damping",
            110,
            optional="measured damping on the modes of the updated model",
        ),
    ),
    sections=(
        ReportSection(
            "measured_damping",
            "Measured damping",
            "equalise.page:measured_damping",
            intro=(
                "The update compared test and model with one damping ratio. Afterwards each paired mode of "
                "the model has the measured damping ratio, so that its FRFs can be compared with the measured "
                "ones."
            ),
            optional=True,
            place=140,
        ),
    ),
)
