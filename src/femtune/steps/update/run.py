"""The update of the free parameters as the study asks: at once, in stages, from many starts, on reduced models."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.steps.info.facts import alert_of
from femtune.steps.select.fisher import known_of_frfs
from femtune.steps.update.on_reduced_model import TrainingProgress, find_on_reduced
from femtune.steps.update.raw import RawUpdate, then_raw
from femtune.steps.update.starts import History, find_from_starts
from femtune.study.error_places import errors_at
from femtune.study.stages import bottom_up
from femtune.study.update_method import method_of
from femtune.updating import look_further, update, with_noise

if TYPE_CHECKING:
    from femtune.residuals import Evaluation
    from femtune.selection.expected import ExpectedKnowledge
    from femtune.steps.update.record.reduction import ReductionResults
    from femtune.study.progress import Progress
    from femtune.study.record import Alert
    from femtune.study.study import Study
    from femtune.updating import Iteration, MultiStart, ReducedSearch, StageResult, UpdateResult


@dataclass(frozen=True, eq=False)
class FoundParameters:
    """The update as a whole, and what is known of its parts.

    Parameters
    ----------
    result : from the initial values to the end
    reduction : how the reduced models did, where the study asks for them
    starts : the starts, where the study asks for several
    stages : the stages of a bottom-up study
    study : the study on the model at the result, where the model has moved
    alerts : what is said of the runs of an external solver
    search : the reduced models at the end, from which another update may go on
    known : information of the FRFs on the parameters at the result; None without FRFs
    raw : the update with measured FRFs after one with equal damping, where there is one
    """

    result: UpdateResult
    reduction: ReductionResults | None = None
    starts: MultiStart | None = None
    stages: tuple[StageResult, ...] = ()
    study: Study | None = None
    alerts: tuple[Alert, ...] = ()
    search: ReducedSearch | None = None
    known: ExpectedKnowledge | None = None
    raw: RawUpdate | None = None


def find_parameters(study: Study, folder: Path, at: Evaluation, progress: Progress) -> FoundParameters:
    """Find the free parameters from an evaluation at the initial values; the history of iterations goes into `folder`.

    Where FRFs of an identified test are compared, whose errors all lines share, the covariance is that of its noise.

    Raises
    ------
    FemtuneError : ``run.unwritable``, ``study.stage``, and what the update method raises
    """
    outcome = _found(study, folder, at, progress)
    result, known = with_noise_of_tests(outcome.study or study, outcome.result)
    outcome = replace(outcome, result=result, known=known)
    return _with_raw(study, outcome, folder, progress)


def _with_raw(study: Study, found: FoundParameters, folder: Path, progress: Progress) -> FoundParameters:
    """With the update by the measured FRFs, where an identified test with equal damping was compared."""
    history, method = History(folder, study.parameters), method_of(study.file.update, study.parameters)

    def tell(iteration: Iteration) -> None:
        history.add(iteration)
        progress.step("measured FRFs", iteration.number, None)

    raw, told = then_raw(study, found.result, method, tell, found.search)
    if raw is None:
        return replace(found, alerts=(*found.alerts, *map(alert_of, told)))
    result, known = with_noise_of_tests(raw.study, raw.result)
    return replace(
        found, result=result, known=known, study=raw.study, search=raw.search or found.search, raw=raw,
        alerts=(*found.alerts, *map(alert_of, told)),
    )  # fmt: skip


def with_noise_of_tests(study: Study, result: UpdateResult) -> tuple[UpdateResult, ExpectedKnowledge | None]:
    """A result with the noise covariance of its identified tests, and the information of the FRFs on the parameters."""
    known = known_of_frfs(study, result.after, "after", result.active)
    # stages have a covariance of their own
    if known is None or known.noise is None or study.file.stage:
        return result, known
    return with_noise(result, known.noise), known


def _found(study: Study, folder: Path, at: Evaluation, progress: Progress) -> FoundParameters:
    """The same, with the covariance of independent errors.

    Raises
    ------
    FemtuneError : ``run.unwritable``, ``study.stage``, and what the update method raises
    """
    table, reduction = study.file.update, study.file.reduction
    with errors_at(study.file.where("update", "regularisation")):
        method = method_of(table, study.parameters)
    history = History(folder, study.parameters)
    history.begin()

    def tell(iteration: Iteration, where: str = "update", most: int | None = table.max_iterations) -> None:
        # kept before it is shown: whoever shows it may be interrupted
        history.add(iteration)
        progress.step(f"{where}: weighted mean error {100 * iteration.mean_error:.4g} %", iteration.number, most)

    def tell_of_stage(stage: str, seed: int, iteration: Iteration) -> None:
        tell(iteration, f"stage {stage}, seed {seed}" if seed else f"stage {stage}", None)

    if study.source.needs_runs:
        # few studies have a solver
        from femtune.steps.update.external import find_on_solver, opened_solver  # noqa: PLC0415
        from femtune.study.external import write_updated  # noqa: PLC0415

        with opened_solver(study, progress) as runs:
            assert runs is not None
            moved = find_on_solver(study, runs, method, tell, at)
            write_updated(runs, moved.result.values)
        return FoundParameters(moved.result, study=moved.study, alerts=moved.alerts)
    if study.file.stage:
        told = TrainingProgress(progress, 0 if reduction is None else reduction.full_solutions)
        result, stages = bottom_up(study, at, tell_of_stage, told)
        return FoundParameters(result, stages=stages)
    if table.starts > 1:
        starts, facts, search = find_from_starts(study, method, folder, at, progress)
        for iteration in starts.best.history:
            history.add(iteration)
        return FoundParameters(starts.best, facts, starts, search=search)
    if reduction is not None:
        result, facts, search = find_on_reduced(study, method, tell, at, progress)
        return FoundParameters(result, facts, search=search)
    problem = study.problem()
    result = update(problem, method, tell, at)
    return FoundParameters(look_further(problem, method, result, report=tell) if table.look_further else result)
