"""Cases on reduced models: the same comparison, its modes from a dense model of low order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
import scipy.sparse as sp

from femtune.model import ConfiguredModel, EigenSolution, ModelPoint, SubspaceDerivative
from femtune.model.reduce import ReducedModel, ReducedModes, ReducedPoint, reduced_derivative, reduced_modes
from femtune.residuals.case import ModalCase
from femtune.residuals.solver import ModelSolver


class _Reduced:
    """Modes and derivatives of reduced models; what they return answers all that residuals ask of a solution."""

    def modes(self, point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
        """As `reduced_modes`."""
        return cast(EigenSolution, reduced_modes(cast(ReducedPoint, point), count, max_hz))

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As `reduced_derivative`."""
        return reduced_derivative(cast(ReducedModes, solution), members, np.asarray(rows))


reduced_solver: ModelSolver = _Reduced()


def reduced_case(case: ModalCase, model: ReducedModel) -> ModalCase:
    """The case on a reduced model whose rows are the case's sensors.

    Its states hold `ReducedModes`: shapes in the coordinates of the basis, which the sensors' rows turn into motions.
    Residuals that modes do not serve ask the full model, which the case keeps.
    """
    sensors = cast(sp.csr_array, model.rows)
    reduced = cast(ConfiguredModel, model)
    return replace(case, configured=reduced, sensors=sensors, solver=reduced_solver, full=case.on_full_model)
