"""UpdateProblem: configurations, residuals and parameters; no algorithm in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.correlate import no_pairs
from femtune.errors import FemtuneError
from femtune.parameters import ParameterSet
from femtune.residuals.aligned import AlignedModes, align
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import (
    CaseState,
    Group,
    ModalCase,
    groups_of,
    keep_paired,
    pair_case,
    solve_case,
    track,
)
from femtune.residuals.frequency import frequency_residual
from femtune.residuals.seen import seen_only
from femtune.residuals.shape import mac_residual, shape_difference

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class ResidualRules:
    """What is compared, and how well it is known.

    Parameters
    ----------
    frequency_sd : relative standard deviation of frequencies (of eigenvalues in that form), 0 leaves them out; "test"
        takes the test's own
    shape_sd : standard deviation of the entries of scaled shapes, or of the MAC form; 0 leaves shapes out
    frequency_form : "frequency" or "eigenvalue"
    shape_form : "difference" or "mac"
    shape_scaling : "unit-norm" or "largest-entry", of differences
    """

    frequency_sd: float | Literal["test"] = 0.01
    shape_sd: float = 0.0
    frequency_form: Literal["frequency", "eigenvalue"] = "frequency"
    shape_form: Literal["difference", "mac"] = "difference"
    shape_scaling: Literal["unit-norm", "largest-entry"] = "unit-norm"


@dataclass(frozen=True)
class Evaluation:
    """Residuals at one point, with the states that they were taken at; a Jacobian of no columns without derivatives."""

    x: Reals
    states: tuple[CaseState, ...]
    blocks: tuple[ResidualBlock, ...]
    has_derivatives: bool = True

    @property
    def residuals(self) -> Reals:
        """(n,) all blocks."""
        return np.concatenate([b.values for b in self.blocks]) if self.blocks else np.zeros(0)

    @property
    def jacobian(self) -> Reals:
        """(n, k) all blocks."""
        return np.concatenate([b.jacobian for b in self.blocks]) if self.blocks else np.zeros((0, len(self.x)))

    @property
    def kinds(self) -> list[str]:
        """(n,) kind of each residual."""
        return [b.kind for b in self.blocks for _ in b.values]

    @property
    def objective(self) -> float:
        """½ rᵀr."""
        return 0.5 * float(self.residuals @ self.residuals)

    @property
    def mean_error(self) -> float:
        """√(Σ e²/σ² / Σ 1/σ²) over all comparisons: if every misfit e has one size, this is it."""
        weights = sum(b.sd**-2 for b in self.blocks)
        return float(np.sqrt(2.0 * self.objective / weights)) if weights else float("nan")


@dataclass(frozen=True)
class UpdateProblem:
    """Cases that share parameters, and the rules by which they are compared."""

    cases: tuple[ModalCase, ...]
    parameters: ParameterSet
    rules: ResidualRules = ResidualRules()

    def start(self, x: Reals) -> Evaluation:
        """Solve and pair afresh; errors as of `solved`."""
        return self.assess(x, self.solved(x))

    def solved(self, x: Reals) -> list[CaseState]:
        """States that are paired afresh, without residuals and their derivatives.

        Raises
        ------
        FemtuneError : ``correlate.no-pairs`` where no test mode finds a partner
        """
        states = []
        for case in self.cases:
            solution = solve_case(case, x)
            states.append(CaseState(case, solution, groups_of(pair_case(case, solution))))
        if not any(s.groups for s in states):
            raise _no_pairs(states)
        return states

    def follow(self, x: Reals, before: Evaluation, derivatives: bool = True) -> Evaluation:
        """Solve at another point with the pairing frozen: each motion is tracked, whatever its new number."""
        states = []
        for state in before.states:
            solution = solve_case(state.case, x)
            states.append(CaseState(state.case, solution, track(state.groups, state.solution, solution)))
        return self.assess(x, states, derivatives)

    def pair_again(self, at: Evaluation) -> Evaluation:
        """The same point, paired afresh; modes that were paired stay so unless something better claims the partner.

        What comes back has its derivatives.
        """
        states = []
        for s in at.states:
            fresh = groups_of(pair_case(s.case, s.solution))
            states.append(CaseState(s.case, s.solution, keep_paired(s.groups, fresh)))
        same = all(a.groups == b.groups for a, b in zip(states, at.states))
        return at if same and at.has_derivatives else self.assess(at.x, states)

    def assess(self, x: Reals, states: Sequence[CaseState], derivatives: bool = True) -> Evaluation:
        """Residual blocks of given states; without derivatives, which cost more than the modes, where not wanted."""
        blocks = [b for s in states for group in s.groups for b in self._blocks(s, group, derivatives)]
        return Evaluation(np.asarray(x, dtype=float), tuple(states), tuple(blocks), derivatives)

    def _blocks(self, state: CaseState, group: Group, derivatives: bool) -> list[ResidualBlock]:
        tests, models = group
        case = state.case
        derivative = (case.solver.derivative if derivatives else seen_only)(state.solution, models, case.sensors)
        test = case.test.shapes[:, list(tests)]
        aligned = align(derivative, test)
        out = []
        for a, i in enumerate(tests):
            if self.rules.frequency_sd:
                out.append(self._frequency_block(case, i, aligned, a))
            if self.rules.shape_sd:
                pair = self._shape(aligned.shapes[:, a], aligned.shape_gradients[:, a], test[:, a])
                out.append(ResidualBlock("shape", case.name, case.test.labels[i], *pair, self.rules.shape_sd))
        return out

    def _frequency_block(self, case: ModalCase, i: int, aligned: AlignedModes, a: int) -> ResidualBlock:
        sd = self._frequency_sd(case, i)
        value, gradient = float(aligned.eigenvalues[a]), aligned.eigenvalue_gradients[a]
        pair = frequency_residual(value, gradient, float(case.test.freq_hz[i]), sd, self.rules.frequency_form)
        return ResidualBlock("frequency", case.name, case.test.labels[i], *pair, sd)

    def _shape(self, shape: Reals, gradient: Reals, test: Reals) -> tuple[Reals, Reals]:
        if self.rules.shape_form == "mac":
            return mac_residual(shape, gradient, test, self.rules.shape_sd)
        return shape_difference(shape, gradient, test, self.rules.shape_sd, self.rules.shape_scaling)

    def _frequency_sd(self, case: ModalCase, i: int) -> float:
        if self.rules.frequency_sd != "test":
            return self.rules.frequency_sd
        if case.test.freq_sd_hz is None or not case.test.freq_sd_hz[i] > 0.0:
            raise FemtuneError(
                "residual.no-scatter",
                f"configuration {case.name}: the test gives no scatter for mode {case.test.labels[i]}",
                hint="give frequency_sd a number",
            )
        # λ = ω² scatters twice as much as ω, relatively
        times = 2.0 if self.rules.frequency_form == "eigenvalue" else 1.0
        return times * float(case.test.freq_sd_hz[i] / case.test.freq_hz[i])


def _no_pairs(states: Sequence[CaseState]) -> FemtuneError:
    """The error that no test mode found a partner, for the first configuration that has a test."""
    state = states[0]
    reasons = {u.test: u.reason for u in pair_case(state.case, state.solution).unpaired_test}
    return no_pairs(state.case.test, reasons, f"configuration {state.case.name}")
