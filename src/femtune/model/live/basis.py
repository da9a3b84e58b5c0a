"""A second reduction: the reduced model of an update is trained to be exact everywhere, and is too large for a page.

The modes of the first reduced model at points of the region and of the bounds are ordered by their singular values in
energy norm; the leading ones are the basis. The modes of the updated point come first, so that it is exact there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.reduce import ReducedModel, ReducedModes, reduced_modes

WHOLE = 40
"""Order up to which all of a model is kept: a smaller basis would save nothing."""
_NEGLIGIBLE = 1e-9
"""Singular value relative to the largest one below which a vector is rounding."""
_DEPENDENT = 1e-7
"""Part of a vector outside those before it below which it is rounding."""


def is_whole(model: ReducedModel) -> bool:
    """True where all of a model is kept, so that no points need to be solved for a basis."""
    return model.order <= WHOLE


@dataclass(frozen=True, eq=False)
class SecondBasis:
    """Leading vectors of the modes at some points.

    Parameters
    ----------
    model : the first reduced model
    at : (k,) the updated point
    count : vectors that it has in any case: the lowest modes and the static responses at the updated point
    vectors : (r, q) in the coordinates of the first basis; yᵀ(K − σM)y = 1 at the updated point; the first ones are the
        modes there
    """

    model: ReducedModel
    at: Reals
    count: int
    vectors: Reals = field(repr=False)

    def leading(self, order: int) -> Reals:
        """(r, order) vectors that diagonalise K and M of the updated point on the leading ones, yᵀ(K − σM)y = 1."""
        some = self.vectors[:, :order]
        mass = some.T @ self.model.at(self.at).mass @ some
        _, turned = la.eigh(0.5 * (mass + mass.T))
        return np.asarray(some @ turned[:, ::-1])


def second_basis(
    model: ReducedModel, at: Reals, points: Sequence[Reals], count: int, most: int, forces: Reals | None = None,
    near: Sequence[Reals] = (), near_count: int = 0,
) -> SecondBasis:  # fmt: skip
    """The basis from the modes at points.

    Parameters
    ----------
    points : (k,) each; where the model cannot be solved, one is left out
    count : modes that matter
    most : vectors at most
    forces : (r, f) whose static responses the basis must have too; None without any
    near : (k,) further points, about the updated one
    near_count : modes that matter there and at the updated point, where they are more than `count`

    Raises
    ------
    FemtuneError : ``reduce.indefinite`` at the updated point
    """
    near_count = max(count, near_count)
    start = reduced_modes(model.at(at), near_count)
    if is_whole(model):
        return SecondBasis(model, at, start.wanted, start.vectors)
    point = start.point
    root = la.cholesky(point.stiffness - model.shift * point.mass)
    modes = start.vectors[:, : max(start.wanted, 1)]
    if forces is not None:
        modes = np.hstack([modes, _responses(model, at, forces)])
    first = _independent(root @ modes)
    wanted = start.wanted if forces is None else first.shape[1]
    snapshots = [root @ _shapes(model, x, n) for n, some in ((near_count, near), (count, points)) for x in some]
    if forces is not None:
        snapshots += [root @ _responses(model, x, forces) for x in (*near, *points)]
    rest = np.hstack([s for s in snapshots if s.size] or [np.zeros((len(root), 0))])
    rest = rest - first @ (first.T @ rest)
    rest = rest - first @ (first.T @ rest)
    if rest.shape[1]:
        left, size, _ = la.svd(rest, full_matrices=False)
        left = left[:, size > _NEGLIGIBLE]
        first = np.hstack([first, left])
    vectors = la.solve_triangular(root, first[:, :most])
    return SecondBasis(model, at, wanted, vectors)


def _independent(vectors: Reals) -> Reals:
    """An orthonormal basis of what the vectors span, the first ones first."""
    Q, R = la.qr(vectors, mode="economic")
    size = np.linalg.norm(vectors, axis=0)
    return np.asarray(Q[:, np.abs(np.diag(R)) > _DEPENDENT * size[: len(Q.T)]])


def _responses(model: ReducedModel, x: Reals, forces: Reals) -> Reals:
    """(r, f) responses (K − σM)⁻¹F of unit energy; none where the model has none."""
    point = model.at(x)
    try:
        found = la.cho_solve(la.cho_factor(point.stiffness - model.shift * point.mass), forces)
    except la.LinAlgError:
        return np.zeros((model.order, 0))
    energy = np.einsum("rf,rf->f", forces, found)
    return np.asarray(found[:, energy > 0.0] / np.sqrt(energy[energy > 0.0]))


def _shapes(model: ReducedModel, x: Reals, count: int) -> Reals:
    """(r, m) modes of unit energy; none where the model cannot be solved."""
    try:
        modes: ReducedModes = reduced_modes(model.at(x), count)
    except FemtuneError:
        return np.zeros((model.order, 0))
    return modes.vectors[:, : modes.wanted]
