"""One residual function of the parameters for all solvers, and a record of the solutions that a solver takes.

A general solver needs residuals that depend on the parameters alone, not on the way by which they were reached. So the
test modes are paired afresh at every point, without gates, by the assignment of model modes with the least sum of
squares. All test modes are paired everywhere: the number of residuals is constant. Test modes that are close to each
other are compared as a subspace, everywhere the same ones: there the residuals are smooth where model modes cross,
while single modes that cross have no derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.subspace import RANK_TOLERANCE
from femtune.residuals import CaseState, ComparedCase, Evaluation, FrequencyResidual, ShapeResidual, UpdateProblem
from femtune.residuals.case import Group
from femtune.residuals.pairing import Joined
from femtune.residuals.weights import as_weights

CLOSE_MODES = 0.1
"""Relative distance of test frequencies below which modes are compared as a subspace."""
FAR = 1e6
"""Value of all residuals for general solvers at a point where the model cannot be solved."""


@dataclass(eq=False)
class Trace:
    """Objective ½ rᵀr of every solution in turn; infinite where the model could not be solved."""

    objectives: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class BestPairing(UpdateProblem):
    """An update problem in which every point is paired by the least sum of squares; see the text of the module."""

    trace: Trace = field(default_factory=Trace)

    @property
    def size(self) -> int:
        """Number of residuals, the same everywhere."""
        parts = [(case, r) for case in self.cases for r in self._residuals(case)]
        return sum(len(case.test) * _length(case, r) for case, r in parts)

    def start(self, x: Reals) -> Evaluation:
        """One solution, with derivatives."""
        return self.at(x, derivatives=True)

    def follow(self, x: Reals, before: Evaluation, derivatives: bool = True) -> Evaluation:
        """One solution; `before` has no effect."""
        return self.at(x, derivatives)

    def pair_again(self, at: Evaluation, joined: Sequence[Joined] = ()) -> Evaluation:
        """The same point with derivatives; the pairing here never alternates."""
        del joined
        return at if at.has_derivatives else self.assess(at.x, at.states)

    def at(self, x: Reals, derivatives: bool) -> Evaluation:
        """One solution, counted."""
        self.trace.objectives.append(np.inf)
        found = self.assess(x, [_paired(case, x, self._residuals(case)) for case in self.cases], derivatives)
        self.check_compared(found)
        self.trace.objectives[-1] = found.objective
        return found

    def _residuals(self, case: ComparedCase) -> tuple[FrequencyResidual | ShapeResidual, ...]:
        found = (*self.residuals, *case.residuals)
        # a residual of another kind would need squares of its own below
        assert all(isinstance(r, (FrequencyResidual, ShapeResidual)) for r in found)
        return tuple(r for r in found if isinstance(r, (FrequencyResidual, ShapeResidual)))

    def counted(self) -> BestPairing:
        """The same problem with a new record."""
        return replace(self, trace=Trace())


def _length(case: ComparedCase, residual: FrequencyResidual | ShapeResidual) -> int:
    """Residuals of a mode."""
    if isinstance(residual, FrequencyResidual):
        return 1
    return len(case.test.dofs) - (residual.scaling == "largest-entry")


def _paired(case: ComparedCase, x: Reals, residuals: Sequence[FrequencyResidual | ShapeResidual]) -> CaseState:
    bare = CaseState(case, case.configured.at(x))
    modes = bare.solution
    values, shapes = modes.eigenvalues[: modes.wanted], np.asarray(case.sensors @ modes.shapes[:, : modes.wanted])
    if len(values) < len(case.test):
        raise FemtuneError("correlate.no-pairs")
    found = LeastPairing(case, values, shapes, tuple(residuals)).groups()
    return CaseState(case, bare.point, tuple(found), modes)


@dataclass(eq=False)
class LeastPairing:
    """The pairing with the least sum of squares of all.

    A pairing that is only locally the best would jump, and the objective with it: close test modes are compared with
    every set of as many model modes, and the sets are then chosen together.
    """

    case: ComparedCase
    values: Reals
    shapes: Reals
    residuals: tuple[FrequencyResidual | ShapeResidual, ...]
    best: tuple[float, dict[int, int], list[Group]] = (np.inf, {}, [])

    def groups(self) -> list[Group]:
        """The groups of test modes with their model modes."""
        close = close_modes(self.case.test.freq_hz)
        self.single = pair_squares(self.case, range(len(self.case.test)), self.values, self.shapes, self.residuals)
        self.alone = [tests[0] for tests in close if len(tests) == 1]
        self.sets = [(tests, self._sets(tests)) for tests in close if len(tests) > 1]
        # of the groups that are not chosen yet, and of single modes, at least
        least = [float(self.single[self.alone].min(axis=1).sum())]
        for _, squares in reversed(self.sets):
            least.append(least[-1] + squares[0][0])
        self.least = least[::-1]
        self._choose(0, 0.0, [])
        _, partner, found = self.best
        return [*found, *(((test,), (model,)) for test, model in partner.items())]

    def _sets(self, tests: tuple[int, ...]) -> list[tuple[float, tuple[int, ...]]]:
        """Sums of squares of close test modes with every set of model modes turned to them, the least first."""
        every = list(combinations(range(len(self.values)), len(tests)))
        A = np.moveaxis(self.shapes[:, every], 1, 0)
        turned = np.linalg.pinv(A, rcond=RANK_TOLERANCE) @ self.case.test.shapes[:, list(tests)]
        u, _, vt = np.linalg.svd(turned / np.linalg.norm(turned, axis=1, keepdims=True), full_matrices=False)
        Q = u @ vt
        values, shapes = np.einsum("sai,sa,sai->is", Q, self.values[every], Q), np.moveaxis(A @ Q, 0, -1)
        squares = sum(
            pair_squares(self.case, [test], values[i], shapes[:, i], self.residuals)[0] for i, test in enumerate(tests)
        )
        return sorted(zip(np.asarray(squares).tolist(), every))

    def _choose(self, position: int, so_far: float, groups: list[Group]) -> None:
        """All choices of sets without common modes that can be better than the best one so far."""
        taken = {j for _, models in groups for j in models}
        if position == len(self.sets):
            free = [j for j in range(len(self.values)) if j not in taken]
            rows, columns = linear_sum_assignment(self.single[np.ix_(self.alone, free)])
            tests, models = [self.alone[i] for i in rows], [free[j] for j in columns]
            total = so_far + float(self.single[tests, models].sum())
            if total < self.best[0]:
                self.best = total, dict(zip(tests, models)), groups
            return
        tests, squares = self.sets[position]
        for value, models in squares:
            if so_far + value + self.least[position + 1] >= self.best[0]:
                return
            if taken.isdisjoint(models):
                self._choose(position + 1, so_far + value, [*groups, (tests, models)])


def close_modes(freq_hz: Reals) -> list[tuple[int, ...]]:
    """Positions of test modes in chains of neighbours that are closer than CLOSE_MODES."""
    order = np.argsort(freq_hz).tolist()
    chains = [[order[0]]]
    for before, i in pairwise(order):
        if freq_hz[i] <= freq_hz[before] * (1.0 + CLOSE_MODES):
            chains[-1].append(i)
        else:
            chains.append([i])
    return sorted(tuple(sorted(chain)) for chain in chains)


def pair_squares(
    case: ComparedCase,
    tests: Sequence[int],
    eigenvalues: Reals,
    shapes: Reals,
    residuals: Sequence[FrequencyResidual | ShapeResidual],
) -> Reals:
    """(t, m) sum of squares of some test modes, each compared with each model mode."""
    out = np.zeros((len(tests), len(eigenvalues)))
    for residual in residuals:
        if isinstance(residual, FrequencyResidual):
            out += _frequency(residual, case, list(tests), eigenvalues)
        else:
            out += [_shape(residual, case.test.shapes[:, i], shapes) for i in tests]
    # a model mode without motion at the sensors has no shape to compare
    return np.nan_to_num(out, nan=1e30, posinf=1e30)


def _frequency(residual: FrequencyResidual, case: ComparedCase, tests: list[int], eigenvalues: Reals) -> Reals:
    test, stated = case.test.freq_hz[tests][:, None], case.test.freq_sd_hz
    sd = residual.sd if residual.sd != "test" or stated is None else stated[tests][:, None] / test
    ratio = np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi * test)
    return np.asarray(((ratio - 1.0) / sd) ** 2)


def _shape(residual: ShapeResidual, test: Reals, shapes: Reals) -> Reals:
    sd = np.broadcast_to(np.asarray(as_weights(residual.weights).sd, dtype=float), (len(shapes),))
    with np.errstate(all="ignore"):
        if residual.scaling == "largest-entry":
            top = int(np.argmax(np.abs(test)))
            model, reference = shapes / shapes[top], test / test[top]
        else:
            side = np.where(test @ shapes < 0.0, -1.0, 1.0)
            model, reference = side * shapes / np.linalg.norm(shapes, axis=0), test / np.linalg.norm(test)
        return np.asarray((((model - reference[:, None]) / sd[:, None]) ** 2).sum(axis=0))


@dataclass(eq=False)
class Residuals:
    """Residuals and Jacobian as functions for general solvers; the Jacobian at the last point is no new solution."""

    problem: BestPairing
    size: int
    best: tuple[float, Reals] | None = None
    _last: tuple[bytes, Evaluation | None] = (b"", None)

    def _at(self, x: Reals, derivatives: bool) -> Evaluation | None:
        lower, upper = self.problem.parameters.bounds
        inside = np.clip(x, lower, upper)
        key, found = inside.tobytes(), self._last[1]
        try:
            if key != self._last[0]:
                found = self.problem.at(inside, derivatives=False)
            if derivatives and found is not None:
                found = self.problem.pair_again(found)
        except FemtuneError:
            found = None
        self._last = key, found
        if found is not None and (self.best is None or found.objective < self.best[0]):
            self.best = found.objective, inside
        return found

    def values(self, x: Reals) -> Reals:
        """(n,) residuals."""
        found = self._at(x, derivatives=False)
        return np.full(self.size, FAR) if found is None else found.residuals

    def jacobian(self, x: Reals) -> Reals:
        """(n, k)."""
        found = self._at(x, derivatives=True)
        return np.zeros((self.size, len(x))) if found is None else found.jacobian
