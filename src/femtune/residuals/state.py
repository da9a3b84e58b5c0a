"""States of a case: solved and paired at a point, or followed there from another one."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import NDArray

from femtune.model import EigenSolution
from femtune.residuals.case import CaseState, ModalCase
from femtune.residuals.pairing import groups_of, pair_case, track


def state_at(case: ModalCase, x: NDArray, known: EigenSolution | None = None) -> CaseState:
    """A case at a normalised parameter vector, its test modes paired; `known` are its modes where they are solved.

    A case without test modes is not solved for modes here.
    """
    state = CaseState(case, case.configured.at(x) if known is None else known.point, (), known)
    return paired_afresh(state) if len(case.test) else state


def paired_afresh(state: CaseState) -> CaseState:
    """The same state with its test modes paired again."""
    solution = state.solution
    return CaseState(state.case, state.point, groups_of(pair_case(state.case, solution)), solution)


def followed(state: CaseState, x: NDArray) -> CaseState:
    """The case at another point, its pairing frozen: each motion is tracked."""
    there = CaseState(state.case, state.case.configured.at(x))
    if not state.groups:
        return there
    groups = track(state.groups, state.solution, there.solution)
    return CaseState(there.case, there.point, groups, there.solution)


def paired_count(states: Sequence[CaseState]) -> int:
    """Number of paired test modes."""
    return sum(len(tests) for s in states for tests, _ in s.groups)
