"""Equations of rigid elements (RBE2, RBAR, RBE1, RTRPLT, RROD) between displacements in the nodes' own frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.fem.elements.placement import arm_transform
from femtune.fem.structure import ConstraintRows, NodeTable

Reals = NDArray[np.float64]
Components = Sequence[tuple[int, Sequence[int]]]
"""Grid points with components of 1 to 6; a point may stand there several times."""

# coefficients are direction cosines and lever arms; what is left of exact cancellation is dropped
NOISE = 1e-13
# largest condition number of six independent components, lengths in units of the element's own
CONDITION = 1e8
# a rod's dependent component has at least this part along the rod
ALONG = 1e-6
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
    return follow_rows(dependent, np.tile(6 * start + np.arange(6), (len(dependent), 1)), follow, owner)


def rigid_motion(nodes: NodeTable, ends: NDArray[np.int64], starts: NDArray[np.int64]) -> Reals:
    """(k, 6, 6) from the displacements of nodes at rows `starts` to those of rows `ends` of one rigid body each."""
    arm = nodes.xyz[ends] - nodes.xyz[starts]
    return arm_transform(nodes.frames[ends], arm, nodes.frames[starts])


def follow_rows(
    dependent: NDArray[np.int64], on: NDArray[np.int64], follow: Reals, owner: int, noise: float = NOISE
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
    """RBAR, RTRPLT: the components of a few points that are not independent follow, or those that are named.

    `card` is the card's name for messages. Errors as of `rigid_body_rows`, and ``constraint.own-node`` where a point
    stands there twice.
    """
    where = Where(record=f"{card} {owner}")
    again = [n for i, n in enumerate(points) if n in points[:i]]
    if again:
        what = f"grid point {again[0]} is at two ends of the element"
        raise FemtuneError("constraint.own-node", what, where=where, hint="name different grid points")
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
    found = [6 * nodes.position(n, where) + c - 1 for n, components in listed for c in sorted(components)]
    return np.array(found, dtype=np.int64)


def motion_of(nodes: NodeTable, dofs: NDArray[np.int64], start: NDArray[np.int64]) -> Reals:
    """(m, 6) from the displacements of the grid point at row `start` (1,) to DOFs of the same rigid body."""
    rows = dofs // 6
    return rigid_motion(nodes, rows, np.repeat(start, len(rows)))[np.arange(len(rows)), dofs % 6]


def _size(nodes: NodeTable, free: NDArray[np.int64], slaves: NDArray[np.int64], start: NDArray[np.int64]) -> float:
    """Largest distance of the element's points from the first, the unit of length of its judgements."""
    rows = np.unique(np.concatenate([free, slaves])) // 6
    return float(np.linalg.norm(nodes.xyz[rows] - nodes.xyz[start], axis=1).max(initial=0.0))


def _check_twice(nodes: NodeTable, free: NDArray[np.int64], slaves: NDArray[np.int64], where: Where) -> None:
    both = np.intersect1d(free, slaves)
    if len(both):
        raise twice_in_element(nodes, int(both[0]), "independent and dependent", where)
    for dofs, kind in ((free, "independent"), (slaves, "dependent")):
        check_once(nodes, dofs, kind, where)


def check_once(nodes: NodeTable, dofs: NDArray[np.int64], kind: str, where: Where) -> None:
    """Error ``constraint.twice-in-element`` for a DOF that stands twice in a list."""
    numbers, counts = np.unique(dofs, return_counts=True)
    if (counts > 1).any():
        raise twice_in_element(nodes, int(numbers[counts > 1][0]), f"{kind} twice", where)


def twice_in_element(nodes: NodeTable, dof: int, what: str, where: Where) -> FemtuneError:
    """A DOF stands in two lists of an element, or twice in one."""
    name = f"component {dof % 6 + 1} of grid point {nodes.ids[dof // 6]}"
    return FemtuneError("constraint.twice-in-element", f"{name} is {what}", where=where, hint="keep it in one place")


def _invert(motion: Reals, length: float, where: Where) -> Reals:
    """Rigid motion, at the first point, from the six independent components.

    Lengths are scaled so that the judgement does not depend on the unit.
    """
    hint = "give six components that describe every rigid motion, for example 123456 at one point"
    if len(motion) != 6:
        what = f"{len(motion)} independent components are given; a rigid body has six"
        raise FemtuneError("constraint.rigid-independent", what, where=where, hint=hint)
    scale = np.array([1.0] * 3 + [1.0 / (length or 1.0)] * 3)
    scaled = motion * scale
    scaled /= np.linalg.norm(scaled, axis=1, keepdims=True)
    if np.linalg.cond(scaled) > CONDITION:
        what = "the six independent components leave a rigid motion open"
        raise FemtuneError("constraint.rigid-independent", what, where=where, hint=hint)
    return np.asarray(np.linalg.inv(motion))


def rigid_rod_rows(nodes: NodeTable, ends: tuple[int, int], dependent: tuple[int, int], owner: int) -> ConstraintRows:
    """RROD: the distance of two grid points stays; one translation, (0 for end A or 1 for end B, 1 to 3), follows.

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
    if abs(along[chosen]) < ALONG:
        what = (
            f"the dependent component {dependent[1]} of grid point {ends[dependent[0]]} is at right angles to the rod"
        )
        raise FemtuneError("constraint.rod-component", what, where=where,
                           hint="choose a translation that has a part along the rod")  # fmt: skip
    others = np.delete(np.arange(6), chosen)
    follow = -along[others] / along[chosen]
    return follow_rows(dofs[[chosen]], dofs[others][None], follow[None], owner)


def _rod_axis(nodes: NodeTable, rows: NDArray[np.int64], where: Where) -> Reals:
    """Unit vector from end A to end B, (3,), in the basic frame."""
    a, b = nodes.xyz[rows]
    length = float(np.linalg.norm(b - a))
    if length <= 1e-12 * max(float(np.abs(a).max()), float(np.abs(b).max())):
        what = "the element's two ends are at the same place"
        raise FemtuneError("element.zero-length", what, where=where, hint="join coincident points by RBE2")
    return np.asarray((b - a) / length)
