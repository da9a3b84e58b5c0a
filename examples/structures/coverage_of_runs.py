"""How often intervals of the parameters of a model of runs contain the truth: six frequencies, three parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.dofs import Dof, DofSet
from femtune.fem import NodeTable
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.model.imported.from_runs import Runs, fit_runs
from femtune.model.imported.model import field_of_variable
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase, FrequencyResidual, PairingRules, UpdateProblem
from femtune.updating import update

NAMES = ("a", "b", "c")
NOISE = 0.003
_NONE = NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


def frequencies(p: np.ndarray) -> np.ndarray:
    """A chain of six masses to ground whose springs depend on three parameters, two of them not linearly."""
    s = 1e4 * np.array([p[0], p[1] ** 3, p[0] * p[2], p[2], p[1], 2.0 * p[2]])
    K = np.diag(s + np.append(s[1:], 0.0)) - np.diag(s[1:], 1) - np.diag(s[1:], -1)
    return np.sqrt(la.eigvalsh(K, np.diag([2.0, 1.0, 1.5, 0.5, 1.0, 2.0]))) / (2 * np.pi)


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


def coverage(runs: int, specimens: int, seed: int = 1, correlation: str | None = None) -> RunsCoverage:
    """How many 90 % intervals contain the truth.

    Parameters
    ----------
    runs : in the table, within 20 % of the nominal values
    specimens : whose parameters lie within 12 %, and whose frequencies are measured with noise
    correlation : of Kriging with a quadratic trend; None: polynomials of degree three
    """
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.8, 1.2, (runs, 3))
    hz = np.array([frequencies(p) for p in points])
    degree = 3 if correlation is None else 2
    fitted = fit_runs(Runs(NAMES, points, hz), _NONE, degree, crossed=True, correlation=correlation)
    parameters = ParameterSet(tuple(Parameter(name, 1.0, 0.5, 1.5) for name in NAMES))
    model = parametric_model(
        fitted.structure, parameters, [Assignment(name, field_of_variable(name), relative=False) for name in NAMES]
    )
    configured = configure(model, Configuration("runs"))
    dofs = DofSet(Dof(int(node), "S") for node in fitted.structure.nodes.scalar_points)
    hits = np.zeros(3, int)
    for _ in range(specimens):
        truth = rng.uniform(0.88, 1.12, 3)
        measured = frequencies(truth) * (1.0 + NOISE * rng.standard_normal(6))
        test = ModeSet(measured, np.eye(6), dofs, source="simulated")
        case = ComparedCase(configured, test, configured.transformation, count=6, rules=PairingRules(0.9))
        result = update(UpdateProblem((case,), parameters, (FrequencyResidual(NOISE),)))
        sd = np.sqrt(np.diag(result.covariance.without_bounds))
        hits += np.abs(result.x - (truth - 1.0)) < 1.6449 * sd
    return RunsCoverage(hits, specimens, np.sqrt(np.mean(fitted.error**2, axis=0)))
