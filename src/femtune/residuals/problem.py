"""UpdateProblem: configurations, residuals and parameters; no algorithm in it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from femtune.arrays import Reals
from femtune.correlation import no_pairs
from femtune.correlation.unit_factor import unit_factor
from femtune.errors import FemtuneError
from femtune.parameters import ParameterSet
from femtune.residuals.case import CaseState, ComparedCase
from femtune.residuals.frf.model_way import settled
from femtune.residuals.kinds import Scatter
from femtune.residuals.pair import ByMode, OfPairs, PairResidual
from femtune.residuals.pairing import Joined, completed, join, keep_paired, modes_at_sensors, pair_case
from femtune.residuals.state import followed, paired_afresh, state_at
from femtune.residuals.weights import ResidualBlock, without_common_error

_LARGEST = 1e200
"""Largest sum of squares: the product of two does not overflow a double."""


@dataclass(frozen=True)
class Evaluation:
    """Residuals at one point, with the states that they were taken at; a Jacobian of no columns without derivatives.

    `blocks` are what is compared, each by its own standard deviations; residuals and Jacobian take the error into
    account that all frequencies share, of relative standard deviation `common_sd`, see `without_common_error`.
    """

    x: Reals
    states: tuple[CaseState, ...]
    blocks: tuple[ResidualBlock, ...]
    has_derivatives: bool = True
    common_sd: float = 0.0

    @cached_property
    def weighted(self) -> tuple[ResidualBlock, ...]:
        """Blocks of independent values of unit variance."""
        return without_common_error(self.blocks, self.common_sd)

    @property
    def residuals(self) -> Reals:
        """(n,) all blocks."""
        return np.concatenate([b.values for b in self.weighted]) if self.blocks else np.zeros(0)

    @property
    def jacobian(self) -> Reals:
        """(n, k) all blocks."""
        return np.concatenate([b.jacobian for b in self.weighted]) if self.blocks else np.zeros((0, len(self.x)))

    @property
    def kinds(self) -> list[str]:
        """(n,) kind of each residual."""
        return [b.kind for b in self.blocks for _ in b.values]

    @property
    def lost(self) -> dict[str, int]:
        """By kind, the number of combinations of its residuals that are zero whatever the noise."""
        out: dict[str, int] = {}
        for block in self.blocks:
            out[block.kind] = out.get(block.kind, 0) + block.lost
        return out

    @property
    def independent(self) -> int:
        """Number of independent residuals."""
        return len(self.residuals) - sum(self.lost.values())

    @property
    def objective(self) -> float:
        """½ rᵀr."""
        return 0.5 * float(self.residuals @ self.residuals)

    @property
    def tests(self) -> tuple[frozenset[int], ...]:
        """Positions of the test modes of each case that have a partner."""
        return tuple(frozenset(i for tests, _ in state.groups for i in tests) for state in self.states)

    @property
    def squares(self) -> dict[tuple[str, str, str], float]:
        """Sum of squares by what is compared: configuration, label and kind."""
        out: dict[tuple[str, str, str], float] = {}
        for b in self.weighted:
            key = (b.configuration, b.mode, b.kind)
            out[key] = out.get(key, 0.0) + float(b.values @ b.values)
        return out

    @property
    def weights(self) -> float:
        """Σ 1/σ² over all comparisons, infinite where it overflows."""
        with np.errstate(over="ignore"):
            return float(sum(np.float64(b.sd) ** -2 for b in self.blocks))

    @property
    def mean_error(self) -> float:
        """√(Σ e²/σ² / Σ 1/σ²) over all comparisons: if every misfit e has one size, this is it."""
        weights = self.weights
        squares = sum(float(b.values @ b.values) for b in self.blocks)
        return float(np.sqrt(squares / weights)) if weights else float("nan")


@dataclass(frozen=True)
class UpdateProblem:
    """Cases that share parameters, each with its residuals.

    Parameters
    ----------
    residuals : of paired modes, compared in every case before those of its own, mode by mode
    scatter : "stated" where the standard deviations are known, "estimated" where they are relative weights and the
        residuals tell their size
    common_sd : relative standard deviation of an error that all frequencies of the model share, such as that of a wrong
        mass
    pairing_held : whether the pairing stays as it is where an update starts, its motions followed

    Examples
    --------
    >>> from femtune.residuals.frequency import FrequencyResidual
    >>> UpdateProblem((), ParameterSet(()), (FrequencyResidual(0.01),)).scatter
    'stated'
    """

    cases: tuple[ComparedCase, ...]
    parameters: ParameterSet
    residuals: tuple[PairResidual, ...] = ()
    scatter: Scatter = "stated"
    common_sd: float = 0.0
    pairing_held: bool = False

    def start(self, x: Reals) -> Evaluation:
        """Solve and pair afresh.

        Raises
        ------
        FemtuneError : as of `solved`, those of the residuals, ``residual.nothing-compared``
        """
        state = self.assess(x, self.solved(x))
        self.check_compared(state)
        return state

    def solved(self, x: Reals) -> list[CaseState]:
        """States that are paired afresh, without residuals and their derivatives.

        Raises
        ------
        FemtuneError : ``correlate.no-pairs`` where modes are compared and no test mode finds a partner
        """
        states = [state_at(case, x) for case in self.cases]
        self.check_paired(states)
        return states

    def check_paired(self, states: Sequence[CaseState]) -> None:
        """Refuse states of which modes should be compared and none is paired (error ``correlate.no-pairs``)."""
        tested = [s for s in states if len(s.case.test) and self._compares_modes(s.case)]
        if tested and not any(s.groups for s in tested):
            raise _no_pairs(tested[0])

    def _compares_modes(self, case: ComparedCase) -> bool:
        return bool(self.residuals) or any(isinstance(r, OfPairs) for r in case.residuals)

    def check_compared(self, at: Evaluation) -> None:
        """Refuse an evaluation of no residual, or of some that cannot be squared.

        Raises
        ------
        FemtuneError : ``residual.nothing-compared``, ``residual.out-of-range``
        """
        if not len(at.residuals):
            names = ", ".join(case.name for case in self.cases)
            raise FemtuneError("residual.nothing-compared", configurations=names)
        if not (1.0 / _LARGEST < at.weights < _LARGEST and at.objective < _LARGEST):
            raise _out_of_range(at)

    def follow(self, x: Reals, before: Evaluation, derivatives: bool = True) -> Evaluation:
        """Solve at another point with the pairing frozen: each motion is tracked even if its number changes."""
        return self.assess(x, [followed(state, x) for state in before.states], derivatives)

    def pair_again(self, at: Evaluation, joined: Sequence[Joined] = ()) -> Evaluation:
        """The same point, paired afresh; modes that were paired stay so unless something better claims the partner.

        What comes back has its derivatives. `joined`: of each case, test modes that are compared as one subspace.
        """
        states = list(at.states) if self.pairing_held else [_paired_again(s) for s in at.states]
        if joined:
            states = [replace(s, groups=join(s.groups, j)) for s, j in zip(states, joined, strict=True)]
        same = all(a.groups == b.groups for a, b in zip(states, at.states))
        return at if same and at.has_derivatives else self.assess(at.x, states)

    def paired_as(self, end: Evaluation, states: Sequence[CaseState]) -> list[CaseState]:
        """States at the point of an evaluation on other models, paired as that evaluation is.

        As in `pair_again`, modes that were paired stay so unless something better claims the partner, and test modes
        that were compared as one subspace still are.

        Parameters
        ----------
        end : an evaluation of the same comparisons, such as one on reduced models
        states : of the cases of this problem, paired afresh
        """
        out = []
        for state, theirs in zip(states, end.states, strict=True):
            groups = theirs.groups if self.pairing_held else keep_paired(theirs.groups, state.groups)
            groups = join(groups, [frozenset(tests) for tests, _ in theirs.groups if len(tests) > 1])
            out.append(state if groups == state.groups else state.with_groups(groups))
        return out

    def over(self, at: Evaluation, tests: Sequence[Collection[int]]) -> float:
        """½ rᵀr at a point with all of some test modes compared, those included that have no partner there.

        Parameters
        ----------
        tests : positions of test modes, for each case
        """
        states = []
        for state, wanted in zip(at.states, tests, strict=True):
            groups = completed(state.case, state.groups, state.solution, wanted) if wanted else state.groups
            if groups is None:
                return np.inf
            states.append(state if groups == state.groups else state.with_groups(groups))
        if all(new is old for new, old in zip(states, at.states)):
            return at.objective
        return self.assess(at.x, states, derivatives=False).objective

    def to_send(self) -> UpdateProblem:
        """The problem as another process can load it.

        Comparisons that are settled at their first state are as they were settled.
        """
        return replace(self, cases=tuple(map(_to_send, self.cases)))

    def unsolved(self, at: Evaluation) -> Evaluation:
        """An evaluation with nothing solved, on the cases of this problem.

        It keeps residuals, derivatives and pairing; modes are solved again where they are needed.
        """
        pairs = zip(self.cases, at.states, strict=True)
        return replace(at, states=tuple(CaseState(c, c.configured.at(at.x), state.groups) for c, state in pairs))

    def assess(self, x: Reals, states: Sequence[CaseState], derivatives: bool = True) -> Evaluation:
        """Residual blocks of given states; without derivatives, which cost more than the modes, where not wanted."""
        everywhere = (ByMode(self.residuals),) if self.residuals else ()
        blocks = [b for s in states for r in (*everywhere, *s.case.residuals) for b in r.blocks(s, derivatives)]
        return Evaluation(np.asarray(x, dtype=float), tuple(states), tuple(blocks), derivatives, self.common_sd)


def _to_send(case: ComparedCase) -> ComparedCase:
    full = None if case.full is None else _to_send(case.full)
    return replace(case, residuals=tuple(settled(r) for r in case.residuals), full=full)


def _paired_again(state: CaseState) -> CaseState:
    if not len(state.case.test):
        return state
    fresh = paired_afresh(state)
    return replace(fresh, groups=keep_paired(state.groups, fresh.groups))


def _out_of_range(at: Evaluation) -> FemtuneError:
    """The error that squares of residuals or of their weights overflow, with the block that is at fault."""
    worst = max(at.blocks, key=lambda b: max(_largest(b), 10.0 ** abs(np.log10(b.sd))))
    return FemtuneError(
        "residual.out-of-range",
        values={"standard deviation": worst.sd, "largest residual in it": _largest(worst)},
        residual=worst.label,
    )


def _largest(block: ResidualBlock) -> float:
    return float(np.abs(block.values).max(initial=0.0))


def _no_pairs(state: CaseState) -> FemtuneError:
    """The error that no test mode found a partner."""
    pairing = pair_case(state.case, state.solution)
    reasons = {u.test: u.reason for u in pairing.unpaired_test}
    error = no_pairs(state.case.test, reasons, f"configuration {state.case.name}")
    for notice in unit_factor(state.case.test, modes_at_sensors(state.case, state.solution), pairing):
        error.hint = notice.what
    return error
