"""The live model in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.live.record import LiveResults
from femtune.steps.live.run import live_results
from femtune.steps.run.outcomes import Made, Outcomes, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def make_live(run: Run, outcomes: Outcomes, made: Made) -> LiveResults | None:
    """The live model at the end of the update; None where the study wants none."""
    updated = outcomes.of(Updated)
    return live_results(updated.study(run.study), updated.parameters, made.arrays, run.progress)
