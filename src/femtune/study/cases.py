"""Configurations of a study: the model in each state, its test in the study's units and axes, and the sensors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from femtune.correlate import SensorMap, map_sensors, rigid_motion_sensor
from femtune.correlate.generalised import GeneralisedSensor
from femtune.dofs import DIRECTIONS, parse_dof
from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.fem import NodeTable, Structure
from femtune.files.study_file import ConfigurationEntry, StudyFile, overlay
from femtune.files.study_file.kinds import support
from femtune.files.uff import UffContent, read_uff
from femtune.modal import ModeSet
from femtune.model import ConfiguredModel, ParametricModel, configure
from femtune.residuals import ModalCase, PairingRules
from femtune.study.drawn_mesh import DrawnMesh
from femtune.study.held_out import HeldOut, held_out, without
from femtune.study.located import located, located_in, place_of
from femtune.testdata import ModalTest
from femtune.testdata.checks import check_test, real_modes
from femtune.testdata.convert import place
from femtune.units import unit_system


@dataclass(frozen=True, eq=False)
class StudyCase:
    """One configuration: its entry in the study, the model in this state, and its test where there is one.

    `sensors` are those of the modes that are compared; `all_sensors` has those of measured FRFs too. `mesh` is drawn
    in place of the model's own elements, where it has none. `compared` is all that is compared in this configuration,
    None where nothing is; the update sees it without what is `held` out.
    """

    entry: ConfigurationEntry
    configured: ConfiguredModel
    test: ModalTest | None = None
    sensors: SensorMap | None = None
    compared: ModalCase | None = None
    all_sensors: SensorMap | None = None
    mesh: DrawnMesh | None = None
    held: HeldOut = field(default_factory=HeldOut)

    @property
    def name(self) -> str:
        """Name of the configuration."""
        return self.entry.name

    @property
    def modal(self) -> ModalCase | None:
        """What is compared, where modes were measured."""
        return self.compared if self.compared is not None and len(self.compared.test) else None

    @property
    def used(self) -> ModalCase | None:
        """What the update uses of it; None where nothing is compared, or where it is kept for validation."""
        if self.compared is None or self.entry.use != "update":
            return None
        return without(self.compared, self.held)


def study_case(
    file: StudyFile, model: ParametricModel, entry: ConfigurationEntry
) -> tuple[StudyCase, tuple[Notice, ...]]:
    """A configuration with what was found while its test was read.

    Raises
    ------
    FemtuneError : what is wrong with the overlay, the test or the sensors
    """
    _check_nodes(file, entry, model.structure.nodes)
    with located_in(file, entry):
        configured = configure(model, overlay(entry))
    if entry.test is None:
        return StudyCase(entry, configured), ()
    test, notices = _read_test(file, entry)
    _check_coordinates(file, model.structure)
    with located(place_of(file, entry, "test")):
        found = _sensor_map(file, test, model.structure)
    modal, sensors, held = None, found, HeldOut()
    if test.modes is not None:
        sensors = _of_modes(found, test.modes)
        modal = _modal_case(file, entry, configured, test.modes, sensors)
        held = held_out(file, entry, modal)
    return StudyCase(entry, configured, test, sensors, modal, found, held=held), (*notices, *found.notices)


def _check_coordinates(file: StudyFile, structure: Structure) -> None:
    """Sensors cannot be put on points whose place is not known (error ``matrices.no-coordinates``)."""
    if not structure.nodes.located and (not file.sensors.by_id or file.rigid_floor):
        raise FemtuneError(
            "matrices.no-coordinates",
            "the points of the model have no coordinates, so sensors cannot be put on the nearest ones",
            where=file.where("sensors"),
            hint='name the mesh: grid = "model.bdf" in [model]; or match by number: by_id = true in [sensors]',
        )


def _of_modes(sensors: SensorMap, modes: ModeSet) -> SensorMap:
    """The sensors of the modes; what only FRFs have is left aside."""
    keep = [i for i, dof in enumerate(sensors.dofs) if dof in modes.dofs]
    matches = tuple(sensors.matches[i] for i in keep)
    return replace(sensors, matrix=sp.csr_array(sensors.matrix[keep]), dofs=sensors.dofs.select(keep), matches=matches)


def _check_nodes(file: StudyFile, entry: ConfigurationEntry, nodes: NodeTable) -> None:
    """Refuse grid points and components of an overlay that the deck does not have, each where it is named."""
    errors = ErrorCollector()
    for i, mass in enumerate(entry.masses):
        with errors.catch(), located(place_of(file, entry, "masses", i, "node")):
            nodes.position(mass.node)
    for key in ("supports_added", "supports_removed"):
        for i, text in enumerate(getattr(entry, key)):
            with errors.catch(), located(place_of(file, entry, key, i)):
                for node, components in support(text):
                    _ = [nodes.dof(node, int(c)) for c in components]
    errors.raise_if_any()


def on_model(case: StudyCase, model: ParametricModel) -> StudyCase:
    """The same configuration, test and sensors on another model of the same grid points."""
    configured = configure(model, case.configured.configuration)
    if case.compared is None:
        return replace(case, configured=configured)
    of_modes = case.sensors.matrix if case.modal is not None and case.sensors is not None else None
    sensors = sp.csr_array((0, configured.n_free)) if of_modes is None else of_modes @ configured.transformation
    compared = replace(case.compared, configured=configured, sensors=sp.csr_array(sensors))
    return replace(case, configured=configured, compared=compared)


def sensor_tolerance(file: StudyFile, structure: Structure) -> float:
    """The study's tolerance; without one a thousandth of the model's diagonal.

    That is enough for rounded coordinates and too little for a wrong node.
    """
    if file.sensors.tolerance is not None:
        return file.sensors.tolerance
    xyz = structure.nodes.xyz
    size = float(np.linalg.norm(np.ptp(xyz, axis=0))) if len(xyz) else 0.0
    # a model of one point, or of scalar points only, has no size
    return 1e-3 * size or 1e-3


def _read_test(file: StudyFile, entry: ConfigurationEntry) -> tuple[ModalTest, tuple[Notice, ...]]:
    assert entry.test is not None
    with located(place_of(file, entry, "test")):
        content = _content(file, entry, file.path_of(entry.test))
        test = place(content.test, entry.rotation, entry.origin)
        notices = (*content.notices, *check_test(test))
    if test.modes is None:
        return test, notices
    modes = real_modes(test.modes).modes
    return replace(test, modes=_labelled(file, entry, modes)), notices


def _content(file: StudyFile, entry: ConfigurationEntry, path: Path) -> UffContent:
    units, own = file.study.unit_system, unit_system(entry.test_units) if entry.test_units else None
    try:
        return read_uff(path, units=units, file_units=own, records=entry.records, name=entry.name)
    except FemtuneError as error:
        if error.code == "uff.no-units":
            key = "test_units" if file.configuration else "units"
            error.hint = (
                f'say it in the study, where it names this file: {key} = "m-kg-s" (or "mm-t-s", "in-slinch-s", …)'
            )
        raise


def _labelled(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> ModeSet:
    if entry.mode_labels is None:
        return modes
    if len(entry.mode_labels) != len(modes):
        raise FemtuneError(
            "study.mode-labels",
            f"configuration {entry.name}: {len(entry.mode_labels)} labels for the {len(modes)} modes of the test",
            where=place_of(file, entry, "mode_labels"),
            values={"labels": ", ".join(entry.mode_labels), "test modes": _listed(modes)},
            hint="give one label for each mode of the test, in the order of the file",
        )
    return replace(modes, labels=entry.mode_labels)


def _listed(modes: ModeSet) -> str:
    return ", ".join(f"{label} ({f:.4g} Hz)" for label, f in zip(modes.labels, modes.freq_hz))


def _sensor_map(file: StudyFile, test: ModalTest, structure: Structure) -> SensorMap:
    _check_given(file, structure.nodes)
    unused = _only_for_responses(file, test)
    return map_sensors(
        test,
        structure,
        tolerance=sensor_tolerance(file, structure),
        by_id=file.sensors.by_id,
        given=file.sensors.nodes,
        combinations=[c for c in combinations(file, structure) if (c.dof.node, c.dof.direction) not in unused],
    )


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
        with located(file.where("sensors", "nodes", str(test_node))):
            nodes.position(node)


def _combinations(file: StudyFile, nodes: NodeTable) -> Iterable[GeneralisedSensor]:
    for i, sensor in enumerate(file.sensor):
        for j, term in enumerate(sensor.terms):
            with located(file.where("sensor", i, "terms", j)):
                nodes.dof(term.node, DIRECTIONS.index(term.component))
        terms = tuple((t.node, DIRECTIONS.index(t.component), t.factor) for t in sensor.terms)
        yield GeneralisedSensor(sensor.label, terms)


def _floors(file: StudyFile, structure: Structure) -> Iterable[GeneralisedSensor]:
    for i, floor in enumerate(file.rigid_floor):
        with located(file.where("rigid_floor", i)):
            yield from rigid_motion_sensor(structure, floor.test_node, floor.nodes, floor.origin, floor.digits)


def _modal_case(
    file: StudyFile, entry: ConfigurationEntry, configured: ConfiguredModel, modes: ModeSet, sensors: SensorMap
) -> ModalCase:
    known = _with_scatter(file, modes.select_dofs(sensors.dofs))
    gates = file.correlate
    return ModalCase(
        configured,
        known,
        sp.csr_array(sensors.matrix @ configured.transformation),
        _left_out(file, entry, known),
        tuple(_fixed_pairs(file, entry, known)),
        file.modes.wanted,
        file.modes.max_hz,
        PairingRules(gates.frequency_gate, gates.mac_gate, gates.cluster_gap),
    )


def _with_scatter(file: StudyFile, modes: ModeSet) -> ModeSet:
    """The modes with the scatter of shapes that [validate] states, where the test does not tell its own."""
    stated = file.validation.shape_sd
    if stated is None or modes.shapes_sd is not None:
        return modes
    largest = np.nanmax(np.abs(modes.shapes), axis=0, initial=0.0)
    return replace(modes, shapes_sd=np.where(np.isnan(modes.shapes), np.nan, stated * largest))


def _fixed_pairs(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> Iterable[tuple[int, int]]:
    for i, pair in enumerate(entry.pairs):
        where = place_of(file, entry, "pairs", i, "test")
        yield _position(entry, modes, pair.test, where), pair.model - 1


def _left_out(file: StudyFile, entry: ConfigurationEntry, modes: ModeSet) -> dict[int, str]:
    found = {}
    for i, one in enumerate(entry.leave_out):
        where = place_of(file, entry, "leave_out", i)
        by_label = one.mode is not None
        at = _position(entry, modes, one.mode or "", where) if by_label else _nearest(entry, modes, one.hz or 0, where)
        found[at] = one.reason
    return found


def _position(entry: ConfigurationEntry, modes: ModeSet, label: str, where: Where) -> int:
    if label not in modes.labels:
        raise _no_mode(entry, modes, f"no mode is called '{label}'", where)
    return modes.labels.index(label)


def _nearest(entry: ConfigurationEntry, modes: ModeSet, hz: float, where: Where) -> int:
    i = int(np.argmin(np.abs(modes.freq_hz - hz)))
    if abs(modes.freq_hz[i] - hz) > 0.01 * hz:
        raise _no_mode(entry, modes, f"there is no mode within 1 % of {hz:g} Hz", where)
    return i


def _no_mode(entry: ConfigurationEntry, modes: ModeSet, what: str, where: Where) -> FemtuneError:
    return FemtuneError(
        "study.unknown-mode",
        f"configuration {entry.name}: {what} in the test",
        where=where,
        values={"test modes": _listed(modes)},
        hint="name one of these modes",
    )
