"""Outputs z(θ) of a model and their derivatives, with a count of what they cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.modal.subspace import clusters
from femtune.residuals import CaseState, Evaluation, ResidualRules, UpdateProblem
from femtune.residuals.case import Group

Reals = NDArray[np.float64]


class Outputs(Protocol):
    """What a model predicts for k parameters θ in their own units: m outputs and their sensitivity matrix."""

    def values(self, theta: Reals) -> Reals:
        """z (m,)."""
        ...

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """z (m,) and G = ∂z/∂θ (m, k), at the price of one model solution."""
        ...


@dataclass
class Counted:
    """Outputs whose model solutions are counted; the last point is remembered, so that it is solved once.

    `solutions` is how many there were.
    """

    outputs: Outputs
    solutions: int = 0
    _last: tuple[Reals, Reals, Reals | None] | None = field(default=None, repr=False)

    def values(self, theta: Reals) -> Reals:
        """As of the outputs; ``quantify.not-finite`` where they are no numbers."""
        if self._last is None or not np.array_equal(self._last[0], theta):
            self.solutions += 1
            self._last = (theta.copy(), _finite(self.outputs.values(theta), theta), None)
        return self._last[1]

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """As of the outputs; ``quantify.not-finite`` where they are no numbers."""
        known = self._last
        if known is not None and known[2] is not None and np.array_equal(known[0], theta):
            return known[1], known[2]
        self.solutions += 1
        z, G = self.outputs.linearised(theta)
        self._last = (theta.copy(), _finite(z, theta), _finite(G, theta))
        return z, G


def _finite(a: Reals, theta: Reals) -> Reals:
    if np.isfinite(a).all():
        return a
    raise FemtuneError(
        "quantify.not-finite",
        "the model gives no number at a point of the cloud",
        values={"parameters": ", ".join(f"{t:.6g}" for t in theta)},
        hint="a scatter so wide reaches values without meaning: lower the standard deviations at the start",
    )


@dataclass(frozen=True)
class FunctionOutputs:
    """Outputs of two functions: z(θ) and G(θ)."""

    function: Callable[[Reals], Reals]
    jacobian: Callable[[Reals], Reals]

    def values(self, theta: Reals) -> Reals:
        """z (m,)."""
        return np.asarray(self.function(theta), float)

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """z (m,) and G (m, k)."""
        return self.values(theta), np.asarray(self.jacobian(theta), float)


@dataclass(frozen=True)
class FrequencyOutputs:
    """Frequencies in Hz of the paired modes of an update problem, each motion followed from where it was paired.

    Modes of a close cluster are those of its subspace turned to the test's shapes, which are smooth where the modes
    cross.

    Parameters
    ----------
    problem : its residual rules do not matter, its pairing does
    paired : where the motions are followed from
    """

    problem: UpdateProblem
    paired: Evaluation

    @property
    def labels(self) -> tuple[str, ...]:
        """(m,) configuration and test mode."""
        alone = len(self.problem.cases) == 1
        return tuple(f"{'' if alone else b.configuration + ' '}mode {b.mode}" for b in _frequencies(self.paired))

    @property
    def modes(self) -> tuple[str, ...]:
        """(m,) labels of the test modes."""
        return tuple(b.mode for b in _frequencies(self.paired))

    @property
    def test_hz(self) -> Reals:
        """(m,) the test's own frequencies."""
        return np.array([_test_hz(self.paired, b.configuration, b.mode) for b in _frequencies(self.paired)])

    def values(self, theta: Reals) -> Reals:
        """(m,) Hz."""
        return self._hz(self._at(theta, derivatives=False))

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """(m,) Hz and (m, k) Hz by the unit of each parameter."""
        at = self._at(theta, derivatives=True)
        slopes = np.concatenate([b.jacobian for b in _frequencies(at)])
        return self._hz(at), slopes * self.test_hz[:, None] / self.problem.parameters.scale

    def _at(self, theta: Reals, derivatives: bool) -> Evaluation:
        return self.problem.follow(self.problem.parameters.normalise(theta), self.paired, derivatives)

    def _hz(self, at: Evaluation) -> Reals:
        return np.asarray((np.concatenate([b.values for b in _frequencies(at)]) + 1.0) * self.test_hz)


def frequency_outputs(problem: UpdateProblem, theta: Reals | None = None) -> FrequencyOutputs:
    """Outputs of the modes that are paired at θ, the nominal values where none are given.

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, and what an eigen-solution raises
    """
    cases = tuple(replace(case, residuals=()) for case in problem.cases if len(case.test))
    plain = replace(problem, cases=cases, rules=ResidualRules(frequency_sd=1.0))
    x = np.zeros(len(problem.parameters.free)) if theta is None else problem.parameters.normalise(theta)
    at = plain.start(x)
    return FrequencyOutputs(plain, plain.assess(at.x, [replace(s, groups=_close_together(s)) for s in at.states]))


def _close_together(state: CaseState) -> tuple[Group, ...]:
    """The groups of a state with those of close modes joined, however well each finds its partner here.

    Elsewhere in the cloud they may repeat, where only their subspace can be followed.
    """
    close = {j: n for n, c in enumerate(clusters(state.solution.freq_hz, state.case.rules.relative_gap)) for j in c}
    found: dict[int, tuple[list[int], list[int]]] = {}
    for tests, models in state.groups:
        joined = found.setdefault(close.get(models[0], -1 - models[0]), ([], []))
        joined[0].extend(tests)
        joined[1].extend(models)
    return tuple(sorted((tuple(sorted(t)), tuple(sorted(m))) for t, m in found.values()))


def _frequencies(at: Evaluation) -> list:
    return [b for b in at.blocks if b.kind == "frequency"]


def _test_hz(at: Evaluation, configuration: str, mode: str) -> float:
    case = next(s.case for s in at.states if s.case.name == configuration)
    return float(case.test.freq_hz[case.test.labels.index(mode)])


def second_derivatives(outputs: Counted, theta: Reals, step: Reals) -> tuple[Reals, Reals, Reals]:
    """z (m,), G (m, k) and H = ∂²z/∂θ∂θ (m, k, k), symmetric, by k differences of the sensitivity matrix.

    Parameters
    ----------
    step : (k,) step of each parameter
    """
    z, G = outputs.linearised(theta)
    columns = [(outputs.linearised(theta + h)[1] - G) / s for h, s in zip(np.diag(step), step)]
    H = np.stack(columns, axis=-1)
    return z, G, np.asarray(0.5 * (H + np.swapaxes(H, 1, 2)))
