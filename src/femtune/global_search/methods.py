"""Search of the whole box for the minimum of an objective: differential evolution, a genetic algorithm, CMA-ES.

The objective takes all points of a generation at once, (k, n) → (k,). What cannot be computed is infinite. Each method
has a random generator of its own seed, and keeps the best value after every generation: the picture of its convergence.

Sources: Storn and Price 1997 (differential evolution, as in SciPy); Deb and Agrawal 1995, Deb 2001 (simulated binary
crossover, polynomial mutation); Hansen and Ostermeier 2001 (CMA-ES, as in the library cma).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import differential_evolution

from femtune._optional import require
from femtune.arrays import Flags, Reals
from femtune.global_search.kinds import METHODS, SearchWord

Objective = Callable[[Reals], Reals]

_CROSSOVER_INDEX = 15.0
"""Distribution index of simulated binary crossover: the larger, the nearer children are to their parents (Deb 2001)."""
_MUTATION_INDEX = 20.0
"""Distribution index of polynomial mutation, likewise."""
_ELITE = 2
"""Best points that pass to the next generation unchanged."""


@dataclass(frozen=True)
class SearchRules:
    """How the box is searched.

    Parameters
    ----------
    method : differential-evolution, genetic, cma-es
    population : points of a generation
    generations : the most
    tolerance : the search ends where the objectives of a generation differ by less than this part of their mean
    crossover, mutation : of the genetic algorithm: probability that two parents are crossed, and that a parameter of a
        child is mutated; None: one parameter of each child on average
    seed : of the random generator
    """

    method: SearchWord = "differential-evolution"
    population: int = 60
    generations: int = 300
    tolerance: float = 1e-6
    crossover: float = 0.9
    mutation: float | None = None
    seed: int = 0


@dataclass(frozen=True, eq=False)
class GlobalMinimum:
    """The best point of a search.

    Parameters
    ----------
    x : (n,)
    value : objective there
    history : (g,) best value after each generation, the first of the initial population
    evaluations : (g,) number of evaluations until then
    converged : False if the search ended with the last generation
    """

    x: Reals
    value: float
    history: Reals
    evaluations: Reals
    converged: bool


@dataclass(eq=False)
class _Counted:
    """An objective that remembers the best point, and the best value after each generation."""

    objective: Objective
    x: Reals | None = None
    value: float = np.inf
    count: int = 0
    history: list[float] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def __call__(self, points: Reals) -> Reals:
        values = np.asarray(self.objective(points), dtype=float)
        values = np.where(np.isfinite(values), values, np.inf)
        self.count += len(points)
        best = int(np.argmin(values))
        if self.x is None or values[best] < self.value:
            self.x, self.value = np.array(points[best]), float(values[best])
        self.history.append(self.value)
        self.counts.append(self.count)
        return values

    def result(self, converged: bool) -> GlobalMinimum:
        assert self.x is not None
        return GlobalMinimum(self.x, self.value, np.array(self.history), np.array(self.counts), converged)


def global_minimum(objective: Objective, lower: Reals, upper: Reals, rules: SearchRules | None = None) -> GlobalMinimum:
    """The least value of an objective within bounds that a method finds.

    Raises
    ------
    FemtuneError : ``install.missing`` for cma-es without its library

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.global_search import global_minimum
    >>> found = global_minimum(lambda x: np.sum((x - 0.3) ** 2, axis=1), np.zeros(2), np.ones(2))
    >>> found.x.round(3)
    array([0.3, 0.3])
    """
    rules = rules or SearchRules()
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    counted = _Counted(lambda unit: objective(lower + unit * (upper - lower)))
    search: Callable[[_Counted, int, SearchRules], bool] = METHODS[rules.method].load()
    converged = search(counted, len(lower), rules)
    minimum = counted.result(converged)
    return GlobalMinimum(lower + minimum.x * (upper - lower), *_rest(minimum))


def _rest(minimum: GlobalMinimum) -> tuple[float, Reals, Reals, bool]:
    return minimum.value, minimum.history, minimum.evaluations, minimum.converged


def _spread_is_small(values: Reals, tolerance: float) -> bool:
    return bool(np.isfinite(values).all() and np.std(values) <= tolerance * abs(float(np.mean(values))))


def by_differential_evolution(counted: _Counted, factors: int, rules: SearchRules) -> bool:
    minimum = differential_evolution(
        lambda x: counted(x.T if x.ndim == 2 else x[None]),
        [(0.0, 1.0)] * factors,
        popsize=max(1, round(rules.population / factors)),
        maxiter=rules.generations,
        tol=rules.tolerance,
        rng=np.random.default_rng(rules.seed),
        init="sobol",
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return bool(minimum.success)


def by_genetic_algorithm(counted: _Counted, factors: int, rules: SearchRules) -> bool:
    rng = np.random.default_rng(rules.seed)
    size = 2 * max(_ELITE, round(rules.population / 2))
    points = rng.random((size, factors))
    values = counted(points)
    for _ in range(rules.generations):
        if _spread_is_small(values, rules.tolerance):
            return True
        parents = points[tournament(values, size, rng)]
        children = mutated(crossed(parents, rules.crossover, rng), rules.mutation, rng)
        elite = np.argsort(values, kind="stable")[:_ELITE]
        of_children = counted(children)
        kept = np.argsort(of_children, kind="stable")[: size - _ELITE]
        points = np.vstack([points[elite], children[kept]])
        values = np.concatenate([values[elite], of_children[kept]])
    return False


def tournament(values: Reals, size: int, rng: np.random.Generator) -> Reals:
    """Positions of as many parents: each is the better of two drawn at random."""
    pairs = rng.integers(len(values), size=(size, 2))
    return np.asarray(np.where(values[pairs[:, 0]] <= values[pairs[:, 1]], pairs[:, 0], pairs[:, 1]))


def crossed(parents: Reals, probability: float, rng: np.random.Generator) -> Reals:
    """Children of neighbouring parents, about which they are distributed symmetrically."""
    one, other = parents[0::2], parents[1::2]
    u = rng.random(one.shape)
    power = 1.0 / (_CROSSOVER_INDEX + 1.0)
    spread = np.where(u <= 0.5, (2.0 * u) ** power, (2.0 * (1.0 - u)) ** -power)
    crossed: Flags = (rng.random((len(one), 1)) < probability) & (rng.random(one.shape) < 0.5)
    half = np.where(crossed, 0.5 * spread * (one - other), 0.5 * (one - other))
    middle = 0.5 * (one + other)
    return np.clip(np.concatenate([middle + half, middle - half]), 0.0, 1.0)


def mutated(children: Reals, probability: float | None, rng: np.random.Generator) -> Reals:
    """Children of which some parameters are moved."""
    chance = 1.0 / children.shape[1] if probability is None else probability
    u = rng.random(children.shape)
    power = 1.0 / (_MUTATION_INDEX + 1.0)
    step = np.where(u < 0.5, (2.0 * u) ** power - 1.0, 1.0 - (2.0 * (1.0 - u)) ** power)
    return np.clip(np.where(rng.random(children.shape) < chance, children + step, children), 0.0, 1.0)


def by_cma_es(counted: _Counted, factors: int, rules: SearchRules) -> bool:
    cma = require("cma", extra="search")
    options = {
        "bounds": [0.0, 1.0], "popsize": rules.population, "maxiter": rules.generations,
        "tolfunrel": rules.tolerance, "seed": rules.seed + 1, "verbose": -9,
    }  # fmt: skip
    strategy = cma.CMAEvolutionStrategy(np.full(factors, 0.5), 0.3, options)
    while not strategy.stop():
        points = strategy.ask()
        strategy.tell(points, counted(np.array(points)).tolist())
    return "maxiter" not in strategy.stop()
