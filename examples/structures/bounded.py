"""Problems whose data are weak, so that many updates end on bounds, with true values drawn from the prior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import truncnorm

from femtune.arrays import Flags, Reals
from femtune.modal import ModeSet
from femtune.residuals import ShapeResidual, UpdateProblem
from femtune.updating import parameter_covariance
from femtune.updating.covariance import Box
from femtune.updating.truncated import SamplerRules
from structures.springs import factor_model, simulated_case, spring_structure

RULES = SamplerRules(chains=48, least=800, most=60)
_K, _N = 6, 14
_NEAR = 1e-9

Truth = Callable[["BoundedProblem", np.random.Generator], Reals]


def from_prior(problem: BoundedProblem, rng: np.random.Generator) -> Reals:
    """Uniform between the bounds, or normal about zero and truncated to them."""
    if problem.prior_sd is None:
        return rng.uniform(problem.lower, problem.upper, _K)
    ends = problem.lower / problem.prior_sd, problem.upper / problem.prior_sd
    return np.asarray(truncnorm.rvs(*ends, scale=problem.prior_sd, size=_K, random_state=rng))


def first_at(depth: float) -> Truth:
    """The first parameter at a depth above its lower bound, in widths of the bounds; the others from the prior."""

    def truth(problem: BoundedProblem, rng: np.random.Generator) -> Reals:
        x = from_prior(problem, rng)
        x[0] = problem.lower + depth * (problem.upper - problem.lower)
        return x

    return truth


@dataclass(frozen=True)
class BoundedProblem:
    """A linear problem of six changes x of factors 1 + x, with 14 residuals of unit variance and another J every time.

    Parameters
    ----------
    lower, upper : bounds of x
    strength : size of the entries of J; strong data leave few parameters on bounds
    prior_sd : standard deviation of a prior about zero; None for a uniform one
    unknown : whether the variance is estimated from the residuals
    power : the quantity of which intervals are wanted is (1 + x)^power
    """

    name: str
    words: str
    lower: float
    upper: float
    strength: float
    prior_sd: float | None = None
    unknown: bool = False
    power: float = 1.0
    truth: Truth = from_prior


@dataclass(frozen=True, eq=False)
class BoundedTest:
    """One test: whether the intervals hold the truth, the same with bounded parameters as known, and their state."""

    held: Flags
    held_if_known: Flags
    on_bound: Flags
    lowest: float


def bounded_test(problem: BoundedProblem, seed: int) -> BoundedTest:
    """A test with its own J, true values and noise."""
    rng = np.random.default_rng([seed, 7])
    # residuals that see some combinations thirty times better than others
    J = problem.strength * rng.standard_normal((_N, _K)) @ np.diag(np.geomspace(1.0, 0.03, _K)) @ _turn(rng)
    truth = problem.truth(problem, rng)
    r = -J @ truth + rng.standard_normal(_N)
    extra = np.eye(_K) / problem.prior_sd if problem.prior_sd else np.zeros((0, _K))
    low, high = np.full(_K, problem.lower), np.full(_K, problem.upper)
    rows, values = np.vstack([J, extra]), np.concatenate([r, np.zeros(len(extra))])
    x = lsq_linear(rows, -values, bounds=(low, high), method="bvls", tol=1e-14).x
    on_bound = (x <= low + _NEAR) | (x >= high - _NEAR)
    box = Box(x, low, high, extra @ x, np.zeros(_K))
    spread = np.full(_K, (problem.upper - problem.lower) / np.sqrt(12.0))
    found = parameter_covariance(
        r + J @ x, J, ["frequency"] * _N, extra, on_bound, spread, scatter="estimated" if problem.unknown else "stated",
        box=box,
    )  # fmt: skip
    assert found.posterior is not None
    samples = (1.0 + replace(found.posterior, rules=RULES).samples) ** problem.power
    ends = np.quantile(samples, [0.025, 0.975], axis=0)
    wanted = (1.0 + truth) ** problem.power
    half = found.coverage_factor() * np.sqrt(np.diag(found.without_bounds))
    return BoundedTest(
        (ends[0] <= wanted) & (wanted <= ends[1]), np.abs(x - truth) <= half, on_bound, float(ends.min())
    )


def _turn(rng: np.random.Generator) -> Reals:
    """Random orthogonal matrix."""
    return np.linalg.qr(rng.standard_normal((_K, _K)))[0]


PROBLEMS = (
    BoundedProblem(
        "uniform prior", "six factors from 0.5 to 1.5 by 14 residuals, standard deviations stated.", -0.5, 0.5, 10.0
    ),
    BoundedProblem(
        "normal prior", "factors from 0.7 to 1.3 with a prior of standard deviation 0.3 about 1, truncated to the "
        "bounds.", -0.3, 0.3, 4.0, prior_sd=0.3,
    ),
    BoundedProblem(
        "variance estimated", "as the first, with the variance estimated from the residuals.", -0.5, 0.5, 10.0,
        unknown=True,
    ),
    BoundedProblem(
        "positive quantities", "six second moments of area I with factors from 0 to 3; intervals of the thickness "
        "∛I.", -1.0, 2.0, 3.5, power=1.0 / 3.0,
    ),
)  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# A chain of springs by shapes whose entries have standard deviations of their own, as an identification gives them.


@dataclass(frozen=True)
class ShapesProblem:
    """From a seed: true values by name, and the update problem with the noisy test of that seed."""

    names: tuple[str, ...]
    words: str
    problem: Callable[[int], tuple[dict[str, float], UpdateProblem]]


def shapes_with_deviations() -> ShapesProblem:
    """Six masses and seven springs; four factors, uniform from 0.8 to 1.2, by the shapes of three modes alone."""
    springs = [(-1, 0, 1e4), (0, 1, 1e4), (1, 2, 1e4), (2, 3, 1e4), (3, 4, 1e4), (4, 5, 1e4), (5, -1, 1e4)]
    groups = {"ka": [1, 2], "kb": [3, 4], "kc": [5], "kd": [6]}
    configured = factor_model(spring_structure(springs, [1.0] * 6), groups, (0.8, 1.2))
    residual = ShapeResidual("test")

    def problem(seed: int) -> tuple[dict[str, float], UpdateProblem]:
        rng = np.random.default_rng([seed, 11])
        x = rng.uniform(-0.2, 0.2, len(groups))
        exact = simulated_case(configured, list(x), range(6), 3)
        sd = 0.02 * rng.uniform(0.5, 2.0, exact.test.shapes.shape)
        unit = exact.test.shapes / np.linalg.norm(exact.test.shapes, axis=0)
        noisy = unit + sd * rng.standard_normal(unit.shape)
        test = ModeSet(exact.test.freq_hz, noisy, exact.test.dofs, shapes_sd=sd, source=f"simulated, seed {seed}")
        case = replace(exact, configured=configured, count=4, test=test, fixed=tuple((i, i) for i in range(3)))
        truth = {name: 1.0 + float(v) for name, v in zip(groups, x)}
        return truth, UpdateProblem((case,), configured.model.parameters, (residual,))

    return ShapesProblem(
        tuple(groups),
        "four springs from 0.8 to 1.2 by three shapes of six entries, each with its own standard deviation of 0.01 to "
        "0.04 of the norm.",
        problem,
    )
