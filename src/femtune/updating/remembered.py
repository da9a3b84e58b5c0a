"""A solver that remembers: modes are not solved again where stiffness and mass are what they were.

An update of damping changes neither, and needs the modes at each of its points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from femtune.model import EigenSolution, ModelPoint, SubspaceDerivative
from femtune.model.full_model import ModelSolver
from femtune.residuals import UpdateProblem

_Key = tuple[int, int | None, float | None]


@dataclass(frozen=True, eq=False)
class RememberingSolver:
    """Asks `solver`, and keeps the last answer for each configuration."""

    solver: ModelSolver
    kept: dict[_Key, EigenSolution] = field(default_factory=dict, repr=False)

    def modes(
        self, point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None = None
    ) -> EigenSolution:
        """Modes of a point; those of the last point, where it has the same stiffness and mass."""
        key = (id(point.configured), count, max_hz)
        old = self.kept.get(key)
        if old is None or not _same(old.point, point):
            self.kept[key] = self.solver.modes(point, count, max_hz, *(() if start is None else (start,)))
            return self.kept[key]
        return replace(old, point=point, known_factor=old.factor)

    def improved(self, start: EigenSolution, steps: int) -> EigenSolution:
        """See `ModelSolver`."""
        return self.solver.improved(start, steps)

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """See `ModelSolver`."""
        return self.solver.derivative(solution, members, rows)


def remembering(problem: UpdateProblem) -> UpdateProblem:
    """The same problem with a solver that remembers in each of its cases."""
    cases = tuple(replace(case, solver=RememberingSolver(case.solver)) for case in problem.cases)
    return replace(problem, cases=cases)


def _same(one: ModelPoint, other: ModelPoint) -> bool:
    return np.array_equal(one.symmetric_stiffness.data, other.symmetric_stiffness.data) and np.array_equal(
        one.symmetric_mass.data, other.symmetric_mass.data
    )
