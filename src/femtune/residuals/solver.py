"""Who computes full-model solutions for the residuals: the model's own functions, or whatever stands before them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import scipy.sparse as sp

from femtune.model import EigenSolution, ModelPoint, SubspaceDerivative, solve_modes, subspace_derivative


class ModelSolver(Protocol):
    """Solutions of the full model and their derivatives, as `solve_modes` and `subspace_derivative` give them."""

    def modes(self, point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
        """Modes of a model point."""
        ...

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """Derivatives of the subspace of some modes at the rows that are wanted."""
        ...


class _Direct:
    """Solves whatever it is asked."""

    def modes(self, point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
        """As `solve_modes`."""
        return solve_modes(point, count, max_hz)

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As `subspace_derivative`."""
        return subspace_derivative(solution, members, rows)


direct: ModelSolver = _Direct()
