"""The variability of the parameters in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.quantify.record import QuantifyResults
from femtune.steps.quantify.run import quantify_at
from femtune.steps.run.outcomes import Made, Outcomes, Prepared, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def quantify_after(run: Run, outcomes: Outcomes, made: Made) -> QuantifyResults | None:
    """The variability of the parameters; None without repeated tests."""
    repeats, updated = outcomes.of(Prepared).repeats, outcomes.of(Updated)
    if repeats is None:
        return None
    study, x = updated.study(run.study), updated.parameters.result.x
    return quantify_at(study, repeats, x, made.arrays, run.progress, run.folder)
