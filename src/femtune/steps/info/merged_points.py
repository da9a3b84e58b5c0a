"""What merging coincident grid points would do to the first frequencies, as records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from femtune.fem.connectivity import coincident_pairs, connectivity, merged
from femtune.model import EigenSolution, configure, parametric_model, solve_modes
from femtune.model.mesh_error import USUAL_DOFS
from femtune.model.response.rigid import is_rigid
from femtune.parameters import ParameterSet
from femtune.study.record import Alert, alert

if TYPE_CHECKING:
    from femtune.fem.structure import Structure
    from femtune.model import Configuration
    from femtune.study.cases import StudyCase

_SHOWN = 3
"""Elastic modes whose frequencies are compared."""


def of_merged_points(case: StudyCase) -> Iterable[Alert]:
    """The first frequencies of the deck with coincident points merged, beside those of the deck as it is."""
    structure, configuration = case.configured.model.structure, case.configured.configuration
    if structure.nodes.n_dofs > USUAL_DOFS:
        return
    pairs = coincident_pairs(structure, connectivity(structure))
    if not len(pairs):
        return
    before, after = (_solved(s, configuration) for s in (structure, merged(structure, pairs)))
    yield alert(
        "info", "model.merged-points", configuration=case.name, count=len(pairs), before=_words(before),
        after=_words(after),
    )  # fmt: skip


def _solved(structure: Structure, configuration: Configuration) -> EigenSolution:
    model = parametric_model(structure, ParameterSet(()), ())
    return solve_modes(configure(model, configuration).at(np.zeros(0)))


def _words(solution: EigenSolution) -> str:
    """Number of rigid-body modes, and the first elastic frequencies."""
    rigid = is_rigid(solution)[: solution.wanted]
    shown = [f"{hz:.4g}" for hz in solution.freq_hz[~rigid[: len(solution.freq_hz)]][:_SHOWN]]
    bodies = int(rigid.sum())
    return f"{', '.join(shown)} Hz" + (f" above {bodies} rigid-body modes" if bodies else "")
