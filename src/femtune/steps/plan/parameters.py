"""Information of the planned test on the parameters: derivatives of the target modes at candidates and sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.optimize import linear_sum_assignment

from femtune.arrays import Integers, Reals
from femtune.modal import clusters, largest_entries, mac
from femtune.model.full_model import direct
from femtune.model.response.rigid import is_rigid
from femtune.planning import (
    CalibrationObjective,
    CalibrationPoint,
    ClusterShapes,
    data_sd,
    expected_sd,
    joined_information,
)
from femtune.steps.modes.shapes import grid_translations
from femtune.steps.plan.record import ExpectedParameter
from femtune.study.solved import nominal

if TYPE_CHECKING:
    from femtune.files.study_file import PlanTable
    from femtune.model import EigenSolution
    from femtune.planning import Objective
    from femtune.steps.plan.candidates import Sites, SiteSensor, Uniaxial
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study


@dataclass(frozen=True, eq=False)
class PointDerivatives:
    """Target modes and their derivatives at grid points, at one point of the prior.

    Parameters
    ----------
    frequencies : (k, k) information of the frequencies
    clusters : with one sensor a grid point, along the basic axes
    """

    frequencies: Reals
    clusters: tuple[ClusterShapes, ...]

    def along(self, at: Integers, axes: Reals) -> CalibrationPoint:
        """At grid points (n,) along directions (n, d, 3)."""
        return CalibrationPoint(
            self.frequencies,
            tuple(
                ClusterShapes(
                    np.einsum("nij,njq->niq", axes, c.shapes[at]),
                    np.einsum("nij,njtk->nitk", axes, c.slopes[at]),
                    c.noise,
                )
                for c in self.clusters
            ),
        )


class Calibration:
    """Derivatives at some grid points, at the nominal point first.

    Parameters
    ----------
    rows : (n,) rows of the grid points, each once
    """

    def __init__(self, table: PlanTable, rows: Integers, points: Sequence[PointDerivatives]) -> None:
        self._table, self._points = table, points
        self._at = {int(r): i for i, r in enumerate(rows)}

    def _along(self, rows: Integers, axes: Reals) -> list[CalibrationPoint]:
        at = np.array([self._at[int(r)] for r in rows], np.int64)
        return [p.along(at, axes) for p in self._points]

    def objective(self, rows: Integers, axes: Reals, placed: Sequence[SiteSensor]) -> CalibrationObjective:
        """For candidates at rows (s,) along directions (s, d, 3), beside sensors that are there."""
        there = list(zip(*self._groups(placed)))
        return CalibrationObjective(self._along(rows, axes), there, self._table.criterion, self._table.average)

    def _groups(self, sensors: Sequence[SiteSensor]) -> list[list[CalibrationPoint]]:
        """Uniaxial and triaxial sensors, at each point."""
        groups = []
        for d in (1, 3):
            some = [s for s in sensors if len(s.shapes) == d]
            if some:
                axes = np.array([s.axes if s.axis is None else s.axes[[s.axis]] for s in some])
                groups.append(self._along(np.array([s.row for s in some]), axes))
        return groups

    def information(self, sensors: Sequence[SiteSensor]) -> list[Reals]:
        """(k, k) at each point."""
        return [joined_information(parts) for parts in zip(*self._groups(sensors))]

    def of_candidates(self, sites: Sites, uniaxial: Uniaxial, triaxial: bool) -> Reals:
        """(k, k) at the nominal point with a sensor at every candidate."""
        if triaxial:
            return self._along(sites.rows, sites.axes)[0].information
        directions = sites.axes[uniaxial.site, uniaxial.axis][:, None, :]
        return self._along(sites.rows[uniaxial.site], directions)[0].information

    @property
    def of_frequencies(self) -> Reals:
        """(k, k) of the frequencies alone, at the nominal point."""
        return self._points[0].frequencies


def calibration(
    study: Study, case: StudyCase, solution: EigenSolution, targets: Integers, sites: Sites, rows: Integers,
    table: PlanTable, progress: Progress,
) -> Calibration:  # fmt: skip
    """Derivatives at grid points `rows`, at the nominal point and at further points of a Latin hypercube."""
    maker = _Maker(study, case, table, sites, rows)
    points = [maker.at(solution, targets)]
    for i, x in enumerate(hypercube(study, table.points - 1, table.seed)):
        progress.step("derivatives within the bounds of the parameters", i, table.points - 1)
        other = study.solver.modes(case.configured.at(x), solution.wanted, None)
        points.append(maker.at(other, maker.matched(solution, targets, other)))
    return Calibration(table, rows, points)


def hypercube(study: Study, count: int, seed: int) -> Reals:
    """(count, k) normalised points within the bounds."""
    lower, upper = study.parameters.bounds
    if count < 1:
        return np.zeros((0, len(lower)))
    from scipy.stats import qmc  # noqa: PLC0415  half a second that a plan without samples does not need

    sampler = qmc.LatinHypercube(len(lower), rng=np.random.default_rng(seed))
    return np.asarray(lower + (upper - lower) * sampler.random(count))


@dataclass(frozen=True, eq=False)
class _Maker:
    """Derivatives of the target modes of one solution after the other."""

    study: Study
    case: StudyCase
    table: PlanTable
    sites: Sites
    rows: Integers

    def matched(self, solution: EigenSolution, targets: Integers, other: EigenSolution) -> Integers:
        """Positions of the target modes in another solution, by the MAC at the candidates."""
        one = self._at_sites(solution)[:, targets]
        macs = mac(one, self._at_sites(other))
        return np.asarray(linear_sum_assignment(-macs)[1])

    def _at_sites(self, solution: EigenSolution) -> Reals:
        motion = grid_translations(self.case.configured, solution, self.sites.rows)
        return (self.sites.axes @ motion).reshape(-1, motion.shape[-1])

    def at(self, solution: EigenSolution, targets: Integers) -> PointDerivatives:
        """At one solution; rigid-body modes carry no information."""
        rigid = is_rigid(solution)[: solution.wanted]
        elastic = [int(t) for t in targets if not rigid[t]]
        largest = largest_entries(self._at_sites(solution))
        sd = self.study.parameters.prior[1]
        k = len(sd)
        information, derivatives = np.zeros((k, k)), []
        for members in clusters(solution.freq_hz, self.study.file.correlate.cluster_gap):
            elastic_members = [i for i, member in enumerate(members) if member in elastic]
            if not elastic_members:
                continue
            made = direct.derivative(solution, members, self._observed)
            slope = np.einsum("kjj->jk", made.stiffness) - made.eigenvalues[:, None] * np.einsum("kjj->jk", made.mass)
            relative = (
                0.5 * slope[elastic_members] / made.eigenvalues[elastic_members, None] * sd / self.table.frequency_sd
            )
            information += relative.T @ relative
            noise = self.table.shape_sd * largest[[members[i] for i in elastic_members]]
            derivatives.append(
                ClusterShapes(self._basic(made.shapes), self._basic(made.outside[:, elastic_members] * sd), noise)
            )
        return PointDerivatives(information, tuple(derivatives))

    @property
    def _observed(self) -> object:
        return self.case.configured.transformation[(6 * self.rows[:, None] + np.arange(3)).ravel()]

    def _basic(self, values: Reals) -> Reals:
        """From displacement axes of the grid points (3n, …) to basic axes (n, 3, …)."""
        frames = self.case.configured.model.structure.nodes.frames[self.rows]
        own = values.reshape(len(self.rows), 3, *values.shape[1:])
        return np.asarray(np.einsum("nij,nj...->ni...", frames, own))


class CalibrationKnown(Protocol):
    """Information of the planned test on the parameters, in a calibration with modes or with FRFs."""

    def objective(self, rows: Integers, axes: Reals, placed: Sequence[SiteSensor]) -> Objective:
        """For candidates at rows (s,) along directions (s, d, 3), beside sensors that are there."""
        ...

    def information(self, sensors: Sequence[SiteSensor]) -> list[Reals]:
        """(k, k) at each point."""
        ...

    def of_candidates(self, sites: Sites, uniaxial: Uniaxial, triaxial: bool) -> Reals:
        """(k, k) at the nominal point with a sensor at every candidate."""
        ...

    @property
    def of_frequencies(self) -> Reals | None:
        """(k, k) of the frequencies alone, at the nominal point; None where they are not compared."""
        ...


def expected_parameters(
    study: Study, known: CalibrationKnown, sensors: Sequence[SiteSensor], every: Reals | None
) -> tuple[ExpectedParameter, ...]:
    """Expected standard deviations of the free parameters.

    Parameters
    ----------
    every : (k, k) information of all candidates at the nominal point, None where it is not known
    """
    each = known.information(sensors)
    ratios = [expected_sd(F) for F in each]
    frequencies, data = known.of_frequencies, data_sd(each[0])
    alone = None if frequencies is None else expected_sd(frequencies)
    best = None if every is None else expected_sd(every)
    values = study.parameters.values(nominal(study))
    return tuple(
        ExpectedParameter(
            name=p.name,
            unit=p.unit,
            nominal=values[p.name],
            prior_sd=p.sd,
            expected_sd=float(ratios[0][i] * p.sd),
            worst_sd=float(max(r[i] for r in ratios) * p.sd),
            data_sd=float(data[i] * p.sd) if np.isfinite(data[i]) else None,
            frequencies_sd=None if alone is None else float(alone[i] * p.sd),
            candidates_sd=None if best is None else float(best[i] * p.sd),
        )
        for i, p in enumerate(study.parameters.free)
    )
