"""Vibration tests in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.run.outcomes import Initial, Made, Outcomes, Prepared, Updated, Vibrated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def compare_vibrations(run: Run, outcomes: Outcomes, made: Made) -> Vibrated:
    """Vibration tests beside the model before and after the update."""
    before, after = outcomes.of(Initial).at.x, outcomes.of(Updated).parameters.result.x
    return Vibrated(outcomes.of(Prepared).vibration_tests.beside(run.study, before, after, made.arrays))
