"""The lowest modes by SLEPc over MPI, with the same proof that none was missed, and without factors of our own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Notice
from femtune.model.distributed import SlepcModes, slepc_count, slepc_is_chosen, slepc_lowest
from femtune.model.distributed.launch import petsc_options
from femtune.model.eigen.sturm import missed
from femtune.model.linear.symmetric import SymmetricMatrix

End = Callable[[Reals, int, int, float, bool], tuple[int, tuple[float, int] | None]]

_LEAST_DOFS = 400
"""DOFs up to which the dense solution of this process is faster than starting others."""
_EXTRA_MODES = 6
"""Modes beyond the wanted ones: they serve the derivatives, and the count needs a gap above the wanted modes."""
_MOST_EXTRA = 400
"""Extra modes after which a count that does not agree is an error."""
_ACCURACY = 1e-6
"""Largest relative residual; SLEPc goes on to 1e-10, and stiffnesses twelve decades apart leave rounding above that."""
_NEGATIVE_ENERGY = 1e-8
"""Strain energy relative to the sum of the magnitudes of its terms that is more than rounding of a rigid-body mode."""


@dataclass(frozen=True, eq=False)
class SlepcSolution:
    """Modes with the count of eigenvalues below `sturm_shift`; −1 where it could not be counted."""

    values: Reals
    shapes: Reals = field(repr=False)
    wanted: int
    shift: float
    sturm_shift: float
    sturm_count: int


def goes_to_slepc(M: SymmetricMatrix, count: int | None) -> bool:
    """True where SLEPc is chosen, except for small problems and those where most modes are wanted.

    Raises
    ------
    FemtuneError : ``solver.unavailable`` for an unknown eigen-solver
    """
    return slepc_is_chosen() and M.shape[0] > _LEAST_DOFS and 2 * ((count or 0) + _EXTRA_MODES) < _with_mass(M)


def small_for_slepc(M: SymmetricMatrix) -> tuple[Notice, ...]:
    """The notice that SLEPc is chosen and was not used; () where it is not chosen."""
    if not slepc_is_chosen():
        return ()
    return (Notice("slepc.not-used", level="info", dofs=M.shape[0], limit=_LEAST_DOFS),)


def _with_mass(M: SymmetricMatrix) -> int:
    return int((M.diagonal() > 0.0).sum())


def solve_by_slepc(
    K: SymmetricMatrix, M: SymmetricMatrix, count: int | None, max_hz: float | None, end: End
) -> SlepcSolution:
    """The `count` lowest modes, or all up to `max_hz` but at least one.

    Parameters
    ----------
    end : from the eigenvalues, the number wanted, the number that is accurate, the shift and whether these are all:
        the number that keeps a repeated mode whole, and a cut above it with the number of modes below, or None

    Raises
    ------
    FemtuneError : ``eigen.uncounted``, ``eigen.inaccurate``, ``eigen.missed-modes``, ``eigen.negative``,
        ``slepc.…``
    """
    wanted = _wanted(K, M, count, max_hz)
    possible, extra = _with_mass(M), _EXTRA_MODES
    while True:
        asked = min(wanted + extra, possible)
        modes = slepc_lowest(K, M, asked)
        known = _accurate(modes, wanted)
        whole, cut = end(modes.values, wanted, known, modes.shift, len(modes.values) == possible)
        below = None if cut is None else slepc_count(K, M, cut[0])
        if cut is not None and below in (None, cut[1]):
            break
        if asked == possible or extra > _MOST_EXTRA:
            raise _missed(cut, below)
        extra *= 4
    counted = -1 if below is None else below
    _check_negative(K, modes.values[:known], modes.shapes[:, :known])
    return SlepcSolution(modes.values[:known], modes.shapes[:, :known], whole, modes.shift, cut[0], counted)


def _wanted(K: SymmetricMatrix, M: SymmetricMatrix, count: int | None, max_hz: float | None) -> int:
    if max_hz is None:
        return max(count or 0, 1)
    below = slepc_count(K, M, (2.0 * np.pi * max_hz) ** 2)
    if below is None:
        raise FemtuneError("eigen.uncounted", max_hz=max_hz)
    return max(below, 1)


def _accurate(modes: SlepcModes, wanted: int) -> int:
    """Number of modes before the first that is not accurate."""
    bad = np.flatnonzero(~(modes.errors <= _ACCURACY))
    known = int(bad[0]) if bad.size else len(modes.values)
    if known >= wanted:
        return known
    worst = f"{modes.errors[known]:.1e}" if bad.size else "not known, because it did not converge"
    options = petsc_options()
    code = "eigen.inaccurate/slepc-petsc-options" if options else "eigen.inaccurate/slepc"
    raise FemtuneError(code, values=options, mode=known + 1, residual=worst)


def _check_negative(K: SymmetricMatrix, values: Reals, shapes: Reals) -> None:
    """Refuse modes of negative strain energy; that of a rigid-body mode is rounding of large parts."""
    below = shapes[:, values < 0.0]
    strain = np.einsum("ij,ij->j", below, K @ below)
    sizes = SymmetricMatrix(np.abs(K.data), K.indices, K.indptr)
    if (strain < -_NEGATIVE_ENERGY * np.einsum("ij,ij->j", np.abs(below), sizes @ np.abs(below))).any():
        raise FemtuneError("eigen.negative", eigenvalue=values[0])


def _missed(cut: tuple[float, int] | None, below: int | None) -> FemtuneError:
    options = petsc_options()
    if not options:
        return missed(cut, below)
    if cut is None:
        return FemtuneError("eigen.missed-modes/no-gap-petsc-options", values=options)
    return FemtuneError(
        "eigen.missed-modes/petsc-options", values=options, below=below, eigenvalue=cut[0], found=cut[1]
    )
