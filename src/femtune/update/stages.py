"""Bottom-up updating: stages that run one after another, the posterior of each being the prior of the next.

Source: handbook chapter, section 9 (components first, then joints; mass and stiffness first, damping after, from
several seed values).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, UpdateProblem
from femtune.update.belief import Belief, Misfit, learned
from femtune.update.remembered import remembering
from femtune.update.result import Iteration, UpdateResult
from femtune.update.sensitivity_method import SensitivityMethod, update

Reals = NDArray[np.float64]
Tell = Callable[[str, int, Iteration], None]
"""Called with the stage, the number of the seed (0: the belief itself) and each iteration."""

_SAME_OPTIMUM = 0.1


@dataclass(frozen=True)
class Stage:
    """One stage.

    Parameters
    ----------
    name : of the stage
    parameters : names of those that move; the others rest at what earlier stages believe
    problem : what is compared, made where the stage starts (regions of lines follow the modes found so far)
    method : how; where `prior` holds its regularisation is replaced by the belief of earlier stages
    prior : whether that belief is the prior
    seeds : further start values of moving parameters by name, in their units; every one is run to its end
    """

    name: str
    parameters: tuple[str, ...]
    problem: Callable[[Reals], UpdateProblem]
    method: SensitivityMethod = field(default_factory=SensitivityMethod)
    prior: bool = True
    seeds: tuple[Mapping[str, float], ...] = ()


@dataclass(frozen=True)
class ErrorSum:
    """Misfit of one test mode, or function, by one kind of residual before and after a stage.

    Parameters
    ----------
    before, after : |r|σ, relative to what is compared
    """

    configuration: str
    label: str
    kind: str
    before: float
    after: float


@dataclass(frozen=True)
class StageResult:
    """What a stage found.

    Parameters
    ----------
    best : the update with the smallest objective
    runs : the updates from the belief and from every seed, in their order
    refused : why no update could start from a seed, by its number from 1
    start, belief : before and after
    misfit : by kind, residuals beside what noise and uncertain parameters explain
    """

    stage: Stage
    best: UpdateResult
    runs: tuple[UpdateResult, ...]
    start: Belief
    belief: Belief
    misfit: Mapping[str, Misfit]
    refused: Mapping[int, str] = field(default_factory=dict)

    @property
    def agreed(self) -> tuple[bool, ...]:
        """For every run whether it ends where the best one does: within a tenth of a standard deviation."""
        moved = np.isin([p.name for p in self.belief.parameters.free], self.stage.parameters)
        sd = np.sqrt(np.diag(self.belief.covariance))[moved]
        return tuple(
            bool(run.status.ok and (np.abs(run.x - self.best.x)[moved] <= _SAME_OPTIMUM * sd).all())
            for run in self.runs
        )

    @property
    def error_sums(self) -> tuple[ErrorSum, ...]:
        """Misfits before and after, by configuration, label and kind (the chapter's Figure 29)."""
        before, after = _sums(self.runs[0].before), _sums(self.best.after)
        return tuple(ErrorSum(*key, before[key], after[key]) for key in before if key in after)


def run_stages(
    stages: Sequence[Stage],
    start: Belief,
    tell: Tell = lambda stage, seed, iteration: None,
) -> tuple[StageResult, ...]:
    """All stages; one that does not end at an optimum is followed by the next all the same, from its best point.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, and what the problem of a stage raises where it starts
    """
    results: list[StageResult] = []
    for stage in stages:
        results.append(run_stage(stage, results[-1].belief if results else start, tell))
    return tuple(results)


def run_stage(stage: Stage, start: Belief, tell: Tell) -> StageResult:
    """One stage, from its belief and from every seed."""
    problem = remembering(stage.problem(start.x))
    method = replace(stage.method, regularisation=start.prior()) if stage.prior else stage.method
    runs: list[UpdateResult] = []
    refused: dict[int, str] = {}
    for n, x in enumerate(_starts(stage, start)):
        try:
            at = problem.start(x)
        except FemtuneError as error:
            # a seed far from the truth may pair no mode; the belief itself must
            if not n:
                raise
            refused[n] = error.what
            continue
        runs.append(update(problem, method, partial(tell, stage.name, n), at, stage.parameters))
    best = min(runs, key=lambda run: (not run.status.ok, run.history[-1].objective))
    found = learned(start, best)
    return StageResult(stage, best, tuple(runs), start, found.belief, found.misfit, refused)


def _starts(stage: Stage, start: Belief) -> list[Reals]:
    """The belief, and the belief with the values of each seed."""
    names = [p.name for p in start.parameters.free]
    out = [start.x]
    for seed in stage.seeds:
        values = start.parameters.denormalise(start.x)
        values[[names.index(name) for name in seed]] = list(seed.values())
        out.append(start.parameters.normalise(values))
    return out


def _sums(at: Evaluation) -> dict[tuple[str, str, str], float]:
    found: dict[tuple[str, str, str], float] = {}
    for block in at.blocks:
        key = (block.configuration, block.mode, block.kind)
        found[key] = float(np.hypot(found.get(key, 0.0), block.error))
    return found
