"""Measured FRFs in the resonance regions of paired modes, for a stage that finds damping."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.residuals import case_without_modes, state_at
from femtune.residuals.frf.choice import frf_residual
from femtune.residuals.frf.lines import Resonance, Resonances
from femtune.residuals.frf.residual import Places
from femtune.residuals.frf.scatter import FrfScatter
from femtune.study.axes import sensor_axis

if TYPE_CHECKING:
    from femtune.dofs import DofSet
    from femtune.errors import Where
    from femtune.files.study_file import StageEntry
    from femtune.modal import FrfSet
    from femtune.residuals import CaseState, ComparedCase
    from femtune.study.axes import Axis
    from femtune.study.cases import StudyCase


def resonance_case(
    case: StudyCase, modal: ComparedCase | None, entry: StageEntry, x: NDArray[np.float64], where: Where
) -> ComparedCase:
    """The configuration with its FRFs about the resonances that are paired at x, each moved to the model's own peak.

    `modal` are the modes that the stage uses. Modes that are left out or not paired (local ones) have no region.
    Stiffness and mass stay as they are, so that the remaining difference is due to damping.

    Raises
    ------
    FemtuneError : ``study.stage`` where the configuration has no FRFs, no modes or no damping ratios, or pairs none;
        ``residual.*``
    """
    measured = case.used_frfs
    if modal is None or measured is None or modal.test.damping_ratio is None:
        raise FemtuneError("study.stage/no-resonances", where=where, configuration=case.name)
    state = state_at(modal, x)
    modes = _paired(state)
    if not modes:
        raise FemtuneError("study.stage/none-paired", where=where, configuration=case.name)
    functions, places = _placed(case, measured)
    scatter = FrfScatter(entry.frf_sd, entry.frf_floor)
    residual, _ = frf_residual(state.solution, functions, Resonances(modes), scatter=scatter, places=places)
    return case_without_modes(
        modal.configured, (residual,), count=modal.count, max_hz=modal.max_hz, solver=modal.solver
    )


def _paired(state: CaseState) -> tuple[Resonance, ...]:
    test, ratios = state.case.test, state.case.test.damping_ratio
    assert ratios is not None
    return tuple(
        Resonance(test.labels[i], float(test.freq_hz[i]), float(ratios[i]), float(state.solution.freq_hz[j]))
        for tests, models in state.groups
        for i, j in zip(tests, models)
    )


def _placed(case: StudyCase, measured: FrfSet) -> tuple[FrfSet, Places]:
    """The functions whose DOFs exist in the model and can move."""
    outputs, inputs = sensor_axis(case, measured.responses)[0], sensor_axis(case, measured.references)[0]
    at = np.ix_(_positions(outputs, measured.responses), _positions(inputs, measured.references))
    coherence = None if measured.coherence is None else measured.coherence[at]
    some = replace(
        measured, values=measured.values[at], coherence=coherence, responses=outputs.labels, references=inputs.labels,
        response_names=(), reference_names=(),
    )  # fmt: skip
    return some, Places(sp.csr_array(outputs.rows), sp.csr_array(inputs.rows))


def _positions(axis: Axis, measured: DofSet) -> list[int]:
    known = {dof: i for i, dof in enumerate(measured)}
    return [known[dof] for dof in axis.labels]
