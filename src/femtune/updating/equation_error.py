"""First phases of a search: the test's modes in the equation of motion, without pairing.

For each test mode the motion q of a reduced model is sought that satisfies (K(p) − λ_e M(p)) q = 0 with the *test's*
eigenvalue and passes through the measured shape, both as well as possible; q is eliminated (variable projection), so
that the residual depends on the parameters only. Since λ_e is the test's, no mode of the model has to be found and
paired: far from the solution, where modes have changed places, this still points home. With noise it is biased: it is
a way to get near, and the asked residuals follow.

Source: equation error and its expansion of shapes, Mottershead, Link and Friswell (2011); Golub and Pereyra (1973) with
Kaufman's Jacobian.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.model.reduce import ReducedModel, ReducedPoint
from femtune.residuals import CaseState, ComparedCase, Residual, ResidualBlock, UpdateProblem

_MOST_PHASES = 8
"""The modes of a case are added in this many sets at most; each set costs a solution."""
_SINGULAR = 1e-13
"""Pivot, relative to the largest one, below which a triangle is singular to rounding: a few hundred units in the last
place of a double."""


@dataclass(frozen=True, eq=False)
class EquationError(Residual):
    """Residuals [L⁻¹(K − λ_e M)q; β(Cq − φ_e)] of some test modes on a reduced model, at the best q.

    LLᵀ is the nominal stiffness, shifted so that it is definite: forces count by the energy that they store.

    Parameters
    ----------
    test, members : the test's modes, and the positions of those that count
    weight : β; a large one makes the motion pass through the measured shape
    """

    test: ModeSet
    members: tuple[int, ...]
    weight: float = 10.0
    label = "equation error"
    of_modes = True
    on_modes = True
    not_normal = "they serve as a search objective and have no stated standard deviation"

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One block a mode."""
        point, rows = reduced_point(state), np.asarray(state.case.sensors)
        factor = la.cholesky(_metric(point), lower=True)
        return [self._of_mode(state, point, factor, rows, i, derivatives) for i in self.members]

    def _of_mode(
        self, state: CaseState, point: ReducedPoint, factor: Reals, rows: Reals, i: int, derivatives: bool
    ) -> ResidualBlock:
        known = ~np.isnan(self.test.shapes[:, i])
        shape = self.test.shapes[known, i] / np.linalg.norm(self.test.shapes[known, i])
        value = (2.0 * np.pi * self.test.freq_hz[i]) ** 2
        # a motion as large as the measured one stores √λ|φ|, whatever the units
        force = la.solve_triangular(factor, point.stiffness - value * point.mass, lower=True)
        size = _size(factor, rows[known], shape)
        matrix = np.vstack([force / size, self.weight * rows[known]])
        target = np.concatenate([np.zeros(len(force)), self.weight * shape])
        basis, triangle = la.qr(matrix, mode="economic")
        q = _solved(triangle, basis.T @ target)
        jacobian = _jacobian(point, factor, value, q, len(shape), size) if derivatives else np.zeros((len(target), 0))
        jacobian = jacobian - basis @ (basis.T @ jacobian)
        name, label = state.case.name, self.test.labels[i]
        return self.block(name, label, matrix @ q - target, jacobian, 1.0)


def reduced_point(state: CaseState) -> ReducedPoint:
    """The dense model at a state.

    Raises
    ------
    FemtuneError : ``update.needs-reduction``
    """
    if not isinstance(state.case.configured, ReducedModel):
        raise FemtuneError(
            "update.needs-reduction",
            values={"degrees of freedom": state.case.configured.n_free},
            configuration=state.case.name,
        )
    return cast(ReducedPoint, state.point)


def _metric(point: ReducedPoint) -> Reals:
    nominal = point.model.at(np.zeros(point.n_parameters))
    return np.asarray(nominal.stiffness - point.model.shift * nominal.mass)


def _solved(triangle: Reals, target: Reals) -> Reals:
    """The least solution where a motion is neither seen nor stiff, by substitution everywhere else."""
    diagonal = np.abs(np.diag(triangle))
    if diagonal.min() > _SINGULAR * diagonal.max():
        return np.asarray(la.solve_triangular(triangle, target))
    return np.asarray(np.linalg.lstsq(triangle, target, rcond=_SINGULAR)[0])


def _size(factor: Reals, rows: Reals, shape: Reals) -> float:
    """Length in the energy norm of the least motion that passes through the shape."""
    seen = la.solve_triangular(factor, rows.T, lower=True)
    return float(np.linalg.norm(np.linalg.lstsq(seen.T, shape, rcond=1e-6)[0]))


def _jacobian(point: ReducedPoint, factor: Reals, value: float, q: Reals, measured: int, size: float) -> Reals:
    pairs = zip(point.stiffness_derivatives, point.mass_derivatives)
    forces = np.stack([k @ q - value * (m @ q) for k, m in pairs], axis=1)
    upper = la.solve_triangular(factor, forces, lower=True) / size
    return np.vstack([upper, np.zeros((measured, forces.shape[1]))])


def equation_error_phases(reduced: UpdateProblem, weight: float = 10.0) -> tuple[UpdateProblem, ...]:
    """Problems for the beginning of a search: the equation error of the lowest test mode, then of the lowest two …

    With all modes at once, the upper ones hold a search in wrong valleys that the lower ones would lead it past.

    Parameters
    ----------
    reduced : on reduced models, see `femtune.residuals.state.reduced_case`
    """
    order = {id(case): _by_frequency(case) for case in reduced.cases}
    most = max((len(members) for members in order.values()), default=0)
    counts = sorted({int(c) for c in np.ceil(np.linspace(1, most, min(most, _MOST_PHASES)))})
    return tuple(replace(reduced, cases=tuple(_cases(reduced, order, c, weight))) for c in counts)


def _cases(reduced: UpdateProblem, order: dict[int, list[int]], count: int, weight: float) -> Iterator[ComparedCase]:
    for case in reduced.cases:
        members = order[id(case)][:count]
        if members:
            none = ModeSet(np.zeros(0), np.zeros((0, 0)), DofSet(()), source="compared by the equation error")
            yield replace(case, test=none, residuals=(EquationError(case.test, tuple(members), weight),), left_out={},
                          fixed=())  # fmt: skip


def _by_frequency(case: ComparedCase) -> list[int]:
    wanted = [i for i in range(len(case.test)) if i not in case.left_out]
    return sorted(wanted, key=lambda i: float(case.test.freq_hz[i]))
