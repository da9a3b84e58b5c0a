"""How often intervals of the parameters of a model of runs contain the truth: six frequencies, three parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.optimize import least_squares

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.fem import NodeTable
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.model.imported.from_runs import Runs, fit_runs
from femtune.model.imported.model import field_of_variable
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, PairingRules, UpdateProblem
from femtune.surrogates import SurrogateRules
from femtune.updating import update

NAMES = ("a", "b", "c")
NOISE = 0.003
_MASSES = [2.0, 1.0, 1.5, 0.5, 1.0, 2.0]
_WIDE = 1.6449
"""Half width of 90 % of the normal distribution."""
_NONE = NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


Springs = Callable[[Reals, Reals, Reals], list[Reals]]


def ambiguous(a: Reals, b: Reals, c: Reals) -> list[Reals]:
    """Springs whose frequencies may belong to two sets of parameters: one with stiff b and soft c, and the reverse."""
    return [a, b**3, a * c, c, b, 2.0 * c]


def unique(a: Reals, b: Reals, c: Reals) -> list[Reals]:
    """Springs whose frequencies belong to one set of parameters."""
    return [a, a, b**3, b, a * c, c]


def frequencies(p: Reals, springs: Springs) -> Reals:
    """(6,) of a chain of six masses to ground whose springs depend on three parameters, some of them not linearly."""
    return _modes(p, springs)[0]


def _modes(p: Reals, springs: Springs) -> tuple[Reals, Reals]:
    """Frequencies, and shapes of unit modal mass."""
    s = 1e4 * np.array(springs(*p))
    K = np.diag(s + np.append(s[1:], 0.0)) - np.diag(s[1:], 1) - np.diag(s[1:], -1)
    values, shapes = la.eigh(K, np.diag(_MASSES))
    return np.sqrt(values) / (2 * np.pi), shapes


def slopes(p: Reals, springs: Springs) -> Reals:
    """(6, 3) derivatives of the frequencies."""
    hz, shapes = _modes(p, springs)
    stretched = np.diff(shapes, axis=0, prepend=0.0) ** 2
    changes = [1e4 * np.array(springs(*(p + 1e-30j * e))).imag / 1e-30 for e in np.eye(3)]
    return np.asarray((stretched.T @ np.transpose(changes)) / (8.0 * np.pi**2 * hz[:, None]))


@dataclass(frozen=True)
class RunsCoverage:
    """What was found.

    Parameters
    ----------
    hits : (3,) number of 90 % intervals of each parameter that contain the truth
    specimens : number of intervals of each
    error : (6,) standard deviation of the relative errors of each frequency, a run being left out
    """

    hits: np.ndarray
    specimens: int
    error: np.ndarray

    @property
    def share(self) -> float:
        """Of all intervals."""
        return float(self.hits.sum()) / (3 * self.specimens)


def _specimens(count: int, rng: np.random.Generator, springs: Springs) -> Iterator[tuple[Reals, Reals]]:
    """True parameters within 12 %, and frequencies measured with noise."""
    for _ in range(count):
        truth = rng.uniform(0.88, 1.12, 3)
        yield truth, frequencies(truth, springs) * (1.0 + NOISE * rng.standard_normal(6))


def coverage(
    runs: int, specimens: int, seed: int = 1, rules: SurrogateRules | None = None, springs: Springs = unique
) -> RunsCoverage:
    """How many 90 % intervals contain the truth.

    Parameters
    ----------
    runs : in the table, within 20 % of the nominal values
    specimens : whose parameters lie within 12 %, and whose frequencies are measured with noise
    seed : of points and specimens
    rules : of surrogates; None: polynomials of degree three
    """
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.8, 1.2, (runs, 3))
    hz = np.array([frequencies(p, springs) for p in points])
    fitted = fit_runs(Runs(NAMES, points, hz), _NONE, 3, crossed=True, rules=rules)
    parameters = ParameterSet(tuple(Parameter(name, 1.0, 0.5, 1.5) for name in NAMES))
    model = parametric_model(
        fitted.structure, parameters, [Assignment(name, field_of_variable(name), relative=False) for name in NAMES]
    )
    configured = configure(model, Configuration("runs"))
    dofs = DofSet(Dof(int(node), "S") for node in fitted.structure.nodes.scalar_points)
    hits = np.zeros(3, int)
    for truth, measured in _specimens(specimens, rng, springs):
        test = ModeSet(measured, np.eye(6), dofs, source="simulated")
        case = ComparedCase(configured, test, configured.transformation, count=6, rules=PairingRules(0.9))
        result = update(UpdateProblem((case,), parameters, (FrequencyResidual(NOISE),)))
        sd = np.sqrt(np.diag(result.covariance.without_bounds))
        hits += np.abs(result.x - (truth - 1.0)) < _WIDE * sd
    return RunsCoverage(hits, specimens, np.sqrt(np.mean(fitted.error**2, axis=0)))


@dataclass(frozen=True)
class ExactCoverage:
    """The same specimens without a table: the chain itself, fitted by SciPy.

    Parameters
    ----------
    hits, hits_from_truth : (3,) intervals that contain the truth, with the nominal and the true values as start
    local : number of specimens where the nominal values lead to a worse minimum than the true ones
    other : number of specimens where they lead to a better one, further away from the truth
    specimens : number
    """

    hits: np.ndarray
    hits_from_truth: np.ndarray
    local: int
    other: int
    specimens: int


def exact_coverage(runs: int, specimens: int, seed: int = 1, springs: Springs = unique) -> ExactCoverage:
    """What the intervals of the chain itself contain, for the specimens of `coverage`."""
    rng = np.random.default_rng(seed)
    rng.uniform(0.8, 1.2, (runs, 3))
    hits, chi2 = np.zeros((2, 3), int), np.zeros((specimens, 2))
    for i, (truth, measured) in enumerate(_specimens(specimens, rng, springs)):
        sd = NOISE * measured
        for j, start in enumerate((np.ones(3), truth)):
            found = least_squares(
                lambda p: (frequencies(p, springs) - measured) / sd,  # noqa: B023
                start,
                lambda p: slopes(p, springs) / sd[:, None],  # noqa: B023
                bounds=(0.5, 1.5),
                x_scale=0.01,
            )
            wide = _WIDE * np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
            hits[j] += np.abs(found.x - truth) < wide
            chi2[i, j] = 2.0 * found.cost
    gain = chi2[:, 0] - chi2[:, 1]
    return ExactCoverage(hits[0], hits[1], int(np.sum(gain > 0.01)), int(np.sum(gain < -0.01)), specimens)
