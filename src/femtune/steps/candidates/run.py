"""The step candidates: several sets of parameters, each updated from the same test, and their comparison."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune._optional import require
from femtune.errors import FemtuneError
from femtune.executor import Serial, finish
from femtune.files.study_file import CandidatesTable, PosteriorTable
from femtune.files.study_file.candidates import NO_SEARCH, NOMINAL
from femtune.global_search import SearchRules, global_minimum
from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import CANDIDATES_FILE
from femtune.model import digest
from femtune.model.full_model import direct
from femtune.sampling import LARGEST_K, SamplingRules
from femtune.selection import identifiability
from femtune.selection.candidate_models import (
    CandidateFit,
    Group,
    evidence_weights,
    largest_of_right,
    rank_candidates,
    subset_count,
    subsets,
)
from femtune.selection.combinations import listed
from femtune.selection.evidence import LinearFit
from femtune.selection.minimax import smallest_largest
from femtune.status import Status
from femtune.steps.candidates.instances import InstancePopulation, Limit
from femtune.steps.candidates.record import (
    CandidateResults,
    CandidatesResults,
    CandidateValue,
    InstanceResults,
    LeftOutEvidence,
    LeftOutPrediction,
    log_evidence_or_least,
)
from femtune.steps.posterior.evidence import evidence_at, sampled_evidence
from femtune.steps.run_folder import unwritable
from femtune.steps.select.record.identifiability import CombinationRecord
from femtune.steps.update.external import least_squares_on_solver, moved_to, opened_solver
from femtune.steps.update.facts.update import citations, combination_record
from femtune.study.error_places import errors_at
from femtune.study.executor import executor_of
from femtune.study.external import point_of
from femtune.study.model_runs import ResidualRuns
from femtune.study.record import alert
from femtune.study.study import load_study, solved_by
from femtune.study.update_method import method_of
from femtune.updating import StartResult, StartRules, starting_points, update
from femtune.updating.sensitivity_method import moving_parameters
from femtune.updating.starts import comparable, distinct_optima, height, noise_level

if TYPE_CHECKING:
    from femtune.arrays import Flags, Reals
    from femtune.files.study_file import StudyFile
    from femtune.parameters import ParameterSet
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.residuals.kinds import Scatter
    from femtune.selection.candidate_models import CandidateRanking
    from femtune.study.external import SolverRuns
    from femtune.study.progress import Progress
    from femtune.study.record import Alert, CitationRecord
    from femtune.study.study import Study
    from femtune.updating import SensitivityMethod, UpdateResult

_SUBSET = re.compile(r"S[0-9]+(\.[0-9]+)*")


@dataclass(frozen=True)
class ParameterChoice:
    """A set of parameters: those that move, and expressions of those that follow them."""

    name: str
    parameters: tuple[str, ...]
    ties: Mapping[str, str] = field(default_factory=dict)
    note: str = ""


def candidate_citations() -> tuple[CitationRecord, ...]:
    """Publications on the criteria."""
    return citations(("schwarz1978", "beck2004", "goulet2013"))


@dataclass(frozen=True)
class _Task:
    """The candidate, the position of its problem, that of the configuration that is left out, and the start."""

    candidate: ParameterChoice
    problem: int
    left_out: int | None = None
    start: int = 0
    optimum: tuple[float, ...] | None = None
    """Where the evidence is sampled."""


Found = dict[str, Any]
"""What a run found, as a line of the journal holds it."""


@dataclass(frozen=True, eq=False)
class _Fitting:
    """The runs; called with a task.

    Parameters
    ----------
    problems, methods : with the ties of some candidates; the first without any
    free : free parameters of the study, by which candidates are compared
    probability : with which a right model has no larger residual than the limit
    search : from whose random populations the starts come; None: from the initial values and a Latin hypercube
    sampling : effort for a sampled evidence; None: none
    """

    problems: tuple[UpdateProblem, ...]
    methods: tuple[SensitivityMethod, ...]
    rules: StartRules
    free: ParameterSet
    probability: float
    search: SearchRules | None = None
    sampling: SamplingRules | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "problems": tuple(problem.to_send() for problem in self.problems)}

    def __call__(self, task: _Task) -> Found:
        try:
            if task.left_out is not None:
                return self._predicted(task, task.left_out)
            if task.optimum is not None:
                return self._sampled(task, np.array(task.optimum))
            if not task.candidate.parameters:
                problem = self.problems[task.problem]
                at = problem.start(np.zeros(len(problem.parameters.free)))
                return {**self._facts(problem, at, task.candidate), "status": "CONVERGED"}
            return self._fitted(task)
        except FemtuneError as error:
            return {"problem": error.what}

    def _fitted(self, task: _Task) -> Found:
        """The update from one start."""
        moving = moving_parameters(self.problems[task.problem], task.candidate.parameters)
        start = self._start(self.problems[task.problem], moving, task.start)
        return self._end(*self._updated(task.problem, None, start, task.candidate.parameters), task.candidate)

    def _end(self, problem: UpdateProblem, result: UpdateResult, candidate: ParameterChoice) -> Found:
        sd = {name: float(value) for name, value in result.sd.items() if np.isfinite(value)}
        return {
            **self._facts(problem, result.after, candidate),
            "least_worst": self._least_worst(problem, result, candidate), "status": result.status.name, "sd": sd,
            "at_bound": list(result.at_bound), "end": result.x.tolist(), "objective": result.objective,
        }  # fmt: skip

    def _least_worst(self, problem: UpdateProblem, result: UpdateResult, candidate: ParameterChoice) -> float:
        """The smallest largest residual, sought only where that of the optimum is larger than a right model's."""
        stated = problem.scatter == "stated"
        limit = largest_of_right(result.after.independent, self.probability) if stated else 0.0
        at = smallest_largest(
            result.after, problem.follow, moving_parameters(problem, candidate.parameters),
            problem.parameters.bounds, limit,
        )  # fmt: skip
        return float(np.abs(at.residuals).max(initial=0.0))

    def _updated(
        self, number: int, left_out: int | None, start: Evaluation | None, moving: Sequence[str]
    ) -> tuple[UpdateProblem, UpdateResult]:
        """The update without a configuration, from the initial values or another start, and the problem at its end."""
        problem = self.problems[number]
        problem = replace(problem, cases=tuple(c for i, c in enumerate(problem.cases) if i != left_out))
        return problem, update(problem, self.methods[number], start=start, active=moving)

    def _at(self, number: int, left_out: int, x: Reals) -> Evaluation:
        """One configuration at a point."""
        problem = self.problems[number]
        return replace(problem, cases=(problem.cases[left_out],)).start(x)

    def _start(self, problem: UpdateProblem, moving: Flags, number: int) -> Evaluation:
        """The start of a number: the initial values, a drawn point, or the best that a random population reaches."""
        x = np.zeros(len(moving))
        if self.search is not None:
            population = Population(problem, problem.start(x), moving)
            lower, upper = (edge[moving] for edge in problem.parameters.bounds)
            minimum = global_minimum(population, lower, upper, replace(self.search, seed=self.rules.seed + number))
            return problem.follow(population.whole(minimum.x[None])[0], population.before)
        return problem.start(self._drawn(problem, moving, number))

    def _drawn(self, problem: UpdateProblem, moving: Flags, number: int) -> Reals:
        """The initial values, or a point of the Latin hypercube."""
        if not number:
            return np.zeros(len(moving))
        drawn = starting_points(problem.parameters, replace(self.rules, count=self.rules.count - 1))
        return np.where(moving, drawn[number - 1], 0.0)

    def _facts(self, problem: UpdateProblem, at: Evaluation, candidate: ParameterChoice) -> Found:
        """What candidates are compared by."""
        parameters, r = problem.parameters, at.residuals
        moving = [parameters.index(name) for name in candidate.parameters]
        prior_mean, prior_sd = parameters.prior
        known = identifiability(at.jacobian[:, moving], np.asarray(prior_sd)[moving], candidate.parameters)
        J, (lower, upper) = at.jacobian[:, moving], parameters.bounds
        stated = [parameters.free[i].prior_sd is not None for i in moving]
        worst = int(np.argmax(np.abs(r)))
        labels = [b.label for b in at.blocks for _ in b.values]
        return {
            "values": {name: float(v) for name, v in parameters.values(at.x).items()},
            "error": at.mean_error, "chi2": float(r @ r), "residuals": at.independent,
            "rank": known.rank, "curvature": (J.T @ J).tolist(), "slope": (J.T @ r).tolist(),
            "lower": (lower - at.x)[moving].tolist(), "upper": (upper - at.x)[moving].tolist(),
            "prior_mean": (prior_mean - at.x)[moving].tolist(),
            "prior_sd": [float(sd) if known else None for sd, known in zip(np.asarray(prior_sd)[moving], stated)],
            "worst": float(abs(r[worst])), "worst_label": labels[worst],
            "undetermined": [combination_record(known, c).model_dump(mode="json") for c in known.undetermined],
        }  # fmt: skip

    def _sampled(self, task: _Task, optimum: Reals) -> Found:
        """The sampled evidence about an optimum, and the configurations left out by the samples."""
        problem = self.problems[task.problem]
        at = problem.start(optimum)
        if not task.candidate.parameters:
            return {
                "log_evidence": evidence_at(at, problem.scatter), "sd": 0.0, "effective": None, "k_hat": None,
                "left_out": [],
            }  # fmt: skip
        result = self._updated(task.problem, None, at, task.candidate.parameters)[1]
        assert self.sampling is not None
        return asdict(sampled_evidence(problem, result, self.sampling))

    def _predicted(self, task: _Task, left_out: int) -> Found:
        """Sum of squares of the residuals of a configuration, and of their weights, from an update without it.

        It starts from the initial values: the optimum with all configurations would betray the one that is left out.
        """
        x = np.zeros(len(self.problems[task.problem].parameters.free))
        if task.candidate.parameters:
            x = self._updated(task.problem, left_out, None, task.candidate.parameters)[1].x
        at = self._at(task.problem, left_out, x)
        return {"squares": at.mean_error**2 * at.weights, "weights": at.weights}


@dataclass(frozen=True, eq=False)
class _SolverFitting(_Fitting):
    """The runs with an external solver, which makes those around a point side by side.

    Parameters
    ----------
    studies : of the problems
    """

    studies: tuple[Study, ...] = ()
    runs: SolverRuns | None = None

    def _least_worst(self, problem: UpdateProblem, result: UpdateResult, candidate: ParameterChoice) -> float:
        """That of the optimum: each further point would be a run."""
        return float(np.abs(result.after.residuals).max(initial=0.0))

    def _fitted(self, task: _Task) -> Found:
        problem = self.problems[task.problem]
        point = self._drawn(problem, moving_parameters(problem, task.candidate.parameters), task.start)
        moved = self._moved(task.problem, None, point, task.candidate.parameters)
        return self._end(*moved, task.candidate)

    def _updated(
        self, number: int, left_out: int | None, start: Evaluation | None, moving: Sequence[str]
    ) -> tuple[UpdateProblem, UpdateResult]:
        point = np.zeros(len(self.problems[number].parameters.free)) if start is None else start.x
        return self._moved(number, left_out, point, moving)

    def _moved(
        self, number: int, left_out: int | None, point: Reals, moving: Sequence[str]
    ) -> tuple[UpdateProblem, UpdateResult]:
        assert self.runs is not None
        study = self._with_cases(number, lambda i: i != left_out)
        moved = least_squares_on_solver(study, self.runs, self.methods[number], point, moving)
        return moved.study.problem(), moved.result

    def _at(self, number: int, left_out: int, x: Reals) -> Evaluation:
        assert self.runs is not None
        study = self._with_cases(number, lambda i: i == left_out)
        return moved_to(study, self.runs, point_of(study.parameters, self.runs, x)).problem().start(x)

    def _with_cases(self, number: int, wanted: Callable[[int], bool]) -> Study:
        """The study with some of the configurations that the update uses."""
        study = self.studies[number]
        used = [case for case in study.cases if case.used is not None]
        return replace(study, cases=tuple(case for i, case in enumerate(used) if wanted(i)))


@dataclass(frozen=True, eq=False)
class Population:
    """χ² at points (n, moving) of a generation, with the pairing of the initial values; infinite where it fails."""

    problem: UpdateProblem
    before: Evaluation
    moving: Flags

    def whole(self, points: Reals) -> Reals:
        """(n, k) points of all parameters."""
        out = np.zeros((len(points), len(self.moving)))
        out[:, self.moving] = points
        return out

    def __call__(self, points: Reals) -> Reals:
        runs = ResidualRuns(self.problem, self.before)
        return np.array([np.sum(runs(x).values ** 2) for x in self.whole(points)])


def _best_start(
    problem: UpdateProblem, candidate: ParameterChoice, calibrations: Sequence[Found], from_initial: bool
) -> Found:
    """The best of the starts of a candidate, with the numbers of starts that reached it, of other optima that are as
    good, and of starts that are not used. Starts may fail, but not all, and not the one from the initial values."""
    failed = ["problem" in f for f in calibrations]
    if all(failed) or (from_initial and failed[0]) or not candidate.parameters:
        return calibrations[0]
    starts = comparable([_start_result(i, f) for i, f in enumerate(calibrations) if "problem" not in f])
    best = calibrations[min(starts, key=height).number]
    moving = int(moving_parameters(problem, candidate.parameters).sum())
    optima = distinct_optima(
        starts, problem.parameters.prior[1], noise_level(best["objective"], best["residuals"], moving)
    )
    return {
        **best, "least_worst": min(f["least_worst"] for f in calibrations if "least_worst" in f),
        "reached": len(optima[0].members) if optima else 0, "others": sum(o.as_good for o in optima[1:]),
        "unpaired": len(calibrations) - len(starts),
        "errors": [calibrations[start.number]["error"] for start in starts],
    }  # fmt: skip


def _start_result(number: int, calibration: Found) -> StartResult:
    end = np.array(calibration["end"])
    return StartResult(
        number, end, end, calibration["objective"], Status[calibration["status"]], residuals=calibration["residuals"]
    )


def candidates_of(study: Study) -> tuple[ParameterChoice, ...]:
    """The initial values, and the candidates that the study lists."""
    listed_ones = (ParameterChoice(c.name, c.parameters, c.ties, c.note) for c in study.file.candidate)
    return (ParameterChoice(NOMINAL, ()), *listed_ones)


def groups_of(study: Study, table: CandidatesTable) -> tuple[Group, ...]:
    """Parameters that join or leave together: those of the study, and every other free parameter alone.

    Raises
    ------
    FemtuneError : ``candidates.too-many``
    """
    if table.subsets == "none":
        return ()
    taken = {*table.always, *(name for group in table.groups for name in group)}
    alone = () if table.groups else tuple((p.name,) for p in study.parameters.free if p.name not in taken)
    groups = (*table.groups, *alone)
    if table.least > len(groups):
        raise FemtuneError("candidates.sizes/groups", values={"least": table.least, "groups": len(groups)})
    most = min(table.most or len(groups), len(groups))
    count = subset_count(len(groups), table.least, most)
    if table.subsets == "nested":
        count = sum(len(groups) - size for size in range(most))
    if count > table.largest_number:
        raise FemtuneError(
            "candidates.too-many",
            values={"groups": len(groups), "subsets": count, "largest_number": table.largest_number},
        )
    return groups


def compare_candidates(
    study: Study, folder: Path, resume: bool, arrays: dict[str, Reals], progress: Progress
) -> CandidatesResults:
    """Update all candidates and compare them; every run is on disk as soon as it has ended.

    Raises
    ------
    FemtuneError : ``candidates.*``, ``run.unwritable``, and what the initial values raise
    """
    table = study.file.candidates or CandidatesTable()
    with errors_at(study.file.where("candidates")):
        if study.file.stage:
            raise FemtuneError("candidates.stages")
        groups = groups_of(study, table)
        for candidate in study.file.candidate if groups else ():
            if _SUBSET.fullmatch(candidate.name):
                raise FemtuneError("candidates.name", name=candidate.name)
        if not study.file.candidate and not groups:
            raise FemtuneError("candidates.none")
        _check_asked(study, table)
    # the journal of solutions would keep thousands of them that nobody asks for again
    with opened_solver(study, progress) as solver:
        work = _Comparison(solved_by(study, direct), table, folder, progress, solver)
        return _compared(work, groups, resume, arrays)


def _check_asked(study: Study, table: CandidatesTable) -> None:
    """Refuse what needs thousands of solutions of another program, and what is not there."""
    if table.search != NO_SEARCH and study.source.needs_runs:
        raise FemtuneError("external.study/update", key="search")
    if table.instances and study.source.needs_runs:
        raise FemtuneError("external.study/update", key="instances")
    if table.evidence == "sampled":
        if study.source.needs_runs:
            raise FemtuneError("external.study/update", key="evidence")
        if study.file.specimens:
            raise FemtuneError("posterior.specimens")
    if table.search == "cma-es":
        # before the first run: what a run misses would be kept as its result
        require("cma", extra="search")


def _compared(work: _Comparison, groups: Sequence[Group], resume: bool, arrays: dict[str, Reals]) -> CandidatesResults:
    study, table = work.study, work.table
    work.begin(resume)
    candidates = list(candidates_of(study))
    fits = work.fitted(candidates)
    for more in _further(table, groups, work.fitted):
        candidates += [c for c, _ in more]
        fits += [f for _, f in more]
    # without its tests a specimen keeps the initial values of its own parameters, so that nothing is predicted
    wanted = table.leave_one_out and study.specimens is None
    predicted = work.predicted(candidates, fits) if wanted else [{} for _ in candidates]
    sampled = work.sampled(candidates, fits)
    found = _results(study, table, candidates, fits, predicted, sampled, arrays)
    return _with_instances(work, candidates, fits, found, arrays) if table.instances else found


def _with_instances(
    work: _Comparison,
    candidates: Sequence[ParameterChoice],
    fits: Sequence[Found],
    found: CandidatesResults,
    arrays: dict[str, Reals],
) -> CandidatesResults:
    """The comparison with a population of instances of each candidate that was solved."""
    table, records = work.table, list(found.candidates)
    least = min(c.error_percent for c in found.solved if c.bic is not None and c.error_percent is not None)
    error = np.inf if table.threshold is None else 0.01 * table.threshold * least
    limit = Limit(found.limit, error)
    for i, (candidate, fit) in enumerate(zip(candidates, fits)):
        if records[i].problem or not candidate.parameters:
            continue
        study = work._study(candidate)
        population = InstancePopulation(
            study, study.problem(), candidate.parameters, np.array(fit["end"]), limit, work.progress
        )
        instances = population.results(table.instances, table.seed, f"candidates/instances/{i}", arrays)
        records[i] = records[i].model_copy(update={"instances": instances})
    sentences = [
        s for record in records if record.instances is not None for s in _of_instances(record.name, record.instances)
    ]
    return found.model_copy(update={"candidates": tuple(records), "sentences": (*found.sentences, *sentences)})


def _of_instances(name: str, found: InstanceResults) -> Iterator[str]:
    near = f", and {found.kept_near} of {found.drawn_near} drawn near an admissible point" if found.drawn_near else ""
    yield f"{found.kept} of {found.drawn} instances of {name} within the bounds are not falsified{near}."


Pairs = list[tuple[ParameterChoice, Found]]


def _further(
    table: CandidatesTable, groups: Sequence[Group], fitted: Callable[[list[ParameterChoice]], list[Found]]
) -> Iterator[Pairs]:
    """Subsets of the groups with what they reach."""
    most = min(table.most or len(groups), len(groups))
    if table.subsets == "all":
        some = [_subset(table, groups, chosen) for chosen in subsets(groups, table.least, most)]
        yield list(zip(some, fitted(some)))
    best: tuple[Group, ...] = ()
    for _ in range(most if table.subsets == "nested" else 0):
        grown = [tuple(g for g in groups if g in (*best, new)) for new in groups if new not in best]
        some = [_subset(table, groups, chosen) for chosen in grown]
        fits = fitted(some)
        yield list(zip(some, fits))
        best = grown[int(np.argmin([f.get("chi2", np.inf) for f in fits]))]


def _subset(table: CandidatesTable, groups: Sequence[Group], chosen: Sequence[Group]) -> ParameterChoice:
    """Named by the numbers of its groups: "S1.3"."""
    name = "S" + ".".join(str(groups.index(group) + 1) for group in chosen)
    return ParameterChoice(name, (*table.always, *(name for group in chosen for name in group)))


@dataclass(eq=False)
class _Comparison:
    """The runs of a study; what an earlier comparison has left in the run folder is not made again."""

    study: Study
    table: CandidatesTable
    folder: Path
    progress: Progress
    solver: SolverRuns | None = None
    known: dict[str, Found] = field(default_factory=dict)
    tied: dict[str, Study] = field(default_factory=dict)

    def begin(self, resume: bool) -> None:
        """Take over the lines of an earlier comparison of the same study (error ``run.unwritable``)."""
        problem = self.study.problem()
        at = problem.start(np.zeros(len(problem.parameters.free)))
        lower, upper = problem.parameters.bounds
        key = digest(
            self.study.file.update.model_dump_json(), self.table.starts, self.table.seed, repr(self._search),
            self.table.probability,
            at.residuals, at.jacobian, lower, upper,
        )  # fmt: skip
        self.file = FinishedRuns(self.folder / CANDIDATES_FILE, key)
        try:
            lines = self.file.begin(resume)
        except OSError as error:
            raise unwritable(self.folder, error) from error
        self.known = {str(line.get("run")): dict(line) for line in lines}

    @property
    def _search(self) -> SearchRules | None:
        """Of the population that each start is the best of."""
        table = self.table
        if table.search == NO_SEARCH:
            return None
        return SearchRules(table.search, table.population, table.generations)

    @property
    def _sampling(self) -> SamplingRules | None:
        """Effort for a sampled evidence."""
        if self.table.evidence != "sampled":
            return None
        table = self.study.file.posterior or PosteriorTable()
        return SamplingRules(table.draws, table.seed, table.gradients)

    def sampled(self, candidates: Sequence[ParameterChoice], fits: Sequence[Found]) -> list[Found]:
        """The sampled evidence of every solved candidate; empty without one."""
        wanted = self._sampling is not None
        asked = [i for i, f in enumerate(fits) if wanted and "problem" not in f]
        optima: list[tuple[float, ...]] = [
            tuple(fits[i].get("end", np.zeros(len(self._study(candidates[i]).parameters.free)).tolist())) for i in asked
        ]
        ends = self._done(candidates, [(i, None, 0, x) for i, x in zip(asked, optima)], "evidence of candidate models")
        by_number = dict(zip(asked, ends))
        return [by_number.get(i, {}) for i in range(len(candidates))]

    def fitted(self, candidates: Sequence[ParameterChoice]) -> list[Found]:
        """What every candidate reaches with all configurations."""
        counts = [self.table.starts if c.parameters else 1 for c in candidates]
        asked = [(i, None, n) for i, count in enumerate(counts) for n in range(count)]
        ends = iter(self._run(candidates, asked, "updates of candidate models"))
        grouped = [[next(ends) for _ in range(count)] for count in counts]
        return [
            _best_start(self._study(candidate).problem(), candidate, some, self._search is None)
            for candidate, some in zip(candidates, grouped)
        ]

    def predicted(self, candidates: Sequence[ParameterChoice], calibrations: Sequence[Found]) -> list[dict[int, Found]]:
        """By configuration, what every solved candidate predicts of it."""
        count = len(self.study.problem().cases)
        if count < 2:
            return [{} for _ in candidates]
        asked = [(i, j, 0) for i, f in enumerate(calibrations) if "problem" not in f for j in range(count)]
        ends = self._run(candidates, asked, "configurations left out and predicted")
        out: list[dict[int, Found]] = [{} for _ in candidates]
        for (i, j, _), end in zip(asked, ends):
            out[i][j] = end
        return out

    def _run(
        self, candidates: Sequence[ParameterChoice], asked: Sequence[tuple[int, int | None, int]], what: str
    ) -> list[Found]:
        """The runs of candidates by position, without the configuration at the second position, by start."""
        return self._done(candidates, [(*one, None) for one in asked], what)

    def _done(
        self, candidates: Sequence[ParameterChoice],
        asked: Sequence[tuple[int, int | None, int, tuple[float, ...] | None]], what: str,
    ) -> list[Found]:  # fmt: skip
        studies = (self.study, *(self._study(c) for c in candidates if c.ties))
        at = dict(zip((i for i, c in enumerate(candidates) if c.ties), range(1, len(studies))))
        tasks = [_Task(candidates[i], at.get(i, 0), left_out, start, x) for i, left_out, start, x in asked]
        keys = [_key(task) for task in tasks]
        work, executor = self._work(studies), executor_of(self.study) if self.solver is None else Serial()
        done = sum(key in self.known for key in keys)
        self.progress.step(what, done, len(tasks))

        def keep(number: int, calibration: Found) -> None:
            nonlocal done
            try:
                # kept before it is shown: whoever shows it may be interrupted
                self.file.add({"run": keys[number], **calibration})
            except OSError as error:
                raise unwritable(self.folder, error) from error
            self.known[keys[number]] = calibration
            done += 1
            self.progress.step(what, done, len(tasks))

        known = {i: self.known[key] for i, key in enumerate(keys) if key in self.known}
        return finish(executor, work, tasks, known, name="candidate", finished=keep)

    def _work(self, studies: tuple[Study, ...]) -> _Fitting:
        facts = (
            tuple(s.problem() for s in studies), tuple(method_of(s.file.update, s.parameters) for s in studies),
            StartRules(self.table.starts, self.table.seed), self.study.parameters, self.table.probability, self._search,
            self._sampling,
        )  # fmt: skip
        return _Fitting(*facts) if self.solver is None else _SolverFitting(*facts, studies, self.solver)

    def _study(self, candidate: ParameterChoice) -> Study:
        """The study, with the ties of a candidate where it has some; made once."""
        if not candidate.ties:
            return self.study
        if candidate.name not in self.tied:
            self.tied[candidate.name] = _tied_study(self.study, candidate)
        return self.tied[candidate.name]


def _key(task: _Task) -> str:
    facts = (
        sorted(task.candidate.parameters), sorted(task.candidate.ties.items()), task.left_out, task.start, task.optimum
    )  # fmt: skip
    return digest(*map(repr, facts))


def _tied_study(study: Study, candidate: ParameterChoice) -> Study:
    """The study with the ties of a candidate.

    Raises
    ------
    FemtuneError : ``tie.*``, at the candidate
    """
    file: StudyFile = study.file
    number = next(i for i, c in enumerate(file.candidate) if c.name == candidate.name)
    entries = [
        e if e.name not in candidate.ties
        else e.model_copy(
            update={
                "tie": candidate.ties[e.name], "lower": None, "upper": None, "nominal": None, "sd": None, "mean": None,
                "prior": None, "prior_name": None,
            }
        )
        for e in file.parameter
    ]  # fmt: skip
    changed = file.model_copy(update={"parameter": tuple(entries), "candidate": (), "candidates": None})
    changed._given = replace(file.given, model=study.built)
    place = file.where("candidate", number, "ties")
    try:
        tied = solved_by(load_study(changed), direct)
    except FemtuneError as error:
        # the parameter itself is right in the study
        error.where = place
        raise
    with errors_at(place):
        tied.problem()
        method_of(tied.file.update, tied.parameters)
    return tied


def _results(
    study: Study,
    table: CandidatesTable,
    candidates: Sequence[ParameterChoice],
    calibrations: Sequence[Found],
    predicted: Sequence[Mapping[int, Found]],
    sampled: Sequence[Found],
    arrays: dict[str, Reals],
) -> CandidatesResults:
    solved = [i for i, f in enumerate(calibrations) if "problem" not in f]
    free, scatter = study.parameters, study.file.residuals.scatter
    inner = [[calibrations[j] for j in solved if _contains(candidates[i], candidates[j])] for i in solved]
    ranking = rank_candidates(
        [_fit(calibrations[i], free, within) for i, within in zip(solved, inner)],
        scatter=scatter, threshold=table.threshold,
        probability=table.probability, cluster_distance=table.cluster_distance,
    )  # fmt: skip
    names = [case.name for case in study.problem().cases]
    logs = np.array([sampled[i].get("log_evidence", np.nan) for i in solved])
    by_sample = evidence_weights(np.where(ranking.comparable, logs, np.nan))
    records = []
    for i, (candidate, f, out) in enumerate(zip(candidates, calibrations, predicted, strict=True)):
        record = _record(study, candidate, f, table.starts)
        if i in solved:
            least = min(map(_least_of, inner[solved.index(i)]))
            record = record.model_copy(
                update={
                    "least_worst_residual": least,
                    **_left_out(names, out),
                    **_criteria(ranking, solved.index(i)),
                    **_of_samples(sampled[i], float(by_sample[solved.index(i)])),
                }
            )
        records.append(record)
    arrays["candidates/distances"] = ranking.distances
    return CandidatesResults(
        candidates=tuple(records),
        scatter=scatter,
        size=ranking.size,
        limit=ranking.limit,
        threshold=table.threshold,
        probability=table.probability,
        cluster_distance=table.cluster_distance,
        distances_key="candidates/distances",
        sentences=tuple(_sentences(records)),
        alerts=tuple(_alerts(study, records)),
    )


def _of_samples(sampled: Found, probability: float) -> dict[str, Any]:
    if "log_evidence" not in sampled:
        return {"not_sampled": sampled.get("problem", "")}
    return {
        "sampled_log_evidence": sampled["log_evidence"], "sampled_log_evidence_sd": sampled["sd"],
        "sampled_effective": sampled["effective"], "sampled_k_hat": sampled["k_hat"],
        "sampled_probability": probability if np.isfinite(probability) else None,
        "left_out_evidence": tuple(LeftOutEvidence(**one) for one in sampled["left_out"]),
        "left_out_trusted": all(one["k_hat"] is not None and one["k_hat"] <= LARGEST_K for one in sampled["left_out"]),
    }  # fmt: skip


def _contains(one: ParameterChoice, other: ParameterChoice) -> bool:
    """Whether every model of the other candidate is one of the first, which has the same ties and all parameters."""
    return set(other.parameters) <= set(one.parameters) and dict(other.ties) == dict(one.ties)


def _least_of(calibration: Found) -> float:
    """Smallest largest residual that was found; initial values have one only."""
    return float(calibration["least_worst"] if "least_worst" in calibration else calibration["worst"])


def _fit(calibration: Found, parameters: ParameterSet, within: Sequence[Found]) -> CandidateFit:
    """`within` are the candidate and those that it contains: what one of them reaches, the candidate reaches too."""
    place = np.array([calibration["values"][p.name] / p.scale for p in parameters.free])
    moving = len(calibration["slope"])
    slope, lower, upper, mean = (np.array(calibration[key], float) for key in ("slope", "lower", "upper", "prior_mean"))
    sd = np.array([np.inf if s is None else s for s in calibration["prior_sd"]], float)
    linear = LinearFit(np.array(calibration["curvature"], float).reshape(moving, moving), slope, lower, upper, mean, sd)
    return CandidateFit(
        calibration["chi2"], calibration["residuals"], calibration["rank"], linear,
        place, min(map(_least_of, within)), min(f["error"] for f in within),
    )  # fmt: skip


def _record(study: Study, candidate: ParameterChoice, calibration: Found, starts: int) -> CandidateResults:
    facts: dict[str, Any] = {
        "name": candidate.name, "parameters": candidate.parameters, "ties": dict(candidate.ties),
        "note": candidate.note, "status": calibration.get("status", ""), "problem": calibration.get("problem", ""),
    }  # fmt: skip
    if facts["problem"]:
        return CandidateResults(**facts)
    values = tuple(
        CandidateValue(
            parameter=name,
            value=calibration["values"][name],
            sd=calibration.get("sd", {}).get(name),
            role=_role(study, candidate, name),
            at_bound=name in calibration.get("at_bound", ()),
        )
        for name in study.parameters.names
    )
    return CandidateResults(
        **facts, values=values, error_percent=100.0 * calibration["error"], chi2=calibration["chi2"],
        residuals=calibration["residuals"], rank=calibration["rank"],
        undetermined=tuple(CombinationRecord.model_validate(c) for c in calibration["undetermined"]),
        worst_residual=calibration["worst"], worst_label=calibration["worst_label"],
        starts=starts if candidate.parameters else 1, starts_at_best=calibration.get("reached", 1),
        starts_unpaired=calibration.get("unpaired", 0),
        start_errors_percent=tuple(100.0 * error for error in calibration.get("errors", ())),
        other_optima=calibration.get("others", 0),
    )  # fmt: skip


def _role(study: Study, candidate: ParameterChoice, name: str) -> str:
    if name in candidate.parameters:
        return "updated"
    free = study.parameters.names.index(name) if name in study.parameters.names else None
    follows = name in candidate.ties or (free is not None and not study.parameters.parameters[free].free)
    return "tied" if follows else "initial value"


def _left_out(names: Sequence[str], out: Mapping[int, Found]) -> dict[str, Any]:
    entries = tuple(
        LeftOutPrediction(configuration=names[j], error_percent=None, reason=f["problem"])
        if "problem" in f
        else LeftOutPrediction(
            configuration=names[j], error_percent=100.0 * float(np.sqrt(f["squares"] / f["weights"]))
        )
        for j, f in sorted(out.items())
    )
    if not entries or any(e.error_percent is None for e in entries):
        return {"left_out": entries}
    squares, weights = (sum(f[key] for f in out.values()) for key in ("squares", "weights"))
    return {"left_out": entries, "prediction_percent": 100.0 * float(np.sqrt(squares / weights))}


def _criteria(ranking: CandidateRanking, row: int) -> dict[str, Any]:
    def number(values: Reals) -> float | None:
        return float(values[row]) if np.isfinite(values[row]) else None

    return {
        "bic": number(ranking.bic), "bic_weight": number(ranking.bic_weights),
        "log_evidence": number(ranking.log_evidence), "probability": number(ranking.probabilities),
        "admissible": bool(ranking.admissible[row]), "cluster": int(ranking.clusters[row]) or None,
    }  # fmt: skip


def _sentences(records: Sequence[CandidateResults]) -> Iterator[str]:
    """What the criteria say, and where they differ."""
    solved = [c for c in records if not c.problem]
    least = min(solved, key=lambda c: c.chi2 or 0.0)
    yield f"{least.name} has the smallest residuals: its weighted mean error is {least.error_percent:.3g} %."
    ranked = [c for c in solved if c.bic is not None]
    by_bic = min(ranked, key=lambda c: c.bic or 0.0)
    by_evidence = max(ranked, key=log_evidence_or_least)
    yield (
        f"BIC prefers {by_bic.name} (weight {by_bic.bic_weight:.2g}), the evidence {by_evidence.name} "
        f"(probability {by_evidence.probability or 0.0:.2g})."
    )
    sampled = [c for c in ranked if c.sampled_probability is not None]
    if sampled:
        first = max(sampled, key=lambda c: c.sampled_log_evidence or 0.0)
        yield (
            f"The sampled evidence prefers {first.name} (probability {first.sampled_probability:.2g}, ln Z = "
            f"{first.sampled_log_evidence:.2f} ± {first.sampled_log_evidence_sd:.2f})."
        )
    whole = [c for c in sampled if c.left_out_evidence]
    sure = [c for c in whole if c.left_out_trusted]
    if sure:
        best = max(sure, key=_predicted_density)
        yield (
            f"Of {listed([c.name for c in sure])}, the samples of {best.name} predict configurations that are left out "
            f"best: the sum of the logarithms of their densities is {_predicted_density(best):.1f}."
        )
    unsure = [c.name for c in whole if c not in sure]
    if unsure:
        yield (
            f"The samples of {listed(unsure)} do not tell how well a configuration is predicted that is left out (k̂ "
            f"above {LARGEST_K}): each one moves the parameters too far."
        )
    tested = [c for c in solved if c.prediction_percent is not None]
    if tested:
        best = min(tested, key=lambda c: c.prediction_percent or 0.0)
        yield (
            f"{best.name} predicts configurations that were left out best: its mean error is "
            f"{best.prediction_percent:.3g} %."
        )
    admissible = [c for c in solved if c.admissible]
    if admissible:
        clusters = len({c.cluster for c in admissible})
        yield (
            f"{len(admissible)} of {len(solved)} models are admissible: {listed([c.name for c in admissible])}, in "
            f"{clusters} {'cluster' if clusters == 1 else 'clusters'} of similar parameters."
        )
    else:
        yield "No model is admissible: each has a residual that is larger than its standard deviation explains."
    vague = [c.name for c in solved if c.undetermined]
    if vague:
        yield f"The data leave combinations of parameters undetermined in {listed(vague)}."


def _predicted_density(candidate: CandidateResults) -> float:
    return sum(one.log_density for one in candidate.left_out_evidence)


_DOUBTFUL = 1.0
"""Error of the logarithm of the evidence of linear residuals that is told: a factor of 2.7."""


def _linear_alerts(records: Sequence[CandidateResults], scatter: Scatter) -> Iterator[Alert]:
    """Candidates whose linear evidence differs from the sampled one, beside that of the best; and those without one."""
    both = [c for c in records if c.sampled_probability is not None and c.log_evidence is not None]
    # with estimated scatter the linear evidence takes one size of the errors for all, the samples each their own
    if both and scatter == "stated":
        best = max(both, key=lambda c: c.sampled_log_evidence or 0.0)

        def off(c: CandidateResults) -> float:
            of_samples = (c.sampled_log_evidence or 0.0) - (best.sampled_log_evidence or 0.0)
            return (c.log_evidence or 0.0) - (best.log_evidence or 0.0) - of_samples

        wrong = {c.name: off(c) for c in both if abs(off(c)) > _DOUBTFUL}
        if wrong:
            errors = listed([f"{name} ({error:+.1f})" for name, error in wrong.items()])
            yield alert("warning", "candidates.linear-evidence", best=best.name, errors=errors)
    for c in records:
        if c.not_sampled:
            yield alert("warning", "candidates.not-sampled", name=c.name, reason=c.not_sampled)


def _alerts(study: Study, records: Sequence[CandidateResults]) -> Iterator[Alert]:
    solved = [c for c in records if not c.problem]
    for c in records:
        if c.problem:
            yield alert("problem", "candidates.failed", name=c.name, reason=c.problem)
        elif c.bic is None:
            yield alert("warning", "candidates.other-residuals", name=c.name, residuals=c.residuals)
        elif not Status[c.status].ok:
            yield alert("warning", "candidates.not-converged", name=c.name, status=c.status)
        if c.bic is not None and c.log_evidence is None:
            yield alert("warning", "candidates.no-evidence", name=c.name)
        if c.other_optima:
            yield alert("warning", "candidates.not-unique", name=c.name, others=c.other_optima)
    worst = sorted({c.name for c in solved if any(v.at_bound for v in c.values)})
    if worst:
        yield alert("warning", "candidates.at-bound", names=listed(worst))
    yield from _linear_alerts(records, study.file.residuals.scatter)
    if study.file.reduction is not None:
        yield alert("info", "candidates.full-model")
