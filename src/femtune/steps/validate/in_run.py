"""FRFs that the update did not use, in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.run.outcomes import Damped, Initial, Made, Outcomes, Unused, Updated
from femtune.steps.validate.frf_deviation import MeasuredBeside, frf_deviations
from femtune.steps.validate.frf_validation import unused_frfs

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def compare_unused_frfs(run: Run, outcomes: Outcomes, made: Made) -> Unused:
    """Beside the model at both ends; before the update only for their deviation."""
    initial, updated = outcomes.of(Initial), outcomes.of(Updated)
    after = unused_frfs(run.study, updated.parameters.result.x, made.arrays, run.progress)
    some = any(one.found is not None for one in after)
    before = unused_frfs(run.study, initial.at.x, {}, run.progress) if some else ()
    damped, equalise = outcomes.find(Damped), run.study.file.equalise
    beside = MeasuredBeside()
    if damped is not None and equalise is not None:
        beside = MeasuredBeside(damped.records, outcomes.arrays, equalise.not_compared_hz)
    return Unused(after, frf_deviations(initial.at, updated.at, before, after, beside))
