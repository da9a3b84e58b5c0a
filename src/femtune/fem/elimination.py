"""Elimination: from the free DOFs to the whole g-set, u_g = T u_free, for any chain of constraint equations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from femtune.arrays import Integers
from femtune.dofs import Dof
from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.fem.structure import ConstraintRows

Describe = Callable[[int], Dof]

SINGULAR_LOOP = 1e-11
"""Singular values of a loop of equations up to this fraction of the largest mean that it has no unique solution.

The loop is solved by a factorisation, which loses as many digits; five would be left.
"""


@dataclass(frozen=True, eq=False)
class Elimination:
    """u_g = T u_free: `T` (n_g, n_free) csr; `free` (n_free,) g-set DOFs of its columns, ascending."""

    T: sp.csr_array
    free: Integers


def eliminate(n_dofs: int, rows: ConstraintRows, held: Iterable[int], describe: Describe) -> Elimination:
    """Solve the constraint equations for their dependent DOFs and set the held ones to zero.

    Parameters
    ----------
    n_dofs : size of the g-set
    rows : equations, one dependent DOF each, in any order; dependent DOFs may depend on other dependent DOFs
    held : g-set DOFs that do not move
    describe : name of a g-set DOF, for messages

    Raises
    ------
    FemtuneError : ``constraint.dependent-twice``, ``constraint.dependent-held``, ``constraint.zero-coefficient``,
        ``constraint.circular``; several are collected
    """
    fixed = np.unique(np.fromiter(held, dtype=np.int64))
    matrix = sp.csr_array((rows.coefficient, (rows.row, rows.dof)), shape=(len(rows), n_dofs))
    _check(rows, matrix, fixed, describe)
    is_free = np.ones(n_dofs, bool)
    is_free[rows.dependent] = is_free[fixed] = False
    free = np.flatnonzero(is_free)
    follow = _solve(matrix[:, rows.dependent], matrix[:, free], rows, describe)
    identity = sp.csr_array((np.ones(len(free)), (free, np.arange(len(free)))), shape=(n_dofs, len(free)))
    place = sp.csr_array((np.ones(len(rows)), (rows.dependent, np.arange(len(rows)))), shape=(n_dofs, len(rows)))
    T = sp.csr_array(identity + place @ follow)
    T.eliminate_zeros()
    T.sort_indices()
    return Elimination(T, free)


def _owner(rows: ConstraintRows, i: int) -> str:
    return f"rigid element {rows.owner[i]}" if rows.owner[i] else "MPC"


def _name(dof: Dof) -> str:
    return f"component {dof.component} of node {dof.node}"


def _check(rows: ConstraintRows, matrix: sp.csr_array, fixed: Integers, describe: Describe) -> None:
    errors = ErrorCollector()
    order = np.argsort(rows.dependent, kind="stable")
    repeated = np.flatnonzero(np.diff(rows.dependent[order]) == 0)
    for i in repeated:
        with errors.catch():
            raise _twice(rows, int(order[i]), int(order[i + 1]), describe)
    for i in np.flatnonzero(np.isin(rows.dependent, fixed)):
        with errors.catch():
            raise _held(rows, int(i), describe)
    coefficients = matrix[np.arange(len(rows)), rows.dependent] if len(rows) else np.zeros(0)
    for i in np.flatnonzero(np.asarray(coefficients) == 0.0):
        with errors.catch():
            raise _no_coefficient(rows, int(i), describe)
    errors.raise_if_any()


def _twice(rows: ConstraintRows, first: int, second: int, describe: Describe) -> FemtuneError:
    return FemtuneError(
        "constraint.dependent-twice",
        where=Where(record=_owner(rows, second)),
        element=int(rows.owner[second]),
        values={"also dependent in": _owner(rows, first)},
        dof=_name(describe(int(rows.dependent[first]))),
    )


def _held(rows: ConstraintRows, i: int, describe: Describe) -> FemtuneError:
    return FemtuneError(
        "constraint.dependent-held",
        where=Where(record=_owner(rows, i)),
        element=int(rows.owner[i]),
        dof=_name(describe(int(rows.dependent[i]))),
    )


def _no_coefficient(rows: ConstraintRows, i: int, describe: Describe) -> FemtuneError:
    return FemtuneError(
        "constraint.zero-coefficient",
        where=Where(record=_owner(rows, i)),
        element=int(rows.owner[i]),
        dof=_name(describe(int(rows.dependent[i]))),
    )


def _solve(among: sp.csr_array, on: sp.csr_array, rows: ConstraintRows, describe: Describe) -> sp.csr_array:
    """−among⁻¹ on: dependents from free DOFs; chains by substitution, loops by factorisation."""
    if not len(rows):
        return sp.csr_array(on.shape)
    inverse = sp.diags_array(1.0 / among.diagonal())
    step = sp.csr_array(sp.eye_array(len(rows)) - inverse @ among)
    step.setdiag(0.0)
    step.eliminate_zeros()
    if _check_loops(among, step, rows, describe):
        return _factorised(among, on)
    follow = sp.csr_array(-(inverse @ on))
    # (1 − N)⁻¹ = (1 + N)(1 + N²)(1 + N⁴) …, finite because chains end
    while step.nnz:
        follow, step = sp.csr_array(follow + step @ follow), sp.csr_array(step @ step)
        step.eliminate_zeros()
    return follow


def _factorised(among: sp.csr_array, on: sp.csr_array) -> sp.csr_array:
    columns = np.unique(on.indices)
    solved = splu(among.tocsc()).solve(-on[:, columns].toarray())
    spread = sp.csr_array(
        (np.ones(len(columns)), (np.arange(len(columns)), columns)), shape=(len(columns), on.shape[1])
    )
    return sp.csr_array(sp.csr_array(solved) @ spread)


def _check_loops(among: sp.csr_array, step: sp.csr_array, rows: ConstraintRows, describe: Describe) -> bool:
    """True if equations depend on each other in a loop; error if a loop has no solution."""
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415  many models have no constraint equations

    count, label = connected_components(step, directed=True, connection="strong")
    sizes = np.bincount(label, minlength=count)
    for group in np.flatnonzero(sizes > 1):
        at = np.flatnonzero(label == group)
        _, s, vt = np.linalg.svd(among[at][:, at].toarray())
        if s[-1] <= SINGULAR_LOOP * s[0]:
            # the first of those that move most, so that rounding does not choose among equal ones
            moving = np.abs(vt[-1]) > 0.999 * np.abs(vt[-1]).max()
            raise _circular(rows, int(at[np.argmax(moving)]), at, describe)
    return bool((sizes > 1).any())


def _circular(rows: ConstraintRows, i: int, loop: Integers, describe: Describe) -> FemtuneError:
    names = sorted({_owner(rows, int(j)) for j in loop})
    return FemtuneError(
        "constraint.circular",
        where=Where(record=_owner(rows, i)),
        element=int(rows.owner[i]),
        values={"equations in the loop": ", ".join(names[:5]) + (" …" if len(names) > 5 else "")},
        dof=_name(describe(int(rows.dependent[i]))),
    )
