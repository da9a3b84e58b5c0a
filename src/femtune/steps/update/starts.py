"""The update of a study from many starts: each result is written as soon as it is known and reused later."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import HISTORY_FILE, STARTS_FILE
from femtune.model import digest
from femtune.status import Status
from femtune.steps.run_folder import unwritable
from femtune.steps.update.facts.reduction import reduction_results
from femtune.steps.update.on_reduced_model import TrainingProgress
from femtune.study.executor import executor_of
from femtune.study.stages import reduction_rules
from femtune.study.update_method import start_rules
from femtune.updating import (
    Sample,
    StartResult,
    multi_start,
    multi_start_reduced,
)

if TYPE_CHECKING:
    from femtune.parameters import ParameterSet
    from femtune.residuals import Evaluation
    from femtune.steps.update.record.reduction import ReductionResults
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import (
        Iteration,
        MultiStart,
        ReducedSearch,
        SensitivityMethod,
    )


@dataclass(eq=False)
class Starts:
    """The file of one run: a line that says what it is of, then one for every sample and every try of every start."""

    folder: Path
    key: str
    known: dict[tuple[int, int], StartResult] = field(default_factory=dict)
    samples: dict[int, Sample] = field(default_factory=dict)

    @property
    def _file(self) -> FinishedRuns:
        return FinishedRuns(self.folder / STARTS_FILE, self.key)

    def begin(self, resume: bool) -> None:
        """Take over what an earlier run of the same left; an empty file otherwise (error ``run.unwritable``)."""
        try:
            entries = list(_entries(self._file.begin(resume)))
        except OSError as error:
            raise unwritable(self.folder, error) from error
        self.known = {(start.number, start.tries): start for start in entries if isinstance(start, StartResult)}
        self.samples = {sample.number: sample for sample in entries if isinstance(sample, Sample)}

    def add(self, entry: StartResult | Sample) -> None:
        """A line for an end or a sample (error ``run.unwritable``)."""
        try:
            self._file.add(_line(entry) if isinstance(entry, StartResult) else _of_sample(entry))
        except OSError as error:
            raise unwritable(self.folder, error) from error


def _line(s: StartResult) -> dict[str, object]:
    objective = s.objective if np.isfinite(s.objective) else None
    return {
        "number": s.number, "tries": s.tries, "start": s.start.tolist(), "end": s.end.tolist(), "objective": objective,
        "status": None if s.status is None else s.status.name, "iterations": s.iterations, "problem": s.problem,
        "residuals": s.residuals, "tests": [sorted(tests) for tests in s.tests],
    }  # fmt: skip


def _of_sample(s: Sample) -> dict[str, object]:
    objective = s.objective if np.isfinite(s.objective) else None
    return {"sample": s.number, "x": s.x.tolist(), "objective": objective, "residuals": s.residuals}


def _entries(lines: Iterable[Mapping[str, object]]) -> Iterator[StartResult | Sample]:
    """What the lines hold; what cannot be read is found again."""
    for line in lines:
        try:
            yield _sample(line) if "sample" in line else _start(line)
        except (ValueError, KeyError, TypeError):
            return


def _sample(line: Mapping[str, object]) -> Sample:
    value = line["objective"]
    objective = np.nan if value is None else float(str(value))
    return Sample(int(str(line["sample"])), np.array(line["x"], float), objective, int(str(line["residuals"])))


def _start(line: Mapping[str, object]) -> StartResult:
    objective, status = line["objective"], line["status"]
    return StartResult(
        number=int(str(line["number"])),
        start=np.array(line["start"], float),
        end=np.array(line["end"], float),
        objective=np.nan if objective is None else float(str(objective)),
        status=None if status is None else Status[str(status)],
        tries=int(str(line["tries"])),
        iterations=int(str(line["iterations"])),
        problem=str(line["problem"]),
        residuals=int(str(line["residuals"])),
        tests=tuple(frozenset(tests) for tests in line["tests"]),  # type: ignore[attr-defined]
    )


def find_from_starts(
    study: Study, method: SensitivityMethod, folder: Path, at: Evaluation, progress: Progress
) -> tuple[MultiStart, ReductionResults | None, ReducedSearch | None]:
    """The parameters from many starts, how reduced models did where there are some, and these models."""
    table, rules, problem = study.file.update, start_rules(study.file.update), study.problem()
    starts = Starts(folder, _key(study, at))
    starts.begin(study.file.study.journal)
    tell = _teller(starts, progress, rules.count)
    limits = reduction_rules(study)
    if limits is None:
        searches = multi_start(
            problem, method, rules, nominal=at, known=starts.known, report=tell, executor=executor_of(study),
            sampled=starts.samples, report_sample=_sample_teller(starts, progress, rules.samples),
        )  # fmt: skip
        return searches, None, None
    told = TrainingProgress(progress, limits.full_solutions)
    told.begin(case.name for case in problem.cases)
    reduced = multi_start_reduced(
        problem, method, limits, rules, equation_error=table.first == "equation-error", nominal=at,
        known=starts.known, report=tell, executor=executor_of(study, reduced=True), sampled=starts.samples,
        report_sample=_sample_teller(starts, progress, rules.samples), told=told,
    )  # fmt: skip
    return reduced.starts, reduction_results(reduced.update, limits), reduced.update.search


def _teller(starts: Starts, progress: Progress, count: int) -> Callable[[StartResult], None]:
    ends = {start.number for start in starts.known.values()}

    def tell(start: StartResult) -> None:
        # kept before it is shown: whoever shows it may be interrupted
        starts.add(start)
        ends.add(start.number)
        progress.step("starts that have ended", len(ends), count)

    return tell


def _sample_teller(starts: Starts, progress: Progress, count: int) -> Callable[[Sample], None]:
    done = {sample.number for sample in starts.samples.values()}

    def tell(sample: Sample) -> None:
        starts.add(sample)
        done.add(sample.number)
        progress.step("samples of the objective", len(done), count)

    return tell


def _key(study: Study, at: Evaluation) -> str:
    """Of all that starts depend on: what is compared and how it answers, the bounds, and [update] and [reduction]."""
    reduction = study.file.reduction
    tables = study.file.update.model_dump_json() + ("" if reduction is None else reduction.model_dump_json())
    tables += "".join(component.model_dump_json() for component in study.file.component)
    lower, upper = study.parameters.bounds
    return digest(tables, at.residuals, at.jacobian, lower, upper)


@dataclass(frozen=True)
class History:
    """The file of one run; `begin` removes that of an earlier run."""

    folder: Path
    parameters: ParameterSet

    @property
    def path(self) -> Path:
        """The file."""
        return self.folder / HISTORY_FILE

    def begin(self) -> None:
        """An empty file (error ``run.unwritable``)."""
        try:
            # removed first: a link of this name must not lead the lines into another file
            self.path.unlink(missing_ok=True)
            self.path.touch(exist_ok=False)
        except OSError as error:
            raise unwritable(self.folder, error) from error

    def add(self, iteration: Iteration) -> None:
        """A line for an iteration (error ``run.unwritable``)."""
        line = {
            "iteration": iteration.number,
            "mean_error": iteration.mean_error,
            "objective": iteration.objective,
            "parameters": self.parameters.values(iteration.x),
            "at_bound": iteration.at_bound,
            "events": [*iteration.events, *filter(None, [iteration.better_minimum])],
        }
        try:
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(line, ensure_ascii=False) + "\n")
        except OSError as error:
            raise unwritable(self.folder, error) from error
