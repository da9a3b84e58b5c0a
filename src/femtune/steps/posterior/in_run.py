"""The posterior distribution in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.posterior.record import PosteriorResults
from femtune.steps.posterior.run import posterior_at
from femtune.steps.run.outcomes import Made, Outcomes, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def posterior_after(run: Run, outcomes: Outcomes, made: Made) -> PosteriorResults | None:
    """The samples; None if the study asks for none."""
    if run.study.file.posterior is None:
        return None
    updated = outcomes.of(Updated)
    return posterior_at(updated.study(run.study), updated.parameters, run.folder, made.arrays, run.progress)
