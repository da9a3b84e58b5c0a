"""The step posterior: a sampled distribution of the parameters about the result of the update."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import FemtuneError
from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import POSTERIOR_FILE
from femtune.model import digest
from femtune.model.full_model import direct
from femtune.sampling import (
    Known,
    Likelihood,
    PosteriorSamples,
    SamplingRules,
    Shift,
    SolvedSample,
    Solving,
    far_from,
)
from femtune.steps.posterior.centre import about_most_probable
from femtune.steps.posterior.facts import OutsideOptimum, SampledFacts, posterior_results
from femtune.steps.posterior.further import further_tests
from femtune.steps.posterior.kept import KeptSolutions, as_text, from_text
from femtune.steps.posterior.model_errors import none_of, unknown_changes
from femtune.steps.posterior.predictions import Predicting
from femtune.steps.posterior.problem import at_result, likelihood_of, sampler_of, solving_of, without_likelihood
from femtune.study.error_places import errors_at
from femtune.study.executor import executor_of
from femtune.study.study import solved_by
from femtune.study.update_method import method_of
from femtune.updating import StartRules, multi_start

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.arrays import Reals
    from femtune.files.study_file import PosteriorTable
    from femtune.residuals import UpdateProblem
    from femtune.steps.posterior.record import PosteriorResults
    from femtune.steps.update.run import FoundParameters
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

_CHECKED_ON_FULL = 20
"""Samples at which the full model is solved beside a reduced one: the standard deviation of the difference is then
known to a sixth."""
_CHECKED_ON_LARGE = 4
"""The same where a solution takes half a minute: the deviation is known to a factor of two."""
_LARGE = 100_000
"""Free DOFs above which it does."""
_AS_GOOD = 2.0
"""Difference of log likelihood to the lowest of the samples' upper 95 %, up to which another optimum counts: a region
there has a seventh of the density of the edge of the samples, and may be wider."""
_LOWER_EDGE = 0.05
"""Quantile of the log likelihood of the samples that counts as their edge."""


def check_posterior(study: Study) -> None:
    """Check, before anything is solved, that there is one set of residuals of a model that can be solved often.

    Raises
    ------
    FemtuneError : ``posterior.stages``, ``posterior.external``, ``posterior.specimens``
    """
    with errors_at(study.file.where("posterior")):
        if study.file.stage:
            raise FemtuneError("posterior.stages")
        if study.source.needs_runs:
            raise FemtuneError("posterior.external")
        if study.file.specimens:
            raise FemtuneError("posterior.specimens")


def posterior_at(
    study: Study, update: FoundParameters, folder: Path, arrays: dict[str, NDArray[Any]], progress: Progress
) -> PosteriorResults:
    """The samples about the result of the update; each solution is on disk as soon as it has ended.

    Raises
    ------
    FemtuneError : ``posterior.*``, ``executor.*``, ``run.unwritable``
    """
    table, result = study.file.posterior, update.result
    assert table is not None
    begun = time.monotonic()
    with errors_at(study.file.where("posterior")):
        if not result.status.ok:
            raise FemtuneError("posterior.not-converged", status=result.status.value)
        reduced = update.search if update.search is not None and update.search.serves_all else None
        full = solved_by(study, direct).problem()
        problem = full if reduced is None else reduced.reduced_problem()
        solving = solving_of(problem, result, reduced is not None)
        executor = executor_of(study, reduced=reduced is not None)
        rules = SamplingRules(table.draws, table.seed, table.gradients, sampling=table.sampling)
        errors, changes = none_of(len(solving.of(solving.at, False).residuals)), None
        if table.discrepancy != "none":
            progress.step("posterior: effects of errors of the model", 0, None)
            found = unknown_changes(study, result, solving)
            if isinstance(found, str):
                errors = replace(errors, reason=found)
            else:
                changes = found
                solving, errors = about_most_probable(changes, solving, result, table.noise, rules)
        file = FinishedRuns(folder / POSTERIOR_FILE, _key(solving))
        size = len(solving.of(solving.at, False).residuals), len(solving.moving)
        kept = KeptSolutions(executor, file, progress, _line, partial(_of_line, *size))
        kept.begin(study.file.study.journal)
        solutions = _Solutions(solving, kept)
        likelihood = likelihood_of(solving, result, table.noise, errors)
        samples = sampler_of(solving, likelihood, rules, solutions, solutions.tell).run()
        starts, regions = _other_regions(study, update, problem, solving, samples, likelihood, table, progress)
        orders = () if reduced is None else tuple(trained.model.order for trained in reduced.trained)
        error = None if reduced is None else _full_error(full, result, samples, likelihood, solving.shift, progress)
        further, not_predicted = further_tests(study, samples, result.x, solving.moving, table.further_sd, progress)
        predicting = Predicting(study, result.x, changes, errors, executor, progress)
        predictions = predicting.run(samples, likelihood, solving.moving, folder, arrays)
    facts = SampledFacts(
        table=table, result=result, moving=solving.moving, samples=samples, likelihood=likelihood,
        anew=np.array([solutions.anew(x) for x in samples.x]), recalled=kept.recalled,
        seconds=time.monotonic() - begun, executor=executor.words, starts=starts, regions=regions,
        errors=errors, left_out=_left_out(solving), reduced_orders=orders, full_error=error, further=further,
        remarks=(*(n.what for n in kept.remarks), *not_predicted, *predictions.remarks),
        predictions=predictions,
    )  # fmt: skip
    return posterior_results(facts, arrays)


def _left_out(solving: Solving) -> tuple[str, ...]:
    return tuple(without_likelihood(solving.at.weighted))


# ----------------------------------------------------------------------------------------------------
# Solutions, kept in the run folder.


@dataclass(eq=False)
class _Solutions:
    """The model at samples."""

    solving: Solving
    kept: KeptSolutions[SolvedSample]

    def tell(self, text: str) -> None:
        """What is done."""
        self.kept.progress.step(f"posterior: {text}", 0, None)

    def __call__(self, points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
        """See `femtune.sampling.sampler.ModelAtSamples`."""
        keys = [_run(x, derivatives) for x in points]
        what = f"posterior: solutions with{'' if derivatives else 'out'} derivatives"
        tasks = [(np.array(x), derivatives) for x in points]
        results = self.kept.solved(self.solving, tasks, keys, what, "sample")
        return [None if s.problem else Known(np.array(x), s.residuals, s.jacobian) for x, s in zip(points, results)]

    def anew(self, x: Reals) -> bool:
        """Whether the pairing is another one at a sample that was solved without derivatives."""
        return self.kept.known[_run(x, False)].paired_anew


def _run(x: Reals, derivatives: bool) -> str:
    return digest(np.ascontiguousarray(x), derivatives)


def _key(solving: Solving) -> str:
    """Of all that a solution depends on."""
    at, (lower, upper) = solving.at, solving.problem.parameters.bounds
    shift = () if solving.shift is None else (solving.shift.about, solving.shift.constant, solving.shift.slope)
    return digest(at.x, at.residuals, at.jacobian, lower, upper, *solving.side.rows(at.x), solving.moving, *shift)


def _line(solved: SolvedSample) -> dict[str, object]:
    J = None if solved.jacobian is None else as_text(solved.jacobian)
    return {
        "residuals": as_text(solved.residuals), "jacobian": J, "paired_anew": bool(solved.paired_anew),
        "problem": solved.problem,
    }  # fmt: skip


def _of_line(rows: int, columns: int, line: Mapping[str, Any]) -> SolvedSample | None:
    """A solution with so many residuals and parameters; None for what is none, and is solved again."""
    try:
        problem = str(line["problem"])
        rows = 0 if problem else rows
        J = None if line["jacobian"] is None else from_text(line["jacobian"], rows * columns).reshape(rows, columns)
        return SolvedSample(from_text(line["residuals"], rows), J, bool(line["paired_anew"]), problem)
    except (ValueError, KeyError, TypeError):
        return None


# ----------------------------------------------------------------------------------------------------
# What the samples do not show by themselves.


def _other_regions(
    study: Study, update: FoundParameters, problem: UpdateProblem, solving: Solving, samples: PosteriorSamples,
    likelihood: Likelihood, table: PosteriorTable, progress: Progress,
) -> tuple[int, tuple[OutsideOptimum, ...]]:  # fmt: skip
    """Number of updates from other points, and optima outside the samples that explain the data about as well."""
    many = update.starts
    if many is None:
        if not table.starts:
            return 0, ()
        progress.step("posterior: updates from other points", 0, None)
        rules = StartRules(table.starts, table.seed)
        method = method_of(study.file.update, study.parameters)
        many = multi_start(problem, method, rules, active=update.result.active)
    theta = samples.weights.values @ samples.theta
    at_centre = likelihood.at(samples.residuals, np.tile(theta, (len(samples.x), 1)))
    regions = []
    for optimum in many.optima:
        x = optimum.x[solving.moving]
        if not far_from(samples.x, x):
            continue
        try:
            there = solving.of(problem.start(optimum.x), False).residuals
        except FemtuneError:
            continue
        if len(there) != len(solving.of(solving.at, False).residuals):
            continue
        log = float(likelihood.at(there[None], theta[None])[0])
        if log > np.quantile(at_centre, _LOWER_EDGE) - _AS_GOOD:
            regions.append(OutsideOptimum(optimum.x, log - float(at_centre.max()), len(optimum.members)))
    return len(many.starts), tuple(regions)


def _full_error(
    full: UpdateProblem, result: UpdateResult, samples: PosteriorSamples, likelihood: Likelihood, shift: Shift | None,
    progress: Progress,
) -> float | None:  # fmt: skip
    """Standard deviation of the difference of log likelihood of full and reduced model; None if it cannot be had."""
    moving = np.flatnonzero(np.isin([p.name for p in result.parameters.free], result.active))
    solving = Solving(full, at_result(full, result), result.side, moving, shift)
    rng = np.random.default_rng(0)
    large = any(case.configured.n_free > _LARGE for case in full.cases)
    count = _CHECKED_ON_LARGE if large else _CHECKED_ON_FULL
    chosen = rng.choice(len(samples.x), count, p=samples.weights.values)
    differences = []
    for number, i in enumerate(chosen):
        progress.step("posterior: samples on the full model", number, count)
        solved = solving((samples.x[i], False))
        if len(solved.residuals) == samples.residuals.shape[1]:
            both = np.vstack([solved.residuals, samples.residuals[i]])
            on_full, on_reduced = likelihood.at(both, np.tile(samples.theta[i], (2, 1)))
            differences.append(float(on_full - on_reduced))
    return float(np.std(differences)) if len(differences) > 1 else None
