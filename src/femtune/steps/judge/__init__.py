"""The verdict on a run: accepted, accepted with reservations, or not accepted; a part of a run.

Each topic has a module of the same name in `facts` (numerical results -> record), `reasons` (results -> reasons) and
`page` (record -> blocks), where it needs them. `verdict` puts the reasons together.
"""

from __future__ import annotations

from femtune.steps.step import InRun, ReportSection, Step

STEP = Step(
    "judge",
    in_run=(InRun("judge", "judge.in_run:judge", 220),),
    sections=(
        ReportSection(
            "judgement",
            "Reasons for the verdict",
            "judge.page:judgement",
            intro=(
                "A run is not accepted if one of the reasons is serious enough; all others are reservations. "
                "It is accepted without reservations only if nothing was left out or failed."
            ),
            optional=True,
            place=15,
        ),
    ),
)
