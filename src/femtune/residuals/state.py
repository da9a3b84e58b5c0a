"""States of a case: solved and paired at a point, or followed there from another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model import ConfiguredModel, EigenSolution, ModelPoint, SubspaceDerivative
from femtune.model.full_model import ModelSolver
from femtune.model.reduce import ReducedModel, ReducedModes, ReducedPoint, reduced_derivative, reduced_modes
from femtune.residuals.case import CaseState, ComparedCase
from femtune.residuals.frf.on_reduced import on_reduced
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.pairing import groups_of, pair_case, track


def state_at(case: ComparedCase, x: NDArray, known: EigenSolution | None = None) -> CaseState:
    """A case at a normalised parameter vector, its test modes paired; `known` are its modes where they are solved.

    A case without test modes is not solved for modes here.
    """
    state = CaseState(case, case.configured.at(x) if known is None else known.point, (), known)
    return paired_afresh(state) if len(case.test) else state


def paired_afresh(state: CaseState) -> CaseState:
    """The same state with its test modes paired again."""
    solution = state.solution
    return CaseState(state.case, state.point, groups_of(pair_case(state.case, solution)), solution)


def followed(state: CaseState, x: NDArray) -> CaseState:
    """The case at another point, its pairing frozen: each motion is tracked."""
    there = CaseState(state.case, state.case.configured.at(x))
    if not state.groups:
        return there
    groups = track(state.groups, state.solution, there.solution)
    return CaseState(there.case, there.point, groups, there.solution)


# ----------------------------------------------------------------------------------------------------
# Cases on reduced models: the same comparison, its modes from a dense model of low order.


class _Reduced:
    """Modes and derivatives of reduced models; what they return answers all that residuals ask of a solution."""

    def modes(
        self, point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None = None
    ) -> EigenSolution:
        """As `reduced_modes`."""
        return cast(EigenSolution, reduced_modes(cast(ReducedPoint, point), count, max_hz))

    def improved(self, start: EigenSolution, steps: int) -> EigenSolution:
        """Modes of a reduced model are exact within its basis."""
        return start

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As `reduced_derivative`."""
        return reduced_derivative(cast(ReducedModes, solution), members, np.asarray(rows))


reduced_solver: ModelSolver = _Reduced()


def reduced_case(case: ComparedCase, model: ReducedModel, functions: Sequence[FrfResidual] = ()) -> ComparedCase:
    """The case on a reduced model whose rows are the case's sensors, and after them the ports of `functions`.

    Its states hold `ReducedModes`: shapes in the coordinates of the basis, which the sensors' rows turn into motions.
    Other residuals that modes do not serve ask the full model, which the case keeps.

    Parameters
    ----------
    functions : FRF residuals of the case that the reduced model serves, see `femtune.residuals.frf.on_reduced`
    """
    sensors, ports = np.split(model.rows, [case.sensors.shape[0]])
    return replace(
        case, configured=cast(ConfiguredModel, model), sensors=cast(sp.csr_array, sensors), solver=reduced_solver,
        residuals=on_reduced(case, functions, ports), full=case.on_full_model,
    )  # fmt: skip
