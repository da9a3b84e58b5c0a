"""The step plan: sensors for a test that has not been made yet, from the modes of the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.dofs import DIRECTIONS, Dof
from femtune.errors import FemtuneError
from femtune.files.study_file import PlanTable, with_plan
from femtune.files.study_file.kinds import number_list
from femtune.model.response.rigid import is_rigid
from femtune.planning import information_of, mesh_distances, outcome_of, rank_of, set_independence, trace_lines
from femtune.planning.kinds import PLACEMENT_METHODS
from femtune.planning.lines_for_poles import PoleTest, pole_lines
from femtune.residuals.frf.scatter import relative_sd
from femtune.steps.held_folder import held_for_solver
from femtune.steps.info.facts import model_modes
from femtune.steps.modes.shapes import grid_translations, mode_shapes
from femtune.steps.plan.candidates import Sites, SiteSensor, accessible_rows, moving, sites_of, surface_mesh
from femtune.steps.plan.design import Designer, PlannedDesign
from femtune.steps.plan.effects import mass_loading, sensor_masses, suspension_effect
from femtune.steps.plan.excitation import (
    Excitation,
    Exciter,
    exciter_records,
    frequency_lines,
    mode_excitation,
    pole_lines_record,
)
from femtune.steps.plan.files import NO_FILES, PlanFiles, check_plan_files, write_plan_files
from femtune.steps.plan.parameters import expected_parameters
from femtune.steps.plan.record import (
    PlannedFunctions,
    PlannedLines,
    PlannedPoleLines,
    PlannedSensor,
    PlannedSet,
    PlanResults,
    TargetMode,
)
from femtune.steps.plan.result import PlanResult
from femtune.steps.plan.sensors import PlacedSensors, candidate_shapes, given_sensors
from femtune.steps.results import Results
from femtune.steps.update.facts.update import citations
from femtune.study.error_places import errors_at
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.record import alert
from femtune.study.solutions import looking_up
from femtune.study.solved import nominal, solve
from femtune.study.study import load_study, with_modes_asked
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.model import EigenSolution
    from femtune.planning import SensorOutcome
    from femtune.study.cases import StudyCase
    from femtune.study.drawn_mesh import DrawnMesh
    from femtune.study.progress import Progress
    from femtune.study.record import Alert
    from femtune.study.study import Study

Arrays = dict[str, NDArray[Any]]

_HIGH_AUTO_MAC = 0.5
"""AutoMAC of two target modes above which an alert says that the sensors hardly distinguish them."""
_LARGE_SHIFT_PERCENT = 0.5
"""Shift of a frequency by the masses of the sensors, in %, above which an alert is given.

It is then as large as usual errors of measured frequencies.
"""
_UNINFORMED_RATIO = 0.9
"""Ratio of expected to prior standard deviation of a parameter above which an alert says that the test gives no
information about it.
"""
_SOFT_RATIO = 0.2
"""Highest frequency of a suspension relative to the first elastic mode up to which it is soft.

At one fifth the suspension changes the first frequency by about 2 %.
"""
_PREFIX = {"triaxial": "T", "uniaxial": "U", "visualisation": "V"}


def plan_test(
    source: Path | str | StudyFile,
    options: Mapping[str, Any],
    progress: Progress = silent,
    *,
    fresh: bool = False,
    files: PlanFiles = NO_FILES,
    units: str | None = None,
    page: Path | None = None,
) -> PlanResult:
    """A plan at the initial values of the parameters.

    Parameters
    ----------
    options : keys of [plan] that take the place of the study's
    fresh : do not take solutions from the journal of the study's run folder
    files : a Universal File and a table to write
    units : of a deck alone, which does not state them
    page : where the report will be written; not a file that was read

    Raises
    ------
    FemtuneError : ``plan.*``, ``eigen.*``, ``response.units-needed``, ``uff.cannot-write``, ``write.overwrites-input``
    """
    watch = Stopwatch(call("plan", source))
    arrays: Arrays = {}
    with watch.step("read"):
        study = _read(source, options, units, progress)
        check_plan_files(study, files, page)
        inputs = inputs_of(study)
    table = study.file.plan
    assert table is not None
    with watch.step("modes"), looking_up(study, fresh) as looked_up:
        case = looked_up.study.cases[0]
        progress.step(f"modes of {case.name}", 0, None)
        solution = solve(looked_up.study, case, nominal(looked_up.study))
    progress.step("placing the sensors", 0, None)
    with watch.step("sensors"), errors_at(study.file.where("plan")):
        plan = _Plan(looked_up.study, case, solution, table, progress)
        record = plan.record(arrays)
    write_plan_files(study, record, files, arrays)
    facts = study_facts(study)
    results = Results(
        provenance=provenance(inputs, watch),
        study=facts if study.units_known else facts.model_copy(update={"units": ""}),
        modes=(model_modes(case.name, "before", solution),),
        mode_shapes=(_drawn(case, solution, arrays),),
        plan=record,
        citations=citations(_papers(record)),
    )
    return PlanResult(record, results, arrays, remarks=tuple(looked_up.remarks), files=files.written)


def _papers(record: PlanResults) -> list[str]:
    """Keys of the publications on what ran."""
    kinds = {s.kind for s in record.sensors if not s.given}
    search = PLACEMENT_METHODS[record.method].citations
    return [
        *(search if record.aim == "modes" and kinds & {"triaxial", "uniaxial"} else ()),
        *(["kammer2004"] if record.aim == "modes" and "triaxial" in kinds else []),
        *(["fedorov1972"] if record.exchanges else []),
        *(["atkinson2007"] if record.aim == "parameters" else []),
        *(["williams1985"] if record.exciters else []),
    ]


def _read(source: Path | str | StudyFile, options: Mapping[str, Any], units: str | None, progress: Progress) -> Study:
    """The study with the configuration that is planned alone, and as many modes as its targets need."""
    with held_for_solver(source, "plan"):
        study = load_study(source, progress)
    file = study.file
    if units is not None:
        if study.units_known:
            raise FemtuneError("response.units-given", where=file.where("study", "units"))
        file = file.model_copy(update={"study": file.study.model_copy(update={"units": unit_system(units).name})})
    file = with_plan(file, options)
    table = file.plan or PlanTable()
    names = [case.name for case in study.cases]
    name = names[0] if table.configuration is None else table.configuration
    if name not in names:
        where, values = file.where("plan", "configuration"), {"configurations": ", ".join(names)}
        raise FemtuneError(
            "study.unknown-configuration/name", where=where, values=values, configuration=name, first=names[0]
        )
    study = replace(
        study, file=file, cases=(study.cases[names.index(name)],), units_known=study.units_known or units is not None
    )
    return _with_targets(study, table)


def _with_targets(study: Study, table: PlanTable) -> Study:
    """The study with at least the modes that the targets need."""
    asked = study.file.modes
    if table.modes is not None:
        listed = number_list(table.modes)
        most = max([*listed.singles, *(s.numbers[-1] for s in listed.spans)], default=1)
        if not listed.every and (asked.count is None or asked.count < most):
            return with_modes_asked(study, most, None)
    elif table.band_hz is not None and (asked.max_hz is None or asked.max_hz < table.band_hz[1]):
        return with_modes_asked(study, None, table.band_hz[1])
    return study


def _drawn(case: StudyCase, solution: EigenSolution, arrays: Arrays) -> Any:
    """The structure for pictures."""
    alone = replace(case, test=None, sensors=None, compared=None)
    return mode_shapes(alone, "before", replace(solution, wanted=1), "plan", arrays)


@dataclass(frozen=True, eq=False)
class _Targets:
    """Positions of the target modes in the solution, and the number of rigid-body modes that were left out."""

    positions: Integers
    rigid: NDArray[np.bool_]
    left_out: int


def _targets(study: Study, solution: EigenSolution, table: PlanTable) -> _Targets:
    rigid = is_rigid(solution)[: solution.wanted]
    numbers = _wanted(study, solution, table)
    kept = numbers if table.rigid_body else numbers[~rigid[numbers]]
    if not kept.size:
        if table.band_hz is not None and table.modes is None:
            low, high = table.band_hz
            where = study.file.where("plan", "band_hz")
            raise FemtuneError(
                "plan.target-modes/none-in-band", where=where, name=study.cases[0].name, low=low, high=high
            )
        raise FemtuneError(
            "plan.target-modes/only-rigid", where=study.file.where("plan", "modes"), name=study.cases[0].name
        )
    return _Targets(kept, rigid[kept], len(numbers) - len(kept))


def _check_pole_lines(study: Study, targets: _Targets, table: PlanTable) -> None:
    """Refuse, before sensors are placed, lines for an identification of a plan that has no FRFs or poles."""
    if table.identification_lines is None:
        return
    where = study.file.where("plan", "identification_lines")
    if not table.exciters and not table.exciters_placed:
        raise FemtuneError("plan.pole-lines/no-exciters", where=where)
    if targets.rigid.all():
        raise FemtuneError("plan.pole-lines/rigid-body", where=where)


def _wanted(study: Study, solution: EigenSolution, table: PlanTable) -> Integers:
    count = solution.wanted
    if table.modes is not None:
        listed = number_list(table.modes)
        absent = sorted({*listed.singles, *(s.numbers[-1] for s in listed.spans)} - set(range(1, count + 1)))
        if absent:
            raise FemtuneError(
                "plan.target-modes/absent", where=study.file.where("plan", "modes"), name=study.cases[0].name,
                numbers=", ".join(map(str, absent[:5])), count=count,
            )  # fmt: skip
        return np.array(listed.among(range(1, count + 1)), np.int64) - 1
    freq = solution.freq_hz
    low, high = table.band_hz if table.band_hz is not None else (0.0, np.inf)
    return np.flatnonzero((freq >= low) & (freq <= high))


class _Plan:
    """Targets, candidates and sensors of one configuration."""

    def __init__(
        self, study: Study, case: StudyCase, solution: EigenSolution, table: PlanTable, progress: Progress
    ) -> None:
        self.study, self.case, self.solution, self.table = study, case, solution, table
        self.progress = progress
        self.targets = _targets(study, solution, table)
        _check_pole_lines(study, self.targets, table)
        self.mesh = surface_mesh(case)
        self.xyz = study.model.structure.nodes.xyz
        rows = accessible_rows(study, case, table, self.mesh)
        everywhere = sites_of(case, solution, self.targets.positions, rows, self.mesh, table)
        some = moving(everywhere)
        if not some.any():
            raise FemtuneError("plan.candidates/constrained", where=study.file.where("plan"), count=len(rows))
        self.sites: Sites = everywhere.select(some)
        self.still = int((~some).sum())

    def record(self, arrays: Arrays) -> PlanResults:
        """The plan; its arrays go into `arrays`."""
        table, targets = self.table, self.targets
        given = given_sensors(self.study, self.case, self.solution, targets.positions, table)
        elastic_hz = self.solution.freq_hz[targets.positions][~targets.rigid]
        lines = frequency_lines(table, elastic_hz, arrays, self.study.file.where("plan", "damping_ratio"))
        lines_hz = None if lines is None else arrays[lines.calibration_key]
        counts = self._counts(given)
        designer = Designer(
            study=self.study,
            case=self.case,
            solution=self.solution,
            targets=targets.positions,
            table=table,
            sites=self.sites,
            given=given,
            counts=counts,
            lines_hz=lines_hz,
            progress=self.progress,
        )
        design = designer.design()
        placed, triaxial = design.placed, counts[0]
        anywhere = outcome_of(candidate_shapes(self.sites, design.uniaxial, bool(triaxial)))
        shapes = np.concatenate([s.shapes for s in placed.sensors])
        if (rank := rank_of(shapes)) < shapes.shape[1]:
            raise FemtuneError("plan.dependent/sensors", channels=len(shapes), rank=rank, modes=shapes.shape[1])
        chosen = outcome_of(shapes)
        arrays["plan/auto_mac"] = chosen.auto_mac
        sensors = self._sensors(placed.sensors)
        setup = self._setup(placed.sensors, sensors, design.excitation)
        setup["frequency_lines"] = lines
        setup["pole_lines"] = self._pole_lines(placed.sensors, design.excitation, lines, arrays)
        setup |= self._expected(design, lines_hz, arrays)
        return PlanResults(
            configuration=self.case.name,
            modes=tuple(self._mode(j, chosen, anywhere) for j in range(len(targets.positions))),
            rigid_left_out=targets.left_out,
            candidate_points=len(self.sites),
            candidate_directions=len(design.uniaxial.site),
            still=self.still,
            method=table.method,
            weighting=table.weighting,
            triaxial_threshold=table.triaxial_threshold,
            uniaxial_threshold=table.uniaxial_threshold,
            rejected=placed.rejected,
            exchanges=placed.exchanges,
            sensors=sensors,
            chosen=_planned_set(len(shapes), chosen),
            all_candidates=_planned_set(3 * len(self.sites) if triaxial else len(design.uniaxial.site), anywhere),
            lines=self._lines(placed.sensors),
            auto_mac_key="plan/auto_mac",
            alerts=(*self._alerts(placed, chosen), *self._alerts_of_setup(setup)),
            **setup,
        )

    def _expected(self, design: PlannedDesign, lines_hz: Reals | None, arrays: Arrays) -> dict[str, Any]:
        """Expected standard deviations of the parameters; fields of the record by name."""
        table, known = self.table, design.known
        if known is None:
            return {}
        if table.data == "frfs":
            assert lines_hz is not None
            assumed: dict[str, Any] = {"functions": self._functions(design, lines_hz, arrays)}
        else:
            assumed = {"frequency_sd": table.frequency_sd, "shape_sd": table.shape_sd}
        information = known.information(design.placed.sensors)[0]
        return {
            "aim": table.aim,
            "criterion": table.criterion if table.aim == "parameters" else None,
            "points": table.points,
            "log_det_parameters": float(np.linalg.slogdet(np.eye(len(information)) + information)[1]),
            "parameters": expected_parameters(self.study, known, design.placed.sensors, design.every),
            **assumed,
        }

    def _functions(self, design: PlannedDesign, lines_hz: Reals, arrays: Arrays) -> PlannedFunctions:
        """What is assumed of the FRFs, and the lines that were chosen."""
        table = self.table
        if design.lines is not None:
            arrays["plan/chosen_lines"] = lines_hz[design.lines]
        return PlannedFunctions(
            form=table.frf_form,
            relative_sd=relative_sd(table.frf_sd, table.frf_floor),
            floor=table.frf_floor,
            lines=len(lines_hz) if design.lines is None else len(design.lines),
            lines_key=None if design.lines is None else "plan/chosen_lines",
            order=design.order,
        )

    def _setup(
        self, sensors: tuple[SiteSensor, ...], records: tuple[PlannedSensor, ...], excitation: Excitation | None
    ) -> dict[str, Any]:
        """Exciters, and what sensors and suspension change; fields of the record by name."""
        table, targets, solution, case = self.table, self.targets, self.solution, self.case
        fields: dict[str, Any] = {
            "suspension": suspension_effect(self.study, case, solution, targets.positions, table),
        }
        if excitation is not None:
            outputs, inputs = self._all_modes(sensors), self._all_modes(excitation.exciters)
            fields["exciters"] = exciter_records(self.study, excitation, records)
            fields["excitation"] = mode_excitation(
                solution, targets.positions, excitation, outputs, inputs, table.damping_ratio
            )
        masses = sensor_masses(table, sensors)
        fields["sensor_mass"] = float(masses.sum())
        fields["loading"] = mass_loading(
            self.study, case, solution, targets.positions, targets.rigid, sensors, masses
        )  # fmt: skip
        return fields

    def _pole_lines(
        self,
        sensors: tuple[SiteSensor, ...],
        excitation: Excitation | None,
        lines: PlannedLines | None,
        arrays: dict[str, Reals],
    ) -> PlannedPoleLines | None:
        """Lines from which the poles of the elastic target modes follow, by their spacing."""
        table, elastic = self.table, ~self.targets.rigid
        if table.identification_lines is None or lines is None:
            return None
        assert excitation is not None
        outputs = np.concatenate([s.shapes for s in sensors])[:, elastic]
        inputs = np.array([e.shape for e in excitation.exciters])[:, elastic]
        hertz = self.solution.freq_hz[self.targets.positions][elastic]
        relative = relative_sd(table.frf_sd, table.frf_floor)
        residues = (outputs[:, None] * inputs).reshape(-1, len(hertz))
        test = PoleTest(hertz, np.full(len(hertz), table.damping_ratio), residues, relative, table.frf_floor)
        self.progress.step("lines for an identification", 0, None)
        with errors_at(self.study.file.where("plan", "identification_lines")):
            found = pole_lines(test, lines.low_hz, lines.high_hz, table.identification_lines)
        return pole_lines_record(found, relative, table.frf_floor, arrays)

    def _all_modes(self, where: Sequence[SiteSensor | Exciter]) -> Reals:
        """(rows, n) all wanted modes along the directions of sensors or exciters."""
        motion = grid_translations(self.case.configured, self.solution, np.array([s.row for s in where]))
        return np.concatenate(
            [(s.axes if s.axis is None else s.axes[[s.axis]]) @ moved for s, moved in zip(where, motion)]
        )

    def _alerts_of_setup(self, setup: Mapping[str, Any]) -> Iterator[Alert]:
        vague = [p.name for p in setup.get("parameters", ()) if p.expected_sd > _UNINFORMED_RATIO * p.prior_sd]
        if vague:
            yield alert("warning", "plan.uninformed", names=", ".join(vague), percent=100.0 * _UNINFORMED_RATIO)
        low = [str(e.number) for e in setup.get("excitation", ()) if e.level < self.table.exciter_level]
        if low:
            percent = 100.0 * self.table.exciter_level
            yield alert("warning", "plan.not-excited", modes=", ".join(low), percent=percent)
        bare = [e.name for e in setup.get("exciters", ()) if e.sensor is None]
        if bare:
            yield alert("info", "plan.no-driving-point", names=", ".join(bare))
        worst = min(setup["loading"], key=lambda m: m.shift_percent, default=None)
        if worst is not None and worst.shift_percent < -_LARGE_SHIFT_PERCENT:
            yield alert("warning", "plan.mass-loading", number=worst.number, shift=worst.shift_percent)
        hung = setup["suspension"]
        if hung is not None and max(hung.rigid_hz) > _SOFT_RATIO * hung.first_elastic_hz:
            facts = {"rigid": max(hung.rigid_hz), "elastic": hung.first_elastic_hz, "limit": 100.0 * _SOFT_RATIO}
            yield alert("warning", "plan.stiff-suspension", **facts)

    def _counts(self, given: tuple[SiteSensor, ...]) -> tuple[int, int]:
        """Triaxial and uniaxial sensors to place: twice as many uniaxial ones as modes where nothing is said."""
        table, modes = self.table, len(self.targets.positions)
        triaxial, uniaxial = table.triaxial, table.uniaxial
        if not triaxial and not uniaxial and not given:
            uniaxial = 2 * modes
        channels = 3 * triaxial + uniaxial + sum(len(s.shapes) for s in given)
        if channels < modes:
            raise FemtuneError(
                "plan.too-few-sensors", where=self.study.file.where("plan"), channels=channels, modes=modes
            )
        return triaxial, uniaxial

    def _mode(self, j: int, chosen: SensorOutcome, anywhere: SensorOutcome) -> TargetMode:
        position = int(self.targets.positions[j])
        alike = _largest(chosen.auto_mac, j)
        return TargetMode(
            number=position + 1,
            freq_hz=float(self.solution.freq_hz[position]),
            rigid_body=bool(self.targets.rigid[j]),
            auto_mac=0.0 if alike is None else float(chosen.auto_mac[j, alike]),
            alike_number=None if alike is None else int(self.targets.positions[alike]) + 1,
            auto_mac_candidates=0.0 if alike is None else float(np.delete(anywhere.auto_mac[j], j).max()),
        )

    def _sensors(self, sensors: tuple[SiteSensor, ...]) -> tuple[PlannedSensor, ...]:
        Q = information_of(*(s.shapes for s in sensors))
        shares = [float(set_independence(s.shapes[None], Q)[0]) for s in sensors]
        counts: dict[str, int] = {}
        records = []
        for s, share in zip(sensors, shares):
            counts[s.kind] = counts.get(s.kind, 0) + 1
            records.append(self._sensor(s, f"{_PREFIX[s.kind]}{counts[s.kind]}", share))
        return tuple(records)

    def _sensor(self, s: SiteSensor, name: str, share: float) -> PlannedSensor:
        node = int(self.study.model.structure.nodes.ids[s.row])
        axes = [0, 1, 2] if s.axis is None else [s.axis]
        return PlannedSensor(
            name=name,
            kind=s.kind,
            node=node,
            dofs=tuple(str(Dof(node, DIRECTIONS[a + 1])) for a in axes),
            position=_vector(self.xyz[s.row]),
            axes=(_vector(s.axes[0]), _vector(s.axes[1]), _vector(s.axes[2])),
            direction=None if s.direction is None else _vector(s.direction),
            given=s.given,
            independence=min(max(share, 0.0), 1.0),
        )

    def _lines(self, sensors: tuple[SiteSensor, ...]) -> tuple[tuple[int, int], ...]:
        rows = list(dict.fromkeys(s.row for s in sensors))
        edges = _edges(self.mesh)
        if len(rows) < 2 or not len(edges):
            return ()
        ids = self.study.model.structure.nodes.ids
        pairs = trace_lines(mesh_distances(self.xyz, edges, rows))
        return tuple((int(ids[rows[i]]), int(ids[rows[j]])) for i, j in pairs)

    def _alerts(self, placed: PlacedSensors, chosen: SensorOutcome) -> list[Alert]:
        alerts = []
        for kind, count, wanted in placed.lacking:
            facts = {"placed": count, "wanted": wanted, "kind": kind, "key": f"{kind}_threshold"}
            alerts.append(alert("warning", "plan.rejected", **facts))
        if self.still:
            alerts.append(alert("info", "plan.still", count=self.still))
        if chosen.largest_off_diagonal > _HIGH_AUTO_MAC:
            i, j = (int(self.targets.positions[k]) + 1 for k in chosen.worst_pair)
            alerts.append(alert("warning", "plan.alike", one=i, other=j, mac=chosen.largest_off_diagonal))
        return alerts


def _largest(mac: Reals, j: int) -> int | None:
    """Position of the mode that is most like mode j."""
    if len(mac) < 2:
        return None
    row = mac[j].copy()
    row[j] = -1.0
    return int(np.argmax(row))


def _planned_set(channels: int, outcome: SensorOutcome) -> PlannedSet:
    return PlannedSet(
        channels=channels,
        condition=outcome.condition if np.isfinite(outcome.condition) else None,
        log_det=outcome.log_det if np.isfinite(outcome.log_det) else None,
        auto_mac=outcome.largest_off_diagonal,
        auto_mac_rms=outcome.root_mean_square,
    )


def _vector(values: Reals) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _edges(mesh: DrawnMesh) -> NDArray[np.int64]:
    """(e, 2) sides of faces and lines."""
    four = np.where(mesh.faces < 0, mesh.faces[:, [2]], mesh.faces)
    sides = np.stack([four, np.roll(four, -1, axis=1)], axis=2).reshape(-1, 2)
    both = np.concatenate([mesh.lines, sides])
    return both[both[:, 0] != both[:, 1]]
