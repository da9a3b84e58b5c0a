"""Supports that give way: a DOF that the deck holds has a small compliance c in the structure.

At the end of an update c is zero. The DOF s then moves by −c·r, where r = (K_sf − λM_sf)φ is the force on the support
in a mode φ of unit modal mass, and the dynamic stiffness of the free DOFs changes by −c·ddᵀ with d = (K_fs − λM_fs).
The derivatives at c = 0 are therefore exact without another solution of the model: ∂λ/∂c = −r², and those of shapes
have the force r·d. The stiffness of a spring is infinite there, so that it has no derivative.

A support is freed for an update by a spring in the place of the constraint, whose stiffness is 1/c.

Source: R. L. Fox, M. P. Kapoor, Rates of change of eigenvalues and eigenvectors, AIAA Journal 6, 1968, applied to the
matrices that are condensed to the free DOFs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Integers, Reals
from femtune.fem import FieldRef, Structure
from femtune.fem.elements.discrete import SCALAR_MASS, SPRING
from femtune.fem.structure import ElementBatch
from femtune.fem.values import ValueTable
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    ParametricModel,
    SubspaceDerivative,
    configure,
    parametric_model,
)
from femtune.model.configuration import held_dofs
from femtune.model.derivatives.modes import inverse_gaps, outside
from femtune.model.derivatives.sensors import TOLERANCE, outside_at_sensors
from femtune.model.digests import digest
from femtune.model.full_model import ModelSolver, direct
from femtune.parameters import Parameter, ParameterSet, parse_expression
from femtune.residuals import CaseState, Evaluation, UpdateProblem
from femtune.updating import UpdateResult

_USUALLY_FREE = 0.5
"""Share of the grid points from which a direction that is held belongs to the model, such as that of a plane frame, and
not to its supports."""
_AT_ONCE = 4_000_000
"""Numbers (DOFs × supports × modes) of the motions that are solved for together."""
_STIFFEST = 1e-5
"""Compliance relative to the largest plausible one from which the update with a support as a parameter starts: zero has
no spring, and smaller ones lose digits of the stiffness of the structure."""


@dataclass(frozen=True)
class Support:
    """Held DOFs with one compliance each, zero unless a parameter moves it.

    Parameters
    ----------
    name : an identifier that no parameter has
    dofs : g-set DOFs
    """

    name: str
    dofs: tuple[int, ...]


def supported_dofs(structure: Structure, configurations: Sequence[Configuration]) -> Integers:
    """g-set DOFs of grid points that all configurations hold, as the deck does.

    Directions that are held at most grid points are left out: they are those in which the model does not move at all.
    """
    n, held = 6 * len(structure.nodes.ids), None
    for configuration in configurations:
        own = set(held_dofs(structure, replace(configuration, supports_added=())).tolist())
        own -= {structure.nodes.dof(node, int(c)) for node, several in configuration.supports_added for c in several}
        held = own if held is None else held & own
    dofs = np.array(sorted(i for i in held or () if i < n), np.int64)
    share = np.bincount(dofs % 6, minlength=6) / max(len(structure.nodes.ids), 1)
    return dofs[share[dofs % 6] < _USUALLY_FREE]


@dataclass(frozen=True, eq=False)
class SupportRows:
    """What couples supported DOFs s to the free DOFs f of a configuration.

    Parameters
    ----------
    dofs : (s,) g-set DOFs; those without stiffness are not among them
    stiffness, mass : (s, f) rows of K and M
    """

    dofs: Integers
    stiffness: sp.csr_array
    mass: sp.csr_array

    def forces(self, solution: EigenSolution) -> Reals:
        """(s, m) forces on the supports in all modes of unit modal mass."""
        phi = solution.shapes
        return np.asarray(self.stiffness @ phi - (self.mass @ phi) * solution.eigenvalues)


def support_rows(configured: ConfiguredModel, dofs: Integers, x: Reals) -> SupportRows:
    """The rows at some parameters, of the model without these supports.

    A line of bars that nothing else keeps from turning about itself is held at a grid point of the line when its
    supports are removed. Directions are then removed one by one, and those are left out for which it still turns.

    Raises
    ------
    FemtuneError : as `configure`
    """
    rows = _rows(configured, dofs, x)
    if rows is not None:
        return rows
    parts = [part for c in range(6) if (part := _rows(configured, dofs[dofs % 6 == c], x)) is not None]
    known = np.concatenate([part.dofs for part in parts])
    order = np.argsort(known)
    stiffness, mass = (sp.vstack([getattr(part, name) for part in parts], "csr") for name in ("stiffness", "mass"))
    return SupportRows(known[order], sp.csr_array(stiffness[order]), sp.csr_array(mass[order]))


def _rows(configured: ConfiguredModel, dofs: Integers, x: Reals) -> SupportRows | None:
    """The rows of supports that are removed together; None where a DOF that was free is then held."""
    free = configure(configured.model, released(configured, dofs))
    point, place = free.at(x), {int(dof): i for i, dof in enumerate(free.free)}
    if not place.keys() >= set(configured.free.tolist()):
        return None
    known = np.array([dof for dof in dofs.tolist() if dof in place], np.int64)
    rows, columns = ([place[int(dof)] for dof in some] for some in (known, configured.free))
    return SupportRows(known, *(sp.csr_array(m[rows][:, columns]) for m in (point.stiffness, point.mass)))


def released(configured: ConfiguredModel, dofs: Integers) -> Configuration:
    """The configuration without some of its supports."""
    ids = configured.model.structure.nodes.ids
    pairs = tuple((int(ids[dof // 6]), str(1 + dof % 6)) for dof in dofs.tolist())
    configuration = configured.configuration
    return replace(configuration, supports_removed=(*configuration.supports_removed, *pairs))


# ----------------------------------------------------------------------------------------------------
# Derivatives by compliances at zero.


def with_carriers(structure: Structure, supports: Sequence[Support]) -> tuple[Structure, list[Assignment]]:
    """The structure with a mass at each supported DOF, which moves nothing, so that compliances can be parameters."""
    dofs = np.array([dof for s in supports for dof in s.dofs], np.int64)
    owner = np.repeat(np.arange(len(supports)), [len(s.dofs) for s in supports])
    return _with_scalars(structure, SCALAR_MASS.key, "CMASS2", "M", dofs, owner, [s.name for s in supports])


@dataclass(frozen=True)
class GivingWay:
    """Solves a model whose last parameters are compliances of supports, which are zero.

    Parameters
    ----------
    given : solver of all other parameters
    rows : of the configuration
    supports : in the order of their parameters
    """

    given: ModelSolver
    rows: SupportRows
    supports: tuple[Support, ...]

    modes = staticmethod(direct.modes)
    improved = staticmethod(direct.improved)

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As `subspace_derivative`, with ∂/∂c of the supports in the last columns."""
        found, members = self.given.derivative(solution, members, rows), list(members)
        phi, values = solution.shapes[:, members], solution.eigenvalues[members]
        first, mean = len(found.stiffness) - len(self.supports), float(np.mean(values))
        of_mass = self.rows.mass @ phi
        at_mean = self.rows.stiffness @ phi - mean * of_mass
        stiffness, mass, moved = found.stiffness.copy(), found.mass.copy(), found.outside.copy()
        for k, at in enumerate(self._own, start=first):
            r, m = at_mean[at], of_mass[at]
            # the term −(m dᵀ + d mᵀ) of the mass is that of the motion of the support
            mass[k] = -(r.T @ m + m.T @ r)
            stiffness[k] = -(r.T @ r) + mean * mass[k]
        moved[:, :, first:] = self._moved(solution, members, rows)
        return replace(found, stiffness=stiffness, mass=mass, outside=moved)

    @cached_property
    def _own(self) -> list[list[int]]:
        """Rows of each support."""
        place = {int(dof): i for i, dof in enumerate(self.rows.dofs)}
        return [[place[dof] for dof in s.dofs if dof in place] for s in self.supports]

    @cached_property
    def _kept(self) -> WeakKeyDictionary[EigenSolution, dict[str, Reals]]:
        """Motions of the wanted modes, one by one, by their solution and the rows."""
        return WeakKeyDictionary()

    def _moved(self, solution: EigenSolution, members: list[int], rows: sp.csr_array) -> Reals:
        """(rows, c, supports) part of the derivative of shapes outside the subspace of the members."""
        if len(members) > 1 or members[0] >= solution.wanted:
            return self._solved(solution, [members], rows)
        kept, key = self._kept.setdefault(solution, {}), digest(rows)
        if key not in kept:
            kept[key] = self._solved(solution, [[j] for j in range(solution.wanted)], rows)
        return kept[key][:, members]

    def _solved(self, solution: EigenSolution, clusters: list[list[int]], rows: sp.csr_array) -> Reals:
        """The same of several subspaces, some modes at a time."""
        members, count = [j for cluster in clusters for j in cluster], len(self.supports)
        choice = np.zeros((len(self.rows.dofs), count))
        for k, at in enumerate(self._own):
            choice[at, k] = 1.0
        few = rows.shape[0] <= count * len(members) and max(members) < solution.wanted
        if few and not solution.point.depends_on_frequency:
            moved, error = outside_at_sensors(solution, rows, clusters, self._along(solution, members, choice))
            if error <= TOLERANCE:
                return moved
        gaps, K, M = inverse_gaps(solution, clusters), self.rows.stiffness, self.rows.mass
        out = np.zeros((rows.shape[0], len(members), count))
        at_once = max(1, _AT_ONCE // max(count * len(solution.shapes), 1))
        for begin in range(0, len(members), at_once):
            some = members[begin : begin + at_once]
            phi, values = solution.shapes[:, some], solution.eigenvalues[some]
            r = K @ phi - (M @ phi) * values
            acting = (r[:, :, None] * choice[:, None, :]).reshape(len(r), -1)
            of_column = np.repeat(values, count)
            forces = -(K.T @ acting - (M.T @ acting) * of_column)
            acts = np.flatnonzero(forces.any(axis=0))
            if len(acts):
                own = np.repeat(gaps[:, begin : begin + at_once], count, axis=1)[:, acts]
                u = np.zeros((rows.shape[0], forces.shape[1]))
                u[:, acts] = rows @ outside(solution, of_column[acts], own, forces[:, acts])
                out[:, begin : begin + at_once] = u.reshape(rows.shape[0], len(some), count)
        return out

    def _along(self, solution: EigenSolution, members: list[int], choice: Reals) -> Callable[[Reals], Reals]:
        """A function that projects the forces of the supports on vectors: (n, a) -> (supports, a, c).

        The forces themselves, one for each mode and support, are never formed.

        Parameters
        ----------
        choice : (s, supports) 1 for the DOFs of each support
        """
        K, M = self.rows.stiffness, self.rows.mass
        phi, values = solution.shapes[:, members], solution.eigenvalues[members]
        r = K @ phi - (M @ phi) * values

        def along(left: Reals) -> Reals:
            stiffness, mass = K @ left, M @ left
            each = ((stiffness - mass * value).T @ (own[:, None] * choice) for value, own in zip(values, r.T))
            return -np.moveaxis(np.array(list(each)), (0, 2), (2, 0))

        return along


# ----------------------------------------------------------------------------------------------------
# Finite compliances.


def with_spring(model: ParametricModel, support: Support, largest: float) -> ParametricModel:
    """The model with springs at the supported DOFs, for a configuration without these supports.

    Its last free parameter is the compliance of each spring relative to the largest plausible one; the nominal value
    is nearly zero.

    Raises
    ------
    FemtuneError : as `parametric_model`
    """
    given = model.structure if model.given is None else model.given
    dofs, owner = np.array(support.dofs, np.int64), np.zeros(len(support.dofs), np.int64)
    stiffness = f"{support.name}stiffness"
    wide, assignments = _with_scalars(given, SPRING.key, "CELAS2", "K", dofs, owner, [stiffness])
    compliance = Parameter(support.name, _STIFFEST, 0.1 * _STIFFEST, 1.0)
    tied = Parameter(stiffness, tie=parse_expression(f"{1.0 / largest!r}/{support.name}"))
    parameters = ParameterSet((*model.parameters.parameters, compliance, tied), curved=False)
    return parametric_model(wide, parameters, [*model.assignments, *assignments], model.tables)


def support_freed(
    result: UpdateResult, model: ParametricModel, support: Support, largest: float
) -> tuple[UpdateProblem, Evaluation]:
    """The comparisons of an update with springs in the place of a support, and its end there with derivatives.

    Parameters
    ----------
    largest : plausible compliance of each DOF

    Raises
    ------
    FemtuneError : as `parametric_model` and `configure`
    """
    wide, dofs = with_spring(model, support, largest), np.array(support.dofs)
    x = np.append(result.x, 0.0)
    cases, states = [], []
    for state in result.after.states:
        case = state.case.on_full_model
        configured = configure(wide, released(case.configured, dofs))
        place = {int(dof): i for i, dof in enumerate(configured.free)}
        at = [place[int(dof)] for dof in case.configured.free]
        size = case.configured.n_free, configured.n_free
        seen = case.sensors @ sp.csr_array((np.ones(size[0]), (np.arange(size[0]), at)), shape=size)
        cases.append(replace(case, configured=configured, sensors=sp.csr_array(seen), full=None, solver=direct))
        states.append(CaseState(cases[-1], configured.at(x), state.groups))
    problem = UpdateProblem(tuple(cases), wide.parameters, common_sd=result.after.common_sd)
    return problem, problem.assess(x, states)


def _with_scalars(
    structure: Structure, kind: str, card: str, role: str, dofs: Integers, owner: Integers, names: Sequence[str]
) -> tuple[Structure, list[Assignment]]:
    """The structure with grounded scalar elements, and the assignments of parameters to their values.

    Parameters
    ----------
    dofs : (e,) g-set DOFs
    owner : (e,) position of the parameter of each
    """
    table = structure.values
    first = 1 + max([0, *(int(b.ids.max()) for b in structure.batches if len(b)), *structure.element_kinds])
    ids, ground = first + np.arange(len(dofs)), np.full(len(dofs), -1, np.int64)
    refs = [FieldRef(card, int(ids[np.argmax(owner == k)]), role) for k in range(len(names))]
    batch = ElementBatch(
        kind, card, ids, np.column_stack([dofs // 6, ground]), np.column_stack([dofs, ground]),
        {role: len(table.refs) + owner},
    )  # fmt: skip
    values = ValueTable((*table.refs, *refs), np.concatenate([table.values, np.ones(len(refs))]), table.derived)
    wide = replace(
        structure, values=values, batches=(*structure.batches, batch),
        element_kinds={**structure.element_kinds, **dict.fromkeys(map(int, ids), card)},
    )  # fmt: skip
    return wide, [Assignment(name, ref, relative=False) for name, ref in zip(names, refs)]
