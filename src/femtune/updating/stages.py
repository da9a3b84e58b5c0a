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
from scipy.special import chdtri

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.parameters import ParameterSet
from femtune.residuals import Evaluation, UpdateProblem
from femtune.updating.prior import Prior
from femtune.updating.remembered import remembering
from femtune.updating.result import Iteration, UpdateResult
from femtune.updating.sensitivity_method import SensitivityMethod, update

# ----------------------------------------------------------------------------------------------------
# Belief: what is known of the parameters between two updates, and what an update makes of it.
#
# Sources: A. Tarantola, Inverse Problem Theory, 2005, section 3.2; S. F. Schmidt, Application of State-Space Methods
# to Navigation Problems, Advances in Control Systems 3, 1966 (parameters that are not estimated but considered).


_BY_CHANCE, _LEAST_FREEDOM = 0.01, 1e-3


@dataclass(frozen=True, eq=False)
class Belief:
    """Values and covariance of all free parameters.

    Parameters
    ----------
    x : (k,) normalised values
    covariance : (k, k) of x
    found : (k,) parameters that were updated; the others have the values of the study
    """

    parameters: ParameterSet
    x: Reals
    covariance: Reals
    found: NDArray[np.bool_]

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations in the parameters' units."""
        spread = np.sqrt(np.diag(self.covariance)) * self.parameters.scale
        return {p.name: float(s) for p, s in zip(self.parameters.free, spread)}

    @property
    def values(self) -> dict[str, float]:
        """Values of all parameters, tied ones too."""
        return self.parameters.values(self.x)

    def prior(self) -> Prior:
        """The updated parameters as prior of the next update; other parameters keep their priors."""
        at = np.flatnonzero(self.found)
        scale = self.parameters.scale[at]
        names = tuple(self.parameters.free[i].name for i in at)
        covariance = self.covariance[np.ix_(at, at)] * np.outer(scale, scale)
        return Prior(names, self.parameters.denormalise(self.x)[at], covariance)


def first_belief(parameters: ParameterSet) -> Belief:
    """The parameters' own nominal values and priors."""
    k = len(parameters.free)
    return Belief(parameters, np.zeros(k), np.diag(parameters.prior[1] ** 2), np.zeros(k, bool))


@dataclass(frozen=True)
class Misfit:
    """How large the residuals of one kind are beside what noise and uncertain parameters explain.

    Parameters
    ----------
    size : root of the sum of squares over its expectation: about 1
    large : True where chance exceeds it once in a hundred tests of a right model
    """

    size: float
    large: bool


@dataclass(frozen=True)
class Learned:
    """Parameters with covariance after an update, and the agreement of the data by kind of residual."""

    belief: Belief
    misfit: dict[str, Misfit]


def learned(before: Belief, result: UpdateResult) -> Learned:
    """The belief after an update that moved some parameters while the others rested where they were believed to be.

    With residuals r, Jacobian J of all parameters, and rows R of a prior, the update moves by −K r with
    K = (JₘᵀJₘ + RᵀR)⁻¹Jₘᵀ in the rows of what moved and zero in the others. So errors e before become (I − K J)e − K n
    with the noise n of the data: what rests and is uncertain makes what moves uncertain, and correlated with it. Where
    a kind of residual is larger than noise and all these errors explain, its noise counts as so much larger. A
    parameter at a bound counts as resting, and keeps its standard deviation.
    """
    moved = np.isin([p.name for p in before.parameters.free], result.active) & ~_at_bound(result)
    J = result.after.jacobian
    gain = np.zeros(J.T.shape)
    gain[moved] = _gain(J[:, moved], result.side.prior_rows[:, moved])
    turn = np.eye(len(moved)) - gain @ J
    old = turn @ before.covariance @ turn.T
    misfit = _misfit(result, J, gain, old + gain @ gain.T)
    noise = gain * [misfit[kind].size if misfit[kind].large else 1.0 for kind in result.after.kinds]
    covariance = old + noise @ noise.T
    after = Belief(before.parameters, result.x, 0.5 * (covariance + covariance.T), before.found | moved)
    return Learned(after, misfit)


def _at_bound(result: UpdateResult) -> NDArray[np.bool_]:
    return np.isin([p.name for p in result.parameters.free], result.at_bound)


def _gain(J: Reals, prior: Reals) -> Reals:
    """(JᵀJ + RᵀR)⁻¹Jᵀ: pseudo-inverse where the data do not determine everything and no prior does."""
    inverse = np.linalg.pinv(np.vstack([J, prior]), rcond=1e-10)
    return np.asarray(inverse @ inverse.T @ J.T)


def _misfit(result: UpdateResult, J: Reals, gain: Reals, posterior: Reals) -> dict[str, Misfit]:
    """By kind; the residuals' covariance is I + U D Uᵀ with U = [J, Kᵀ] and D = [[P, −I], [−I, 0]], P the posterior."""
    kinds, one = np.asarray(result.after.kinds), -np.eye(len(posterior))
    D = np.block([[posterior, one], [one, np.zeros_like(one)]])
    U = np.hstack([J, gain.T])
    return {
        str(kind): _misfit_of(result.after.residuals[kinds == kind], U[kinds == kind], D, result.after.lost[str(kind)])
        for kind in np.unique(kinds)
    }


def _misfit_of(r: Reals, U: Reals, D: Reals, lost: int) -> Misfit:
    """Sum of squares relative to its mean; its distribution is approximated by χ² with the same mean and variance."""
    product, independent = D @ (U.T @ U), len(r) - lost
    mean = independent + float(np.trace(product))
    if mean < _LEAST_FREEDOM:
        return Misfit(1.0, False)
    freedom = mean**2 / (independent + 2.0 * float(np.trace(product)) + float(np.trace(product @ product)))
    ratio = float(r @ r) / mean
    return Misfit(float(np.sqrt(ratio)), bool(ratio * freedom > chdtri(freedom, _BY_CHANCE)))


Tell = Callable[[str, int, Iteration], None]
"""Called with the stage, the number of the seed (0: results of earlier stages) and each iteration."""

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
    seeds : further initial values of moving parameters by name, in their units; every one is run to its end
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
        """For every run, True if it reaches the best optimum: within a tenth of a standard deviation."""
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
    """All stages; a stage that does not reach an optimum is followed by the next one, from its best point.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, and what the problem of a stage raises where it starts
    """
    results: list[StageResult] = []
    for stage in stages:
        results.append(run_stage(stage, results[-1].belief if results else start, tell))
    return tuple(results)


def run_stage(stage: Stage, start: Belief, tell: Tell) -> StageResult:
    """One stage, from the results of earlier stages and from every seed."""
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
    best = min(runs, key=lambda run: (not run.status.ok, run.objective))
    found = learned(start, best)
    return StageResult(stage, best, tuple(runs), start, found.belief, found.misfit, refused)


def _starts(stage: Stage, start: Belief) -> list[Reals]:
    """The initial values from earlier stages, and with the values of each seed."""
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
