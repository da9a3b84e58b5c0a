"""The comparisons with the test in `femtune run`, at three versions of the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.journal.run_files import EXPANDED_FILE, numbered
from femtune.steps.correlate.expanded_files import write_expanded_files
from femtune.steps.correlate.versions import as_written, model_records, start
from femtune.steps.run.outcomes import AsWritten, Final, Initial, Made, Outcomes, Updated, Written
from femtune.steps.validate.facts import Sensitivities
from femtune.study.solved import solutions_of

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def correlate_before(run: Run, outcomes: Outcomes, made: Made) -> Initial:
    """The model at the initial values beside the tests."""
    at = start(run.study, run.progress)
    return Initial(at, model_records(run.study, "before", at.x, solutions_of(at), made.arrays, run.progress))


def correlate_after(run: Run, outcomes: Outcomes, made: Made) -> Final:
    """The model at the end of the update beside the tests."""
    updated, sensitivities = outcomes.of(Updated), Sensitivities()
    study, at = updated.study(run.study), updated.at
    records = model_records(study, "after", at.x, solutions_of(at), made.arrays, run.progress, sensitivities.add)
    return Final(records, sensitivities)


def correlate_as_written(run: Run, outcomes: Outcomes, made: Made) -> AsWritten:
    """The written deck beside the tests."""
    study = outcomes.of(Written).study
    at = as_written(study, outcomes.of(Updated).at)
    records = model_records(study, "after as written", at.x, solutions_of(at), made.arrays, run.progress)
    return AsWritten(records, at.mean_error)


def write_expanded(run: Run, outcomes: Outcomes, made: Made) -> None:
    """The test shapes expanded to the model at its last version."""
    study = outcomes.of(Updated).study(run.study)
    records = (outcomes.find(AsWritten) or outcomes.of(Final)).records
    paths = numbered(run.folder / EXPANDED_FILE, len(study.cases))
    made.add_files(write_expanded_files(study, records.correlations, outcomes.arrays, paths))
