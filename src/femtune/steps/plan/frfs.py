"""Information of a planned FRF test on the parameters: the residual of the calibration, with the model as test.

The FRFs of the model between sensors and exciters take the place of measured ones, so that the Jacobian of
`FrfResidual` with its forms and standard deviations is that of the calibration. The information of functions and lines
adds up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Complexes, Integers, Reals
from femtune.dofs import Dof, DofSet
from femtune.modal import FrfSet
from femtune.model import constant_damping
from femtune.planning import SumObjective, combined, score
from femtune.residuals import CaseState, FrfResidual, UpdateProblem, case_without_modes
from femtune.residuals.frf.choice import weighted_residual
from femtune.residuals.frf.lines import Band, Region
from femtune.residuals.frf.model_way import ModelWay
from femtune.residuals.frf.on_reduced import ReducedFrfs
from femtune.residuals.frf.residual import Places
from femtune.residuals.frf.scatter import FrfScatter, relative_sd
from femtune.steps.plan.parameters import hypercube
from femtune.study.stages import reduction_rules
from femtune.updating.on_reduced_model import NOBODY, train, unassessed

if TYPE_CHECKING:
    from femtune.files.study_file import PlanTable
    from femtune.planning import Objective
    from femtune.residuals import ComparedCase
    from femtune.steps.plan.candidates import Sites, SiteSensor, Uniaxial
    from femtune.steps.plan.excitation import Exciter
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study

DYNAMIC_RANGE = 1e-4
"""Smallest measurable value relative to the largest value at the driving points: 80 dB.

Smaller values are covered by noise and carry no information.
"""
_NUMBERS_PER_BATCH = 4_000_000
"""Numbers in the temporary arrays of functions that are computed together.

It bounds the memory for these arrays.
"""


@dataclass(frozen=True, eq=False)
class Directions:
    """Unit vectors (n, 3) in the basic system at rows (n,) of grid points."""

    rows: Integers
    vectors: Reals

    def __len__(self) -> int:
        return len(self.rows)

    def select(self, which: Integers | slice) -> Directions:
        """Some of them."""
        return Directions(self.rows[which], self.vectors[which])

    @property
    def keys(self) -> list[bytes]:
        """Keys that distinguish the directions."""
        return [np.append(r, v).tobytes() for r, v in zip(self.rows.astype(float), self.vectors)]


def directions_of(sensors: Sequence[SiteSensor | Exciter]) -> Directions:
    """Measured directions of sensors, or directions of exciters, in their order."""
    axes = [s.axes if s.axis is None else s.axes[[s.axis]] for s in sensors]
    rows = np.array([s.row for s, own in zip(sensors, axes) for _ in own], np.int64)
    return Directions(rows, np.concatenate([np.zeros((0, 3)), *axes]))


class Functions:
    """Slopes of the weighted residuals of FRFs between any directions, at the nominal and at further points.

    Parameters
    ----------
    table : lines, damping, and standard deviations that are assumed
    freq_hz : (l,) frequency lines
    """

    def __init__(self, study: Study, case: StudyCase, table: PlanTable, freq_hz: Reals, progress: Progress) -> None:
        self.study, self.case, self.table, self.freq_hz, self.progress = study, case, table, freq_hz, progress
        self.scatter = FrfScatter(relative_sd(table.frf_sd, table.frf_floor), table.frf_floor)
        x = np.zeros(len(study.parameters.free))
        self.points = (x, *hypercube(study, table.points - 1, table.seed))
        self._alone = case_without_modes(case.configured, (), solver=study.solver)
        way = ModelWay("real-modes", None, constant_damping(table.damping_ratio))
        self.way = way.settled(CaseState(self._alone, case.configured.at(x)), float(freq_hz[-1]))
        self._states = [CaseState(self._alone, case.configured.at(p)) for p in self.points]
        self._reduced: ComparedCase | None = None
        self._levels: list[float] = []

    def slopes(self, p: int, outputs: Directions, inputs: Directions) -> Reals:
        """(o, i, l, c, k) derivatives of the weighted residuals at a point by the prior standard deviations.

        Real and imaginary parts, or the parts of logarithms, along c; zero where nothing would be compared.
        """
        values, gradient = self._computed(p, outputs, inputs)
        residual = self._residual(values, self._places(outputs, inputs))
        residual = replace(
            residual, sd=np.where(np.abs(values) <= DYNAMIC_RANGE * self._levels[p], np.nan, residual.sd)
        )
        known, k = np.isfinite(residual.sd), gradient.shape[-1]
        parts = 1 if residual.form == "log-magnitude" else 2
        derivatives = np.zeros((*known.shape, parts, k))
        if known.any():
            (block,) = residual.compared(values, gradient)
            derivatives[known] = block.jacobian.reshape(parts, -1, k).swapaxes(0, 1) * self.study.parameters.prior[1]
        return derivatives

    def refer_to(self, inputs: Directions) -> None:
        """Make the largest value at these driving points what others must not be small beside."""
        own = (self._computed(p, inputs, inputs)[0] for p in range(len(self.points)))
        self._levels = [float(np.abs(values).max()) for values in own]

    def _residual(self, values: Complexes, places: Places) -> FrfResidual:
        measured = FrfSet(self.freq_hz, values, _labels(values.shape[0]), _labels(values.shape[1]), "accelerance")
        made = weighted_residual(
            self.case.name, measured, places, Band(), self.table.frf_form, self.scatter, self.way
        )  # fmt: skip
        # one block of all functions
        return replace(made, regions=(Region("all", np.arange(len(self.freq_hz))),))

    def _computed(self, p: int, outputs: Directions, inputs: Directions) -> tuple[Complexes, Complexes]:
        """Functions (o, i, l) and their derivatives (…, k); zero for directions that are held."""
        o, i, k = self._moving(outputs), self._moving(inputs), len(self.points[0])
        shape = (len(outputs), len(inputs), len(self.freq_hz))
        values, gradient = np.zeros(shape, complex), np.zeros((*shape, k), complex)
        if o.size and i.size:
            at = np.ix_(o, i)
            values[at], gradient[at] = self._model(p, outputs.select(o), inputs.select(i))
        return values, gradient

    def _model(self, p: int, outputs: Directions, inputs: Directions) -> tuple[Complexes, Complexes]:
        residual = self._residual(
            np.ones((len(outputs), len(inputs), len(self.freq_hz)), complex), self._places(outputs, inputs)
        )
        if self._reduced is None:
            return residual.functions(self.way.model(self._states[p], float(self.freq_hz[-1])), derivatives=True)
        on_basis = ReducedFrfs(residual, self._on_basis(outputs), self._on_basis(inputs))
        return on_basis.functions(self._states[p], True)

    def _unmeasured(self, outputs: Directions, inputs: Directions) -> FrfResidual:
        """The residual that computes functions, with ones as measured values."""
        ones = np.ones((len(outputs), len(inputs), len(self.freq_hz)), complex)
        return self._residual(ones, self._places(outputs, inputs))

    def _places(self, outputs: Directions, inputs: Directions) -> Places:
        return Places(self._matrix(outputs), self._matrix(inputs))

    def _matrix(self, at: Directions) -> sp.csr_array:
        """(n, n_g) rows over the DOFs of all grid points."""
        nodes = self.case.configured.model.structure.nodes
        entries = np.einsum("nj,nji->ni", at.vectors, nodes.frames[at.rows])
        columns = 6 * at.rows[:, None] + np.arange(3)
        rows = np.repeat(np.arange(len(at)), 3)
        return sp.csr_array((entries.ravel(), (rows, columns.ravel())), shape=(len(at), nodes.n_dofs))

    def _moving(self, at: Directions) -> Integers:
        """Positions of the directions that are not held."""
        seen = self._matrix(at) @ self.case.configured.transformation
        return np.flatnonzero(np.abs(seen).max(axis=1).toarray().ravel() > 0.0)

    def reduce(self, outputs: Directions, inputs: Directions, rows: Integers) -> None:
        """Train a reduced model for functions between these directions; any at the grid points `rows` are seen of it.

        Nothing is done without [reduction] or free parameters, nor where the model depends on frequency or is
        assembled from components.
        """
        rules, model = reduction_rules(self.study), self.case.configured.model
        if rules is None or rules.components is not None or model.tables:
            return
        outputs, inputs = (d.select(self._moving(d)) for d in (outputs, inputs))
        self._rows = np.unique(np.concatenate([rows, outputs.rows, inputs.rows]))
        every = Directions(np.repeat(self._rows, 3), np.tile(np.eye(3), (len(self._rows), 1)))
        residual = self._unmeasured(outputs, inputs)
        sensors = sp.csr_array(self._matrix(every) @ self.case.configured.transformation)
        case = replace(self._alone, residuals=(residual,), sensors=sensors)
        problem = UpdateProblem((case,), self.study.parameters)
        self.progress.step(f"reduced model of {self.case.name}", 0, None)
        search = train(problem, rules, unassessed(problem), NOBODY)
        if search.reduced:
            self._reduced = search.reduced_problem().cases[0]
            self._states = [CaseState(self._reduced, self._reduced.configured.at(p)) for p in self.points]

    def _on_basis(self, at: Directions) -> Reals:
        assert self._reduced is not None
        basis = np.asarray(self._reduced.sensors).reshape(len(self._rows), 3, -1)
        return np.einsum("nj,njr->nr", at.vectors, basis[np.searchsorted(self._rows, at.rows)])

    @property
    def order(self) -> int | None:
        """Of the reduced model; None without one."""
        return None if self._reduced is None else self._reduced.configured.n_free


def _labels(count: int) -> DofSet:
    """Any labels: the places say where the functions are."""
    return DofSet(Dof(i + 1, "X") for i in range(count))


class FrfCalibration:
    """Information of sensors with some exciters and lines, for `SensorPlan` and for the expected standard deviations.

    Parameters
    ----------
    lines : positions of the lines that count
    """

    def __init__(self, functions: Functions, exciters: Sequence[Exciter], lines: Integers | None = None) -> None:
        self.functions, self.exciters = functions, tuple(exciters)
        self.lines = np.arange(len(functions.freq_hz)) if lines is None else lines
        self._inputs = directions_of(self.exciters)
        self._known: list[dict[bytes, Reals]] = [{} for _ in functions.points]

    @property
    def _count(self) -> int:
        return len(self.functions.points[0])

    def objective(self, rows: Integers, axes: Reals, placed: Sequence[SiteSensor]) -> Objective:
        """For candidates at rows (s,) along directions (s, d, 3), beside sensors that are there."""
        s, d, _ = axes.shape
        each = self._of(Directions(np.repeat(rows, d), axes.reshape(-1, 3)))
        table = self.functions.table
        own = [F.reshape(s, d, *F.shape[1:]).sum(axis=1) for F in each]
        return SumObjective(own, self.information(placed), table.criterion, table.average)

    def information(self, sensors: Sequence[SiteSensor]) -> list[Reals]:
        """(k, k) at each point."""
        return [F.sum(axis=0) for F in self._of(directions_of(sensors))]

    def of_candidates(self, sites: Sites, uniaxial: Uniaxial, triaxial: bool) -> Reals:
        """(k, k) at the nominal point with a sensor at every candidate."""
        if triaxial:
            every = Directions(np.repeat(sites.rows, 3), sites.axes.reshape(-1, 3))
        else:
            every = Directions(sites.rows[uniaxial.site], sites.axes[uniaxial.site, uniaxial.axis])
        return np.asarray(self._of(every)[0].sum(axis=0))

    @property
    def of_frequencies(self) -> None:
        """FRFs are compared, no frequencies."""
        return None

    def worth(self, sensors: Sequence[SiteSensor]) -> float:
        """The score of a set of sensors."""
        table = self.functions.table
        each = [score(np.eye(len(F)) + F, table.criterion) for F in self.information(sensors)]
        return float(combined(each, table.average))

    def of_inputs(self, candidates: Directions, sensors: Sequence[SiteSensor]) -> list[Reals]:
        """(s, k, k) information that each candidate for an exciter gives with the sensors, at each point."""
        outputs, lines = directions_of(sensors), self.lines

        def of_some(p: int, some: Directions) -> Reals:
            J = self.functions.slopes(p, outputs, some)[:, :, lines]
            return np.einsum("oilck,oilcm->ikm", J, J, optimize=True)

        points = range(len(self.functions.points))
        return [self._in_parts(p, candidates, len(outputs), of_some) for p in points]

    def of_lines(self, sensors: Sequence[SiteSensor]) -> list[Reals]:
        """(l, k, k) information of each line, at each point."""
        outputs = directions_of(sensors)
        information = []
        for p in range(len(self.functions.points)):
            J = self.functions.slopes(p, outputs, self._inputs)
            information.append(np.einsum("oilck,oilcm->lkm", J, J, optimize=True))
        return information

    def _of(self, outputs: Directions) -> list[Reals]:
        """(n, k, k) information of each direction, at each point."""
        keys, functions = outputs.keys, []
        for p, known in enumerate(self._known):
            new = np.array([i for i, key in enumerate(keys) if key not in known], np.int64)
            for i, F in zip(new, self._in_parts(p, outputs.select(new), len(self._inputs), self._of_outputs)):
                known[keys[i]] = F
            functions.append(np.array([known[key] for key in keys]).reshape(-1, self._count, self._count))
        return functions

    def _of_outputs(self, p: int, some: Directions) -> Reals:
        J = self.functions.slopes(p, some, self._inputs)[:, :, self.lines]
        return np.asarray(np.einsum("oilck,oilcm->okm", J, J, optimize=True))

    def _in_parts(
        self, p: int, candidates: Directions, others: int, of_some: Callable[[int, Directions], Reals]
    ) -> Reals:
        """(n, k, k) of candidates, some at a time."""
        k, lines = self._count, len(self.functions.freq_hz)
        some = max(1, _NUMBERS_PER_BATCH // (lines * (others * 4 * k + 100)))
        parts = [np.zeros((0, k, k))]
        for first in range(0, len(candidates), some):
            self.functions.progress.step("information of the FRFs at the candidates", first, len(candidates))
            parts.append(of_some(p, candidates.select(slice(first, first + some))))
        return np.concatenate(parts)
