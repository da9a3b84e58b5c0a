"""Structure: nodes, values, element batches and constraints of one finite element model."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.errors import FemtuneError, Where
from femtune.fem.assembled import AssembledMatrix
from femtune.fem.fields import FieldRef
from femtune.fem.preload import Preload
from femtune.fem.values import ValueTable


@dataclass(frozen=True)
class NodeTable:
    """Grid points and scalar points, and the numbering of their degrees of freedom (the g-set).

    Parameters
    ----------
    ids : (n,) ascending numbers of the grid points
    xyz : (n, 3) coordinates in the basic frame
    frames : (n, 3, 3) displacement frames: columns are unit axes in the basic frame, so u_basic = frame @ u
    scalar_points : (s,) ascending numbers of the scalar points
    has_coordinates : False where the grid points have none: `xyz` is zero then and must not be used

    Grid point i has DOFs 6i … 6i+5, scalar point j has DOF 6n + j.
    """

    ids: Integers
    xyz: Reals
    frames: Reals
    scalar_points: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    has_coordinates: bool = True

    @property
    def n_dofs(self) -> int:
        """Size of the g-set."""
        return 6 * len(self.ids) + len(self.scalar_points)

    @cached_property
    def _grid_at(self) -> dict[int, int]:
        return {int(n): i for i, n in enumerate(self.ids)}

    @cached_property
    def _scalar_at(self) -> dict[int, int]:
        return {int(n): i for i, n in enumerate(self.scalar_points)}

    def position(self, node: int, where: Where | None = None) -> int:
        """Row of a grid point (error ``model.unknown-node``)."""
        if node not in self._grid_at:
            raise FemtuneError("model.unknown-node", where=where, node=node)
        return self._grid_at[node]

    def has_grid(self, node: int) -> bool:
        """True for a grid point of the model."""
        return node in self._grid_at

    def has_scalar(self, node: int) -> bool:
        """True for a scalar point of the model."""
        return node in self._scalar_at

    def dof(self, node: int, component: int, where: Where | None = None) -> int:
        """g-set DOF of a node's component: 1 to 6 of a grid point, 0 or 1 of a scalar point.

        Raises
        ------
        FemtuneError : ``model.unknown-node`` or ``model.component``
        """
        if node in self._scalar_at and component in (0, 1):
            return 6 * len(self.ids) + self._scalar_at[node]
        if not 1 <= component <= 6 and node in self._grid_at:
            raise FemtuneError("model.component", where=where, node=node, component=component)
        return 6 * self.position(node, where) + component - 1

    def describe(self, dof: int) -> Dof:
        """Node and direction of a g-set DOF."""
        n = 6 * len(self.ids)
        if dof >= n:
            return Dof(int(self.scalar_points[dof - n]), "S")
        return Dof(int(self.ids[dof // 6]), DIRECTIONS[1 + dof % 6])

    def dof_set(self) -> DofSet:
        """All g-set DOFs in order."""
        return DofSet(self.describe(i) for i in range(self.n_dofs))

    @cached_property
    def rotated(self) -> NDArray[np.bool_]:
        """(n,) True where the displacement frame is not the basic one."""
        return np.asarray(~np.isclose(self.frames, np.eye(3), atol=1e-14).all(axis=(1, 2)))


@dataclass(frozen=True)
class ElementBatch:
    """Elements of one kind, as arrays.

    Parameters
    ----------
    kind : key of the element kind: "bar", "rod", "spring", "bush", "concentrated-mass", "scalar-mass"
    card : card name of the source, "CBAR"
    ids : (e,) element numbers
    nodes : (e, k) rows of the node table, −1 for ground
    dofs : (e, d) g-set DOFs of the element matrices, −1 for ground
    roles : for each value that the coefficients need ("E", "A", …), (e,) positions in the value table
    facts : constant data per element (orientation, offsets, pin flags …), arrays with first axis e
    settings : fields of `Structure` that have other values for these elements (mass_factor, consistent_mass …)
    """

    kind: str
    card: str
    ids: Integers
    nodes: Integers
    dofs: Integers
    roles: Mapping[str, Integers]
    facts: Mapping[str, NDArray] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.ids)

    def within(self, structure: Structure) -> Structure:
        """The structure with the settings of these elements."""
        return replace(structure, **self.settings) if self.settings else structure

    def some(self, rows: slice | Integers) -> ElementBatch:
        """The batch with some of the elements."""
        roles, facts = ({name: a[rows] for name, a in arrays.items()} for arrays in (self.roles, self.facts))
        ids, nodes, dofs = self.ids[rows], self.nodes[rows], self.dofs[rows]
        return replace(self, ids=ids, nodes=nodes, dofs=dofs, roles=roles, facts=facts)

    def repoint(self, mask: NDArray[np.bool_], moved: Mapping[int, int]) -> ElementBatch:
        """The batch with the roles of the masked elements moved to other positions of the value table."""
        if not mask.any():
            return self
        roles = dict(self.roles)
        for old, new in moved.items():
            roles |= {name: np.where(mask & (at == old), new, roles[name]) for name, at in self.roles.items()}
        return replace(self, roles=roles)

    def repoint_each(self, sets: Integers, parts: Integers, moved: Integers) -> ElementBatch:
        """The batch with the roles of some elements moved to other positions of the value table.

        Parameters
        ----------
        sets : (m,) number of the set to which each element belongs; −1 for one that stays as it is
        parts : (p,) positions, in ascending order
        moved : (sets, p) positions that take their place in each set
        """
        some = sets >= 0
        if not some.any():
            return self
        roles = {name: at.copy() for name, at in self.roles.items()}
        for at in roles.values():
            place = np.minimum(np.searchsorted(parts, at), len(parts) - 1)
            rows = np.flatnonzero(some & (parts[place] == at))
            at[rows] = moved[sets[rows], place[rows]]
        return replace(self, roles=roles)

    def users(self, positions: Collection[int]) -> Integers:
        """Numbers of the elements that have an entry of the value table among their roles."""
        entries, rows = self._uses
        spans = [rows[slice(*np.searchsorted(entries, [i, i + 1]))] for i in positions]
        return self.ids[np.concatenate([rows[:0], *spans])]

    @cached_property
    def _uses(self) -> tuple[Integers, Integers]:
        """Every entry that is used by some element, in ascending order, with the row of that element."""
        columns = list({id(at): at for at in self.roles.values()}.values())
        entries = np.concatenate([np.zeros(0, np.int64), *columns])
        order = np.argsort(entries, kind="stable")
        return entries[order], order % max(len(self), 1)


@dataclass(frozen=True)
class ConstraintRows:
    """Homogeneous linear equations Σ c·u = 0, each with one dependent DOF (rigid elements, multipoint constraints).

    Parameters
    ----------
    dependent : (m,) g-set DOF that each equation eliminates
    row, dof, coefficient : (z,) entries of the equations, including those of the dependent DOFs
    owner : (m,) number of the element that the equation belongs to, 0 for an MPC card
    """

    dependent: Integers
    row: Integers
    dof: Integers
    coefficient: Reals
    owner: Integers

    def __len__(self) -> int:
        return len(self.dependent)

    def keep(self, mask: NDArray[np.bool_]) -> ConstraintRows:
        """The equations where the mask is true."""
        new = np.cumsum(mask) - 1
        z = mask[self.row]
        return ConstraintRows(
            self.dependent[mask], new[self.row[z]], self.dof[z], self.coefficient[z], self.owner[mask]
        )


def no_constraints() -> ConstraintRows:
    """An empty set of equations."""
    i, r = np.zeros(0, np.int64), np.zeros(0)
    return ConstraintRows(i, i, i, r, i)


def join_constraints(parts: Iterable[ConstraintRows]) -> ConstraintRows:
    """Sets of equations one after the other."""
    parts = [no_constraints(), *parts]
    starts = np.cumsum([0, *(len(p) for p in parts)])
    return ConstraintRows(
        np.concatenate([p.dependent for p in parts]),
        np.concatenate([p.row + start for p, start in zip(parts, starts)]),
        np.concatenate([p.dof for p in parts]),
        np.concatenate([p.coefficient for p in parts]),
        np.concatenate([p.owner for p in parts]),
    )


@dataclass(frozen=True)
class OverallDamping:
    """Structural damping of the whole model.

    Parameters
    ----------
    loss_factor : position in the value table of a loss factor of all stiffness (PARAM G), or None
    overall_omega, element_omega : rad/s at which viscous damping replaces the overall and the elements' loss factors
        in responses that are not harmonic (PARAM W3 and W4); 0 leaves this damping out
    mode_ratios : positions in the value table of damping ratios of modes, by number of the mode from 1; 0 is for
        all modes without an individual one
    """

    loss_factor: int | None = None
    overall_omega: float = 0.0
    element_omega: float = 0.0
    mode_ratios: Mapping[int, int] = field(default_factory=dict)

    @property
    def of_whole_model(self) -> frozenset[int]:
        """Positions in the value table of what damps all elements together."""
        return frozenset(self.mode_ratios.values()) | ({self.loss_factor} if self.loss_factor is not None else set())


@dataclass(frozen=True)
class Structure:
    """One finite element model before a configuration is chosen.

    Parameters
    ----------
    nodes, values, batches : grid points, value table and elements
    rigid : equations of rigid elements, always active unless their element is switched off
    multipoint_sets : equations of the MPC sets by set number
    support_sets : g-set DOFs held by the SPC sets, by set number
    permanent : g-set DOFs held by the grid points themselves
    default_support_set, default_multipoint_set : what the case control selects, or None
    mass_factor : factor on all mass (PARAM WTMASS)
    consistent_mass : True for consistent ("coupled") mass of bars, beams and rods, False for lumped
    lumped_along : share of lumped mass in the consistent mass along bars, beams and rods: Nastran's 1/2, 0 for the mass
        of linear shape functions
    hold_singular : True where DOFs without stiffness are held (PARAM AUTOSPC); those that also lack mass always are
    element_kinds : card name of every element number, rigid elements included
    drilling : factor of a shell's stiffness against rotation about its normal (PARAM K6ROT); 1e-6·drilling·G·t
        times the squared difference of that rotation and the membrane's rotation
    normals_within : largest angle in degrees between the normals of shells at a grid point and their mean up to which
        the shells share the mean (PARAM SNORM); 0 for no shared normals
    damping : damping of the whole structure (PARAM G, W3, W4)
    dof_sets : g-set DOFs by the name of a set that the deck lists ("ASET", "SUPORT", "USET U1"); they hold nothing
    assembled : matrices on the g-set that do not come from elements: of another solver, or from DMIG cards
    preload : static load under which the modes are computed, None for the unloaded structure
    """

    nodes: NodeTable
    values: ValueTable
    batches: tuple[ElementBatch, ...]
    rigid: ConstraintRows = field(default_factory=no_constraints)
    multipoint_sets: Mapping[int, ConstraintRows] = field(default_factory=dict)
    support_sets: Mapping[int, Integers] = field(default_factory=dict)
    permanent: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    default_support_set: int | None = None
    default_multipoint_set: int | None = None
    mass_factor: float = 1.0
    consistent_mass: bool = False
    lumped_along: float = 0.5
    hold_singular: bool = True
    element_kinds: Mapping[int, str] = field(default_factory=dict)
    drilling: float = 100.0
    normals_within: float = 20.0
    damping: OverallDamping = field(default_factory=OverallDamping)
    dof_sets: Mapping[str, Integers] = field(default_factory=dict)
    assembled: tuple[AssembledMatrix, ...] = ()
    preload: Preload | None = None

    def split(self, index: int, elements: Iterable[int], region: str) -> Structure:
        """The structure with a separate copy of a value for some of its elements."""
        chosen = np.fromiter(elements, dtype=np.int64)
        values, moved = self.values.split(index, region)
        batches = tuple(b.repoint(np.isin(b.ids, chosen), moved) for b in self.batches)
        return replace(self, values=values, batches=batches)

    def split_each(self, index: int, elements: Sequence[int], regions: Sequence[str]) -> tuple[Structure, list[int]]:
        """The structure with a copy of a value for each of some elements, and the positions of these copies."""
        return self.split_sets(index, [frozenset((e,)) for e in elements], regions)

    def split_sets(
        self, index: int, sets: Sequence[frozenset[int]], regions: Sequence[str]
    ) -> tuple[Structure, list[int]]:
        """The structure with a copy of a value for each of some disjoint sets of elements, and their positions."""
        values, moved = self.values.split_each(index, regions)
        parts = np.array(sorted(self.values.dependents([index])), np.int64)
        targets = np.array([[own[int(i)] for i in parts] for own in moved], np.int64).reshape(len(moved), len(parts))
        number = {e: k for k, members in enumerate(sets) for e in members}
        batches = tuple(
            b.repoint_each(np.array([number.get(e, -1) for e in b.ids.tolist()], np.int64), parts, targets)
            for b in self.batches
        )
        return replace(self, values=values, batches=batches), [own[index] for own in moved]

    def direct_users(self, index: int) -> Integers:
        """Numbers of the elements that use an entry, or an entry derived from it other than one of a single element."""
        chained = self.values.dependents([index]) - self.values.copies_of(index)
        return np.unique(np.concatenate([np.zeros(0, np.int64), *(b.users(chained) for b in self.batches)]))

    def users(self, index: int) -> Integers:
        """Numbers of the elements whose matrices depend on an entry of the value table; 0 for assembled matrices."""
        touched = self.values.dependents([index])
        whole = np.zeros(int(any(m.depends_on(touched) for m in self.assembled)), np.int64)
        if not self.damping.of_whole_model.isdisjoint(touched):
            return np.unique(np.concatenate([whole, *(b.ids for b in self.batches)]))
        return np.unique(np.concatenate([whole, *(b.users(touched) for b in self.batches)]))


# ----------------------------------------------------------------------------------------------------
# Damping ratios of modes as entries of the value table, so that parameters can set them.


ALL_MODES = 0
"""The number that denotes all modes without an individual ratio."""
MODAL = "MODAL"


def mode_ratio_field(number: int) -> FieldRef:
    """``MODAL 3 ZETA``, the damping ratio of mode 3, or ``MODAL ZETA``, that of all modes without one, for number 0."""
    return FieldRef(MODAL, number, "ZETA")


def with_mode_ratios(structure: Structure, ratios: Mapping[int, float]) -> Structure:
    """The structure with damping ratios of modes, by their number from 1, or `ALL_MODES`."""
    table, first = structure.values, len(structure.values.refs)
    fields = tuple(mode_ratio_field(number) for number in ratios)
    values = np.concatenate([table.values, np.array(list(ratios.values()), float)])
    damping = replace(structure.damping, mode_ratios={n: first + i for i, n in enumerate(ratios)})
    return replace(structure, values=ValueTable((*table.refs, *fields), values, table.derived), damping=damping)
