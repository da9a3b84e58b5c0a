"""The bootstrap in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.bootstrap.record import BootstrapResults
from femtune.steps.bootstrap.run import bootstrap_at
from femtune.steps.run.outcomes import Made, Outcomes, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def bootstrap_after(run: Run, outcomes: Outcomes, made: Made) -> BootstrapResults | None:
    """The bootstrap; None if the study asks for none."""
    if run.study.file.bootstrap is None:
        return None
    updated = outcomes.of(Updated)
    study, parameters = updated.study(run.study), updated.parameters
    return bootstrap_at(study, parameters.result, run.folder, made.arrays, run.progress, parameters.search)
