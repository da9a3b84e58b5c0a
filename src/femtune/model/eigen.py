"""Eigen-solution of K φ = λ M φ with rigid-body modes, checked by the Sturm count."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.model.configured import ModelPoint
from femtune.model.eigenpairs import DENSE_UP_TO, lowest
from femtune.model.factorise import Factor, SingularMatrixError, factorise
from femtune.model.shift import spectral_shift

__all__ = ["DENSE_UP_TO", "EigenSolution", "solve_modes"]

_DEFAULT_COUNT = 10
_EXTRA_MODES, _MOST_EXTRA = 6, 400
_REPEATED = 1e-6
"""Neighbours whose λ − σ differ by less than this fraction are one repeated mode."""


@dataclass(frozen=True, eq=False)
class EigenSolution:
    """The lowest modes of a model point.

    Parameters
    ----------
    eigenvalues : (m,) λ = ω² in rad²/s², ascending
    shapes : (n_free, m), φᵀMφ = 1
    wanted : number of modes that were asked for, a repeated one at the end kept whole; the others serve the
        derivatives
    shift : σ below the spectrum, at which the eigenproblem was inverted
    sturm_shift, sturm_count : number of eigenvalues below a shift that separates the modes found from the rest,
        counted from the inertia of K − σM; −1 where it could not be counted
    """

    point: ModelPoint = field(repr=False)
    eigenvalues: NDArray[np.float64]
    shapes: NDArray[np.float64] = field(repr=False)
    wanted: int
    shift: float
    sturm_shift: float
    sturm_count: int
    notices: tuple[Notice, ...] = ()
    known_factor: Factor | None = field(default=None, repr=False)

    @cached_property
    def factor(self) -> Factor:
        """Factors of K − σM, made again where the solution came without them."""
        if self.known_factor is not None:
            return self.known_factor
        return factorise(sp.csr_array(self.point.stiffness - self.shift * self.point.mass))

    @property
    def freq_hz(self) -> NDArray[np.float64]:
        """Natural frequencies of the wanted modes; rigid-body modes come out as (nearly) zero."""
        return np.sqrt(np.maximum(self.eigenvalues[: self.wanted], 0.0)) / (2.0 * np.pi)


def solve_modes(point: ModelPoint, count: int | None = None, max_hz: float | None = None) -> EigenSolution:
    """The `count` lowest modes (ten where nothing is said), or all up to `max_hz` but at least one.

    That no mode was missed is proven by the Sturm count; a model with fewer modes gives all that it has.

    Raises
    ------
    FemtuneError : ``eigen.mechanism`` (a motion without stiffness and mass, naming the DOFs), ``eigen.no-mass``,
        ``eigen.no-dofs``, ``eigen.missed-modes``, ``eigen.inaccurate``, ``eigen.negative``, ``eigen.no-convergence``,
        ``eigen.uncounted``
    """
    K, M = point.stiffness, point.mass
    _check_matrices(point, M)
    shift, factor = spectral_shift(point, K, M)
    possible = int((np.abs(M).sum(axis=1) > 0).sum())
    wanted = min(_wanted(K, M, count, max_hz), possible)
    extra = _EXTRA_MODES
    while True:
        asked = min(wanted + extra, possible)
        values, shapes, known = lowest(K, M, factor, shift, asked, wanted)
        whole = _with_repeats(values, min(wanted, known), shift)
        cut = _cut(values, whole, known, shift, asked == possible or len(values) < asked)
        below = None if cut is None else _count_below(K, M, cut[0])
        if cut is not None and below in (None, cut[1]):
            break
        if asked == possible or extra > _MOST_EXTRA:
            raise _missed(cut, below)
        extra *= 4
    notices = (_not_counted(),) if below is None else ()
    counted = -1 if below is None else below
    # one order in memory, so that what follows is the same to the last bit whoever computed or kept the shapes
    shapes = np.ascontiguousarray(shapes[:, :known])
    return EigenSolution(point, values[:known], shapes, whole, shift, cut[0], counted, notices, factor)


def _check_matrices(point: ModelPoint, M: sp.csr_array) -> None:
    name = point.configured.configuration.name
    if not point.configured.n_free:
        raise FemtuneError(
            "eigen.no-dofs", f"configuration {name}: every DOF is held", hint="remove supports; femtune info lists them"
        )
    if not np.abs(M.data).sum():
        raise FemtuneError(
            "eigen.no-mass", f"configuration {name}: the model has no mass", hint="give the materials a density"
        )


def _wanted(K: sp.csr_array, M: sp.csr_array, count: int | None, max_hz: float | None) -> int:
    if max_hz is None:
        return _DEFAULT_COUNT if count is None else max(count, 1)
    below = _count_below(K, M, (2.0 * np.pi * max_hz) ** 2)
    if below is None:
        raise FemtuneError(
            "eigen.uncounted",
            f"the modes up to {max_hz:g} Hz could not be counted: the factorisation's pivots hide the inertia",
            hint="give the number of modes (count) instead, or another max_hz",
        )
    return max(below, 1)


def _with_repeats(values: NDArray, wanted: int, shift: float) -> int:
    """The number of modes that keeps a repeated mode at the end whole."""
    while wanted < len(values) and values[wanted] - values[wanted - 1] <= _REPEATED * (values[wanted] - shift):
        wanted += 1
    return wanted


def _cut(values: NDArray, wanted: int, known: int, shift: float, complete: bool) -> tuple[float, int] | None:
    """A shift in the widest relative gap above the wanted modes and the number of modes below it; None without one.

    Gaps are relative to λ − σ: among rigid-body modes, whose λ are rounding, there is none.
    """
    ends = values[wanted - 1 : min(known + 1, len(values))]
    if wanted > known:
        return None
    if len(ends) < 2:
        return (float(values[-1] + 0.01 * (values[-1] - shift)), len(values)) if complete else None
    gaps = np.diff(ends) / (ends[1:] - shift)
    i = int(np.argmax(gaps))
    return (0.5 * float(ends[i] + ends[i + 1]), wanted + i) if gaps[i] > _REPEATED else None


def _count_below(K: sp.csr_array, M: sp.csr_array, eigenvalue: float) -> int | None:
    """Number of eigenvalues below a value: negative pivots of K − λM."""
    for nudge in (1.0, 1.0 + 1e-7, 1.0 + 1e-5):
        try:
            count = factorise(sp.csr_array(K - nudge * eigenvalue * M)).negative_pivots
        except SingularMatrixError:
            continue
        if count is not None:
            return count
    return None


def _missed(cut: tuple[float, int] | None, below: int | None) -> FemtuneError:
    if cut is None:
        text = "the modes do not end: no gap above the wanted ones could be found to count them at"
    else:
        text = f"{below} eigenvalues lie below {cut[0]:.6g} rad²/s², but {cut[1]} were found"
    return FemtuneError("eigen.missed-modes", text, hint="ask for a few modes more")


def _not_counted() -> Notice:
    return Notice("eigen.not-counted", "the modes could not be counted: the factorisation's pivots hide the inertia")
