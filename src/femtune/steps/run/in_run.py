"""The parts of `femtune run` that belong to no other step: what is known before, and checks of later parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.bootstrap.run import check_bootstrap
from femtune.steps.info.facts import model_facts, sensor_results
from femtune.steps.judge.same_data import check_independent
from femtune.steps.posterior.run import check_posterior
from femtune.steps.quantify.run import check_quantify, repeats_of
from femtune.steps.results import Results
from femtune.steps.run.outcomes import Initial, Made, Outcomes, Prepared
from femtune.steps.update.facts.update import parameter_facts, what_ran
from femtune.steps.validate.frf_validation import check_frf_band
from femtune.steps.vibration.run import VibrationTests
from femtune.steps.write.run import check_writable_fields
from femtune.study.provenance import provenance, study_facts
from femtune.study.solved import solutions_of

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def prepare(run: Run, outcomes: Outcomes, made: Made) -> Prepared:
    """Before anything is solved; what later steps read and write is checked, so that errors are reported at once."""
    study = run.study
    repeats, vibration_tests = repeats_of(study), VibrationTests.of(study)
    check_frf_band(study)
    check_independent(study)
    if study.file.posterior is not None:
        check_posterior(study)
    if study.writes_deck:
        check_writable_fields(study, run.wide)
    run.progress.step("mass and rigid-body check", 0, None)
    facts = Results(
        provenance=provenance(run.inputs, run.watch),
        study=study_facts(study),
        model=model_facts(study),
        sensors=tuple(s for s in (sensor_results(study, c) for c in study.cases) if s is not None),
        parameters=parameter_facts(study),
        citations=what_ran(study),
    )
    return Prepared(facts, repeats, vibration_tests)


def check_later_parts(run: Run, outcomes: Outcomes, made: Made) -> None:
    """What the steps after the update require of the model and the data, at the initial values."""
    study, at, prepared = run.study, outcomes.of(Initial).at, outcomes.of(Prepared)
    prepared.vibration_tests.check(study, at.x, solutions_of(at))
    if study.file.bootstrap is not None:
        check_bootstrap(study, at)
    if prepared.repeats is not None:
        check_quantify(study, prepared.repeats, at.x)
