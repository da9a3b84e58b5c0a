"""The update of a study on reduced models, where it asks for them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from femtune.steps.update.facts.reduction import reduction_results
from femtune.steps.update.record.reduction import ReductionResults
from femtune.study.stages import reduction_rules
from femtune.updating import MinimumRules, update_reduced

if TYPE_CHECKING:
    from femtune.model.reduce import Trained
    from femtune.residuals import Evaluation
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import Iteration, ReducedSearch, SensitivityMethod, UpdateResult


@dataclass(eq=False)
class TrainingProgress:
    """Says how far training and searches are, with the time that they may still take.

    `clock` is in seconds; `most` are the full solutions of one configuration that the study allows.
    """

    progress: Progress
    most: int
    clock: Callable[[], float] = time.monotonic
    begun: dict[str, float] = field(default_factory=dict)

    def begin(self, names: Iterable[str]) -> None:
        """Before anything is solved: what it will cost at most."""
        for name in names:
            text = f"reduced model of {name}: at most {self.most} full solutions; computing the first"
            self.progress.step(text, 0, self.most)
        self.begun[""] = self.clock()

    def trained(self, name: str, trained: Trained) -> None:
        """A full solution was made."""
        self._say(name, trained, self._errors(trained))

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """A candidate was estimated."""
        known = trained.estimates[np.isfinite(trained.estimates)]
        far = f", estimate {_percent(float(known.max()))}" if known.size else ""
        self._say(name, trained, f"{self._errors(trained)}{far}, {count} of {len(trained.points)} points evaluated")

    def searched(self, number: int) -> None:
        """A search ended."""
        self.progress.step(f"search {number} has ended; solving the full model at its final point", 0, None)

    def _say(self, name: str, trained: Trained, errors: str) -> None:
        done = len(trained.certified)
        text = f"reduced model of {name}: order {trained.model.order}{errors}{self._time(name, done)}; full solutions"
        self.progress.step(text, done, self.most)

    @staticmethod
    def _errors(trained: Trained) -> str:
        """The true error of the model at the last point, before its modes were taken in."""
        error = trained.certified[-1].error
        return f", worst error at the last point {_percent(error)}" if np.isfinite(error) else ""

    def _time(self, name: str, done: int) -> str:
        """Time of a full solution with the estimates that come with it, and what all that are allowed would take."""
        start = self.begun.setdefault(name, self.begun.get("", self.clock()))
        self.begun[""] = self.clock()
        each = (self.begun[""] - start) / done
        return f", {each:.2g} s a solution, at most {_duration(each * (self.most - done))} more" if each > 0.5 else ""


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def find_on_reduced(
    study: Study,
    method: SensitivityMethod,
    report: Callable[[Iteration], None],
    at: Evaluation,
    progress: Progress,
) -> tuple[UpdateResult, ReductionResults, ReducedSearch | None]:
    """The parameters, how the reduced models did, and these models."""
    rules, problem = reduction_rules(study), study.problem()
    assert rules is not None
    told = TrainingProgress(progress, rules.full_solutions)
    told.begin(case.name for case in problem.cases)
    further = MinimumRules() if study.file.update.look_further else None
    reduced = update_reduced(problem, method, rules, report, at, told, further=further)
    return reduced.result, reduction_results(reduced, rules), reduced.search
