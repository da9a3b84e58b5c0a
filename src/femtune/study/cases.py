"""Configurations of a study: the model in each state, its test in the study's units and axes, and the sensors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from femtune.errors import ErrorCollector, Where
from femtune.files.masses_table import read_masses_table
from femtune.files.study_file import ModesTable, supports, switched_off
from femtune.files.study_file.kinds import support
from femtune.model import AddedMass, Configuration, configure
from femtune.study.error_places import errors_at, errors_at_configuration, place_of
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.correlation import SensorMap, SensorPlacement
    from femtune.fem import NodeTable, Structure
    from femtune.files.study_file import ConfigurationEntry, StudyFile
    from femtune.modal import FrfSet
    from femtune.model import ConfiguredModel, ParametricModel
    from femtune.model.reduce import Alone
    from femtune.residuals import ComparedCase
    from femtune.study.drawn_mesh import DrawnMesh
    from femtune.study.specimens import Specimens
    from femtune.testdata import ModalTest


class ModesOfDeck(ModesTable):
    """Number or upper frequency of modes as METHOD of the deck states it; a comparison with a test may need more."""


# ----------------------------------------------------------------------------------------------------
# Modes and sensors of a test that the update does not use; they validate its result.


HELD_OUT = "held out for validation"
"""Reason for which the update leaves out a test mode."""


@dataclass(frozen=True)
class HeldOut:
    """Positions of the test modes and of the sensors that are held out in one configuration, and of the FRFs (response,
    reference)."""

    modes: frozenset[int] = frozenset()
    sensors: frozenset[int] = frozenset()
    functions: frozenset[tuple[int, int]] = frozenset()

    @property
    def any(self) -> bool:
        """True where modes or sensors are held out."""
        return bool(self.modes or self.sensors)


def without(case: ComparedCase, held: HeldOut) -> ComparedCase:
    """The case as the update sees it."""
    if not held.any:
        return case
    keep = [k for k in range(len(case.test.dofs)) if k not in held.sensors]
    return replace(
        case,
        test=case.test.select_dofs(case.test.dofs.select(keep)),
        sensors=sp.csr_array(case.sensors[keep]),
        left_out={**dict.fromkeys(sorted(held.modes), HELD_OUT), **case.left_out},
        # without shapes a pair made by hand says where the order goes on, also if it is held out
        fixed=tuple(pair for pair in case.fixed if pair[0] not in held.modes or not len(case.test.dofs)),
    )


@dataclass(frozen=True, eq=False)
class StudyCase:
    """One configuration: its entry in the study, the model in this state, and its test if there is one.

    `sensors` are those of the modes that are compared; `all_sensors` has those of measured FRFs too. `mesh` is drawn
    in place of the model's own elements, where it has none. `placement` has the stated errors in the positions and
    directions of the sensors of the modes. `compared` is all that is compared in this configuration,
    None where nothing is; the update sees it without what is `held` out.
    """

    entry: ConfigurationEntry
    configured: ConfiguredModel
    test: ModalTest | None = None
    sensors: SensorMap | None = None
    compared: ComparedCase | None = None
    all_sensors: SensorMap | None = None
    mesh: DrawnMesh | None = None
    held: HeldOut = field(default_factory=HeldOut)
    placement: SensorPlacement | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """Name of the configuration."""
        return self.entry.name

    @property
    def used_frfs(self) -> FrfSet | None:
        """The FRFs of the test, NaN where they are held out."""
        frfs = None if self.test is None else self.test.frfs
        return None if frfs is None else self.without_held(frfs)

    def without_held(self, frfs: FrfSet) -> FrfSet:
        """FRFs of the channels of the test, NaN where these are held out."""
        if not self.held.functions:
            return frfs
        values = frfs.values.copy()
        values[tuple(np.array(sorted(self.held.functions)).T)] = np.nan
        return replace(frfs, values=values)

    @property
    def modal(self) -> ComparedCase | None:
        """What is compared, where modes were measured."""
        return self.compared if self.compared is not None and len(self.compared.test) else None

    @property
    def used(self) -> ComparedCase | None:
        """What the update uses of it; None if nothing is compared, or if the configuration is for validation only."""
        if self.compared is None or self.entry.use != "update":
            return None
        return without(self.compared, self.held)


def overlay(
    entry: ConfigurationEntry, present: Alone | None = None, of_test: tuple[AddedMass, ...] = ()
) -> Configuration:
    """The configuration in terms of the model. `present` states what is absent if components are listed; `of_test` are
    the masses of the test equipment."""
    off, held = (frozenset(), ()) if present is None else (present.elements_off, present.interface)
    return Configuration(
        name=entry.name,
        elements_off=switched_off(entry) | off,
        support_set=entry.spc,
        multipoint_set=entry.mpc,
        supports_added=(*supports(entry.supports_added), *held),
        supports_removed=supports(entry.supports_removed),
        masses=(*(AddedMass(m.node, m.mass, m.offset, m.inertia_matrix, m.label) for m in entry.masses), *of_test),
        weighed_mass=entry.weighed_mass,
        weighed_centre=entry.weighed_centre,
        weighed_inertia=entry.weighed_inertia,
    )


@dataclass(frozen=True, eq=False)
class States:
    """The model of a study in the states of its configurations; those of one state share their matrices."""

    file: StudyFile
    model: ParametricModel
    specimens: Specimens | None = None
    made: dict[Configuration, ConfiguredModel] = field(default_factory=dict)

    def case(self, entry: ConfigurationEntry, present: Alone | None = None) -> StudyCase:
        """The model in the state of a configuration, still without its test; `present` as for `overlay`.

        Raises
        ------
        FemtuneError : what is wrong with the overlay
        """
        _check_nodes(self.file, entry, self.model.structure.nodes)
        asked = overlay(entry, present, _masses_of_test(self.file, entry, self.model.structure.nodes))
        state = asked.state
        with errors_at_configuration(self.file, entry):
            if state not in self.made:
                self.made[state] = configure(self.model, asked)
        specimen_model = (
            None if self.specimens is None or entry.specimen is None else self.specimens.models[entry.specimen]
        )
        return StudyCase(entry, replace(self.made[state], model=specimen_model or self.model, configuration=asked))


def _masses_of_test(file: StudyFile, entry: ConfigurationEntry, nodes: NodeTable) -> tuple[AddedMass, ...]:
    """The masses of the table that a configuration names; errors state the number of the line."""
    if entry.masses_file is None:
        return ()
    path = file.path_of(entry.masses_file)
    masses = read_masses_table(path, unit_system(file.study.units).mass)
    errors = ErrorCollector()
    for one in masses:
        with errors.catch(), errors_at(Where(str(path), one.line)):
            nodes.position(one.node)
    errors.raise_if_any()
    return tuple(AddedMass(m.node, m.mass, m.offset, label=m.label, of_test=True) for m in masses)


def _check_nodes(file: StudyFile, entry: ConfigurationEntry, nodes: NodeTable) -> None:
    """Refuse grid points and components of an overlay that the deck does not have, each where it is named."""
    errors = ErrorCollector()
    for i, mass in enumerate(entry.masses):
        with errors.catch(), errors_at(place_of(file, entry, "masses", i, "node")):
            nodes.position(mass.node)
    for key in ("supports_added", "supports_removed"):
        for i, text in enumerate(getattr(entry, key)):
            with errors.catch(), errors_at(place_of(file, entry, key, i)):
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
    """The study's tolerance, or a thousandth of the model's diagonal. That covers rounded coordinates but not a wrong
    node.
    """
    if file.sensors.tolerance is not None:
        return file.sensors.tolerance
    xyz = structure.nodes.xyz
    size = float(np.linalg.norm(np.ptp(xyz, axis=0))) if len(xyz) else 0.0
    # a model of one point, or of scalar points only, has no size
    return 1e-3 * size or 1e-3
