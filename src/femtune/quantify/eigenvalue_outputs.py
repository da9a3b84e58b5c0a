"""Eigenvalues of a configured model as outputs, followed from a reference by their subspaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from femtune.modal.subspace import clusters
from femtune.model import ConfiguredModel, EigenSolution, eigenvalue_derivatives, solve_modes

Reals = NDArray[np.float64]

_DENSE, _ZERO = 2000, 1e-10


@dataclass(frozen=True)
class EigenvalueOutputs:
    """The `count` lowest eigenvalues in rad²/s² at θ, the parameters in their own units.

    Modes that are close at the reference (within `relative_gap` in frequency) are one subspace. Each subspace is
    followed by its overlap with the reference's, whatever modes cross it; inside it eigenvalues are in ascending
    order, which is continuous and, with definite matrices, monotone where single motions cross.

    Parameters
    ----------
    reference : (k,) θ of the reference
    more : modes solved for beyond `count`, in case others come down
    """

    configured: ConfiguredModel
    count: int
    reference: Reals
    relative_gap: float = 0.05
    more: int = 2

    def values(self, theta: Reals) -> Reals:
        """(count,) rad²/s²."""
        solution = self._solved(theta)
        return solution.eigenvalues[self._order(solution)]

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """(count,) and (count, k), rad²/s² by the unit of each parameter.

        At a repeated eigenvalue the slopes are those of some vectors of its subspace: one of many that are as good.
        """
        solution = self._solved(theta)
        order = self._order(solution)
        slopes = eigenvalue_derivatives(solution)[order] / self.configured.model.parameters.scale
        return solution.eigenvalues[order], slopes

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Positions of the modes of each subspace at the reference."""
        found = clusters(self._reference.freq_hz[: self.count], self.relative_gap)
        return tuple(tuple(sorted(g)) for g in found)

    def _solved(self, theta: Reals) -> EigenSolution:
        x = self.configured.model.parameters.normalise(theta)
        return solve_modes(self.configured.at(x), min(self.count + self.more, self.configured.n_free))

    @cached_property
    def _reference(self) -> EigenSolution:
        return self._solved(self.reference)

    def _order(self, solution: EigenSolution) -> list[int]:
        """Positions of the followed modes in a solution, subspace by subspace."""
        old, new = self._reference, solution
        overlap = (old.shapes[:, : self.count].T @ (old.point.mass @ new.shapes)) ** 2
        share = np.vstack([np.tile(overlap[list(g)].sum(axis=0), (len(g), 1)) for g in self.groups])
        found = linear_sum_assignment(-share)[1]
        out, at = [0] * self.count, 0
        for g in self.groups:
            for position, mode in zip(g, sorted(found[at : at + len(g)].tolist())):
                out[position] = int(mode)
            at += len(g)
        return out


@dataclass(frozen=True)
class FrequenciesByOrder:
    """The `count` lowest frequencies in Hz at θ, whatever motions they are of; not smooth where two cross."""

    configured: ConfiguredModel
    count: int

    def values(self, theta: Reals) -> Reals:
        """(count,) Hz."""
        return np.asarray(self._solved(theta).freq_hz[: self.count])

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """(count,) Hz and (count, k) Hz by the unit of each parameter."""
        solution = self._solved(theta)
        hz = solution.freq_hz[: self.count]
        slopes = eigenvalue_derivatives(solution)[: self.count] / self.configured.model.parameters.scale
        return hz, slopes / (8.0 * np.pi**2 * hz[:, None])

    def _solved(self, theta: Reals) -> EigenSolution:
        return solve_modes(self.configured.at(self.configured.model.parameters.normalise(theta)), self.count)


def definite_signs(configured: ConfiguredModel) -> Reals:
    """(k,) +1 where every eigenvalue grows with a free parameter, −1 where every one falls, 0 where nothing is known.

    A parameter that enters K linearly through a positive semidefinite matrix and not M lets no eigenvalue fall; one
    that enters M so lets none grow. Known for small models only (dense eigenvalues of the matrices).
    """
    k = len(configured.model.parameters.free)
    if configured.n_free > _DENSE:
        return np.zeros(k)
    point = configured.at(np.zeros(k))
    stiffness = [_sign(d.toarray()) for d in point.stiffness_derivatives]
    mass = [_sign(d.toarray()) for d in point.mass_derivatives]
    linear = np.array([_is_linear(configured, i) for i in range(k)])
    both = [s if m == 0.0 else -m if s == 0.0 else np.nan for s, m in zip(stiffness, mass)]
    return np.where(linear & np.isfinite(both), np.nan_to_num(both), 0.0)


def _sign(matrix: Reals) -> float:
    """+1 or −1 for a semidefinite matrix, 0 for none at all, NaN for an indefinite one."""
    values = np.linalg.eigvalsh(matrix)
    size = np.abs(values).max(initial=0.0)
    if size == 0.0:
        return 0.0
    if values.min() >= -_ZERO * size:
        return 1.0
    return -1.0 if values.max() <= _ZERO * size else float("nan")


def _is_linear(configured: ConfiguredModel, i: int) -> bool:
    point = configured.at(np.zeros(len(configured.model.parameters.free)))
    second = [
        f(i, j)
        for f in (point.stiffness_second_derivative, point.mass_second_derivative)
        for j in range(point.n_parameters)
    ]
    return not any(np.abs(m.data).max(initial=0.0) > 0.0 for m in second)
