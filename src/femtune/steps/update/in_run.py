"""The update in `femtune run`, and what is found beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.run.outcomes import Initial, Made, ModesLeftOut, Outcomes, TruncationErrors, Updated
from femtune.steps.select.fisher import fisher_results
from femtune.steps.update.facts.iterations import iteration_frfs
from femtune.steps.update.facts.left_out import left_out_mode_records
from femtune.steps.update.facts.truncation import frf_truncations
from femtune.steps.update.run import find_parameters

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def update(run: Run, outcomes: Outcomes, made: Made) -> Updated:
    """The update, the information of the FRFs at its end, and the compared FRFs at each iteration."""
    parameters = find_parameters(run.study, run.folder, outcomes.of(Initial).at, run.progress)
    study, result = parameters.study or run.study, parameters.result
    fisher = fisher_results(study, result.after, "after", parameters.known, result.active)
    units = study.file.study.unit_system if study.units_known else None
    identified = {c.name: c.test for c in study.cases if c.test is not None} if study.file.equalise is None else {}
    return Updated(parameters, fisher, iteration_frfs(result.history, units, made.arrays, identified))


def truncation(run: Run, outcomes: Outcomes, made: Made) -> TruncationErrors:
    """At the start as the update saw it; the end may be that of other cases, if it was reached in stages."""
    before = frf_truncations(outcomes.of(Initial).at, "before", run.progress)
    return TruncationErrors((*before, *frf_truncations(outcomes.of(Updated).at, "after", run.progress)))


def left_out_modes(run: Run, outcomes: Outcomes, made: Made) -> ModesLeftOut:
    """Modes of the model that FRFs are compared without."""
    return ModesLeftOut(left_out_mode_records(outcomes.of(Initial).at, outcomes.of(Updated).at))
