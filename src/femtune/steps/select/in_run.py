"""The selection in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.run.outcomes import Initial, Made, Outcomes
from femtune.steps.select.record.identifiability import SelectionResults
from femtune.steps.select.run import select_at

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def select_before(run: Run, outcomes: Outcomes, made: Made) -> SelectionResults:
    """What the data determine at the initial values."""
    return select_at(run.study, outcomes.of(Initial).at, made.arrays, run.progress)
