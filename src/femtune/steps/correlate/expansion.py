"""Expansion of the test shapes, as records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import NDArray

from femtune.correlation import expand_shapes
from femtune.correlation.kinds import ExpansionMethod
from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.modal import ModeSet
from femtune.steps.modes.shapes import drawn_rows, grid_motion

if TYPE_CHECKING:
    from femtune.correlation import Correlation, ExpandedShapes
    from femtune.files.study_file import CorrelateTable
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
from femtune.steps.correlate.record.expansion import ExpandedMode, ExpansionError, ExpansionResults

Arrays = dict[str, NDArray]


def expansion_results(
    case: StudyCase,
    table: CorrelateTable,
    correlation: Correlation,
    solution: EigenSolution,
    prefix: str,
    arrays: Arrays,
) -> ExpansionResults | None:
    """The record; None if the study does not request it or no shapes were measured. Its arrays go into `arrays`."""
    if table.expand == "none" or case.modal is None or not len(case.modal.test.dofs):
        return None
    left = {u.test for u in correlation.pairing.unpaired_test if u.left_out or u.suspension}
    kept = [i for i in range(len(case.modal.test)) if i not in left]
    test = case.modal.test.select_modes(kept)
    basis = _basis(table, correlation, solution)
    expanded = expand_shapes(
        solution, test, case.modal.sensors, table.expand, basis=basis, noise=table.expand_noise
    )  # fmt: skip
    nodes = case.configured.model.structure.nodes
    kept_arrays = {
        "nodes": nodes.ids,
        "positions": nodes.xyz,
        "shapes": grid_motion(case.configured, expanded.shapes),
        "drawn": drawn_rows(case, solution),
    }
    arrays |= {f"{prefix}/expanded/{name}": array for name, array in kept_arrays.items() if array is not None}
    return ExpansionResults(
        method=table.expand,
        modes=tuple(_mode(test, expanded, j) for j in range(len(test))),
        groups=expanded.groups,
        serep_modes=tuple(j + 1 for j in basis),
        drawn_key=None if kept_arrays["drawn"] is None else f"{prefix}/expanded/drawn",
        **{f"{name}_key": f"{prefix}/expanded/{name}" for name in ("nodes", "positions", "shapes")},
    )


def _basis(table: CorrelateTable, correlation: Correlation, solution: EigenSolution) -> list[int]:
    """Modes of SEREP: the lowest ones that the study wants, else the paired ones with the rest of their clusters."""
    if table.expand_modes is not None:
        return list(range(min(table.expand_modes, solution.wanted)))
    pairing = correlation.pairing
    return sorted({*pairing.model_indices, *(j for cluster in pairing.clusters for j in cluster.model)})


def _mode(test: ModeSet, expanded: ExpandedShapes, j: int) -> ExpandedMode:
    return ExpandedMode(
        test_label=test.labels[j],
        test_freq_hz=float(test.freq_hz[j]),
        misfit_percent=_percent(expanded.misfit[j]),
        errors=tuple(
            ExpansionError(method=m, error_percent=_percent(expanded.held_out[m][j])) for m in get_args(ExpansionMethod)
        ),
    )


def _percent(value: float) -> float | None:
    return 100.0 * float(value) if np.isfinite(value) else None


def expanded_modes(record: ExpansionResults, arrays: Mapping[str, NDArray]) -> ModeSet:
    """The expanded shapes as modes of the test at the DOFs of the grid points that move, in the basic system."""
    nodes, shapes = arrays[record.nodes_key], arrays[record.shapes_key]
    known = [j for j, mode in enumerate(record.modes) if mode.misfit_percent is not None]
    shapes = shapes[:, :, known]
    moving = np.argwhere((shapes != 0.0).any(axis=2))
    dofs = DofSet(Dof(int(nodes[i]), DIRECTIONS[k + 1]) for i, k in moving)
    modes = [record.modes[j] for j in known]
    return ModeSet(
        np.array([m.test_freq_hz for m in modes]),
        shapes[moving[:, 0], moving[:, 1]],
        dofs,
        tuple(m.test_label for m in modes),
        source=f"test, expanded by {record.method}",
    )
