"""A study put together: deck, parameters, configurations and tests as one frozen whole."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from femtune.correlate import SensorMap, map_sensors, rigid_motion_sensor
from femtune.correlate.generalised import GeneralisedSensor
from femtune.dofs import DIRECTIONS
from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.fem import Structure
from femtune.files.nastran.build import BuiltModel, build_structure
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.field_refs import resolve
from femtune.files.study_file import ConfigurationEntry, ParameterEntry, StudyFile, overlay, read_study_file
from femtune.files.uff import read_uff
from femtune.modal import ModeSet
from femtune.model import Assignment, ConfiguredModel, ParametricModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet, parse_expression
from femtune.residuals import ModalCase, PairingRules, ResidualRules, UpdateProblem
from femtune.study.progress import Progress, silent
from femtune.testdata import ModalTest
from femtune.testdata.checks import check_test, real_modes
from femtune.testdata.convert import place
from femtune.units import unit_system

_DECK_SUFFIXES = (".bdf", ".dat", ".nas", ".fem", ".bulk", ".pch", ".inc", ".blk")


@dataclass(frozen=True, eq=False)
class StudyCase:
    """One configuration: its entry in the study, the model in this state, and its test where there is one."""

    entry: ConfigurationEntry
    configured: ConfiguredModel
    test: ModalTest | None = None
    sensors: SensorMap | None = None
    modal: ModalCase | None = None


@dataclass(frozen=True, eq=False)
class Study:
    """Everything that the steps need; `notices` are those of tests and sensors."""

    file: StudyFile
    built: BuiltModel
    model: ParametricModel
    cases: tuple[StudyCase, ...]
    notices: tuple[Notice, ...]

    @property
    def parameters(self) -> ParameterSet:
        """The parameters of the study."""
        return self.model.parameters

    @property
    def rules(self) -> ResidualRules:
        """What is compared, as the study says."""
        table = self.file.residuals
        return ResidualRules(
            table.frequency_sd,  # type: ignore[arg-type]
            table.shape_sd,
            table.frequency_form,
            table.shape_form,
            table.shape_scaling,
        )

    def problem(self) -> UpdateProblem:
        """The update problem of all configurations that are not kept for validation.

        Raises
        ------
        FemtuneError : ``study.no-test``
        """
        cases = tuple(c.modal for c in self.cases if c.modal is not None and c.entry.use == "update")
        if not cases:
            raise FemtuneError(
                "study.no-test",
                "no configuration has a test with modes that the update may use",
                where=Where(str(self.file.path)),
                hint='give a configuration test = "file.uff" with modes (data sets 55)',
            )
        return UpdateProblem(cases, self.parameters, self.rules)


def is_deck(path: Path) -> bool:
    """True for a path that names a deck rather than a study."""
    return path.suffix.lower() in _DECK_SUFFIXES


def load_study(path: Path | str, progress: Progress = silent) -> Study:
    """Read a study with its deck and tests, or a deck alone.

    Raises
    ------
    FemtuneError : whatever is wrong with any of the files; set-up errors are shown together
    """
    path = Path(path)
    file = _study_of_deck(path) if is_deck(path) else read_study_file(path)
    progress.step("reading the deck", 0, None)
    built = build_structure(read_deck(file.deck_path), bool(file.study.allow_ignored))
    _check_allowed(file, built)
    return assemble_study(file, built, progress)


def _study_of_deck(path: Path) -> StudyFile:
    # the units do not matter where no test is read
    file = StudyFile.model_validate({"study": {"title": path.name, "deck": path.name, "units": "m-kg-s"}})
    file._path = path
    return file


def _check_allowed(file: StudyFile, built: BuiltModel) -> None:
    """Cards that the model lacks must be among those that the study allows to be ignored."""
    allowed = {name.upper() for name in file.study.allow_ignored}
    missing = [c for c in built.cards if c.use.startswith("missing") and c.name not in allowed]
    if missing:
        names = ", ".join(f"{c.name} ({c.count})" for c in missing)
        raise FemtuneError(
            "deck.unsupported-element",
            f"the deck has elements that are not understood and that the study does not allow to be ignored: {names}",
            where=missing[0].where,
            hint="add them to allow_ignored if the modes do not depend on them",
        )


def assemble_study(file: StudyFile, built: BuiltModel, progress: Progress = silent) -> Study:
    """Parameters, configurations and tests on a deck that was built."""
    errors = ErrorCollector()
    model = None
    with errors.catch():
        parameters = parameter_set(file, built)
        model = parametric_model(built.structure, parameters, _assignments(file, built))
    notices: list[Notice] = []
    cases: list[StudyCase] = []
    for i, entry in enumerate(file.configurations):
        progress.step(f"configuration {entry.name}", i, len(file.configurations))
        with errors.catch():
            base = model or parametric_model(built.structure, ParameterSet(()), ())
            case, found = _case(file, base, entry)
            cases.append(case)
            notices += found
    errors.raise_if_any()
    assert model is not None
    return Study(file, built, model, tuple(cases), tuple(notices))


def without_parameters(study: Study, built: BuiltModel) -> Study:
    """The same study on another deck (the updated one), all parameters fixed at the deck's values."""
    file = study.file.model_copy(update={"parameter": ()})
    file._path, file._source = study.file._path, study.file._source
    return assemble_study(file, built)


def parameter_set(file: StudyFile, built: BuiltModel) -> ParameterSet:
    """Parameters as the study describes them; several problems are shown together."""
    errors, found = ErrorCollector(), []
    for i, entry in enumerate(file.parameter):
        with errors.catch():
            found.append(_parameter(entry, built, file.where("parameter", i)))
    errors.raise_if_any()
    return ParameterSet(tuple(found))


def _parameter(entry: ParameterEntry, built: BuiltModel, where: Where) -> Parameter:
    positions = [resolve(built, ref, where) for ref in entry.targets]
    tie = None if entry.tie is None else parse_expression(entry.tie, where)
    nominal = entry.nominal
    if nominal is None:
        nominal = _deck_value(entry, built, positions, where) if entry.absolute else 1.0
    lower = nominal if entry.lower is None else entry.lower
    upper = nominal if entry.upper is None else entry.upper
    return Parameter(entry.name, nominal, lower, upper, entry.unit, entry.mean, entry.sd, tie, where)


def _deck_value(entry: ParameterEntry, built: BuiltModel, positions: list[int], where: Where) -> float:
    values = built.structure.values.values[positions]
    if not len(values):
        return 1.0
    if np.ptp(values) > 1e-12 * np.abs(values).max():
        raise FemtuneError(
            "parameter.absolute-differs",
            f"parameter {entry.name}: its fields hold different values, so there is no start value",
            where=where,
            values={str(ref): float(v) for ref, v in zip(entry.targets, values)},
            hint="give nominal, or use factors (absolute = false)",
        )
    return float(values[0])


def _assignments(file: StudyFile, built: BuiltModel) -> Iterable[Assignment]:
    for entry in file.parameter:
        region = entry.region
        chosen = None
        if region is not None:
            chosen = frozenset(int(n) for n in built.structure.element_kinds if n in region)
        for ref in entry.targets:
            yield Assignment(entry.name, ref, not entry.absolute, chosen)


def _case(file: StudyFile, model: ParametricModel, entry: ConfigurationEntry) -> tuple[StudyCase, list[Notice]]:
    configured = configure(model, overlay(entry))
    if entry.test is None:
        return StudyCase(entry, configured), []
    test, notices = _read_test(file, entry)
    sensors = _sensor_map(file, test, model.structure)
    modal = None
    if test.modes is not None:
        modal = _modal_case(file, entry, configured, test.modes, sensors)
    return StudyCase(entry, configured, test, sensors, modal), [*notices, *sensors.notices]


def _read_test(file: StudyFile, entry: ConfigurationEntry) -> tuple[ModalTest, list[Notice]]:
    assert entry.test is not None
    units = file.study.unit_system
    own = unit_system(entry.test_units) if entry.test_units else None
    content = read_uff(file.path_of(entry.test), units=units, file_units=own, records=entry.records, name=entry.name)
    test = place(content.test, entry.rotation, entry.origin)
    notices = [*content.notices, *check_test(test)]
    if test.modes is None:
        return test, notices
    modes = real_modes(test.modes).modes
    return replace(test, modes=_labelled(file, entry, modes)), notices


def _labelled(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> ModeSet:
    if entry.mode_labels is None:
        return modes
    if len(entry.mode_labels) != len(modes) or len(set(entry.mode_labels)) != len(modes):
        raise FemtuneError(
            "study.mode-labels",
            f"configuration {entry.name}: mode_labels must name each of the {len(modes)} test modes once",
            where=Where(str(file.path)),
            values={"labels": ", ".join(entry.mode_labels), "frequencies (Hz)": _listed(modes)},
            hint="give as many labels as the test has modes, in the order of the file",
        )
    return replace(modes, labels=entry.mode_labels)


def _listed(modes: ModeSet) -> str:
    return ", ".join(f"{f:.4g}" for f in modes.freq_hz)


def _sensor_map(file: StudyFile, test: ModalTest, structure: Structure) -> SensorMap:
    table = file.sensors
    tolerance = table.tolerance
    if tolerance is None:
        # a thousandth of the model's size: enough for rounded coordinates, too little for a wrong node
        tolerance = 1e-3 * float(np.linalg.norm(np.ptp(structure.nodes.xyz, axis=0))) if len(structure.nodes.ids) else 0
    combinations = [*_combinations(file), *_floors(file, structure)]
    return map_sensors(
        test,
        structure,
        tolerance=tolerance,
        by_id=table.by_id,
        given=table.nodes,
        combinations=combinations,
    )


def _combinations(file: StudyFile) -> Iterable[GeneralisedSensor]:
    for sensor in file.sensor:
        terms = tuple((t.node, DIRECTIONS.index(t.component), t.factor) for t in sensor.terms)
        yield GeneralisedSensor(sensor.label, terms)


def _floors(file: StudyFile, structure: Structure) -> Iterable[GeneralisedSensor]:
    for floor in file.rigid_floor:
        components = "".join(str(DIRECTIONS.index(c)) for c in floor.components)
        yield from rigid_motion_sensor(structure, floor.test_node, floor.nodes, floor.origin, components)


def _modal_case(
    file: StudyFile, entry: ConfigurationEntry, configured: ConfiguredModel, modes: ModeSet, sensors: SensorMap
) -> ModalCase:
    known = modes.select_dofs(sensors.dofs)
    gates = file.correlate
    return ModalCase(
        configured,
        known,
        sp.csr_array(sensors.matrix @ configured.transformation),
        _left_out(file, entry, known),
        tuple((_position(file, entry, known, p.test), p.model - 1) for p in entry.pairs),
        file.modes.wanted,
        file.modes.max_hz,
        PairingRules(gates.frequency_gate, gates.mac_gate, gates.cluster_gap),
    )


def _left_out(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> dict[int, str]:
    return {
        (
            _position(file, entry, modes, one.mode) if one.mode else _nearest(file, entry, modes, one.hz or 0.0)
        ): one.reason
        for one in entry.leave_out
    }


def _position(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet, label: str) -> int:
    if label not in modes.labels:
        raise _no_mode(file, entry, modes, f"has no mode {label}")
    return modes.labels.index(label)


def _nearest(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet, hz: float) -> int:
    i = int(np.argmin(np.abs(modes.freq_hz - hz)))
    if abs(modes.freq_hz[i] - hz) > 0.01 * hz:
        raise _no_mode(file, entry, modes, f"has no mode within 1 % of {hz:g} Hz")
    return i


def _no_mode(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet, what: str) -> FemtuneError:
    known = ", ".join(f"{label} ({f:.4g} Hz)" for label, f in zip(modes.labels, modes.freq_hz))
    return FemtuneError(
        "study.unknown-mode",
        f"configuration {entry.name}: the test {what}",
        where=Where(str(file.path)),
        values={"test modes": known},
        hint="name one of these modes",
    )
