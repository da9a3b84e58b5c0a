"""Equations of an averaging element (RBE3): a point moves with the mean rigid motion of others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.fem.constraints import CONDITION, NOISE, Components, check_once, component_dofs, follow_rows, motion_of
from femtune.fem.structure import ConstraintRows, NodeTable

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

# singular value of the fit, relative to the largest and lengths in units of the element's own, taken for zero
RANK = 1e-9
# part of a reference component in a motion that the points do not determine, taken for zero
OPEN = 1e-6


@dataclass(frozen=True)
class WeightedPoints:
    """One group of an RBE3: `components` of 1 to 6 at the grid points `numbers`, all of one weight (WT, C, G)."""

    weight: float
    components: Sequence[int]
    numbers: Sequence[int]


def average_rows(
    nodes: NodeTable,
    reference: int,
    components: Sequence[int],
    groups: Sequence[WeightedPoints],
    owner: int,
    dependent: Components = (),
) -> ConstraintRows:
    """RBE3: components of a reference grid point follow the rigid motion that fits the points best.

    The fit is that of least squares, Σ w (u − rigid motion)² over the listed components of the points; rotations
    count with w·L², L being the mean distance of the points from the reference, so that no unit of length matters.

    Parameters
    ----------
    nodes : grid points
    reference, components : REFGRID and REFC, of 1 to 6 in its displacement frame
    groups : WT, C, G
    owner : number of the element
    dependent : the components that are dependent in place of REFC (UM); as many, of REFC and of the points'

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.own-node``, ``constraint.weight``,
        ``constraint.twice-in-element``, ``constraint.undetermined-motion``, ``constraint.dependent-choice``
    """
    where = Where(record=f"RBE3 {owner}")
    _check_groups(reference, groups, where)
    listed = [(n, g.components) for g in groups for n in g.numbers]
    own = component_dofs(nodes, [(reference, components)], where)
    points = component_dofs(nodes, listed, where)
    check_once(nodes, points, "averaged", where)
    weights = np.concatenate([np.full(len(g.numbers) * len(g.components), g.weight) for g in groups])
    length = _mean_distance(nodes, points, own)
    follow = _fit(nodes, points, weights, own, length, where)
    if not len(dependent):
        return follow_rows(own, np.tile(points, (len(own), 1)), follow, owner, noise=0.0)
    chosen = component_dofs(nodes, dependent, where)
    return _exchange(nodes, (own, points, follow), chosen, length, owner)


def _check_groups(reference: int, groups: Sequence[WeightedPoints], where: Where) -> None:
    for group in groups:
        if not group.weight > 0.0:
            what = f"the weight {group.weight:g} is not above zero"
            raise FemtuneError("constraint.weight", what, where=where,
                               hint="give weights above zero; they count in proportion to each other")  # fmt: skip
        if reference in group.numbers:
            what = f"the reference grid point {reference} is among the points that it is the mean of"
            raise FemtuneError("constraint.own-node", what, where=where, hint="take it out of the list of points")


def _mean_distance(nodes: NodeTable, points: Integers, own: Integers) -> float:
    """Mean distance of the points from the reference; 1 where all are at the same place and no length enters."""
    rows = np.unique(points // 6)
    distance = np.linalg.norm(nodes.xyz[rows] - nodes.xyz[own[0] // 6], axis=1)
    return float(distance.mean()) or 1.0


def _fit(nodes: NodeTable, points: Integers, weights: Reals, own: Integers, length: float, where: Where) -> Reals:
    """(reference components, point components): rows of (SᵀWS)⁻¹SᵀW, by singular values and in scaled lengths."""
    unit = _units(length)
    motion = motion_of(nodes, points, own[:1] // 6) * unit[points % 6][:, None] / unit
    root = np.sqrt(weights / weights.max())
    # rows of zeros make six at least, so that the small decomposition knows every open motion
    padded = np.vstack([root[:, None] * motion, np.zeros((max(6 - len(root), 0), 6))])
    U, s, Vt = np.linalg.svd(padded, full_matrices=False)
    rank = int((s > RANK * s[0]).sum())
    _check_determined(Vt[rank:], own, where)
    fit = (Vt[:rank].T / s[:rank]) @ U[: len(root), :rank].T * root
    fit = fit[own % 6]
    fit[np.abs(fit) <= NOISE * np.abs(fit).max(axis=1, keepdims=True)] = 0.0
    return np.asarray(fit * unit[points % 6] / unit[own % 6][:, None])


def _units(length: float) -> Reals:
    """Factors that make displacements of one unit of translations and rotations."""
    return np.array([1.0] * 3 + [length] * 3)


def _check_determined(open_motions: Reals, own: Integers, where: Where) -> None:
    part = np.linalg.norm(open_motions[:, own % 6], axis=0)
    if (part > OPEN).any():
        digits = "".join(str(d % 6 + 1) for d in own[part > OPEN])
        what = f"the points do not determine components {digits} of the reference grid point"
        raise FemtuneError("constraint.undetermined-motion", what, where=where,
                           hint="add points off their common line, or rotations (456) at one of them")  # fmt: skip


def _exchange(
    nodes: NodeTable, terms: tuple[Integers, Integers, Reals], chosen: Integers, length: float, owner: int
) -> ConstraintRows:  # fmt: skip
    """The equations u_own − follow·u_points = 0 solved for other components (UM)."""
    own, points, follow = terms
    where = Where(record=f"RBE3 {owner}")
    dofs, matrix = np.concatenate([own, points]), np.hstack([np.eye(len(own)), -follow])
    _check_choice(nodes, chosen, own, dofs, where)
    at = np.array([int(np.flatnonzero(dofs == d)[0]) for d in chosen])
    block = matrix[:, at]
    unit = _units(length)
    if np.linalg.cond(block * unit[own % 6][:, None] / unit[chosen % 6]) > CONDITION:
        raise _bad_choice("the equations cannot be solved for the components after UM", where)
    others = np.delete(np.arange(len(dofs)), at)
    solved = -np.linalg.solve(block, matrix[:, others])
    return follow_rows(chosen, np.tile(dofs[others], (len(chosen), 1)), solved, owner)


def _check_choice(nodes: NodeTable, chosen: Integers, own: Integers, dofs: Integers, where: Where) -> None:
    check_once(nodes, chosen, "dependent", where)
    if len(chosen) != len(own):
        raise _bad_choice(f"{len(chosen)} components stand after UM, but REFC has {len(own)}", where)
    strange = np.setdiff1d(chosen, dofs)
    if len(strange):
        name = f"component {strange[0] % 6 + 1} of grid point {nodes.ids[strange[0] // 6]}"
        raise _bad_choice(f"{name} stands after UM, but takes no part in the element", where)


def _bad_choice(what: str, where: Where) -> FemtuneError:
    hint = "name as many components as REFC has, of the reference and of the points, or leave UM out"
    return FemtuneError("constraint.dependent-choice", what, where=where, hint=hint)
