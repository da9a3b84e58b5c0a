"""Sensors of a plan: given ones, placed ones, and ones added for visualisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.dofs import Dof, parse_dof
from femtune.errors import FemtuneError
from femtune.planning import Candidates, Placed, eliminate, expand, farthest_points
from femtune.steps.modes.shapes import grid_translations
from femtune.steps.plan.candidates import Sites, SiteSensor, Uniaxial, masses_at, uniaxial_of
from femtune.study.error_places import errors_at

if TYPE_CHECKING:
    from femtune.errors import Where
    from femtune.files.study_file import PlanTable
    from femtune.model import EigenSolution
    from femtune.planning import ChosenSensors
    from femtune.steps.plan.parameters import CalibrationKnown
    from femtune.steps.plan.record import SensorKind
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study


@dataclass(frozen=True, eq=False)
class PlacedSensors:
    """Sensors in their order, and what the search left out and exchanged."""

    sensors: tuple[SiteSensor, ...]
    rejected: int
    exchanges: int
    lacking: tuple[tuple[SensorKind, int, int], ...]
    """Kind, number placed and number wanted where the candidates were exhausted."""


def given_sensors(
    study: Study, case: StudyCase, solution: EigenSolution, targets: Integers, table: PlanTable
) -> tuple[SiteSensor, ...]:
    """Sensors that [plan] places, along the displacement axes of their grid points.

    Raises
    ------
    FemtuneError : ``plan.placed``, ``model.unknown-node``
    """
    nodes, sensors = study.model.structure.nodes, []
    masses = masses_at(study, case, table, np.arange(len(nodes.ids))) if table.placed else np.zeros(0)
    taken: set[tuple[int, int]] = set()
    for i, text in enumerate(table.placed):
        where = study.file.where("plan", "placed", i)
        node, axis, sign = _given(text, where)
        with errors_at(where):
            row = nodes.position(node)
        measured = {(node, a) for a in ([0, 1, 2] if axis is None else [axis])}
        if measured & taken:
            raise FemtuneError("plan.placed/twice", where=where, node=node)
        taken |= measured
        axes = nodes.frames[row].T.copy()
        if axis is not None:
            axes[axis] *= sign
        motion = grid_translations(case.configured, solution, np.array([row]))[0][:, targets]
        shapes = axes @ motion if axis is None else axes[[axis]] @ motion
        kind: SensorKind = "triaxial" if axis is None else "uniaxial"
        sensors.append(SiteSensor(kind, row, axes, axis, shapes, float(masses[row]), given=True))
    return tuple(sensors)


def _given(text: str, where: Where) -> tuple[int, int | None, int]:
    """Node, local axis from 0 and sign of an entry of `placed`."""
    if text.strip().isdecimal() and 0 < len(text.strip()) <= 18:
        return int(text), None, 1
    try:
        dof: Dof = parse_dof(text.strip())
    except FemtuneError as error:
        raise FemtuneError("plan.placed", where=where, text=text) from error
    if dof.component > 3:
        raise FemtuneError("plan.placed/rotation", where=where, text=text)
    if dof.component == 0:
        raise FemtuneError("plan.placed", where=where, text=text)
    return dof.node, dof.component - 1, dof.sign


class SensorPlan:
    """The placement: triaxial sensors first, uniaxial ones beside them, and those for the picture at last."""

    def __init__(
        self,
        table: PlanTable,
        sites: Sites,
        masses: Reals,
        given: Sequence[SiteSensor],
        xyz: Reals,
        names: tuple[str, ...],
        calibration: CalibrationKnown | None = None,
    ) -> None:
        self._calibration = calibration
        self._names, self._table, self._sites, self._masses, self._xyz = names, table, sites, masses, xyz
        self.sensors = list(given)
        self.rejected = self.exchanges = 0
        self.lacking: list[tuple[SensorKind, int, int]] = []
        self.uniaxial = uniaxial_of(sites, table)

    def place(self, triaxial: int, uniaxial: int, visualisation: int) -> PlacedSensors:
        """All sensors (errors ``plan.too-many-sensors``, ``plan.dependent``)."""
        if triaxial:
            self._triaxial(triaxial)
        if uniaxial:
            self._uniaxial(uniaxial)
        if visualisation:
            self._visualisation(visualisation)
        return PlacedSensors(tuple(self.sensors), self.rejected, self.exchanges, tuple(self.lacking))

    def _factor(self, mass: Reals) -> Reals:
        """Factor on the rows of a point."""
        return np.sqrt(mass) if self._table.weighting == "kinetic-energy" else np.ones_like(mass)

    def _placed(self) -> tuple[Placed, ...]:
        placed = []
        for d in (1, 3):
            some = [s for s in self.sensors if len(s.shapes) == d]
            if some:
                shapes = np.array([s.shapes for s in some])
                factor = self._factor(np.array([s.mass for s in some]))
                placed.append(Placed(shapes, shapes * factor[:, None, None]))
        return tuple(placed)

    def _free(self) -> Integers:
        """Sites without a sensor."""
        used = [s.row for s in self.sensors]
        return np.flatnonzero(~np.isin(self._sites.rows, used))

    def _search(self, shapes: Reals, site: Integers, axes: Reals, count: int, kind: SensorKind) -> ChosenSensors:
        if count > len(shapes):
            raise FemtuneError("plan.too-many-sensors", wanted=count, kind=kind, candidates=len(shapes))
        table = self._table
        threshold = table.triaxial_threshold if kind == "triaxial" else table.uniaxial_threshold
        weights = None if table.weighting == "none" else self._factor(self._masses[site])
        candidates = Candidates(shapes, weights, self._names)
        objective = None
        if self._calibration is not None:
            objective = self._calibration.objective(self._sites.rows[site], axes, self.sensors)
        if table.method == "elimination":
            outcome = eliminate(candidates, count, self._placed(), threshold)
        else:
            outcome = expand(candidates, count, self._placed(), threshold, exchange=table.exchange, objective=objective)
        self.rejected += outcome.rejected
        self.exchanges += outcome.exchanges
        if len(outcome.chosen) < count:
            self.lacking.append((kind, len(outcome.chosen), count))
        return outcome

    def _triaxial(self, count: int) -> None:
        free = self._free()
        chosen = self._search(self._sites.local[free], free, self._sites.axes[free], count, "triaxial")
        self.sensors += [self._sensor("triaxial", int(free[i]), None) for i in chosen.chosen]

    def _uniaxial(self, count: int) -> None:
        open_ = self._open_axes()
        site, axis = self.uniaxial.site[open_], self.uniaxial.axis[open_]
        shapes = self._sites.local[site, axis][:, None, :]
        chosen = self._search(shapes, site, self._sites.axes[site, axis][:, None, :], count, "uniaxial")
        self.sensors += [self._sensor("uniaxial", int(site[i]), int(axis[i])) for i in chosen.chosen]

    def _open_axes(self) -> Integers:
        """Uniaxial candidates at points without a sensor, or along another axis of the same axes."""
        taken: dict[int, list[SiteSensor]] = {}
        for s in self.sensors:
            taken.setdefault(s.row, []).append(s)
        return np.array(
            [
                k
                for k, (i, a) in enumerate(zip(self.uniaxial.site, self.uniaxial.axis))
                if all(_beside(s, self._sites.axes[i], int(a)) for s in taken.get(int(self._sites.rows[i]), ()))
            ],
            np.int64,
        )

    def _visualisation(self, count: int) -> None:
        free = self._free()
        if count > len(free):
            raise FemtuneError("plan.too-many-sensors", wanted=count, kind="visualisation", candidates=len(free))
        points, placed = self._xyz[self._sites.rows], self._xyz[[s.row for s in self.sensors]]
        for i in free[farthest_points(points[free], placed.reshape(-1, 3), count)]:
            self.sensors.append(self._sensor("visualisation", int(i), self._best_axis(int(i))))

    def _best_axis(self, i: int) -> int:
        """The normal, or without one the axis along which the target modes move most."""
        if self._table.directions == "normal" and self._sites.on_surface[i]:
            return 2
        return int(np.argmax((self._sites.local[i] ** 2).sum(axis=1)))

    def _sensor(self, kind: SensorKind, i: int, axis: int | None) -> SiteSensor:
        local = self._sites.local[i]
        shapes = local if axis is None else local[[axis]]
        return SiteSensor(kind, int(self._sites.rows[i]), self._sites.axes[i], axis, shapes, float(self._masses[i]))


def _beside(sensor: SiteSensor, axes: Reals, axis: int) -> bool:
    """Whether a uniaxial sensor along a local axis may stand at the point of another sensor."""
    return sensor.axis is not None and sensor.axis != axis and np.allclose(sensor.axes, axes)


def candidate_shapes(sites: Sites, uniaxial: Uniaxial, triaxial: bool) -> Reals:
    """(rows, m) target modes at all candidates."""
    return sites.local.reshape(-1, sites.local.shape[-1]) if triaxial else sites.local[uniaxial.site, uniaxial.axis]
