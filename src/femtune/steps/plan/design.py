"""Sensors, exciters and lines together: for the target modes, or for the parameters in turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.planning import SumObjective, best_of
from femtune.steps.plan.candidates import SiteSensor, masses_at
from femtune.steps.plan.excitation import Excitation, Exciter, find_exciters
from femtune.steps.plan.frfs import Directions, FrfCalibration, Functions, directions_of
from femtune.steps.plan.parameters import calibration
from femtune.steps.plan.sensors import PlacedSensors, SensorPlan

if TYPE_CHECKING:
    from femtune.files.study_file import PlanTable
    from femtune.model import EigenSolution
    from femtune.steps.plan.candidates import Sites, Uniaxial
    from femtune.steps.plan.parameters import CalibrationKnown
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study

_MOST_ROUNDS = 6
"""Rounds of placing sensors, exciters and lines in turns.

Each improves the criterion; the limit bounds the time of a search that improves slowly.
"""
_LEAST_GAIN = 1e-6
"""Increase of the criterion above which a set is better.

Smaller increases are rounding errors and could alternate without end.
"""


@dataclass(frozen=True, eq=False)
class PlannedDesign:
    """A planned set.

    Parameters
    ----------
    uniaxial : candidates
    excitation : None without exciters
    known : information of the test on the parameters; None without free parameters
    every : (k, k) information with a sensor at every candidate, where it is known
    lines : positions of the frequency lines that were chosen; None for all of them
    order : of the reduced model that the FRFs are from; None for the full one
    """

    placed: PlacedSensors
    uniaxial: Uniaxial
    excitation: Excitation | None
    known: CalibrationKnown | None = None
    every: Reals | None = None
    lines: Integers | None = None
    order: int | None = None


@dataclass(frozen=True, eq=False)
class Designer:
    """Everything that a plan chooses from.

    Parameters
    ----------
    counts : numbers of triaxial and uniaxial sensors
    lines_hz : frequency lines; None where all target modes are rigid-body motions
    """

    study: Study
    case: StudyCase
    solution: EigenSolution
    targets: Integers
    table: PlanTable
    sites: Sites
    given: tuple[SiteSensor, ...]
    counts: tuple[int, int]
    lines_hz: Reals | None
    progress: Progress

    def design(self) -> PlannedDesign:
        """Sensors, exciters and lines.

        Raises
        ------
        FemtuneError : ``plan.*``
        """
        table, where = self.table, self.study.file.where
        free = bool(self.study.parameters.free)
        if table.aim == "parameters" and not free:
            raise FemtuneError("plan.parameters/none", where=where("plan", "aim"))
        if table.data == "frfs":
            if not (table.exciters or table.exciters_placed):
                raise FemtuneError("plan.exciters/none", where=where("plan", "data"))
            if free and self.lines_hz is not None:
                return self._for_functions(self.lines_hz)
        known = self._of_modes(self._rows) if table.aim == "parameters" else None
        plan, placed = self._place(known)
        every = None if known is None else known.of_candidates(self.sites, plan.uniaxial, bool(table.triaxial))
        if known is None and free and self.lines_hz is not None:
            known = self._of_modes(np.unique([s.row for s in placed.sensors]))
        return PlannedDesign(placed, plan.uniaxial, self._by_level(plan.uniaxial), known, every)

    @property
    def _rows(self) -> Integers:
        return np.union1d(self.sites.rows, np.array([s.row for s in self.given], np.int64))

    def _of_modes(self, rows: Integers) -> CalibrationKnown:
        self.progress.step("derivatives of the target modes", 0, None)
        return calibration(
            self.study, self.case, self.solution, self.targets, self.sites, rows, self.table, self.progress
        )

    def _place(self, known: CalibrationKnown | None) -> tuple[SensorPlan, PlacedSensors]:
        masses = masses_at(self.study, self.case, self.table, self.sites.rows)
        names = tuple(str(j + 1) for j in self.targets)
        plan = SensorPlan(
            self.table, self.sites, masses, self.given, self.study.model.structure.nodes.xyz, names, known
        )
        return plan, plan.place(*self.counts, self.table.visualisation)

    def _by_level(self, uniaxial: Uniaxial) -> Excitation | None:
        if not (self.table.exciters or self.table.exciters_placed):
            return None
        return find_exciters(self.study, self.solution, self.targets, self.table, self.sites, uniaxial)

    def _for_functions(self, lines_hz: Reals) -> PlannedDesign:
        table = self.table
        plan, placed = self._place(None)
        excitation = self._by_level(plan.uniaxial)
        assert excitation is not None
        functions = self._functions(lines_hz, placed, excitation, self._rows)
        known = FrfCalibration(functions, excitation.exciters)
        every = None
        if table.aim == "parameters":
            _, placed = self._place(known)
            placed, excitation, known = self._turns(plan.uniaxial, placed, excitation, self._with_lines(known, placed))
            every = known.of_candidates(self.sites, plan.uniaxial, bool(table.triaxial))
            if functions.order is not None:
                # a reduced model of the functions that were chosen
                functions = self._functions(lines_hz, placed, excitation, self._rows)
                known = FrfCalibration(functions, excitation.exciters, known.lines)
        else:
            known = self._with_lines(known, placed)
        chosen = known.lines if len(known.lines) < len(lines_hz) else None
        return PlannedDesign(placed, plan.uniaxial, excitation, known, every, chosen, functions.order)

    def _functions(self, lines_hz: Reals, placed: PlacedSensors, excitation: Excitation, rows: Integers) -> Functions:
        functions = Functions(self.study, self.case, self.table, lines_hz, self.progress)
        inputs = directions_of(excitation.exciters)
        functions.reduce(directions_of(placed.sensors), inputs, rows)
        functions.refer_to(inputs)
        return functions

    def _turns(
        self, uniaxial: Uniaxial, placed: PlacedSensors, excitation: Excitation, known: FrfCalibration
    ) -> tuple[PlacedSensors, Excitation, FrfCalibration]:
        """Exciters for the sensors, lines for both, sensors for both, as long as the set becomes better."""
        worth = known.worth(placed.sensors)
        for _ in range(_MOST_ROUNDS):
            before = worth
            if self.table.exciters:
                others = self._exciters(uniaxial, known, placed.sensors)
                better = FrfCalibration(known.functions, others.exciters, known.lines)
                if (new_worth := better.worth(placed.sensors)) > worth + _LEAST_GAIN:
                    worth, excitation, known = new_worth, others, better
            better = self._with_lines(known, placed)
            if (new_worth := better.worth(placed.sensors)) > worth + _LEAST_GAIN:
                worth, known = new_worth, better
            _, again = self._place(known)
            if (new_worth := known.worth(again.sensors)) > worth + _LEAST_GAIN:
                worth, placed = new_worth, again
            if worth <= before + _LEAST_GAIN:
                break
        return placed, excitation, known

    def _exciters(self, uniaxial: Uniaxial, known: FrfCalibration, sensors: Sequence[SiteSensor]) -> Excitation:
        def choose(some: Integers, given: Sequence[Exciter]) -> Integers:
            site, axis = uniaxial.site[some], uniaxial.axis[some]
            own = known.of_inputs(Directions(self.sites.rows[site], self.sites.axes[site, axis]), sensors)
            there = [F.sum(axis=0) for F in known.of_inputs(directions_of(given), sensors)]
            objective = SumObjective(own, there, self.table.criterion, self.table.average)
            return best_of(objective, len(some), self.table.exciters)

        return find_exciters(self.study, self.solution, self.targets, self.table, self.sites, uniaxial, choose)

    def _with_lines(self, known: FrfCalibration, placed: PlacedSensors) -> FrfCalibration:
        """With the lines that are best for the sensors, where only some are wanted."""
        count, wanted = len(known.functions.freq_hz), self.table.frf_lines
        if wanted is None or wanted >= count:
            return known
        own = known.of_lines(placed.sensors)
        none = [np.zeros(F.shape[1:]) for F in own]
        lines = best_of(SumObjective(own, none, self.table.criterion, self.table.average), count, wanted)
        return FrfCalibration(known.functions, known.exciters, lines)
