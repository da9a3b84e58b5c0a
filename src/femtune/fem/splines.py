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

_SHEAR_MODULUS = 1.0 / 2.6
"""G / E = 1 / (2 (1 + ν)) of the tube, ν = 0.3; its area and E are 1, I = D²/8 and J = 2I as for a thin tube."""
_COEFFICIENT_ROUNDING = 1e-11
"""Coefficients below this fraction of the largest of their equation are dropped.

The equations come from a factorisation, which amplifies rounding errors by its condition number; coefficients that
vanish exactly remain of this size in moderately conditioned tubes.
"""
_RIGID_ERROR = 1e-6
"""Largest error of a rigid-body motion that the equations may have, relative to its largest displacement.

It measures the digits that the factorisation lost; half of them must be left for the derivatives of modes.
"""


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
    FemtuneError : ``model.unknown-node``, ``constraint.own-node`` if two successive points coincide,
        ``constraint.spline`` if rounding errors of the equations are too large
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
    wrong = np.abs(rigid[follows] - follow @ rigid[given]) > _RIGID_ERROR * np.abs(rigid).max(axis=0)
    if not np.isfinite(follow).all() or wrong.any():
        lengths = np.linalg.norm(np.diff(nodes.xyz[at], axis=0), axis=1)
        raise FemtuneError("constraint.spline", where=where, ratio=ratio, least=lengths.min(), most=lengths.max())
    return follow_rows(dofs[follows], np.tile(dofs[given], (len(follows), 1)), follow, owner, _COEFFICIENT_ROUNDING)


def _condensed(stiffness: Reals, follows: Integers, given: Integers) -> Reals:
    """(m, n) displacements `follows` due to unit displacements `given`; NaN if the tube is singular."""
    # diagonal scaling gives translations and rotations, short and long segments the same weight
    size = np.sqrt(np.diag(stiffness)[follows])
    scaled = stiffness[np.ix_(follows, follows)] / np.outer(size, size)
    try:
        factor = scipy.linalg.cho_factor(scaled)
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
        twist, rotation = 2.0 * _SHEAR_MODULUS * bending / length, bending / length * np.array([[4.0, 2.0], [2.0, 4.0]])
        law = scipy.linalg.block_diag([[1.0 / length]], [[twist]], rotation, rotation)
        segment = slice(6 * k, 6 * k + 12)
        out[segment, segment] += rows.T @ law @ rows
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
