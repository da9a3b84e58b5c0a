"""The update of a study on reduced models, where it asks for them."""

from __future__ import annotations

from collections.abc import Callable

from femtune.files.study_file.steps import ReductionTable
from femtune.model.reduce import Trained
from femtune.residuals import Evaluation
from femtune.study.load import Study
from femtune.study.progress import Progress
from femtune.study.results_reduction import ReducedModelResults, ReductionResults
from femtune.update import Iteration, ReducedUpdate, ReductionRules, SensitivityMethod, UpdateResult, update_reduced


def find_on_reduced(
    study: Study,
    table: ReductionTable,
    method: SensitivityMethod,
    report: Callable[[Iteration], None],
    at: Evaluation,
    progress: Progress,
) -> tuple[UpdateResult, ReductionResults]:
    """The parameters, and how the reduced models did."""
    rules = ReductionRules(table.tolerance, table.full_solutions, table.order)

    def told(name: str, trained: Trained) -> None:
        text = f"training the reduced model of {name}: order {trained.model.order}"
        progress.step(text, len(trained.certified), table.full_solutions)

    found = update_reduced(study.problem(), method, rules, report, at, told)
    return found.result, _results(found, rules)


def _results(found: ReducedUpdate, rules: ReductionRules) -> ReductionResults:
    models = tuple(
        ReducedModelResults(
            configuration=c.configuration,
            order=c.order,
            full_solutions=c.full_solutions,
            estimate_percent=100.0 * c.estimate,
            certified_error_percent=100.0 * c.certified_error,
            training=c.status.value,
        )
        for c in found.cases
    )
    return ReductionResults(
        tolerance_percent=100.0 * rules.tolerance, certified=found.certified, models=models, rounds=found.rounds
    )
