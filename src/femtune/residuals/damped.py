"""Complex modes of the damped model that belong to the paired real modes of a state, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import EigenSolution
from femtune.model.response import (
    DampingRatios,
    complex_modes,
    complex_modes_at_own_frequency,
    mean_pole_derivative,
)
from femtune.residuals.case import CaseState, Group, PairedMode
from femtune.residuals.frf.model_way import full_modes

_SAME_MOTION = 0.5
"""Least part of the kinetic energy of a complex mode in the real modes of its group."""
_SPARE_MODES = 4
"""Complex modes beyond the number of real ones that are solved first: damping changes their order."""
_MOST_MODES_FACTOR = 8
"""Times this number after which a partner that is still missing is an error."""


@dataclass(frozen=True, eq=False)
class _Poles:
    """Poles (m,) with shapes (n_free, m), which of them oscillate, and the derivatives (k,) of the mean of some."""

    poles: NDArray[np.complex128]
    shapes: NDArray[np.complex128]
    oscillating: NDArray[np.int64]
    complete: bool
    mean_derivative: Callable[[Sequence[int]], NDArray[np.complex128]]


def _poles(real: EigenSolution, count: int, damping: DampingRatios | None) -> _Poles:
    if real.point.depends_on_frequency:
        return _at_own_frequency(real, damping)
    poles = complex_modes(real, count, damping)
    some = np.array([j for j, kind in enumerate(poles.kinds) if kind == "oscillating"], dtype=np.int64)
    return _Poles(poles.poles, poles.shapes, some, poles.complete, partial(mean_pole_derivative, poles))


def _at_own_frequency(real: EigenSolution, damping: DampingRatios | None) -> _Poles:
    """As many poles as there are real modes, each with the tables over frequency at |λ|/2π."""
    if damping is not None or real.point.mode_ratios:
        raise FemtuneError("table.direct/modal-damping")
    complex_modes = complex_modes_at_own_frequency(real.point, real.wanted)
    slopes = np.array([mode.gradient for mode in complex_modes])
    poles = np.array([mode.eigenvalue for mode in complex_modes])
    some = np.flatnonzero(poles.imag > 0.0)
    shapes = np.stack([mode.shape for mode in complex_modes], axis=1)
    return _Poles(poles, shapes, some, True, lambda members: np.asarray(slopes[list(members)].mean(axis=0)))


@dataclass(frozen=True, eq=False)
class DampedModes:
    """The complex modes of a state.

    Parameters
    ----------
    found : poles and shapes of the full model
    members : for each group of the state, positions of its complex modes, as many as it has real modes
    """

    state: CaseState
    found: _Poles
    members: dict[Group, tuple[int, ...]]

    @cached_property
    def _slopes(self) -> dict[tuple[int, ...], NDArray]:
        return {}

    def poles(self, pairs: Sequence[PairedMode], derivatives: bool) -> list[tuple[list[int], complex, NDArray]]:
        """For pairs of one group: positions in `pairs`, the mean pole of their complex modes, and its derivatives (k,).

        If all model modes of the group are paired, the mean of all poles is compared, which is smooth where they
        coincide. Otherwise each test mode is compared with the complex mode whose shape is most similar.
        """
        (group,) = [g for g in self.state.groups if pairs[0].position in g[0]]
        members = self.members[group]
        if len(pairs) == len(members):
            return [self._mean(list(range(len(pairs))), members, derivatives)]
        partners = self._by_shape(pairs, members)
        return [self._mean([i], (j,), derivatives) for i, j in enumerate(partners)]

    def _mean(self, at: list[int], members: tuple[int, ...], derivatives: bool) -> tuple[list[int], complex, NDArray]:
        if derivatives and members not in self._slopes:
            self._slopes[members] = self.found.mean_derivative(members)
        slope = self._slopes[members] if derivatives else np.zeros(0, complex)
        return at, complex(np.mean(self.found.poles[list(members)])), slope

    def _by_shape(self, pairs: Sequence[PairedMode], members: tuple[int, ...]) -> list[int]:
        shapes = self.state.case.on_full_model.sensors @ self.found.shapes[:, list(members)]
        mac = np.array([[_mac(pair.test_shape, shape) for shape in shapes.T] for pair in pairs])
        return [members[j] for j in linear_sum_assignment(-mac)[1]]


def _mac(test: NDArray, model: NDArray) -> float:
    known = ~np.isnan(test)
    a, b = test[known], model[known]
    size = float(np.vdot(a, a).real * np.vdot(b, b).real)
    return float(abs(np.vdot(a, b)) ** 2) / size if size > 0.0 else 0.0


def damped_modes(state: CaseState, damping: DampingRatios | None) -> DampedModes:
    """The complex modes that belong to the groups of a state, computed once.

    Parameters
    ----------
    damping : modal damping in addition to that of the model

    Raises
    ------
    FemtuneError : ``residual.no-complex-mode``, and as of `complex_modes`
    """
    key = ("damped modes", damping)
    if key not in state.shared:
        state.shared[key] = _damped(state, damping)
    return state.shared[key]


def _damped(state: CaseState, damping: DampingRatios | None) -> DampedModes:
    real = full_modes(state, None)
    wanted = [_in_full_model(state, real, models) for _, models in state.groups]
    size = count = real.wanted + _SPARE_MODES
    while True:
        complex_modes = _poles(real, count, damping)
        members, shares = _partners(real, complex_modes, wanted)
        worst = int(np.argmin(shares))
        if shares[worst] >= _SAME_MOTION:
            return DampedModes(state, complex_modes, dict(zip(state.groups, members)))
        if complex_modes.complete or count >= _MOST_MODES_FACTOR * size:
            raise _no_partner(state, worst, float(shares[worst]))
        # real poles of strongly damped motions take the places of others
        count *= 2


def _in_full_model(state: CaseState, real: EigenSolution, models: Sequence[int]) -> list[int]:
    """Positions among the modes of the full model of those of a reduced one, by frequency and shape at the sensors."""
    if state.case.full is None:
        return list(models)
    reduced, full = state.solution, state.case.on_full_model
    seen = np.asarray(state.case.sensors @ reduced.shapes), np.asarray(full.sensors @ real.shapes)
    ours, theirs = (np.maximum(s.eigenvalues, np.finfo(float).tiny) for s in (reduced, real))
    off = 0.5 * np.abs(np.log(ours[list(models), None] / theirs[None, :]))
    mac = np.array([[_mac(seen[0][:, i], seen[1][:, j]) for j in range(off.shape[1])] for i in models])
    return [int(j) for j in linear_sum_assignment(off + 1.0 - mac)[1]]


def _partners(
    real: EigenSolution, poles: _Poles, wanted: Sequence[Sequence[int]]
) -> tuple[list[tuple[int, ...]], Reals]:
    """Oscillating complex modes for the real modes of each group, and their least kinetic energy in the group."""
    some = poles.oscillating
    psi = poles.shapes[:, some]
    inertia = real.point.mass @ psi
    energy = np.einsum("ij,ij->j", psi.conj(), inertia).real
    of_group = [(np.abs(real.shapes[:, list(w)].T @ inertia) ** 2).sum(axis=0) / energy for w in wanted]
    rows = np.array([of_group[g] for g, w in enumerate(wanted) for _ in w])
    if len(some) < len(rows):
        return [() for _ in wanted], np.zeros(len(wanted))
    columns = iter(linear_sum_assignment(-rows)[1])
    places = [[int(next(columns)) for _ in w] for w in wanted]
    shares = np.array([of_group[g][at].min() for g, at in enumerate(places)])
    return [tuple(int(some[j]) for j in at) for at in places], shares


def _no_partner(state: CaseState, group: int, share: float) -> FemtuneError:
    tests, models = state.groups[group]
    case = state.case
    return FemtuneError(
        "residual.no-complex-mode",
        values={"largest share of the kinetic energy": f"{share:.2f}"},
        configuration=case.name,
        mode=" and ".join(case.test.labels[i] for i in tests),
        model=" and ".join(str(j + 1) for j in models),
    )
