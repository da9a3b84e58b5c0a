"""CaseState: one configuration at one parameter vector, solved for no more than the residuals ask for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from numpy.typing import NDArray

from femtune.model import EigenSolution, ModelPoint
from femtune.residuals.aligned import AlignedModes, align
from femtune.residuals.case import Group, ModalCase, groups_of, pair_case, track
from femtune.residuals.pair import PairedMode, pairs_of_group
from femtune.residuals.seen import seen_only


@dataclass(frozen=True, eq=False)
class CaseState:
    """A case at one point.

    Parameters
    ----------
    point : the model there, of the case's `configured` (a reduced model's where the case is reduced)
    groups : frozen groups of paired modes; none where no test mode is paired
    known : the modes there, where they have been solved; without them they are solved when they are asked for
    """

    case: ModalCase
    point: ModelPoint
    groups: tuple[Group, ...] = ()
    known: EigenSolution | None = field(default=None, repr=False)

    @cached_property
    def solution(self) -> EigenSolution:
        """The modes, solved once; errors as of `solve_modes`."""
        return self.known or self.case.solver.modes(self.point, self.case.count, self.case.max_hz)

    @property
    def solved(self) -> EigenSolution | None:
        """The modes where they have been solved, None where nothing asked for them."""
        return self.__dict__.get("solution", self.known)

    @property
    def full(self) -> ModelPoint:
        """The full model at this point, whatever model the modes come from."""
        return self.case.on_full_model.configured.at(self.point.x)

    @cached_property
    def _kept(self) -> dict[tuple[Group, bool], AlignedModes]:
        return {}

    def aligned(self, group: Group, derivatives: bool) -> AlignedModes:
        """A group's model vectors aligned with its test shapes, computed once."""
        if (group, True) in self._kept:
            return self._kept[group, True]
        if (group, derivatives) not in self._kept:
            self._kept[group, derivatives] = self._align(group, derivatives)
        return self._kept[group, derivatives]

    def _align(self, group: Group, derivatives: bool) -> AlignedModes:
        tests, models = group
        derivative = self.case.solver.derivative if derivatives else seen_only
        found = derivative(self.solution, models, self.case.sensors)
        return align(found, self.case.test.shapes[:, list(tests)])

    def pairs(self, derivatives: bool) -> Iterator[PairedMode]:
        """Every paired test mode with the model's motion that stands against it."""
        for group in self.groups:
            yield from pairs_of_group(self.case, group, self.aligned(group, derivatives))


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
