"""Equations of rigid elements (RBE2, RBAR) between displacements in the nodes' own frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.fem.elements.placement import arm_transform
from femtune.fem.structure import ConstraintRows, NodeTable

Reals = NDArray[np.float64]

# coefficients are direction cosines and lever arms; what is left of exact cancellation is dropped
NOISE = 1e-13
# largest condition number of the six independent components of an RBAR, lengths in units of its own
CONDITION = 1e8
ALL_COMPONENTS = (1, 2, 3, 4, 5, 6)


def rigid_element_rows(
    nodes: NodeTable, independent: int, dependents: Sequence[int], components: Sequence[int], owner: int
) -> ConstraintRows:
    """RBE2: the given components of the dependent grid points follow the independent one as a rigid body.

    `independent` and `dependents` are numbers of grid points, `components` are of 1 to 6 in the displacement
    frames of the dependents, `owner` is the element's number.

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.own-node``
    """
    where = Where(record=f"RBE2 {owner}")
    if independent in dependents:
        what = f"grid point {independent} depends on itself"
        raise FemtuneError("constraint.own-node", what, where=where, hint="take it out of the dependent ones")
    start = nodes.position(independent, where)
    ends = np.array([nodes.position(n, where) for n in dependents], dtype=np.int64)
    motion = rigid_motion(nodes, ends, np.full(len(ends), start))
    chosen = np.array(components, dtype=np.int64) - 1
    dependent = (6 * ends[:, None] + chosen).ravel()
    follow = motion[:, chosen].reshape(-1, 6)
    return _rows(dependent, np.tile(6 * start + np.arange(6), (len(dependent), 1)), follow, owner)


def rigid_motion(nodes: NodeTable, ends: NDArray[np.int64], starts: NDArray[np.int64]) -> Reals:
    """(k, 6, 6) from the displacements of nodes at rows `starts` to those of rows `ends` of one rigid body each."""
    arm = nodes.xyz[ends] - nodes.xyz[starts]
    return arm_transform(nodes.frames[ends], arm, nodes.frames[starts])


def _rows(dependent: NDArray[np.int64], on: NDArray[np.int64], follow: Reals, owner: int) -> ConstraintRows:
    """Equations u_dependent − Σ follow · u_on = 0; `on` and `follow` are (m, k)."""
    m, k = follow.shape
    size = np.abs(follow).max(axis=1, initial=1.0)[:, None]
    some = (np.abs(follow) > NOISE * size).ravel()
    row = np.arange(m)
    return ConstraintRows(
        dependent,
        np.concatenate([row, np.repeat(row, k)[some]]),
        np.concatenate([dependent, on.ravel()[some]]),
        np.concatenate([np.ones(m), -follow.ravel()[some]]),
        np.full(m, owner, dtype=np.int64),
    )


def rigid_bar_rows(
    nodes: NodeTable,
    ends: tuple[int, int],
    independent: tuple[Sequence[int], Sequence[int]],
    dependent: tuple[Sequence[int], Sequence[int]],
    owner: int,
) -> ConstraintRows:
    """RBAR: six independent components (CNA, CNB) at two grid points describe the rigid motion of the others.

    `dependent` (CMA, CMB) names the components that follow; both empty means all that are not independent.

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.own-node``, ``constraint.rigid-independent``,
        ``constraint.twice-in-element``
    """
    where = Where(record=f"RBAR {owner}")
    a, b = (nodes.position(n, where) for n in ends)
    if a == b:
        what = f"both ends are grid point {ends[0]}"
        raise FemtuneError("constraint.own-node", what, where=where, hint="name two grid points")
    free = _positions(independent)
    slaves = _positions(dependent) if any(len(d) for d in dependent) else [i for i in range(12) if i not in free]
    _check_overlap(free, slaves, ends, where)
    motion = rigid_motion(nodes, np.array([a, b]), np.array([a, a])).reshape(12, 6)
    inverse = _invert(motion[free], float(np.linalg.norm(nodes.xyz[b] - nodes.xyz[a])), where)
    dof = np.concatenate([6 * a + np.arange(6), 6 * b + np.arange(6)])
    follow = motion[slaves] @ inverse
    return _rows(dof[slaves], np.tile(dof[free], (len(slaves), 1)), follow, owner)


def _positions(components: tuple[Sequence[int], Sequence[int]]) -> list[int]:
    return [6 * end + c - 1 for end in (0, 1) for c in sorted(set(components[end]))]


def _check_overlap(free: list[int], slaves: list[int], ends: tuple[int, int], where: Where) -> None:
    both = sorted(set(free) & set(slaves))
    if both:
        what = f"component {both[0] % 6 + 1} of grid point {ends[both[0] // 6]} is independent and dependent"
        raise FemtuneError("constraint.twice-in-element", what, where=where, hint="keep it in one of the two lists")


def _invert(motion: Reals, length: float, where: Where) -> Reals:
    """Rigid motion, at end A, from the six independent components.

    Lengths are scaled so that the judgement does not depend on the unit.
    """
    hint = "give six components that describe every rigid motion, for example 123456 at one end"
    if len(motion) != 6:
        what = f"{len(motion)} independent components are given; a rigid bar has six"
        raise FemtuneError("constraint.rigid-independent", what, where=where, hint=hint)
    scale = np.array([1.0] * 3 + [1.0 / (length or 1.0)] * 3)
    scaled = motion * scale
    scaled /= np.linalg.norm(scaled, axis=1, keepdims=True)
    if np.linalg.cond(scaled) > CONDITION:
        what = "the six independent components leave a rigid motion open"
        raise FemtuneError("constraint.rigid-independent", what, where=where, hint=hint)
    return np.asarray(np.linalg.inv(motion))
