"""Equations of rigid elements (RBE2, RBAR, RBE1, RTRPLT, RROD) between displacements in the nodes' own frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError, Where
from femtune.fem.elements.placement import arm_transform
from femtune.fem.structure import ConstraintRows, NodeTable

Components = Sequence[tuple[int, Sequence[int]]]
"""Grid points with components of 1 to 6; a point may occur several times."""

COEFFICIENT_ROUNDING = 1e-13
"""Coefficients below this fraction of the largest of their equation are dropped.

Coefficients are direction cosines and lever arms. Where they cancel exactly, a few roundings of 1e-16 remain, which
would only fill the matrices.
"""
LARGEST_CONDITION = 1e8
"""Largest condition number of six independent components, with lengths in units of the element's size.

Half of the digits of a double are lost beyond it; components of points that determine the motion stay far below.
"""
LEAST_COSINE = 1e-6
"""Smallest direction cosine between a rod and its dependent component.

The equation is divided by it, so that up to six digits are lost; a component that is perpendicular to the rod but for
rounding of the coordinates is refused.
"""
ALL_COMPONENTS = (1, 2, 3, 4, 5, 6)


def rigid_element_rows(
    nodes: NodeTable, independent: int, dependents: Sequence[int], components: Sequence[int], owner: int
) -> ConstraintRows:
    """RBE2: the given components of the dependent grid points follow the independent one as a rigid body.

    `independent` and `dependents` are numbers of grid points, `components` are 1 to 6 in the displacement
    frames of the dependents, `owner` is the element's number.

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.own-node``
    """
    where = Where(record=f"RBE2 {owner}")
    if independent in dependents:
        raise FemtuneError("constraint.own-node", where=where, grid=independent)
    start = nodes.position(independent, where)
    ends = np.array([nodes.position(n, where) for n in dependents], dtype=np.int64)
    motion = rigid_motion(nodes, ends, np.full(len(ends), start))
    chosen = np.array(components, dtype=np.int64) - 1
    dependent = (6 * ends[:, None] + chosen).ravel()
    follow = motion[:, chosen].reshape(-1, 6)
    return follow_rows(dependent, np.tile(6 * start + np.arange(6), (len(dependent), 1)), follow, owner)


def rigid_motion(nodes: NodeTable, ends: NDArray[np.int64], starts: NDArray[np.int64]) -> Reals:
    """(k, 6, 6) from the displacements of nodes at rows `starts` to those of rows `ends` of one rigid body each."""
    arm = nodes.xyz[ends] - nodes.xyz[starts]
    return arm_transform(nodes.frames[ends], arm, nodes.frames[starts])


def follow_rows(
    dependent: NDArray[np.int64], on: NDArray[np.int64], follow: Reals, owner: int, noise: float = COEFFICIENT_ROUNDING
) -> ConstraintRows:  # fmt: skip
    """Equations u_dependent − Σ follow · u_on = 0; `on` and `follow` are (m, k).

    Coefficients below `noise` times the largest of their row (of 1 at least) are dropped.
    """
    m, k = follow.shape
    size = np.abs(follow).max(axis=1, initial=1.0)[:, None]
    some = (np.abs(follow) > noise * size).ravel()
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
    free, slaves = list(zip(ends, independent)), list(zip(ends, dependent))
    return rigid_plate_rows(nodes, ends, free, slaves, owner, "RBAR")


def rigid_plate_rows(
    nodes: NodeTable, points: Sequence[int], independent: Components, dependent: Components, owner: int, card: str
) -> ConstraintRows:  # fmt: skip
    """RBAR, RTRPLT: the named components of a few points follow the independent ones, by default all others.

    `card` is the card's name for messages. Raises the errors of `rigid_body_rows`, and ``constraint.own-node`` if a
    point is listed twice.
    """
    where = Where(record=f"{card} {owner}")
    again = [n for i, n in enumerate(points) if n in points[:i]]
    if again:
        raise FemtuneError("constraint.own-node/two-ends", where=where, grid=again[0])
    if not any(len(components) for _, components in dependent):
        free = {(n, c) for n, components in independent for c in components}
        dependent = [(n, [c for c in ALL_COMPONENTS if (n, c) not in free]) for n in points]
    return rigid_body_rows(nodes, independent, dependent, owner, card)


def rigid_body_rows(
    nodes: NodeTable, independent: Components, dependent: Components, owner: int, card: str = "RBE1"
) -> ConstraintRows:  # fmt: skip
    """RBE1: six independent components at one or several grid points describe the rigid motion of the dependent ones.

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.rigid-independent``, ``constraint.twice-in-element``
    """
    where = Where(record=f"{card} {owner}")
    free, slaves = (component_dofs(nodes, listed, where) for listed in (independent, dependent))
    _check_twice(nodes, free, slaves, where)
    start = (free if len(free) else slaves)[:1] // 6
    inverse = _invert(motion_of(nodes, free, start), _size(nodes, free, slaves, start), where)
    follow = motion_of(nodes, slaves, start) @ inverse
    return follow_rows(slaves, np.tile(free, (len(slaves), 1)), follow, owner)


def component_dofs(nodes: NodeTable, listed: Components, where: Where) -> NDArray[np.int64]:
    """g-set DOFs of grid points with their components, in their order."""
    dofs = [6 * nodes.position(n, where) + c - 1 for n, components in listed for c in sorted(components)]
    return np.array(dofs, dtype=np.int64)


def motion_of(nodes: NodeTable, dofs: NDArray[np.int64], start: NDArray[np.int64]) -> Reals:
    """(m, 6) from the displacements of the grid point at row `start` (1,) to DOFs of the same rigid body."""
    rows = dofs // 6
    return rigid_motion(nodes, rows, np.repeat(start, len(rows)))[np.arange(len(rows)), dofs % 6]


def _size(nodes: NodeTable, free: NDArray[np.int64], slaves: NDArray[np.int64], start: NDArray[np.int64]) -> float:
    """Largest distance of the element's points from the first: the unit of length of its tolerances."""
    rows = np.unique(np.concatenate([free, slaves])) // 6
    return float(np.linalg.norm(nodes.xyz[rows] - nodes.xyz[start], axis=1).max(initial=0.0))


def _check_twice(nodes: NodeTable, free: NDArray[np.int64], slaves: NDArray[np.int64], where: Where) -> None:
    both = np.intersect1d(free, slaves)
    if len(both):
        raise twice_in_element(nodes, int(both[0]), "as independent and as dependent", where)
    for dofs, kind in ((free, "independent"), (slaves, "dependent")):
        check_once(nodes, dofs, kind, where)


def check_once(nodes: NodeTable, dofs: NDArray[np.int64], kind: str, where: Where) -> None:
    """Error ``constraint.twice-in-element`` for a DOF that is listed twice."""
    numbers, counts = np.unique(dofs, return_counts=True)
    if (counts > 1).any():
        raise twice_in_element(nodes, int(numbers[counts > 1][0]), f"twice as {kind}", where)


def twice_in_element(nodes: NodeTable, dof: int, what: str, where: Where) -> FemtuneError:
    """Error for a DOF that is in two lists of an element, or twice in one."""
    name = f"component {dof % 6 + 1} of grid point {nodes.ids[dof // 6]}"
    return FemtuneError("constraint.twice-in-element", where=where, dof=name, roles=what)


def _invert(motion: Reals, length: float, where: Where) -> Reals:
    """Rigid motion, at the first point, from the six independent components.

    Lengths are scaled so that the condition number does not depend on their unit.
    """
    if len(motion) != 6:
        raise FemtuneError("constraint.rigid-independent/number", where=where, count=len(motion))
    scale = np.array([1.0] * 3 + [1.0 / (length or 1.0)] * 3)
    scaled = motion * scale
    scaled /= np.linalg.norm(scaled, axis=1, keepdims=True)
    if np.linalg.cond(scaled) > LARGEST_CONDITION:
        raise FemtuneError("constraint.rigid-independent", where=where)
    return np.asarray(np.linalg.inv(motion))


def rigid_rod_rows(nodes: NodeTable, ends: tuple[int, int], dependent: tuple[int, int], owner: int) -> ConstraintRows:
    """RROD: the distance of two grid points is fixed; one translation, (0 for end A or 1 for end B, 1 to 3), follows.

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``element.zero-length``, ``constraint.rod-component``
    """
    where = Where(record=f"RROD {owner}")
    rows = np.array([nodes.position(n, where) for n in ends])
    axis = _rod_axis(nodes, rows, where)
    # extension of the rod from the three translations of each end
    along = np.concatenate([-axis @ nodes.frames[rows[0]], axis @ nodes.frames[rows[1]]])
    dofs = (6 * rows[:, None] + np.arange(3)).ravel()
    chosen = 3 * dependent[0] + dependent[1] - 1
    if abs(along[chosen]) < LEAST_COSINE:
        raise FemtuneError("constraint.rod-component", where=where, component=dependent[1], grid=ends[dependent[0]])
    others = np.delete(np.arange(6), chosen)
    follow = -along[others] / along[chosen]
    return follow_rows(dofs[[chosen]], dofs[others][None], follow[None], owner)


def _rod_axis(nodes: NodeTable, rows: NDArray[np.int64], where: Where) -> Reals:
    """Unit vector from end A to end B, (3,), in the basic frame."""
    a, b = nodes.xyz[rows]
    length = float(np.linalg.norm(b - a))
    if length <= 1e-12 * max(float(np.abs(a).max()), float(np.abs(b).max())):
        raise FemtuneError("element.zero-length", where=where)
    return np.asarray((b - a) / length)


# ----------------------------------------------------------------------------------------------------
# Equations of an averaging element (RBE3): a point moves with the mean rigid motion of others.


RANK_TOLERANCE = 1e-9
"""Singular values of the fit up to this fraction of the largest are zero, with lengths in units of the element's size.

They are zero but for rounding errors, for example where the points lie on a line; the fit divides by the others, which
leaves it seven digits.
"""
LARGEST_OPEN_SHARE = 1e-6
"""Share up to which a reference component may take part in a motion that the points do not determine.

Singular vectors beside a small singular value are known to about 1e-16 over `RANK_TOLERANCE`, that is seven digits.
"""


@dataclass(frozen=True)
class WeightedPoints:
    """One group of an RBE3: `components` of 1 to 6 at the grid points `numbers`, with one weight (WT, C, G)."""

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

    The fit minimises Σ w (u − rigid motion)² over the listed components of the points. Rotations have the weight w·L²,
    where L is the mean distance of the points from the reference, so that the unit of length does not matter.

    Parameters
    ----------
    nodes : grid points
    reference, components : REFGRID and REFC, of 1 to 6 in its displacement frame
    groups : WT, C, G
    owner : number of the element
    dependent : components that are dependent in place of REFC (UM): as many as REFC has, of REFC or of the points

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``constraint.own-node``, ``constraint.weight``,
        ``constraint.twice-in-element``, ``constraint.undetermined-motion``, ``constraint.dependent-choice``
    """
    where = Where(record=f"RBE3 {owner}")
    _check_groups(reference, groups, where)
    listed = [(n, g.components) for g in groups for n in g.numbers]
    moved = component_dofs(nodes, [(reference, components)], where)
    points = component_dofs(nodes, listed, where)
    check_once(nodes, points, "averaged", where)
    weights = np.concatenate([np.full(len(g.numbers) * len(g.components), g.weight) for g in groups])
    length = _mean_distance(nodes, points, moved)
    follow = _fit(nodes, points, weights, moved, length, where)
    if not len(dependent):
        return follow_rows(moved, np.tile(points, (len(moved), 1)), follow, owner, noise=0.0)
    chosen = component_dofs(nodes, dependent, where)
    return _exchange(nodes, (moved, points, follow), chosen, length, owner)


def _check_groups(reference: int, groups: Sequence[WeightedPoints], where: Where) -> None:
    for group in groups:
        if not group.weight > 0.0:
            raise FemtuneError("constraint.weight", where=where, weight=group.weight)
        if reference in group.numbers:
            raise FemtuneError("constraint.own-node/mean", where=where, grid=reference)


def _mean_distance(nodes: NodeTable, points: Integers, moved: Integers) -> float:
    """Mean distance of the points from the reference; 1 if all coincide, where the length does not matter."""
    rows = np.unique(points // 6)
    distance = np.linalg.norm(nodes.xyz[rows] - nodes.xyz[moved[0] // 6], axis=1)
    return float(distance.mean()) or 1.0


def _fit(nodes: NodeTable, points: Integers, weights: Reals, moved: Integers, length: float, where: Where) -> Reals:
    """(reference components, point components): rows of (SᵀWS)⁻¹SᵀW, by singular values and in scaled lengths."""
    unit = _units(length)
    motion = motion_of(nodes, points, moved[:1] // 6) * unit[points % 6][:, None] / unit
    root = np.sqrt(weights / weights.max())
    # at least six rows, padded with zeros, so that the reduced decomposition includes every undetermined motion
    padded = np.vstack([root[:, None] * motion, np.zeros((max(6 - len(root), 0), 6))])
    U, s, Vt = np.linalg.svd(padded, full_matrices=False)
    rank = int((s > RANK_TOLERANCE * s[0]).sum())
    _check_determined(Vt[rank:], moved, where)
    fit = (Vt[:rank].T / s[:rank]) @ U[: len(root), :rank].T * root
    fit = fit[moved % 6]
    fit[np.abs(fit) <= COEFFICIENT_ROUNDING * np.abs(fit).max(axis=1, keepdims=True)] = 0.0
    return np.asarray(fit * unit[points % 6] / unit[moved % 6][:, None])


def _units(length: float) -> Reals:
    """Factors that give translations and rotations the same unit."""
    return np.array([1.0] * 3 + [length] * 3)


def _check_determined(open_motions: Reals, moved: Integers, where: Where) -> None:
    part = np.linalg.norm(open_motions[:, moved % 6], axis=0)
    if (part > LARGEST_OPEN_SHARE).any():
        digits = "".join(str(d % 6 + 1) for d in moved[part > LARGEST_OPEN_SHARE])
        raise FemtuneError("constraint.undetermined-motion", where=where, components=digits)


def _exchange(
    nodes: NodeTable, terms: tuple[Integers, Integers, Reals], chosen: Integers, length: float, owner: int
) -> ConstraintRows:  # fmt: skip
    """The equations u_moved − follow·u_points = 0 solved for other components (UM)."""
    moved, points, follow = terms
    where = Where(record=f"RBE3 {owner}")
    dofs, matrix = np.concatenate([moved, points]), np.hstack([np.eye(len(moved)), -follow])
    _check_choice(nodes, chosen, moved, dofs, where)
    at = np.array([int(np.flatnonzero(dofs == d)[0]) for d in chosen])
    block = matrix[:, at]
    unit = _units(length)
    if np.linalg.cond(block * unit[moved % 6][:, None] / unit[chosen % 6]) > LARGEST_CONDITION:
        raise FemtuneError("constraint.dependent-choice", where=where)
    others = np.delete(np.arange(len(dofs)), at)
    solved = -np.linalg.solve(block, matrix[:, others])
    return follow_rows(chosen, np.tile(dofs[others], (len(chosen), 1)), solved, owner)


def _check_choice(nodes: NodeTable, chosen: Integers, moved: Integers, dofs: Integers, where: Where) -> None:
    check_once(nodes, chosen, "dependent", where)
    if len(chosen) != len(moved):
        raise FemtuneError("constraint.dependent-choice/number", where=where, given=len(chosen), required=len(moved))
    strange = np.setdiff1d(chosen, dofs)
    if len(strange):
        name = f"component {strange[0] % 6 + 1} of grid point {nodes.ids[strange[0] // 6]}"
        raise FemtuneError("constraint.dependent-choice/not-in-element", where=where, dof=name)
