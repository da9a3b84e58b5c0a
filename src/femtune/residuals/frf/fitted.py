"""Functions of the model at a point of an update, from the residuals that were evaluated there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.modal import FrfSet
from femtune.residuals.case import Residual
from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.on_reduced import ReducedFrfs
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.problem import Evaluation


@dataclass(frozen=True, eq=False)
class FittedFrfs:
    """The functions that an FRF residual compares, of the model at one point.

    Parameters
    ----------
    configuration : name
    measured : the functions of the test at the lines that are compared
    phase : False where magnitudes alone are compared: the values are real then
    values : (outputs, inputs, lines) of the model; NaN where nothing is compared
    """

    configuration: str
    measured: FrfSet
    phase: bool
    values: NDArray[np.complex64] = field(repr=False)


def fitted_frfs(evaluation: Evaluation) -> Iterator[FittedFrfs]:
    """Functions of all FRF residuals, in their order. They cost no solution: the blocks of the evaluation have them."""
    blocks = iter([b for b in evaluation.blocks if b.kind == FrfResidual.label])
    for residual in (r for state in evaluation.states for r in state.case.residuals):
        functions = _of_functions(residual)
        if functions is not None:
            values = functions.values_of([next(blocks) for _ in range(functions.block_count)])
            phase = functions.form != "log-magnitude"
            yield FittedFrfs(functions.configuration, functions.measured, phase, values.astype(np.complex64))


def _of_functions(residual: Residual) -> FrfResidual | None:
    settled_residual = settled(residual)
    if isinstance(settled_residual, ReducedFrfs):
        return settled_residual.own
    return settled_residual if isinstance(settled_residual, FrfResidual) else None
