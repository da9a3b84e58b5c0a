"""The solver of the full model: its own functions, or what is put before them (a journal, a memory)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import scipy.sparse as sp

    from femtune.model.configured import ModelPoint
    from femtune.model.derivatives.modes import SubspaceDerivative
    from femtune.model.eigen.solution import EigenSolution


class ModelSolver(Protocol):
    """Solutions of the full model and their derivatives, see `solve_modes` and `subspace_derivative`."""

    def modes(
        self, point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None = None
    ) -> EigenSolution:
        """Modes of a model point; `start` has modes of a point nearby, from which the iteration starts."""
        ...

    def improved(self, start: EigenSolution, steps: int) -> EigenSolution:
        """As `improved_modes`, at the point of `start`."""
        ...

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """Derivatives of the subspace of some modes at the rows that are wanted."""
        ...


class _Direct:
    """The functions of the model itself, imported when they are called."""

    def modes(
        self, point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None = None
    ) -> EigenSolution:
        from femtune.model.eigen.solution import solve_modes  # noqa: PLC0415

        if point.depends_on_frequency:
            from femtune.model.eigen.own_frequency import own_frequency_solution  # noqa: PLC0415

            return own_frequency_solution(point, count, max_hz)
        return solve_modes(point, count, max_hz, start)

    def improved(self, start: EigenSolution, steps: int) -> EigenSolution:
        from femtune.model.eigen.improved import improved_modes  # noqa: PLC0415

        return improved_modes(start, steps)

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        from femtune.model.derivatives.chosen import subspace_derivative  # noqa: PLC0415

        if solution.point.depends_on_frequency:
            from femtune.model.eigen.own_frequency import own_frequency_derivative  # noqa: PLC0415

            return own_frequency_derivative(solution, members, rows)
        return subspace_derivative(solution, members, rows)


direct: ModelSolver = _Direct()
