"""The test of a configuration in the study's units and axes, its sensors on the model, and what is compared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse as sp

from femtune.correlation import map_sensors, rigid_motion_sensor
from femtune.correlation.generalised import GeneralisedSensor
from femtune.dofs import DIRECTIONS, parse_dof
from femtune.errors import FemtuneError, Notice
from femtune.files.described_test import described_test
from femtune.files.deviations import with_deviations
from femtune.files.frequency_table import frequencies_alone
from femtune.files.shape_table import is_shape_table, read_shape_table
from femtune.files.study_file import MEASURED, test_files
from femtune.files.uff import UffFile, read_uff
from femtune.modal import entry_deviations
from femtune.model.eigen.default_count import ELASTIC_MODES
from femtune.residuals import ComparedCase, PairingRules
from femtune.study.cases import HeldOut, ModesOfDeck, sensor_tolerance
from femtune.study.error_places import errors_at, place_of
from femtune.study.sensor_hints import with_keys
from femtune.testdata import convert_units, sensors_at
from femtune.testdata.checks import check_test, real_modes
from femtune.testdata.convert import place, scaled_coordinates
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.correlation import SensorMap
    from femtune.dofs import DofSet
    from femtune.errors import Where
    from femtune.fem import NodeTable, Structure
    from femtune.files.study_file import ConfigurationEntry, HoldOutEntry, StudyFile
    from femtune.files.uff import UffContent
    from femtune.modal import FrfSet, ModeSet
    from femtune.model import ConfiguredModel
    from femtune.study.cases import StudyCase
    from femtune.testdata import ModalTest
    from femtune.units import UnitSystem


BEYOND_TEST = 1.25
"""Highest frequency of the modes of the model over that of the test, if [correlate] states neither number nor limit."""


def with_test(file: StudyFile, case: StudyCase, tests: dict[Path, UffFile]) -> tuple[StudyCase, tuple[Notice, ...]]:
    """The configuration with its test, and what was found while it was read; `tests` are files that are parsed.

    Raises
    ------
    FemtuneError : what is wrong with the test or the sensors
    """
    entry, structure = case.entry, case.configured.model.structure
    test, notices = _read_test(file, entry, tests)
    _check_coordinates(file, structure)
    with errors_at(place_of(file, entry, "test")), with_keys(file, entry, test, structure):
        all_sensors = sensor_map(file, test, structure)
    functions, worst = _held_functions(file, entry, test)
    held = HeldOut(functions=functions)
    case = replace(case, test=test, sensors=all_sensors, all_sensors=all_sensors, held=held)
    notices = (*notices, *all_sensors.notices, *worst, *_of_frfs(file, entry, test.frfs))
    if test.modes is None:
        return case, notices
    sensors = _without_off(file, entry, _of_modes(all_sensors, test.modes))
    compared = _compared(file, entry, case.configured, test.modes, sensors)
    return replace(
        case,
        sensors=sensors,
        compared=compared,
        held=replace(held_out(file, entry, compared), functions=held.functions),
    ), notices


def held_out(file: StudyFile, entry: ConfigurationEntry, case: ComparedCase) -> HeldOut:
    """What the study holds out of a configuration's test.

    Raises
    ------
    FemtuneError : ``study.unknown-mode``, ``study.hold-out`` (a sensor that the test does not have, or nothing left)
    """
    modes: set[int] = set()
    sensors: set[int] = set()
    for i, one in enumerate(file.hold_out):
        if entry.use == "update" and one.configuration in (None, entry.name):
            modes |= set(_modes(file, i, one, case.test)) - set(case.left_out)
            sensors |= set(_sensors(file, i, one, case.test.dofs))
    held = HeldOut(frozenset(modes), frozenset(sensors))
    _check_something_left(file, entry, case, held)
    return held


def _modes(file: StudyFile, i: int, one: HoldOutEntry, test: ModeSet) -> Iterator[int]:
    for j, label in enumerate(one.modes):
        if label not in test.labels:
            raise FemtuneError(
                "study.unknown-mode/hold-out",
                where=file.where("hold_out", i, "modes", j),
                values={"test modes": ", ".join(test.labels)},
                label=label,
            )
        yield test.labels.index(label)
    for k, hz in enumerate(test.freq_hz):
        if hz > (one.above_hz or np.inf) or hz < (one.below_hz or -np.inf):
            yield k


def _sensors(file: StudyFile, i: int, one: HoldOutEntry, dofs: DofSet) -> Iterator[int]:
    at = {(dof.node, dof.direction): k for k, dof in enumerate(dofs)}
    for j, label in enumerate(one.sensors):
        dof = parse_dof(label)
        if (dof.node, dof.direction) not in at:
            raise FemtuneError(
                "study.hold-out/unknown-sensor",
                where=file.where("hold_out", i, "sensors", j),
                values={"sensors": _some(dofs)},
                label=label,
            )
        yield at[dof.node, dof.direction]


def _of_frfs(file: StudyFile, entry: ConfigurationEntry, frfs: FrfSet | None) -> tuple[Notice, ...]:
    """Warnings of checks of the FRFs that the study compares."""
    several, used = entry.specimen is not None, entry.use == "update"
    if frfs is None or not any(r.kind == "frf" and r.is_in(entry.name, several, used) for r in file.residual):
        return ()
    from femtune.identification import check_frfs  # noqa: PLC0415  few studies compare functions

    return check_frfs(frfs)


def _held_functions(
    file: StudyFile, entry: ConfigurationEntry, test: ModalTest
) -> tuple[frozenset[tuple[int, int]], tuple[Notice, ...]]:
    """FRFs of outputs or inputs that a table names (between them, where it names both), and of the worst outputs."""
    mine = [
        (i, one)
        for i, one in enumerate(file.hold_out)
        if entry.use == "update"
        and one.configuration in (None, entry.name)
        and (one.outputs or one.inputs or one.worst is not None)
    ]
    frfs = test.frfs
    if frfs is None:
        for i, one in mine:
            if one.configuration is not None or len(file.configurations) == 1:
                raise FemtuneError("study.hold-out/no-frfs", where=file.where("hold_out", i), configuration=entry.name)
        return frozenset(), ()
    functions: set[tuple[int, int]] = set()
    notices: list[Notice] = []
    for i, one in mine:
        if one.worst is not None:
            held, notice = _worst(file, i, one, entry, test, frfs)
            notices.append(notice)
            functions |= held
            continue
        rows = _channels(file, (i, "outputs"), one.outputs, frfs.responses)
        columns = _channels(file, (i, "inputs"), one.inputs, frfs.references)
        functions |= {(row, column) for row in rows for column in columns}
    measured = {(int(i), int(j)) for i, j in zip(*np.nonzero(np.isfinite(frfs.values).any(axis=2)))}
    if functions and not measured - functions:
        where = file.where("hold_out")
        raise FemtuneError("study.hold-out", where=where, configuration=entry.name, remaining="no FRF")
    return frozenset(functions & measured), tuple(notices)


def _worst(
    file: StudyFile, i: int, one: HoldOutEntry, entry: ConfigurationEntry, test: ModalTest, frfs: FrfSet
) -> tuple[set[tuple[int, int]], Notice]:
    """Positions of the FRFs of the worst outputs, or inputs, and the notice of the choice (errors
    ``study.hold-out``)."""
    from femtune.identification.channel_quality import quality  # noqa: PLC0415  few studies ask for it
    from femtune.study.identified_test import identification_of  # noqa: PLC0415

    if one.by == "coherence" and frfs.coherence is None:
        raise FemtuneError(
            "study.hold-out/no-coherence", where=file.where("hold_out", i, "by"), configuration=entry.name
        )
    with errors_at(file.where("hold_out", i, "by")):
        ranking = quality(frfs, one.by, identification_of(file, test))
    channels = "inputs" if ranking.of_inputs else "outputs"
    assert one.worst is not None
    if one.worst >= len(ranking.order):
        raise FemtuneError(
            "study.hold-out/too-many", where=file.where("hold_out", i, "worst"), worst=one.worst,
            measured=len(ranking.order), channels=channels, configuration=entry.name,
        )  # fmt: skip
    labels = (frfs.references if ranking.of_inputs else frfs.responses).labels()
    worst, rest = ranking.order[: one.worst], ranking.order[one.worst :]
    limits = [float(ranking.values[j]) for j in (worst[0], worst[-1], rest[0], rest[-1])]
    notice = Notice(
        "study.worst-held",
        level="info",
        configuration=entry.name,
        rule=ranking.words,
        count=len(worst),
        measured=len(ranking.order),
        channels=channels,
        names=", ".join(labels[j] for j in worst),
        first=limits[0],
        last=limits[1],
        rest_first=limits[2],
        rest_last=limits[3],
    )
    if ranking.of_inputs:
        return {(row, column) for row in range(len(frfs.responses)) for column in worst}, notice
    return {(row, column) for row in worst for column in range(len(frfs.references))}, notice


def _channels(file: StudyFile, key: tuple[int, str], labels: tuple[str, ...], dofs: DofSet) -> list[int]:
    """Positions of the DOFs with given labels; of all DOFs without labels."""
    at = {(dof.node, dof.direction): k for k, dof in enumerate(dofs)}
    named = [parse_dof(label) for label in labels]
    for j, dof in enumerate(named):
        if (dof.node, dof.direction) not in at:
            raise FemtuneError(
                "study.hold-out/unknown-channel",
                where=file.where("hold_out", *key, j),
                values={key[1]: _some(dofs)},
                label=labels[j],
                key=key[1],
            )
    return [at[dof.node, dof.direction] for dof in named] if named else list(at.values())


def _some(dofs: Iterable[object]) -> str:
    names = [str(dof) for dof in dofs]
    return ", ".join(names[:8]) + (f" … ({len(names)} in all)" if len(names) > 8 else "")


def _check_something_left(file: StudyFile, entry: ConfigurationEntry, case: ComparedCase, held: HeldOut) -> None:
    modes = len(case.test) - len(held.modes | set(case.left_out))
    dofs = len(case.test.dofs)
    sensors = dofs - len(held.sensors)
    if held.any and (modes < 1 or (dofs and sensors < 2)):
        left = "no mode" if modes < 1 else "fewer than two sensors"
        raise FemtuneError("study.hold-out", where=file.where("hold_out"), configuration=entry.name, remaining=left)


def _check_coordinates(file: StudyFile, structure: Structure) -> None:
    """Refuse sensors at points without coordinates (error ``matrices.no-coordinates``)."""
    if not structure.nodes.has_coordinates and (not file.sensors.by_id or file.rigid_floor):
        raise FemtuneError("matrices.no-coordinates/for-sensors", where=file.where("sensors"))


def _of_modes(sensors: SensorMap, modes: ModeSet) -> SensorMap:
    """The sensors of the modes, without those of FRFs only."""
    keep = [i for i, dof in enumerate(sensors.dofs) if dof in modes.dofs]
    matches = tuple(sensors.matches[i] for i in keep)
    return replace(sensors, matrix=sp.csr_array(sensors.matrix[keep]), dofs=sensors.dofs.select(keep), matches=matches)


def _without_off(file: StudyFile, entry: ConfigurationEntry, sensors: SensorMap) -> SensorMap:
    """The sensors without those that the study switches off (error ``sensor.off-unknown``)."""
    if not entry.sensors_off:
        return sensors
    at = {(dof.node, dof.direction): i for i, dof in enumerate(sensors.dofs)}
    off = set()
    for k, label in enumerate(entry.sensors_off):
        dof = parse_dof(label)
        if (dof.node, dof.direction) not in at:
            where = place_of(file, entry, "sensors_off", k)
            values = {"sensors": _some(sensors.dofs)}
            raise FemtuneError("sensor.off-unknown", where=where, values=values, label=label, configuration=entry.name)
        off.add(at[dof.node, dof.direction])
    keep = [i for i in range(len(sensors.dofs)) if i not in off]
    if len(keep) < 2:
        where = place_of(file, entry, "sensors_off")
        raise FemtuneError("sensor.off-unknown/none-left", where=where, configuration=entry.name)
    matches = tuple(sensors.matches[i] for i in keep)
    return replace(sensors, matrix=sp.csr_array(sensors.matrix[keep]), dofs=sensors.dofs.select(keep), matches=matches)


def _read_test(
    file: StudyFile, entry: ConfigurationEntry, tests: dict[Path, UffFile]
) -> tuple[ModalTest, tuple[Notice, ...]]:
    names = test_files(entry)
    paths = [file.path_of(name) for name in names]
    with errors_at(place_of(file, entry, "test")):
        if names[0] == MEASURED and MEASURED not in file.given.tests:
            unplaced = measured_frequencies(file)
        elif names[0] in file.given.tests:
            unplaced = _given(file.given.tests[names[0]], file.study.unit_system)
        elif paths[0].suffix.lower() == ".toml":
            unplaced = described_test(paths[0], entry.name, file.study.unit_system)
        elif len(paths) == 1 and is_shape_table(paths[0]):
            units = unit_system(entry.test_units) if entry.test_units else file.study.unit_system
            unplaced = convert_units(read_shape_table(paths[0], units, entry.name), file.study.unit_system)
        else:
            unplaced = _content(file, entry, _parsed(paths, tests)).as_one().test
        unplaced = scaled_coordinates(_with_deviations(file, entry, unplaced), entry.coordinate_factor)
        test = place(unplaced, entry.rotation, entry.origin, allow_mirrored=entry.left_handed)
        notices = (*unplaced.notices, *check_test(test))
    if test.frfs is not None:
        from femtune.study.identified_test import window_of_test  # noqa: PLC0415  few tests have functions

        test = replace(test, exponential_s=window_of_test(file, entry.name, test))
    if test.modes is None:
        return test, notices
    modes = real_modes(test.modes).modes
    return replace(test, modes=_labelled(file, entry, modes)), notices


def measured_frequencies(file: StudyFile) -> ModalTest:
    """The frequencies of the study as a test without shapes."""
    assert file.test is not None
    hz, sd = np.array(file.test.freq_hz), np.array(file.test.freq_sd_hz) if file.test.freq_sd_hz else None
    return frequencies_alone(hz, file.study.unit_system, MEASURED, "frequencies of the study", sd_hz=sd)


def _parsed(paths: list[Path], tests: dict[Path, UffFile]) -> UffFile:
    """One file, or several files of one test."""
    return tests.setdefault(paths[0], UffFile(paths[0])) if len(paths) == 1 else UffFile(paths[0], tuple(paths[1:]))


def _with_deviations(file: StudyFile, entry: ConfigurationEntry, test: ModalTest) -> ModalTest:
    """The test with the standard deviations of the file that the study names."""
    if entry.deviations is None or test.modes is None:
        return test
    return replace(test, modes=with_deviations(test.modes, file.path_of(entry.deviations), entry.mode_labels))


def _given(test: ModalTest, units: UnitSystem) -> ModalTest:
    """A test in memory, in the units of the study; its wire frame states where its sensors are."""
    dofs = [*(test.modes.dofs if test.modes else ()), *(test.frfs.responses if test.frfs else ())]
    sensors = test.sensors or sensors_at(test.geometry, dofs)
    return convert_units(replace(test, sensors=sensors), units)


def _content(file: StudyFile, entry: ConfigurationEntry, parsed: UffFile) -> UffContent:
    units, file_units = file.study.unit_system, unit_system(entry.test_units) if entry.test_units else None
    try:
        return read_uff(parsed, units=units, file_units=file_units, records=entry.records, name=entry.name)
    except FemtuneError as error:
        if error.code == "uff.no-units":
            key = "test_units" if file.configuration else "units"
            error.hint = (
                f'state them in the study, where it names this file: {key} = "m-kg-s" (or "mm-t-s", "in-slinch-s", …)'
            )
        raise


def _labelled(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> ModeSet:
    if entry.mode_labels is None:
        return modes
    if len(entry.mode_labels) != len(modes):
        raise FemtuneError(
            "study.mode-labels",
            where=place_of(file, entry, "mode_labels"),
            values={"labels": ", ".join(entry.mode_labels), "test modes": _listed(modes)},
            configuration=entry.name,
            labels=len(entry.mode_labels),
            modes=len(modes),
        )
    return replace(modes, labels=entry.mode_labels)


def _listed(modes: ModeSet) -> str:
    return ", ".join(f"{label} ({f:.4g} Hz)" for label, f in zip(modes.labels, modes.freq_hz))


def sensor_map(file: StudyFile, test: ModalTest, structure: Structure) -> SensorMap:
    """The sensors of a test on the model, as [sensors] says; errors ``sensor.*``."""
    _check_shapes(file, test, structure)
    _check_given(file, structure.nodes)
    unused = _only_for_responses(file, test)
    return map_sensors(
        test,
        structure,
        tolerance=sensor_tolerance(file, structure),
        by_id=file.sensors.by_id,
        given=file.sensors.nodes,
        combinations=[c for c in combinations(file, structure) if (c.dof.node, c.dof.direction) not in unused],
        leave_out=file.sensors.leave_out,
    )


def _check_shapes(file: StudyFile, test: ModalTest, structure: Structure) -> None:
    """Refuse a test with shapes beside runs without (error ``runs.no-shapes``)."""
    of_runs = file.runs is not None and not len(structure.nodes.ids)
    if of_runs and any(sensor.label.direction != "S" for sensor in test.sensors):
        hz = ", ".join(f"{f:.6g}" for f in test.modes.freq_hz) if test.modes is not None else "…"
        raise FemtuneError("runs.no-shapes", hint=f"replace file in [test] by freq_hz = [{hz}]")


def _only_for_responses(file: StudyFile, test: ModalTest) -> set[tuple[int, str]]:
    """Combinations that [response] or [[load]] names and the test does not have."""
    tables = [t for t in (file.response, *file.load) if t is not None]
    labels = [label for t in tables for name in ("inputs", "outputs", "forces") for label in getattr(t, name, ()) or ()]
    named = {(d.node, d.direction) for d in map(parse_dof, labels)}
    frfs = [] if test.frfs is None else [*test.frfs.responses, *test.frfs.references]
    of_test = [*(s.label for s in test.sensors), *(test.modes.dofs if test.modes else ()), *frfs]
    return named - {(d.node, d.direction) for d in of_test}


def combinations(file: StudyFile, structure: Structure) -> list[GeneralisedSensor]:
    """All sensors that are combinations of model DOFs, [[sensor]] and [[rigid_floor]]."""
    return [*_combinations(file, structure.nodes), *_floors(file, structure)]


def _check_given(file: StudyFile, nodes: NodeTable) -> None:
    for test_node, node in file.sensors.nodes.items():
        with errors_at(file.where("sensors", "nodes", str(test_node))):
            nodes.position(node)


def _combinations(file: StudyFile, nodes: NodeTable) -> Iterable[GeneralisedSensor]:
    for i, sensor in enumerate(file.sensor):
        for j, term in enumerate(sensor.terms):
            with errors_at(file.where("sensor", i, "terms", j)):
                nodes.dof(term.node, DIRECTIONS.index(term.component))
        terms = tuple((t.node, DIRECTIONS.index(t.component), t.factor) for t in sensor.terms)
        yield GeneralisedSensor(sensor.label, terms)


def _floors(file: StudyFile, structure: Structure) -> Iterable[GeneralisedSensor]:
    for i, floor in enumerate(file.rigid_floor):
        with errors_at(file.where("rigid_floor", i)):
            yield from rigid_motion_sensor(structure, floor.test_node, floor.nodes, floor.origin, floor.digits)


def _compared(
    file: StudyFile, entry: ConfigurationEntry, configured: ConfiguredModel, modes: ModeSet, sensors: SensorMap
) -> ComparedCase:
    known = _with_scatter(file, modes.select_dofs(sensors.dofs))
    gates = file.correlate
    return ComparedCase(
        configured,
        known,
        sp.csr_array(sensors.matrix @ configured.transformation),
        _left_out(file, entry, known),
        tuple(_stated_pairs(file, entry, known, "pairs")),
        tuple(_never_paired(file, entry, known)),
        *_modes_wanted(file, known),
        PairingRules(gates.frequency_gate, gates.mac_gate, gates.cluster_gap),
    )


def _modes_wanted(file: StudyFile, test: ModeSet) -> tuple[int | None, float | None]:
    """Number of modes of the model that are solved, or their upper frequency. By default these are all modes up to 1.25
    times the highest frequency of the test, and at least ten elastic modes, or as many as METHOD of the deck states;
    rigid-body modes are not counted.
    """
    asked, of_deck = file.modes, isinstance(file.modes, ModesOfDeck)
    if not len(test) or (not of_deck and (asked.count is not None or asked.max_hz is not None)):
        return asked.count, asked.max_hz
    reach = BEYOND_TEST * float(np.max(test.freq_hz))
    if asked.max_hz is not None and asked.max_hz >= reach:
        return None, asked.max_hz
    return asked.count or ELASTIC_MODES, reach


def _with_scatter(file: StudyFile, modes: ModeSet) -> ModeSet:
    """The modes with the standard deviations of shapes from [validate], if the test does not state them."""
    stated = file.validation.shape_sd
    if stated is None or modes.shapes_sd is not None:
        return modes
    return replace(modes, shapes_sd=entry_deviations(stated, modes.shapes))


def _stated_pairs(
    file: StudyFile, entry: ConfigurationEntry, modes: ModeSet, key: Literal["pairs", "never_pairs"]
) -> Iterable[tuple[int, int]]:
    for i, pair in enumerate(getattr(entry, key)):
        where = place_of(file, entry, key, i, "test")
        yield _position(entry, modes, pair.test, where), pair.model - 1


def _never_paired(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> Iterable[tuple[int, int]]:
    """Pairs that are not made (error ``correlate.never-pair`` for one that is prescribed too)."""
    fixed = set(_stated_pairs(file, entry, modes, "pairs"))
    for i, pair in enumerate(_stated_pairs(file, entry, modes, "never_pairs")):
        if pair in fixed:
            named = entry.never_pairs[i]
            raise FemtuneError(
                "correlate.never-pair", where=place_of(file, entry, "never_pairs", i), test=named.test,
                model=named.model,
            )  # fmt: skip
        yield pair


def _left_out(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> dict[int, str]:
    reasons = {}
    for i, one in enumerate(entry.leave_out):
        where = place_of(file, entry, "leave_out", i)
        by_label = one.mode is not None
        at = _position(entry, modes, one.mode or "", where) if by_label else _nearest(entry, modes, one.hz or 0, where)
        reasons[at] = one.reason
    return reasons


def _position(entry: ConfigurationEntry, modes: ModeSet, label: str, where: Where) -> int:
    if label not in modes.labels:
        raise _no_mode("study.unknown-mode/label", entry, modes, where, label=label)
    return modes.labels.index(label)


def _nearest(entry: ConfigurationEntry, modes: ModeSet, hz: float, where: Where) -> int:
    i = int(np.argmin(np.abs(modes.freq_hz - hz)))
    if abs(modes.freq_hz[i] - hz) > 0.01 * hz:
        raise _no_mode("study.unknown-mode/frequency", entry, modes, where, frequency_hz=hz)
    return i


def _no_mode(code: str, entry: ConfigurationEntry, modes: ModeSet, where: Where, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=where, values={"test modes": _listed(modes)}, configuration=entry.name, **facts)
