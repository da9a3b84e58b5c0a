"""Records of static load cases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.files.study_file import LoadEntry
from femtune.model import ConfiguredModel, ModelPoint
from femtune.model.response import Ports, matrix_ports
from femtune.study.cases import StudyCase
from femtune.study.load import Study
from femtune.study.located import located
from femtune.study.response_axes import Axis, named_axis
from femtune.study.response_solver import solved_static
from femtune.study.results_response import Displacement, StaticResults


def static_results(study: Study, case: StudyCase, point: ModelPoint, default: Axis | None) -> tuple[StaticResults, ...]:
    """Displacements under every [[load]], all with one factorisation.

    Parameters
    ----------
    default : outputs of a load that names none; None for the DOFs that it drives

    Raises
    ------
    FemtuneError : ``response.static-free``, ``response.zero-load``, ``response.held-port``, ``model.unknown-node``,
        ``model.component``
    """
    file, loads = study.file, study.file.load
    if not loads:
        return ()
    forces = [named_axis(file, case, tuple(load.forces), "load", k, "forces") for k, load in enumerate(loads)]
    outputs = [_outputs(study, case, k, default, forces[k]) for k in range(len(loads))]
    _check_loads(study, forces)
    with located(file.where("load")):
        ports = _ports(case.configured, loads, forces, outputs)
        values, relief = solved_static(study, point, ports)
    ends = np.cumsum([len(axis.labels) for axis in outputs])
    parts = [values[end - len(axis.labels) : end, k] for k, (axis, end) in enumerate(zip(outputs, ends))]
    return tuple(_record(load, axis, part, relief) for load, axis, part in zip(loads, outputs, parts))


def _outputs(study: Study, case: StudyCase, k: int, default: Axis | None, forces: Axis) -> Axis:
    load = study.file.load[k]
    if load.outputs is not None:
        return named_axis(study.file, case, load.outputs, "load", k, "outputs")
    return forces if default is None else default


def _check_loads(study: Study, forces: Sequence[Axis]) -> None:
    for k, (load, axis) in enumerate(zip(study.file.load, forces)):
        if not np.any(_row(load, axis).data):
            raise FemtuneError(
                "response.zero-load",
                f"the forces of load {load.name} are zero, or cancel each other",
                where=study.file.where("load", k, "forces"),
                hint="give it a force, or take the load out",
            )


def _row(load: LoadEntry, axis: Axis) -> sp.csr_array:
    """(1, n_g) forces of a load."""
    return sp.csr_array(sp.csr_array(np.array([list(load.forces.values())])) @ axis.rows)


def _ports(
    configured: ConfiguredModel, loads: Sequence[LoadEntry], forces: Sequence[Axis], outputs: Sequence[Axis]
) -> Ports:
    cases = [_row(load, axis) for load, axis in zip(loads, forces)]
    seen = sp.csr_array(sp.vstack([axis.rows for axis in outputs]))
    names = tuple(load.name for load in loads)
    return matrix_ports(
        configured, sp.csr_array(sp.vstack(cases)), seen, _numbered(len(loads)), _numbered(seen.shape[0]), names
    )


def _numbered(count: int) -> DofSet:
    """Labels for combinations that have no DOF of their own; names and order tell them apart."""
    return DofSet(Dof(k + 1, "S") for k in range(count))


def _record(load: LoadEntry, axis: Axis, values: NDArray[np.float64], relief: bool) -> StaticResults:
    moved = (Displacement(output=str(dof), value=float(value)) for dof, value in zip(axis.labels, values))
    forces = tuple(f"{label} {force:g}" for label, force in load.forces.items())
    return StaticResults(load=load.name, forces=forces, inertia_relief=relief, displacements=tuple(moved))
