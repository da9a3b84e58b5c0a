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
from femtune.updating.on_reduced_model import NOBODY, ReducedUpdate, ReductionRules, Told, update_reduced
from femtune.updating.prior import Prior
from femtune.updating.regularisation import position
from femtune.updating.remembered import remembering
from femtune.updating.result import Iteration, UpdateResult
from femtune.updating.sensitivity_method import SensitivityMethod, update
from femtune.updating.starts import best_of

# ----------------------------------------------------------------------------------------------------
# Belief: what is known of the parameters between two updates, and what an update makes of it.
#
# Sources: A. Tarantola, Inverse Problem Theory, 2005, section 3.2; S. F. Schmidt, Application of State-Space Methods
# to Navigation Problems, Advances in Control Systems 3, 1966 (parameters that are not estimated but considered).


_SIGNIFICANCE = 0.01
"""Probability by chance of residuals as large, below which they are larger than stated."""
_LEAST_FREEDOM = 1e-3
"""Expected sum of squares below which no residual is left to judge."""


@dataclass(frozen=True, eq=False)
class Belief:
    """Values and covariance of all free parameters.

    Parameters
    ----------
    x : (k,) normalised values
    covariance : (k, k) of x
    found : (k,) parameters that were updated; the others have the values of the study
    given : (k,) parameters that were set by hand since
    """

    parameters: ParameterSet
    x: Reals
    covariance: Reals
    found: NDArray[np.bool_]
    given: NDArray[np.bool_] | None = None

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
        """Parameters with what was updated or set by hand as prior of the next update; others keep their priors."""
        at = np.flatnonzero(self.found if self.given is None else self.found | self.given)
        scale = self.parameters.scale[at]
        names = tuple(self.parameters.free[i].name for i in at)
        covariance = self.covariance[np.ix_(at, at)] * np.outer(scale, scale)
        return Prior(names, self.parameters.denormalise(self.x)[at], covariance)


@dataclass(frozen=True)
class SetByHand:
    """A parameter that gets a value before a stage: the value itself, or what is added to the present one.

    Parameters
    ----------
    sd : standard deviation of the value; None: that of the parameter's prior
    reason : why, for the report
    """

    parameter: str
    value: float | None = None
    add: float | None = None
    sd: float | None = None
    reason: str = ""


def set_by_hand(belief: Belief, values: Sequence[SetByHand]) -> Belief:
    """The belief with values set by hand: what the data of earlier stages said of these parameters is given up.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, ``study.stage`` for a value outside the bounds
    """
    x, covariance, estimated = belief.x.copy(), belief.covariance.copy(), belief.found.copy()
    given = np.zeros(len(x), bool) if belief.given is None else belief.given.copy()
    for one in values:
        i = position(belief.parameters, one.parameter)
        p = belief.parameters.free[i]
        now = float(belief.parameters.denormalise(x)[i])
        value = now + (one.add or 0.0) if one.value is None else one.value
        if not p.lower <= value <= p.upper:
            raise FemtuneError(
                "study.stage/by-hand-outside-bounds",
                values={p.name: value, "lower": p.lower, "upper": p.upper},
                name=p.name,
            )
        x[i] = (value - belief.parameters.nominal[i]) / belief.parameters.scale[i]
        covariance[i], covariance[:, i] = 0.0, 0.0
        covariance[i, i] = ((p.sd if one.sd is None else one.sd) / belief.parameters.scale[i]) ** 2
        estimated[i], given[i] = False, True
    return Belief(belief.parameters, x, covariance, estimated, given)


def first_belief(parameters: ParameterSet) -> Belief:
    """The parameters' own nominal values and priors."""
    k = len(parameters.free)
    return Belief(parameters, np.zeros(k), np.diag(parameters.prior[1] ** 2), np.zeros(k, bool))


@dataclass(frozen=True)
class Misfit:
    """Size of the residuals of one kind relative to what noise and uncertain parameters explain.

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
    given = None if before.given is None else before.given & ~moved
    after = Belief(before.parameters, result.x, 0.5 * (covariance + covariance.T), before.found | moved, given)
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
    return Misfit(float(np.sqrt(ratio)), bool(ratio * freedom > chdtri(freedom, _SIGNIFICANCE)))


Tell = Callable[[str, int, Iteration], None]
"""Called with the stage, the number of the seed (0: results of earlier stages) and each iteration."""

_SAME_OPTIMUM = 0.1
"""Distance in standard deviations within which two ends are one optimum: it changes no conclusion from the result."""


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
    reduction : with it, the updates search on reduced models, which are trained once and certified at every end
    by_hand : values that parameters get before it
    """

    name: str
    parameters: tuple[str, ...]
    problem: Callable[[Reals], UpdateProblem]
    method: SensitivityMethod = field(default_factory=SensitivityMethod)
    prior: bool = True
    seeds: tuple[Mapping[str, float], ...] = ()
    reduction: ReductionRules | None = None
    by_hand: tuple[SetByHand, ...] = ()


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
    """Result of a stage.

    Parameters
    ----------
    best : the update with the smallest objective of those with as many residuals
    runs : the updates from the belief and from every seed, in their order
    refused : why no update could start from a seed, by its number from 1
    earlier : what earlier stages found
    start, belief : before and after, the first with the values that are set by hand
    misfit : by kind, residuals beside what noise and uncertain parameters explain
    reduced : how the reduced models of the best run did; None without reduced models
    """

    stage: Stage
    best: UpdateResult
    runs: tuple[UpdateResult, ...]
    earlier: Belief
    start: Belief
    belief: Belief
    misfit: Mapping[str, Misfit]
    refused: Mapping[int, str] = field(default_factory=dict)
    reduced: ReducedUpdate | None = None

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
    told: Told = NOBODY,
) -> tuple[StageResult, ...]:
    """All stages; a stage that does not reach an optimum is followed by the next one, from its best point.

    Parameters
    ----------
    told : receives the progress of the training of reduced models

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, ``reduce.*``, and what the problem of a stage raises where it starts
    """
    results: list[StageResult] = []
    for stage in stages:
        results.append(run_stage(stage, results[-1].belief if results else start, tell, told))
    return tuple(results)


def run_stage(stage: Stage, start: Belief, tell: Tell, told: Told = NOBODY) -> StageResult:
    """One stage, from the results of earlier stages and from every seed."""
    earlier, start = start, set_by_hand(start, stage.by_hand)
    problem = remembering(stage.problem(start.x))
    method = replace(stage.method, regularisation=start.prior()) if stage.prior else stage.method
    runs: list[UpdateResult] = []
    reduced: list[ReducedUpdate | None] = []
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
        report = partial(tell, stage.name, n)
        if stage.reduction is None:
            reduced.append(None)
            runs.append(update(problem, method, report, at, stage.parameters))
            continue
        # the box of the parameters is that of the stage, so that all seeds go on with the models of the first run
        search = reduced[-1].search if reduced and reduced[-1] is not None else None
        reduced_run = update_reduced(problem, method, stage.reduction, report, at, told, stage.parameters, search)
        reduced.append(reduced_run)
        runs.append(reduced_run.result)
    i = best_of(problem, runs)
    belief = learned(start, runs[i])
    return StageResult(
        stage=stage,
        best=runs[i],
        runs=tuple(runs),
        earlier=earlier,
        start=start,
        belief=belief.belief,
        misfit=belief.misfit,
        refused=refused,
        reduced=reduced[i],
    )


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
    sums: dict[tuple[str, str, str], float] = {}
    for block in at.blocks:
        key = (block.configuration, block.mode, block.kind)
        sums[key] = float(np.hypot(sums.get(key, 0.0), block.error))
    return sums
