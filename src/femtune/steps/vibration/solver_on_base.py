"""Modes of an external solver in a vibration test: frequencies, shapes at the outputs, participation factors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.dofs import DIRECTIONS, DofSet
from femtune.errors import FemtuneError
from femtune.fem import NodeTable
from femtune.fem.checks import rigid_body_modes
from femtune.files.matrices.placement import read_points
from femtune.files.study_file import ConfigurationSolver
from femtune.model.vibration import ModalTransfer, ModesOnBase, transfer_of_base
from femtune.study.external import own_runs, point_of

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.modes.solved import SolvedModes
    from femtune.files.study_file import StudyFile, VibrationEntry
    from femtune.model.response.modal_damping import DampingRatios
    from femtune.study.study import Study

_RIGID_BODY_RATIO = 1e-3
"""Frequency relative to the highest one of the run, below which a mode is a rigid-body mode.

Rounding keeps it from being exactly zero.
"""


def solver_transfer(study: Study, entry: VibrationEntry, x: Reals, damping: DampingRatios) -> ModalTransfer:
    """Accelerations of the outputs over that of the base, by one run of the solver at normalised parameters.

    Raises
    ------
    FemtuneError : ``external.*``, ``vibration.solver``, ``vibration.no-base``, ``vibration.damping``
    """
    assert entry.base is not None
    where = study.file.where("vibration", study.file.vibration.index(entry))
    runs = own_runs(study.file, entry.solver or _of_configuration(study.file, entry), where)
    try:
        point = point_of(study.parameters, runs, x)
        run = runs.run([point])[0]
    finally:
        runs.journal.close()
    modes = run.parts[0].modes
    if modes is None:
        raise runs.failed(point, run)
    outputs = DofSet.parse(entry.outputs)
    on_base = modes_on_base(modes, outputs, entry.base, _carried(study.file, outputs, entry.base))
    return transfer_of_base(on_base, damping, tuple(map(str, outputs)), f"base {entry.base}")


def modes_on_base(modes: SolvedModes, outputs: DofSet, base: str, carried: Reals) -> ModesOnBase:
    """The modes of a run, seen at outputs that the base carries along.

    Raises
    ------
    FemtuneError : ``vibration.solver`` in its variants, ``vibration.no-base``
    """
    if (modes.freq_hz <= _RIGID_BODY_RATIO * modes.freq_hz.max(initial=0.0)).any():
        raise FemtuneError("vibration.no-base")
    if modes.participation is None or not np.isfinite(pushed := modes.participation[DIRECTIONS.index(base) - 1]).all():
        raise FemtuneError("vibration.solver")
    rows = {int(node): i for i, node in enumerate(modes.nodes)}
    nowhere = np.full(len(modes.freq_hz), np.nan)
    seen = [
        dof.sign * (modes.shapes[rows[dof.node], dof.component - 1] if dof.node in rows and dof.component else nowhere)
        for dof in outputs
    ]
    missing = [str(dof) for dof, shape in zip(outputs, seen, strict=True) if not np.isfinite(shape).all()]
    if missing:
        raise FemtuneError("vibration.solver/outputs", dofs=", ".join(missing))
    return ModesOnBase(modes.freq_hz, np.array(seen), pushed, carried)


def _of_configuration(file: StudyFile, entry: VibrationEntry) -> ConfigurationSolver:
    solver = next(c.solver for c in file.configurations if entry.configuration in (None, c.name))
    return solver or ConfigurationSolver()


def _carried(file: StudyFile, outputs: DofSet, base: str) -> Reals:
    """(o,) motion of the outputs with the base (errors ``vibration.solver/rotation``, ``model.unknown-node``)."""
    if file.model.grid is not None:
        nodes = read_points(file.path_of(file.model.grid))
    else:
        if base.startswith("R"):
            raise FemtuneError("vibration.solver/rotation")
        ids = np.unique(outputs.nodes)
        nodes = NodeTable(ids, np.zeros((len(ids), 3)), np.tile(np.eye(3), (len(ids), 1, 1)))
    motion = rigid_body_modes(nodes)[:, DIRECTIONS.index(base) - 1]
    return np.array([dof.sign * motion[nodes.dof(dof.node, dof.component)] for dof in outputs])
