"""Candidates for sensors: grid points on the surface of the model, their directions, and the target modes there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags, Integers, Reals
from femtune.dofs import DIRECTIONS
from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import number_list
from femtune.model import grid_matrix
from femtune.steps.modes.shapes import grid_translations
from femtune.study.drawn_mesh import ELEMENT, whole_mesh
from femtune.study.error_places import errors_at
from femtune.study.parameters import elements_of

if TYPE_CHECKING:
    from femtune.files.study_file import PlanTable
    from femtune.files.study_file.kinds import Elements
    from femtune.model import EigenSolution
    from femtune.steps.plan.record import SensorKind
    from femtune.study.cases import StudyCase
    from femtune.study.drawn_mesh import DrawnMesh
    from femtune.study.study import Study

_LEAST_MOTION = 1e-6
"""Motion of a candidate relative to the largest of all, up to which it does not move in a target mode.

Smaller motions are rounding errors.
"""


@dataclass(frozen=True, eq=False)
class Sites:
    """Grid points that may carry sensors.

    Parameters
    ----------
    rows : (n,) rows of the grid points
    axes : (n, 3, 3) local axes, one a row, in the basic system; the third is the normal of the surface
    on_surface : (n,) True where there is a normal; `axes` are the basic ones elsewhere
    motion : (n, 3, m) target modes, mass-normalised, in the basic system
    """

    rows: Integers
    axes: Reals
    on_surface: Flags
    motion: Reals

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def local(self) -> Reals:
        """(n, 3, m) target modes along the local axes."""
        return np.asarray(self.axes @ self.motion)

    def select(self, which: NDArray) -> Sites:
        """Some of them."""
        return Sites(self.rows[which], self.axes[which], self.on_surface[which], self.motion[which])


@dataclass(frozen=True, eq=False)
class Uniaxial:
    """Uniaxial candidates: (k,) sites, and local axes from 0."""

    site: Integers
    axis: Integers


def surface_mesh(case: StudyCase) -> DrawnMesh:
    """Active line elements, shells and the outside of solids, all of them; without rigid elements."""
    configured = case.configured
    mesh = case.mesh or whole_mesh(configured.model.structure, configured.configuration.elements_off)
    are_elements = mesh.kinds == ELEMENT
    return replace(mesh, lines=mesh.lines[are_elements], kinds=mesh.kinds[are_elements])


def accessible_rows(study: Study, case: StudyCase, table: PlanTable, mesh: DrawnMesh) -> Integers:
    """Rows of the grid points that [plan] allows, of what is drawn of the active elements.

    Raises
    ------
    FemtuneError : ``plan.candidates``, ``parameter.region``, ``model.unknown-node``
    """
    nodes, where = study.model.structure.nodes, study.file.where
    if not nodes.has_coordinates:
        raise FemtuneError("plan.candidates/no-coordinates", where=where("plan"))
    rows = np.asarray(mesh.used, np.int64)
    if not rows.size:
        # matrices without a mesh
        rows = np.arange(len(nodes.ids))
    if table.nodes is not None:
        # points that are named may lie inside solids
        rows = _named(study, "nodes", table.nodes)
    elements = elements_of(study.file, ("plan",), table, study.built, "[plan]")
    if elements is not None:
        rows = np.intersect1d(rows, _rows_of(study, elements))
    if table.dof_set is not None:
        sets = study.model.structure.dof_sets
        if table.dof_set not in sets:
            known = ", ".join(sets) or "none"
            place = where("plan", "dof_set")
            raise FemtuneError("plan.candidates/unknown-set", where=place, name=table.dof_set, known=known)
        dofs = np.asarray(sets[table.dof_set])
        rows = np.intersect1d(rows, dofs[dofs < 6 * len(nodes.ids)] // 6)
    if table.exclude is not None:
        rows = np.setdiff1d(rows, _named(study, "exclude", table.exclude))
    if not rows.size:
        raise FemtuneError("plan.candidates", where=where("plan"), reason="no grid point satisfies all conditions")
    return rows


def _named(study: Study, key: str, numbers: Elements) -> Integers:
    """Rows of listed grid points; one named singly must exist."""
    nodes, wanted = study.model.structure.nodes, number_list(numbers)
    with errors_at(study.file.where("plan", key)):
        for node in wanted.singles:
            nodes.position(node)
    return np.array([nodes.position(n) for n in wanted.among(nodes.ids.tolist())], np.int64)


def _rows_of(study: Study, elements: Iterable[int]) -> Integers:
    wanted, count = np.array(sorted(elements), np.int64), len(study.model.structure.nodes.ids)
    grid_rows = [b.nodes[np.isin(b.ids, wanted)].ravel() for b in study.model.structure.batches]
    rows = np.unique(np.concatenate([np.zeros(0, np.int64), *grid_rows]))
    return rows[(rows >= 0) & (rows < count)]


def sites_of(
    case: StudyCase, solution: EigenSolution, targets: Integers, rows: Integers, mesh: DrawnMesh, table: PlanTable
) -> Sites:
    """The target modes at grid points, with local axes."""
    xyz = case.configured.model.structure.nodes.xyz
    normal = surface_normals(xyz, mesh.faces)[rows]
    on_surface = (normal != 0.0).any(axis=1)
    axes = np.tile(np.eye(3), (len(rows), 1, 1))
    if table.directions == "normal":
        axes[on_surface] = _tangents(normal[on_surface])
    motion = grid_translations(case.configured, solution, rows)[:, :, targets]
    return Sites(rows, axes, on_surface, motion)


def moving(sites: Sites) -> Flags:
    """(n,) True where a grid point moves in at least one target mode."""
    size = np.linalg.norm(sites.motion, axis=1)
    largest = size.max(axis=0, initial=0.0)
    return np.asarray((size > _LEAST_MOTION * largest).any(axis=1))


def surface_normals(xyz: Reals, faces: NDArray[np.int64]) -> Reals:
    """(n, 3) unit normals of grid points, the mean over their faces by area; zero where there are none.

    Faces of shells may be wound either way: each is turned to the side of the first one at the point.
    """
    total = np.zeros_like(xyz)
    if not len(faces):
        return total
    four = np.where(faces < 0, faces[:, [2]], faces)
    at = xyz[four]
    area = np.cross(at[:, 2] - at[:, 0], at[:, 3] - at[:, 1])
    triangle = faces[:, 3] < 0
    area[triangle] = np.cross(at[triangle, 1] - at[triangle, 0], at[triangle, 2] - at[triangle, 0])
    corner, face = four.ravel(), np.repeat(np.arange(len(faces)), 4)
    keep = ~np.column_stack([np.zeros((len(faces), 3), bool), triangle]).ravel()
    corner, face = corner[keep], face[keep]
    first = np.full(len(xyz), -1, np.int64)
    first[corner[::-1]] = face[::-1]
    side = np.sign(np.einsum("ij,ij->i", area[face], area[first[corner]]))
    np.add.at(total, corner, np.where(side == 0.0, 1.0, side)[:, None] * area[face])
    size = np.linalg.norm(total, axis=1)
    largest = float(np.linalg.norm(area, axis=1).max())
    return np.asarray(np.divide(total, size[:, None], out=np.zeros_like(total), where=size[:, None] > 1e-9 * largest))


def _tangents(normal: Reals) -> Reals:
    """(n, 3, 3) right-handed axes with the normal as the third; the first lies along X, or Y where that is the normal.

    A normal points to the side of its largest basic axis.
    """
    largest = np.argmax(np.abs(normal), axis=1)
    sign = np.sign(np.take_along_axis(normal, largest[:, None], axis=1))
    z = normal * sign
    towards = np.where((np.abs(z[:, 0]) < 0.9)[:, None], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = towards - np.einsum("ij,ij->i", towards, z)[:, None] * z
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(z, x), z], axis=1)


def uniaxial_of(sites: Sites, table: PlanTable) -> Uniaxial:
    """Uniaxial candidates: along the normal on a surface and along each basic axis elsewhere, or as [plan] says."""
    if table.directions == "normal":
        normal = np.flatnonzero(sites.on_surface)
        other = np.repeat(np.flatnonzero(~sites.on_surface), 3)
        axis = np.concatenate([np.full(len(normal), 2), np.tile(np.arange(3), len(other) // 3)])
        return _moving_axes(sites, Uniaxial(np.concatenate([normal, other]), axis))
    axes = [DIRECTIONS.index(d) - 1 for d in table.directions]
    site = np.repeat(np.arange(len(sites)), len(axes))
    return _moving_axes(sites, Uniaxial(site, np.tile(np.array(axes), len(sites))))


def _moving_axes(sites: Sites, uniaxial: Uniaxial) -> Uniaxial:
    size = np.abs(sites.local[uniaxial.site, uniaxial.axis])
    largest = np.linalg.norm(sites.motion, axis=1).max(axis=0, initial=0.0)
    some = (size > _LEAST_MOTION * largest).any(axis=1)
    return Uniaxial(uniaxial.site[some], uniaxial.axis[some])


def masses_at(study: Study, case: StudyCase, table: PlanTable, rows: Integers) -> Reals:
    """(n,) mean of the diagonal entries of the mass matrix at the translations of grid points, before constraints.

    Ones where nothing is weighted by kinetic energy: the matrix of a large model takes its time.
    """
    if table.weighting == "none":
        return np.ones(len(rows))
    diagonal = grid_matrix(study.model, case.configured.configuration, "mass").diagonal()
    return np.asarray(np.maximum(diagonal[6 * rows[:, None] + np.arange(3)], 0.0).mean(axis=1))


@dataclass(frozen=True, eq=False)
class SiteSensor:
    """A sensor at a grid point.

    Parameters
    ----------
    row : row of the grid point
    axes : (3, 3) local axes, one a row, in the basic system
    axis : measured local axis from 0, None for a triaxial sensor
    shapes : (d, m) target modes along its directions
    mass : of the grid point, for weighting by kinetic energy
    """

    kind: SensorKind
    row: int
    axes: Reals
    axis: int | None
    shapes: Reals
    mass: float
    given: bool = False

    @property
    def direction(self) -> Reals | None:
        """(3,) of a uniaxial sensor."""
        return None if self.axis is None else np.asarray(self.axes[self.axis])
