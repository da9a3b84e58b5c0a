"""SciPy's eigsh (ARPACK) on the same matrices: on femtune's PARDISO factors, or on SuperLU's.

The shift is the one that femtune found, given for nothing. The products with M take both triangles, as a user has them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from checks import check_modes, hertz
from numpy.typing import NDArray
from stages import Stages
from workspace import Workspace

from cases import MODES
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.factorise import analyse
from femtune.model.solvers.interface import Analysis

Pair = tuple[NDArray, NDArray]
_TOLERANCE = 0.0  # eigsh's own: rounding


def pardiso(space: Workspace, shift: float | None) -> dict[str, Any]:
    """On PARDISO; the changed matrices with the ordering known and the sum of the old shapes to start from."""
    assert shift is not None
    stages = Stages()
    K, M = space.matrices(0)
    full = K.full(), M.full()
    with stages.stage("analyse"):
        analysis = analyse(K, "PARDISO")
    first = _by_pardiso(analysis, (K, M), full, shift, stages, "")
    del full
    changed = space.matrices(1)
    full = changed[0].full(), changed[1].full()
    second = _by_pardiso(analysis, changed, full, shift, stages, ", changed", first[1].sum(axis=1))
    return _result(stages, shift, [((K, M), first), (changed, second)])


def _by_pardiso(
    analysis: Analysis, pair: tuple[SymmetricMatrix, SymmetricMatrix], full: tuple[sp.csr_array, sp.csr_array],
    shift: float, stages: Stages, suffix: str, start: NDArray | None = None,
) -> Pair:  # fmt: skip
    with stages.stage("factorise" + suffix):
        factor = analysis.factorise(pair[0].plus(-shift, pair[1]))
    solves = _Solves(factor.solve)
    inverse = spla.LinearOperator(full[0].shape, matvec=solves, dtype=float)
    with stages.stage("50 modes" + suffix):
        found = spla.eigsh(full[0], MODES, full[1], sigma=shift, OPinv=inverse, tol=_TOLERANCE, v0=start)
    stages.into("50 modes" + suffix, solves=solves.number)
    return found


class _Solves:
    """A solve that counts."""

    def __init__(self, solve: Callable[[NDArray], NDArray]) -> None:
        self.solve, self.number = solve, 0

    def __call__(self, b: NDArray) -> NDArray:
        self.number += 1
        return self.solve(b)


def superlu(space: Workspace, shift: float | None) -> dict[str, Any]:
    """As eigsh does it by itself."""
    assert shift is not None
    stages = Stages()
    K, M = space.full_matrices(0)
    with stages.stage("50 modes"):
        found = spla.eigsh(sp.csc_array(K), MODES, sp.csc_array(M), sigma=shift, tol=_TOLERANCE)
    return _result(stages, shift, [(space.matrices(0), found)])


def superlu_symmetric(space: Workspace, shift: float | None) -> dict[str, Any]:
    """With SuperLU's options for symmetric matrices, as somebody who knows them would do."""
    assert shift is not None
    stages = Stages()
    K, M = (sp.csc_array(matrix) for matrix in space.full_matrices(0))
    with stages.stage("factorise"):
        factor = spla.splu(
            sp.csc_array(K - shift * M), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )  # fmt: skip
    solves = _Solves(factor.solve)
    inverse = spla.LinearOperator(K.shape, matvec=solves, dtype=float)
    with stages.stage("50 modes"):
        found = spla.eigsh(K, MODES, M, sigma=shift, OPinv=inverse, tol=_TOLERANCE)
    stages.into("50 modes", solves=solves.number)
    return _result(stages, shift, [(space.matrices(0), found)])


def _result(stages: Stages, shift: float, found: list[tuple[Any, Pair]]) -> dict[str, Any]:
    """Sorted, checked."""
    checks, freq = {}, []
    for name, (pair, (values, shapes)) in zip(("nominal", "changed"), found):
        order = np.argsort(values)
        checks[name] = check_modes(pair, shift, values[order], shapes[:, order])
        freq.append(hertz(values[order]).tolist())
    wrong = "; ".join(text for text in (c.wrong() for c in checks.values()) if text)
    return {
        "stages": stages.measured,
        "freq_hz": freq,
        "checks": {name: vars(c) for name, c in checks.items()},
        "wrong": wrong,
    }
