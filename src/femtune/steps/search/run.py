"""The step search: the whole box on a surrogate of the residuals or on the model, then least squares on the model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.experiments import VarianceIndices, latin_hypercube, sample
from femtune.files.study_file import with_search
from femtune.global_search import Front, GlobalMinimum, SearchRules, front_of, global_minimum, surrogate_minimum
from femtune.global_search.kinds import METHODS
from femtune.selection import estimated_size, identifiability, undetermined_sentence
from femtune.steps.held_folder import held_for_solver
from femtune.steps.respond.run import check_places
from femtune.steps.results import Results
from femtune.steps.screen.record import FailedModelRun
from femtune.steps.search.front import ErrorParts
from femtune.steps.search.record import (
    FrontPoint,
    FrontResults,
    GlobalSearchResults,
    SearchedParameter,
    SeedFacts,
    SurrogateFacts,
)
from femtune.steps.search.result import SearchResult
from femtune.steps.select.run import check_parameters
from femtune.steps.update.external import SolverResiduals, least_squares_on_solver, opened_solver
from femtune.steps.update.facts.update import citations, combination_record
from femtune.study.csv_table import write_csv
from femtune.study.error_places import errors_at
from femtune.study.executor import check_executor, executor_of, with_jobs
from femtune.study.model_runs import ModelRun, ResidualRuns, failures, runs_at
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.record import alert
from femtune.study.solutions import looking_up
from femtune.study.solved import nominal
from femtune.study.study import read_study
from femtune.study.update_method import method_of
from femtune.surrogates import (
    ChaosRules,
    KrigingRules,
    RadialRules,
    SumOfSquares,
    Surrogate,
    explained_variances,
    fit_surrogate,
    term_counts,
    where_better,
    where_wrong,
)
from femtune.surrogates.kinds import INFILLS, SURROGATES
from femtune.updating import StartRules, UpdateResult, multi_start

if TYPE_CHECKING:
    from femtune.executor import Executor
    from femtune.files.study_file import SearchTable, StudyFile
    from femtune.selection import Identifiability
    from femtune.study.external import SolverRuns
    from femtune.study.progress import Progress
    from femtune.study.record import Alert
    from femtune.study.study import Study

_DEFAULT_RUNS_PER_PARAMETER = 10
"""Runs of the model per parameter for the surrogate if the study gives none.

The usual size of a computer experiment.
"""
_RUNS_PER_FIT = 5
"""Further runs after which the surrogate is fitted again.

Fewer runs use its errors better; more can run in parallel.
"""
_MOST_RESPONSES = 12
"""Residuals that are fitted one by one.

Of more, principal components are fitted, at most this number, because each fit takes time.
"""
_LEFT_OUT_SQUARES = 1e-10
"""Fraction of the sum of squares that the principal components left out may have: far below errors of the surrogate."""
_SAME_POINT = 1e-3
"""Largest difference of two points, relative to the ranges of the parameters, up to which they are the same minimum.

It is above the accuracy with which a search ends.
"""
_FRONT, _FRONT_MODEL = "search_front", "search_front_model"
_WRONG_SURROGATE = 1.0
"""Difference of χ² between surrogate and model, relative to 1 + χ² of the model, above which an alert says that the
surrogate is wrong.
"""


def search_minimum(
    source: Path | str | StudyFile,
    options: Mapping[str, Any],
    progress: Progress = silent,
    *,
    fresh: bool = False,
    jobs: int | None = None,
    table_of_front: Path | None = None,
) -> SearchResult:
    """The minimum of the squared residuals within the bounds, without initial values.

    Parameters
    ----------
    options : keys of [search] that take the place of the study's
    fresh : do not take solutions from the journal of the study's run folder
    jobs : maximum number of parallel runs; overrides [parallel]

    Raises
    ------
    FemtuneError : ``search.*``, ``surrogate.*``, ``study.no-test``, ``study.no-parameters``
    """
    watch = Stopwatch(call("search", source))
    with held_for_solver(source, "search"):
        with watch.step("read"):
            study = read_study(with_jobs(source, jobs), progress, fresh=fresh, around=False)
            check_parameters(study)
            study.problem()
            table = with_search(study.file, options).search
            assert table is not None
            if table_of_front is not None:
                if not table.front:
                    raise FemtuneError("search.front/csv")
                check_places(study, [table_of_front], None)
            check_executor(study, progress)
            inputs = inputs_of(study)
        arrays: dict[str, Any] = {}
        with (
            looking_up(study, fresh) as looked_up,
            opened_solver(looked_up.study, progress) as solver,
        ):
            search = _Search.begin(looked_up.study, table, progress, solver)
            if table.front:
                # what it cannot compare is said before the first run
                _ = search.parts
            with watch.step("search"):
                ended = search.on_model() if table.on == "model" else search.on_surrogate()
            with watch.step("least squares"):
                record = search.record(ended, arrays)
        if table_of_front is not None:
            objectives = ["frequency_error_squared", "other_error", "third_error"][: table.front_objectives]
            heads = [*(p.name for p in record.parameters), *objectives, *(f"{name}_model" for name in objectives)]
            write_csv(table_of_front, heads, np.hstack([arrays[_FRONT], arrays[_FRONT_MODEL]]))
    results = Results(
        provenance=provenance(inputs, watch),
        study=study_facts(study),
        search=record,
        citations=citations(_papers(table)),
        alerts=record.alerts,
    )
    return SearchResult(record, results, arrays, tuple(looked_up.remarks))


def _papers(table: SearchTable) -> list[str]:
    front = table.front > 0
    infill = table.on == "surrogate" and table.infill > 0
    return [
        *METHODS[table.method].citations,
        *(SURROGATES[table.surrogate].citations if table.on == "surrogate" else ()),
        *(INFILLS[table.infill_by].citations if infill else ()),
        *(["deb2002"] if front else []),
    ]


@dataclass(frozen=True, eq=False)
class _Ended:
    """Where the search of each seed ended: points (s, k) and χ²; the surrogate, and the χ² that it leaves out.

    `shares` are the parts of the variance of the residuals that each parameter explains, from polynomial chaos.
    """

    searches: tuple[GlobalMinimum, ...]
    points: Reals
    chi2: Reals
    surrogate: SurrogateFacts | None = None
    rest: float = 0.0
    front: Front | None = None
    shares: VarianceIndices | None = None

    @property
    def best(self) -> int:
        return int(np.argmin(self.chi2))


@dataclass(eq=False)
class _Search:
    """A search under way: all runs that were made."""

    study: Study
    table: SearchTable
    progress: Progress
    work: ResidualRuns | SolverResiduals
    executor: Executor
    solver: SolverRuns | None = None
    runs: list[ModelRun] = field(default_factory=list)
    told: tuple[Alert, ...] = ()

    @classmethod
    def begin(cls, study: Study, table: SearchTable, progress: Progress, solver: SolverRuns | None) -> _Search:
        """With the residuals at the initial values."""
        progress.step("residuals at the initial values", 0, None)
        problem = study.problem()
        before = problem.start(nominal(study))
        work: ResidualRuns | SolverResiduals = ResidualRuns(problem, before)
        if solver is not None:
            work = SolverResiduals(study, solver, problem, before)
        return cls(study, table, progress, work, executor_of(study), solver)

    @cached_property
    def parts(self) -> ErrorParts:
        """The objectives of the front (errors ``search.front``)."""
        with errors_at(self.study.file.where("search", "front")):
            return ErrorParts.of(self.work.problem, self.work.before, self.table.front_objectives)

    @property
    def bounds(self) -> tuple[Reals, Reals]:
        """Of the normalised free parameters."""
        return self.study.parameters.bounds

    @property
    def rules(self) -> SearchRules:
        """Of the global search."""
        table = self.table
        crossover = SearchRules.crossover if table.crossover is None else table.crossover
        return SearchRules(
            table.method, table.population, table.generations, crossover=crossover, mutation=table.mutation,
            seed=table.seed,
        )  # fmt: skip

    def run(self, points: Reals, what: str) -> Reals:
        """(n, m) residuals at points (n, k), NaN where a run failed."""
        runs = runs_at(self.work, list(points), self.executor, self.progress, what)
        self.runs += runs
        return np.array([run.values for run in runs])

    def on_model(self) -> _Ended:
        """Every generation is a set of runs of the model."""

        def objective(points: Reals) -> Reals:
            return np.asarray(np.sum(self.run(points, "runs of a generation") ** 2, axis=1))

        searches = []
        for seed in range(self.table.seed, self.table.seed + self.table.seeds):
            searches.append(global_minimum(objective, *self.bounds, replace(self.rules, seed=seed)))
        if not np.isfinite(searches[0].value):
            raise FemtuneError("search.all-failed", runs=len(self.runs), reason=self.runs[0].problem)
        front = self._front(lambda points: self.run(points, "runs of a generation of the front"))
        return _Ended(
            tuple(searches), np.array([f.x for f in searches]), np.array([f.value for f in searches]), front=front
        )

    def on_surrogate(self) -> _Ended:
        """Runs of a Latin hypercube, a surrogate of the residuals, further runs, and its minimum."""
        table, (lower, upper) = self.table, self.bounds
        least = _surrogate_rules(table).least_runs(len(lower))
        wanted = table.runs or max(_DEFAULT_RUNS_PER_PARAMETER * len(lower), least)
        if wanted < least:
            where = self.study.file.where("search", "runs")
            raise FemtuneError("search.too-few/asked", where=where, runs=wanted, needed=least, parameters=len(lower))
        x, r = self._good(*self._designed(wanted), least)
        responses = SearchResponses.of(r)
        surrogate = self._fit(x, responses.of_residuals(r))
        checked, fresh_rms = 0, None
        if table.fresh_runs:
            points = lower + latin_hypercube(len(lower), table.fresh_runs, table.seed + 1).points * (upper - lower)
            new_x, new_r = self._good(points, self.run(points, "fresh runs"), 0)
            checked = len(new_x)
            if checked:
                predicted = responses.residuals(surrogate.predict(new_x))
                fresh_rms = float(np.sqrt(np.mean((predicted - new_r) ** 2)))
            x, r = np.vstack([x, new_x]), np.vstack([r, new_r])
            surrogate = self._fit(x, responses.of_residuals(r))
        before, first = _left_out_rms(surrogate, responses) if table.infill else None, len(x)
        made = 0
        while len(points := self._further(surrogate, responses, made)):
            made += len(points)
            new_x, new_r = self._good(points, self.run(points, INFILLS[table.infill_by].text), 0)
            x, r = np.vstack([x, new_x]), np.vstack([r, new_r])
            surrogate = self._fit(x, responses.of_residuals(r))
        self.progress.step("search on the surrogate", 0, None)
        seeds = range(table.seed, table.seed + table.seeds)
        searches = surrogate_minimum(surrogate, responses.objective, (lower, upper), self.rules, seeds)
        rules = _surrogate_rules(table)
        facts = SurrogateFacts(
            method=table.surrogate,
            trend=None if isinstance(rules, ChaosRules) else rules.trend,
            correlation=rules.correlation if isinstance(rules, KrigingRules) else None,
            kernel=rules.kernel if isinstance(rules, RadialRules) else None,
            terms=term_counts(surrogate),
            runs=len(x),
            responses=len(surrogate.fits),
            left_out_rms=_left_out_rms(surrogate, responses),
            left_out_ratio=float(np.sqrt(np.mean(surrogate.left_out_ratio**2))),
            fresh_runs=checked,
            fresh_rms=fresh_rms,
            infill_by=table.infill_by if table.infill else None,
            infill_runs=len(x) - first,
            infill_until=table.infill_until,
            left_out_rms_before=before,
        )
        shares = explained_variances(surrogate) if isinstance(rules, ChaosRules) else None
        front = self._front(lambda points: responses.residuals(surrogate.predict(points)))
        chi2 = 2.0 * searches.values + responses.rest
        return _Ended(searches.searches, searches.ends, chi2, facts, responses.rest, front, shares)

    def _further(self, surrogate: Surrogate, responses: SearchResponses, made: int) -> Reals:
        """(n, k) points of the next further runs, after those that were made; none at the end.

        Runs by improvement are one set. Runs by error end where the stated error is small enough.
        """
        table = self.table
        left, small = table.infill - made, table.infill_until
        if left == 0 or (small is not None and _left_out_rms(surrogate, responses) <= small):
            return np.empty((0, surrogate.x.shape[1]))
        if table.infill_by == "improvement":
            return where_better(surrogate, responses.objective, left, table.seed)
        return where_wrong(surrogate, min(_RUNS_PER_FIT, left), table.seed + made)

    def _designed(self, wanted: int) -> tuple[Reals, Reals]:
        """Points of the sample and their residuals; as many further ones, of a Latin hypercube, as runs failed."""
        lower, upper = self.bounds
        x = lower + sample(self.table.sample, len(lower), wanted, self.table.seed).points * (upper - lower)
        r = self.run(x, "runs for the surrogate")
        failed = int(np.isnan(r).any(axis=1).sum())
        if not 0 < failed < len(x):
            return x, r
        more = lower + latin_hypercube(len(lower), failed, self.table.seed + 2).points * (upper - lower)
        return np.vstack([x, more]), np.vstack([r, self.run(more, "runs in the place of those that failed")])

    def _front(self, residuals: Callable[[Reals], Reals]) -> Front | None:
        """The front of frequency against other errors, by residuals (n, m) at points (n, k)."""
        if not self.table.front:
            return None
        self.progress.step("front of frequency against other errors", 0, None)
        return front_of(lambda points: self.parts(residuals(points)), *self.bounds, self.rules)

    def _good(self, x: Reals, r: Reals, least: int) -> tuple[Reals, Reals]:
        """Points and residuals of the runs that did not fail (error ``search.all-failed`` if too few are left)."""
        good = ~np.isnan(r).any(axis=1)
        if good.sum() < least:
            reason = next(run.problem for run in self.runs if run.problem)
            raise FemtuneError("search.too-few", runs=len(x), good=int(good.sum()), needed=least, reason=reason)
        return x[good], r[good]

    def _fit(self, x: Reals, y: Reals) -> Surrogate:
        table = self.table
        self.progress.step("fitting the surrogate", 0, None)
        with errors_at(self.study.file.where("search")):
            return fit_surrogate(
                x, y, _surrogate_rules(table), self.bounds, [p.name for p in self.study.parameters.free]
            )

    def record(self, ended: _Ended, arrays: dict[str, Any]) -> GlobalSearchResults:
        """Least squares from where the search ended, and all of it as a record."""
        before = len(self.runs)
        at_end = self.run(ended.points[ended.best : ended.best + 1], "the model at the minimum")[0]
        chi2_model = float(at_end @ at_end) if np.isfinite(at_end).all() else None
        front = None if ended.front is None else self._front_results(ended.front, arrays)
        result = self._least_squares(ended)
        arrays["search_history"] = _history(ended, self.table.seed)
        seeds = self._seeds(ended)
        chi2 = 2.0 * result.after.objective
        known = self._identifiability(result)
        initial = self.work.before.residuals
        failed = tuple(FailedModelRun(run=i, reason=reason) for i, reason in failures(self.runs[:before]))
        record = GlobalSearchResults(
            on=self.table.on,
            method=self.table.method,
            runs=before + 1,
            failed=failed,
            residuals=len(initial),
            surrogate=ended.surrogate,
            seeds=seeds,
            parameters=self._parameters(ended, result),
            chi2_initial=float(initial @ initial),
            chi2_searched=float(ended.chi2[ended.best]),
            chi2_model=chi2_model,
            chi2=chi2,
            status=result.status.name,
            message=result.status.value,
            history_key="search_history",
            undetermined=tuple(combination_record(known, c) for c in known.undetermined),
            front=front,
            sentences=(),
        )
        open_ = [undetermined_sentence(known, c) for c in known.undetermined]
        # what the update of a solver says of them is the same
        told = [a for a in self.told if not (open_ and a.code == "external.undetermined")]
        return record.model_copy(update={"sentences": _sentences(record), "alerts": (*_alerts(record, open_), *told)})

    def _identifiability(self, result: UpdateResult) -> Identifiability:
        """What the data determine at the result; a side constraint determines what they leave open."""
        parameters, at = self.study.parameters, result.after
        names = tuple(p.name for p in parameters.free)
        size = 1.0
        if self.study.file.residuals.scatter != "stated":
            size = estimated_size(at.jacobian, at.residuals, sum(at.lost.values()))
        known = identifiability(at.jacobian, np.asarray(parameters.prior[1]), names, size)
        return replace(known, undetermined=()) if len(result.side.matrix) else known

    def _front_results(self, front: Front, arrays: dict[str, Any]) -> FrontResults:
        """Some points of the front with a run of the model at each; all of it among the arrays."""
        chosen = front.spread(self.table.front)
        values = np.array([self.study.parameters.denormalise(x) for x in front.x]).reshape(len(front.x), -1)
        arrays[_FRONT] = np.hstack([values, front.values])
        on_model = front.values[chosen]
        if self.table.on == "surrogate" and len(chosen):
            on_model = self.parts(self.run(front.x[chosen], "the model on the front"))
        arrays[_FRONT_MODEL] = np.full(front.values.shape, np.nan)
        arrays[_FRONT_MODEL][chosen] = on_model
        initial = self.parts(self.work.before.residuals)
        three = front.values.shape[1] == 3
        return FrontResults(
            label=self.parts.label,
            third_label=self.parts.third_label,
            initial_frequency=float(initial[0]),
            initial_other=float(initial[1]),
            initial_third=float(initial[2]) if three else None,
            model_key=_FRONT_MODEL,
            points=tuple(
                FrontPoint(
                    parameters=tuple(map(float, values[i])),
                    frequency=float(front.values[i, 0]),
                    other=float(front.values[i, 1]),
                    frequency_model=_finite(pair[0]),
                    other_model=_finite(pair[1]),
                    third=float(front.values[i, 2]) if three else None,
                    third_model=_finite(pair[2]) if three else None,
                )
                for i, pair in zip(chosen, on_model, strict=True)
            ),
            evaluations=front.evaluations,
            front_key=_FRONT,
        )

    def _least_squares(self, ended: _Ended) -> UpdateResult:
        """From the distinct ends of the searches, by the method of [update]."""
        self.progress.step("least squares on the model", 0, None)
        table = self.study.file.update
        with errors_at(self.study.file.where("update", "regularisation")):
            method = method_of(table, self.study.parameters)
        if self.solver is not None:
            moved = least_squares_on_solver(self.study, self.solver, method, ended.points[ended.best])
            self.told = moved.alerts
            return moved.result
        points: list[Reals] = []
        width = self.bounds[1] - self.bounds[0]
        for i in np.argsort(ended.chi2, kind="stable"):
            if all(np.abs((ended.points[i] - p) / width).max() > _SAME_POINT for p in points):
                points.append(ended.points[i])
        starts = multi_start(
            self.work.problem, method, StartRules(len(points)), nominal=self.work.before, points=np.array(points),
            executor=self.executor,
        )  # fmt: skip
        return starts.best

    def _seeds(self, ended: _Ended) -> tuple[SeedFacts, ...]:
        width = self.bounds[1] - self.bounds[0]
        best = ended.points[ended.best]
        return tuple(
            SeedFacts(
                seed=self.table.seed + i,
                evaluations=int(search.evaluations[-1]),
                chi2=float(chi2),
                same=bool(
                    np.abs((point - best) / width).max()
                    <= (_SAME_POINT if self.table.on == "surrogate" else 10 * _SAME_POINT)
                ),
                converged=search.converged,
            )
            for i, (search, point, chi2) in enumerate(zip(ended.searches, ended.points, ended.chi2, strict=True))
        )

    def _parameters(self, ended: _Ended, result: UpdateResult) -> tuple[SearchedParameter, ...]:
        values, shares = self.study.parameters.denormalise(ended.points[ended.best]), ended.shares
        return tuple(
            SearchedParameter(
                name=p.name,
                unit=p.unit,
                lower=p.lower,
                upper=p.upper,
                initial=p.nominal,
                found=float(values[i]),
                value=result.values[p.name],
                at_bound=p.name in result.at_bound,
                variance_alone=None if shares is None else float(shares.first[i, 0]),
                variance_total=None if shares is None else float(shares.total[i, 0]),
            )
            for i, p in enumerate(self.study.parameters.free)
        )


@dataclass(frozen=True, eq=False)
class SearchResponses:
    """What the surrogate is fitted to: residuals r, or c of r = middle + basis·c + (what is left out).

    Parameters
    ----------
    middle : (m,)
    basis : (m, q) orthonormal columns; None: the residuals themselves
    """

    middle: Reals
    basis: Reals | None

    @classmethod
    def of(cls, r: Reals) -> SearchResponses:
        """By the runs (n, m)."""
        middle = r.mean(axis=0)
        if r.shape[1] <= _MOST_RESPONSES:
            return cls(np.zeros_like(middle), None)
        _, size, rows = np.linalg.svd(r - middle, full_matrices=False)
        left = 1.0 - np.cumsum(size**2) / max(float(np.sum(size**2)), np.finfo(float).tiny)
        count = min(int(np.sum(left > _LEFT_OUT_SQUARES)) + 1, _MOST_RESPONSES)
        return cls(middle, rows[:count].T)

    def of_residuals(self, r: Reals) -> Reals:
        """(n, q) responses of residuals (n, m)."""
        return r if self.basis is None else (r - self.middle) @ self.basis

    def residuals(self, c: Reals) -> Reals:
        """(n, m) residuals of responses (n, q)."""
        return c if self.basis is None else self.middle + c @ self.basis.T

    @property
    def objective(self) -> SumOfSquares:
        """½ rᵀr as a function of the responses, without `rest`."""
        target = np.zeros_like(self.middle) if self.basis is None else -self.basis.T @ self.middle
        return SumOfSquares(target, np.ones(len(target)))

    @property
    def rest(self) -> float:
        """χ² that the responses do not change."""
        if self.basis is None:
            return 0.0
        left = self.middle - self.basis @ (self.basis.T @ self.middle)
        return float(left @ left)


def _left_out_rms(surrogate: Surrogate, responses: SearchResponses) -> float:
    """Root mean square error of predicting each run from the others, in standard deviations of the data."""
    error = responses.residuals(surrogate.left_out) - responses.residuals(surrogate.y)
    return float(np.sqrt(np.mean(error**2)))


def _surrogate_rules(table: SearchTable) -> KrigingRules | RadialRules | ChaosRules:
    """Of a surrogate of the residuals."""
    if table.surrogate == "radial-basis":
        return RadialRules(table.kernel, table.noise)
    if table.surrogate == "chaos":
        return ChaosRules(table.degree)
    return KrigingRules(table.trend, table.correlation, table.noise, seed=table.seed)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _history(ended: _Ended, first: int) -> Reals:
    """(points, 3) seed, evaluations, smallest χ² so far."""
    size = 1.0 if ended.surrogate is None else 2.0
    lines = [
        np.column_stack([np.full(len(s.history), first + i), s.evaluations, size * s.history + ended.rest])
        for i, s in enumerate(ended.searches)
    ]
    return np.vstack(lines)


def _sentences(record: GlobalSearchResults) -> tuple[str, ...]:
    same = sum(seed.same for seed in record.seeds)
    out = [f"{same} of {len(record.seeds)} searches ended at the same minimum on the {record.on}."]
    if record.surrogate is not None:
        s = record.surrogate
        fresh = "" if s.fresh_rms is None else f", {s.fresh_rms:.3g} for {s.fresh_runs} fresh runs"
        out.append(
            f"The surrogate predicts a residual within {s.left_out_rms:.3g} standard deviations of the data "
            f"(root mean square, leaving out one run{fresh})."
        )
        if s.infill_by == "error":
            out.append(
                f"{s.infill_runs} further runs where its expected error was the largest changed this error from "
                f"{s.left_out_rms_before:.3g} to {s.left_out_rms:.3g}."
            )
    shares = sorted(
        ((p.variance_total, p.name) for p in record.parameters if p.variance_total is not None), reverse=True
    )
    if shares:
        named = ", ".join(f"{name} {100.0 * share:.0f} %" for share, name in shares)
        out.append(f"Parts of the variance of the residuals over the box, with interactions (Sobol): {named}.")
    model = "" if record.chi2_model is None or record.on == "model" else f", {record.chi2_model:.4g} by the model there"
    out.append(
        f"χ² is {record.chi2_initial:.4g} at the initial values, {record.chi2_searched:.4g} at the end of the search"
        f"{model}, and {record.chi2:.4g} after least squares on the model."
    )
    return tuple(out)


def _alerts(record: GlobalSearchResults, open_: Sequence[str]) -> list[Alert]:
    out = []
    if open_:
        out.append(alert("warning", "search.undetermined", combinations=" ".join(open_)))
    if record.failed:
        out.append(alert("warning", "search.failed-runs", count=len(record.failed), reason=record.failed[0].reason))
    model = record.chi2_model
    if record.on == "surrogate" and (
        model is None or abs(model - record.chi2_searched) > _WRONG_SURROGATE * (1.0 + model)
    ):
        shown = "no value" if model is None else f"{model:.4g}"
        out.append(alert("warning", "search.surrogate-wrong", surrogate=record.chi2_searched, model=shown))
    s = record.surrogate
    if s is not None and s.infill_until is not None and s.left_out_rms > s.infill_until:
        out.append(
            alert("warning", "search.infill-error", runs=s.infill_runs, error=s.left_out_rms, wanted=s.infill_until)
        )
    at_bound = ", ".join(p.name for p in record.parameters if p.at_bound)
    if at_bound:
        out.append(alert("warning", "search.at-bound", names=at_bound))
    # of many sets with one χ², searches find different ones
    if not open_ and sum(seed.same for seed in record.seeds) < 2 <= len(record.seeds):
        out.append(alert("warning", "search.not-confirmed", seeds=len(record.seeds)))
    return out
