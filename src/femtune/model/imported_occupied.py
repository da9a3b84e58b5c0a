"""Which DOFs imported matrices have entries for: signs of a file that was cut, or of another run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.fem import AssembledMatrix, NodeTable
from femtune.fem.contribution import MatrixKind

Flags = NDArray[np.bool_]

# entries beside a zero diagonal that are rounding, over the largest diagonal
_ROUNDING = 1e-9
_SHOWN = 6


def touched(upper: sp.csr_array, least: float = 0.0) -> Flags:
    """(n,) whether a DOF has an entry above `least`, in its row or column."""
    coo = sp.coo_array(upper)
    some = np.abs(coo.data) > least
    seen = np.zeros(upper.shape[0], bool)
    seen[coo.row[some]] = seen[coo.col[some]] = True
    return seen


def check_occupied(nodes: NodeTable, assembled: Sequence[AssembledMatrix]) -> list[Notice]:
    """Stiffness and mass lie on the same DOFs, and no row has entries but no diagonal.

    Raises
    ------
    FemtuneError : ``matrices.disjoint``, ``matrices.no-diagonal``
    """
    stiffness, mass = (_of_kind(nodes, assembled, kind) for kind in ("stiffness", "mass"))
    if not (stiffness & mass).any():
        raise FemtuneError(
            "matrices.disjoint",
            "no degree of freedom has both stiffness and mass",
            values={"stiffness at": _names(nodes, stiffness), "mass at": _names(nodes, mass)},
            hint="take both of one and the same run, with the same numbers of nodes",
        )
    return [*_loose(nodes, mass & ~stiffness), *_massless(nodes, stiffness & ~mass)]


def _massless(nodes: NodeTable, flags: Flags) -> list[Notice]:
    """Translations only: a lumped mass has no rotations."""
    at = np.arange(len(flags))
    bare = flags & (at < 6 * len(nodes.ids)) & (at % 6 < 3)
    if not bare.any():
        return []
    what = f"{bare.sum()} translations have stiffness and no mass: {_names(nodes, bare)}"
    text = f"{what}; if nodes of elements with mass are among them, the file of the mass was cut"
    return [Notice("matrices.stiffness-without-mass", text, level="info")]


def _loose(nodes: NodeTable, loose: Flags) -> list[Notice]:
    if not loose.any():
        return []
    what = f"{loose.sum()} degrees of freedom have mass and no stiffness, and move freely: {_names(nodes, loose)}"
    return [Notice("matrices.mass-without-stiffness", f"{what}; the file of the stiffness may have been cut")]


def _of_kind(nodes: NodeTable, assembled: Sequence[AssembledMatrix], kind: MatrixKind) -> Flags:
    """DOFs with entries of a kind; each has a diagonal, since x·K x < 0 for some x otherwise."""
    mine = [m.upper for m in assembled if m.kind == kind]
    diagonals = np.max([np.abs(m.diagonal()) for m in mine], axis=0)
    least = _ROUNDING * diagonals.max(initial=0.0)
    bare = np.any([touched(m, least) for m in mine], axis=0) & (diagonals == 0.0)
    if bare.any():
        raise FemtuneError(
            "matrices.no-diagonal",
            f"{bare.sum()} rows of the {kind} have entries and no diagonal",
            values={"DOFs": _names(nodes, bare)},
            hint="the file was cut at the end of a line: write or copy it again; Lagrange multipliers are no part of a "
            "stiffness: let the solver eliminate its constraints",
        )
    return np.asarray(np.any([touched(m) for m in mine], axis=0))


def _names(nodes: NodeTable, flags: Flags) -> str:
    at = np.flatnonzero(flags)
    return ", ".join(str(nodes.describe(int(i)))[:-1] for i in at[:_SHOWN]) + (" …" if at.size > _SHOWN else "")
