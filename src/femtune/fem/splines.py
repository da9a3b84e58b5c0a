"""Equations of an RSPLINE: dependent components follow a thin elastic tube through all of its grid points.

Between grid points whose components are all independent, the tube is cubic in the lateral displacements, and linear in
the axial displacement and the twist. Where only some components of a point are dependent, the result depends on the
ratio of the tube's diameter to its length.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError, Where
from femtune.fem.constraints import follow_rows, motion_of
from femtune.fem.elements import placement
from femtune.fem.structure import ConstraintRows, NodeTable

# of a thin tube with unit area and Young's modulus: I = D²/8, J = 2I, G = E / 2.6
_SHEAR = 1.0 / 2.6
_NOISE = 1e-11
_ACCURACY = 1e-6


def spline_rows(
    nodes: NodeTable, points: Sequence[int], dependent: Sequence[Sequence[int]], ratio: float, owner: int
) -> ConstraintRows:
    """RSPLINE through grid points in order.

    Parameters
    ----------
    nodes : grid points
    points : numbers of the grid points, the ends first and last
    dependent : components from 1 to 6 of each point that follow, in its displacement frame; none at the ends
    ratio : diameter of the tube over the sum of the lengths of all segments
    owner : number of the element

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.own-node`` where two points in sequence are at one place,
        ``constraint.spline`` where rounding spoils the equations
    """
    where = Where(record=f"RSPLINE {owner}")
    at = np.array([nodes.position(n, where) for n in points], dtype=np.int64)
    stiffness = _tube(nodes, at, ratio, points, where)
    follows = np.concatenate([6 * i + np.array(c, np.int64) - 1 for i, c in enumerate(dependent)]).astype(np.int64)
    given = np.setdiff1d(np.arange(6 * len(at)), follows)
    follow = _condensed(stiffness, follows, given)
    dofs = (6 * at[:, None] + np.arange(6)).ravel()
    rigid = motion_of(nodes, dofs, at[:1])
    # rigid-body motion leaves the tube without strain, so the dependent components must follow it
    wrong = np.abs(rigid[follows] - follow @ rigid[given]) > _ACCURACY * np.abs(rigid).max(axis=0)
    if not np.isfinite(follow).all() or wrong.any():
        lengths = np.linalg.norm(np.diff(nodes.xyz[at], axis=0), axis=1)
        raise FemtuneError("constraint.spline", where=where, ratio=ratio, least=lengths.min(), most=lengths.max())
    return follow_rows(dofs[follows], np.tile(dofs[given], (len(follows), 1)), follow, owner, _NOISE)


def _condensed(stiffness: Reals, follows: Integers, given: Integers) -> Reals:
    """(m, n) displacements `follows` that unit displacements `given` cause; NaN where the tube is singular."""
    # diagonal scaling: translations and rotations, short and long segments count alike
    size = np.sqrt(np.diag(stiffness)[follows])
    own = stiffness[np.ix_(follows, follows)] / np.outer(size, size)
    try:
        factor = scipy.linalg.cho_factor(own)
    except np.linalg.LinAlgError:
        return np.full((len(follows), len(given)), np.nan)
    solved = scipy.linalg.cho_solve(factor, stiffness[np.ix_(follows, given)] / size[:, None])
    return np.asarray(-solved / size[:, None])


def _tube(nodes: NodeTable, at: Integers, ratio: float, points: Sequence[int], where: Where) -> Reals:
    """(6n, 6n) stiffness of the tube in the displacement frames of its points."""
    lines = np.diff(nodes.xyz[at], axis=0)
    lengths = np.linalg.norm(lines, axis=1)
    if (lengths == 0.0).any():
        first = int(np.argmin(lengths))
        raise FemtuneError(
            "constraint.own-node/one-place", where=where, grid=points[first], next_grid=points[first + 1]
        )
    bending = (ratio * lengths.sum()) ** 2 / 8.0
    axes = placement.any_axes(lines / lengths[:, None])
    out = np.zeros((6 * len(at), 6 * len(at)))
    for k, (length, frame) in enumerate(zip(lengths, axes)):
        rows = _deformations(length)
        for end in (0, 1):
            turn = frame.T @ nodes.frames[at[k + end]]
            for part in (0, 3):
                columns = slice(6 * end + part, 6 * end + part + 3)
                rows[:, columns] = rows[:, columns] @ turn
        twist, rotation = 2.0 * _SHEAR * bending / length, bending / length * np.array([[4.0, 2.0], [2.0, 4.0]])
        law = scipy.linalg.block_diag([[1.0 / length]], [[twist]], rotation, rotation)
        own = slice(6 * k, 6 * k + 12)
        out[own, own] += rows.T @ law @ rows
    return out


def _deformations(length: float) -> Reals:
    """(6, 12) stretch, twist, and rotations of both ends relative to the chord about z and about y."""
    rows = np.zeros((6, 12))
    rows[0, [0, 6]], rows[1, [3, 9]] = (-1.0, 1.0), (-1.0, 1.0)
    for first, across, about, sign in ((2, 1, 5, -1.0), (4, 2, 4, 1.0)):
        for end in (0, 1):
            rows[first + end, [across, across + 6]] = -sign / length, sign / length
            rows[first + end, about + 6 * end] = 1.0
    return rows
