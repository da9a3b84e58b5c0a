"""What the test changes in the structure: masses of the sensors, and a suspension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import number_list
from femtune.model import AddedMass, configure
from femtune.model.derivatives.modes import pencil_of
from femtune.model.response.rigid import is_rigid
from femtune.planning import rayleigh_with_masses, suspended
from femtune.steps.modes.shapes import grid_translations
from femtune.steps.plan.record import LoadedMode, SuspensionResults
from femtune.study.error_places import errors_at
from femtune.study.solved import nominal

if TYPE_CHECKING:
    from femtune.files.study_file import PlanTable
    from femtune.model import EigenSolution
    from femtune.steps.plan.candidates import SiteSensor
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study

_NO_INERTIA = ((0.0, 0.0, 0.0),) * 3


def sensor_masses(table: PlanTable, sensors: Sequence[SiteSensor]) -> Reals:
    """(s,) mass of each sensor."""
    return np.array([table.triaxial_mass if s.axis is None else table.uniaxial_mass for s in sensors])


def mass_loading(
    study: Study, case: StudyCase, solution: EigenSolution, targets: Integers, rigid: Flags,
    sensors: Sequence[SiteSensor], masses: Reals,
) -> tuple[LoadedMode, ...]:  # fmt: skip
    """Shift of each elastic target mode by the masses of the sensors: solved again, and by the Rayleigh quotient."""
    if not masses.any():
        return ()
    rows = np.array([s.row for s in sensors])
    motion = grid_translations(case.configured, solution, rows)
    values = solution.eigenvalues[: solution.wanted]
    quotient = rayleigh_with_masses(values, masses, motion)
    again = _solved_with(study, case, solution, rows, masses)
    # the loaded mode that is nearest in the scalar product of the mass
    wanted = solution.shapes[:, targets]
    near = np.abs(again.shapes.T @ (pencil_of(solution.point).mass @ wanted)).argmax(axis=0)
    effects = []
    for j, t in enumerate(targets):
        if not rigid[j]:
            exact, approximate = (np.sqrt(v / values[t]) - 1.0 for v in (again.eigenvalues[near[j]], quotient[t]))
            effects.append(
                LoadedMode(
                    number=int(t) + 1, shift_percent=100.0 * float(exact), rayleigh_percent=100.0 * float(approximate)
                )
            )
    return tuple(effects)


def _solved_with(
    study: Study, case: StudyCase, solution: EigenSolution, rows: Integers, masses: Reals
) -> EigenSolution:
    ids, configuration = study.model.structure.nodes.ids, case.configured.configuration
    added = tuple(
        AddedMass(int(ids[r]), float(m), (0.0, 0.0, 0.0), _NO_INERTIA, "sensor") for r, m in zip(rows, masses)
    )
    loaded = configure(study.model, replace(configuration, masses=(*configuration.masses, *added)))
    return study.solver.modes(loaded.at(nominal(study)), solution.wanted, None)


def suspension_effect(
    study: Study, case: StudyCase, solution: EigenSolution, targets: Integers, table: PlanTable
) -> SuspensionResults | None:
    """Frequencies on the springs, in the space of the solved modes.

    Raises
    ------
    FemtuneError : ``plan.suspension``, ``model.unknown-node``
    """
    if not table.suspension:
        return None
    rigid = int(is_rigid(solution)[: solution.wanted].sum())
    if not rigid or rigid == solution.wanted:
        raise FemtuneError("plan.suspension", where=study.file.where("plan", "suspension"), name=case.name)
    nodes, rows, springs = study.model.structure.nodes, [], []
    for i, entry in enumerate(table.suspension):
        where = study.file.where("plan", "suspension", i, "nodes")
        with errors_at(where):
            listed = number_list(entry.nodes)
            constrained = [nodes.position(n) for n in {*listed.singles, *listed.among(nodes.ids.tolist())}]
        if not constrained:
            raise FemtuneError("plan.suspension/no-point", where=where)
        rows += constrained
        springs += [entry.stiffness] * len(constrained)
    motion = grid_translations(case.configured, solution, np.array(rows))
    values = solution.eigenvalues[: solution.wanted]
    hung = suspended(values, rigid, np.array(springs), motion)
    elastic = np.concatenate([np.zeros(rigid), hung.elastic])
    shifts = [0.0 if t < rigid else 100.0 * (np.sqrt(elastic[t] / values[t]) - 1.0) for t in targets]
    return SuspensionResults(
        rigid_hz=tuple(float(f) for f in np.sqrt(np.maximum(hung.rigid, 0.0)) / (2.0 * np.pi)),
        first_elastic_hz=float(np.sqrt(hung.elastic.min()) / (2.0 * np.pi)),
        shift_percent=tuple(map(float, shifts)),
    )
