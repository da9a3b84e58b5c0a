"""Measured damping in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.equalise.run import mapped_damping
from femtune.steps.run.outcomes import Damped, Initial, Made, Outcomes, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def map_damping(run: Run, outcomes: Outcomes, made: Made) -> Damped:
    """Measured damping on the modes of the updated model."""
    return Damped(mapped_damping(outcomes.of(Initial).at, outcomes.of(Updated).at, made.arrays))
