"""Problems with known parameters for coverage studies: do intervals hold the truth as often as they say?

Each problem makes a noisy test of itself from a seed; the noise is Gaussian and of known size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc
from scipy.stats import norm

from femtune.arrays import Reals
from femtune.fem import FieldRef, Structure
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, ShapeResidual, UpdateProblem
from femtune.updating import UpdateResult, update
from structures.frames import bars, make_structure, masses
from structures.springs import factor_model, simulated_case, spring_structure

FREQUENCY_SD, SHAPE_SD = 0.004, 0.02
_SUSPECTED = 0.01
"""Probability of residuals as large by chance."""


@dataclass(frozen=True)
class CoverageProblem:
    """A problem whose truth is known.

    Parameters
    ----------
    truth : values of the parameters by name
    problem : from a seed: the update problem with the noisy test of that seed
    """

    name: str
    truth: dict[str, float]
    problem: Callable[[int], UpdateProblem]


def spring_chain(
    unmodelled: float = 0.0, frequency_sd: float = FREQUENCY_SD, shape_sd: float = SHAPE_SD
) -> CoverageProblem:
    """Six masses and seven springs; four factors by five frequencies and shapes at all masses; known scatter.

    `unmodelled` is a spring from the fourth mass to the ground that the test has and the model lacks, in units of
    the others. `frequency_sd` and `shape_sd` are the standard deviations that are stated, whatever the noise.
    """
    springs = [(-1, 0, 1e4), (0, 1, 1e4), (1, 2, 1e4), (2, 3, 1e4), (3, 4, 1e4), (4, 5, 1e4), (5, -1, 1e4)]
    groups = {"ka": [1, 2], "kb": [3, 4], "kc": [5, 6], "kd": [7]}
    truth = {"ka": 1.15, "kb": 0.85, "kc": 1.05, "kd": 0.7}
    configured = factor_model(spring_structure(springs, [1.0] * 6), groups, (0.3, 2.0))
    hidden = [*springs, (3, -1, 1e4 * unmodelled)] if unmodelled else springs
    real = factor_model(spring_structure(hidden, [1.0] * 6), groups, (0.3, 2.0))
    x = np.array(list(truth.values())) - 1.0
    exact = simulated_case(real, list(x), range(6), 5)
    case = replace(exact, configured=configured, count=6)
    residuals = (FrequencyResidual(frequency_sd), ShapeResidual(shape_sd))

    def problem(seed: int) -> UpdateProblem:
        return UpdateProblem((_noisy(case, seed, SHAPE_SD),), configured.model.parameters, residuals)

    return CoverageProblem("spring chain", truth, problem)


def stepped_cantilever() -> CoverageProblem:
    """A cantilever of two halves with a tip mass; both bending stiffnesses and the mass by five frequencies.

    The scatter is not known: it is estimated from the two residuals that are left.
    """
    truth = {"EIa": 1.1, "EIb": 0.85, "tip": 1.3}
    assignments = [Assignment("EIa" if i <= 5 else "EIb", FieldRef("CBAR", i, "E")) for i in range(1, 11)]
    assignments.append(Assignment("tip", FieldRef("CONM2", 1001, "M")))
    parameters = ParameterSet(tuple(Parameter(name, 1.0, 0.3, 3.0) for name in truth))
    configured = configure(parametric_model(_cantilever(), parameters, assignments), _bending_only(11))
    vertical = [i for i in range(configured.n_free) if configured.free_dof(i).direction == "Y"]
    case = simulated_case(configured, list(np.array(list(truth.values())) - 1.0), vertical, 5)
    # the deviation is given five times too large: as a weight it means nothing
    residuals = (FrequencyResidual(5.0 * FREQUENCY_SD),)

    def problem(seed: int) -> UpdateProblem:
        return UpdateProblem((_noisy(case, seed, 0.0),), parameters, residuals, "estimated")

    return CoverageProblem("stepped cantilever", truth, problem)


def _cantilever() -> Structure:
    """Ten bars along X, 1 m, with a mass at the tip."""
    xyz = np.column_stack([np.linspace(0.0, 1.0, 11), np.zeros((11, 2))])
    pairs = np.column_stack([np.arange(10), np.arange(1, 11)])
    section = {"E": 2.1e11, "G": 8e10, "A": 2e-4, "I1": 1.7e-9, "I2": 6.7e-9, "J": 4e-9, "rho": 7850.0}
    return make_structure(xyz, [bars(pairs, section), masses([10], {"M": 0.3})])


def _bending_only(nodes: int) -> Configuration:
    """Deflection Y and rotation RZ are left of all nodes, nothing of the first."""
    return Configuration(supports_added=((1, "123456"), *((i, "1345") for i in range(2, nodes + 1))))


def _noisy(case: ComparedCase, seed: int, shape_sd: float) -> ComparedCase:
    """The case with noise on its frequencies, relative, and on its shapes of unit norm."""
    rng = np.random.default_rng(seed)
    test: ModeSet = case.test
    freq = test.freq_hz * (1.0 + FREQUENCY_SD * rng.standard_normal(len(test)))
    unit = test.shapes / np.linalg.norm(test.shapes, axis=0)
    shapes = unit + shape_sd * rng.standard_normal(unit.shape)
    return replace(case, test=ModeSet(freq, shapes, test.dofs, source=f"simulated, seed {seed}"))


@dataclass(frozen=True, eq=False)
class CoverageRun:
    """What many updates found.

    Parameters
    ----------
    errors : (tests, parameters) (updated − true)/σ with σ of the linear estimate, bounds left aside
    held : (tests, parameters) whether the 95 % interval contains the true value
    suspected : (tests,) whether a kind of residual is larger than stated deviations explain, at one per cent
    widths : (tests, parameters) of the intervals
    """

    names: tuple[str, ...]
    errors: Reals
    held: NDArray[np.bool_]
    suspected: NDArray[np.bool_]
    widths: Reals

    @property
    def coverage(self) -> Reals:
        """(parameters,) share of the 95 % intervals that hold the truth."""
        return np.asarray(np.mean(self.held, axis=0))

    @property
    def normal_coverage(self) -> Reals:
        """The same if all intervals were ±1.96 σ."""
        return np.asarray(np.mean(np.abs(self.errors) <= norm.ppf(0.975), axis=0))


def run_coverage(problem: CoverageProblem, seeds: Iterable[int]) -> CoverageRun:
    """Update the test of every seed; one that gives no interval (at a bound, not determined) counts as a miss."""
    names = tuple(problem.truth)
    found = [update(problem.problem(seed)) for seed in seeds]
    errors = np.array([[(r.values[n] - problem.truth[n]) / _linear_sd(r, n) for n in names] for r in found])
    held = np.array([[low <= problem.truth[n] <= high for n, (low, high) in _intervals(r, names)] for r in found])
    widths = np.array([[high - low for _, (low, high) in _intervals(r, names)] for r in found])
    return CoverageRun(names, errors, held, np.array([_suspected(r) for r in found]), widths)


def _suspected(result: UpdateResult) -> bool:
    found = result.covariance
    return any(chdtrc(nu, nu * found.misfit[kind] ** 2) < _SUSPECTED for kind, nu in found.freedom.items())


def _linear_sd(result: UpdateResult, name: str) -> float:
    at = [p.name for p in result.parameters.free].index(name)
    return float(np.sqrt(result.covariance.without_bounds[at, at]) * result.parameters.scale[at])


def _intervals(result: UpdateResult, names: Sequence[str]) -> list[tuple[str, tuple[float, float]]]:
    intervals = result.interval()
    return [(name, intervals[name]) for name in names]
