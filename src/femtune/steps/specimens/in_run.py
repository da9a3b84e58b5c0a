"""The comparison of specimens in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.run.outcomes import Final, Initial, Made, Outcomes, Updated
from femtune.steps.specimens.facts import Compared, specimen_results
from femtune.steps.specimens.record import SpecimenResults
from femtune.steps.specimens.run import calibrate_each

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def compare_specimens(run: Run, outcomes: Outcomes, made: Made) -> SpecimenResults | None:
    """The specimens, calibrated jointly and separately; None without specimens."""
    parameters = outcomes.of(Updated).parameters
    before, after = outcomes.of(Initial).records, outcomes.of(Final).records
    separate = calibrate_each(parameters.study or run.study, parameters, run.progress)
    compared = Compared(before.correlations, after.correlations, before.modes, after.modes)
    return specimen_results(run.study, parameters.result, separate, compared)
