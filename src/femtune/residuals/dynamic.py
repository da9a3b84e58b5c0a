"""Modal dynamic residual: the forces (K − λ_e M)ψ that the measured modes would need in the model.

Source: Friswell and Mottershead (1995), equation error; the unmeasured entries of ψ are unknowns of the least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import CaseState
from femtune.residuals.equation import LeastEquationError, equation_error
from femtune.residuals.weights import Weights

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class DynamicResidual:
    """Equation error of every test mode that is not left out; no mode of the model is solved, nothing is paired.

    Parameters
    ----------
    sd : standard deviation of a force, for the test shape with its largest entry scaled to one
    labels : test modes; all that are not left out where None
    """

    sd: float
    labels: tuple[str, ...] | None = None
    on_modes = False

    def __post_init__(self) -> None:
        Weights(self.sd)

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One value for each free DOF and mode.

        Raises
        ------
        FemtuneError : ``residual.sensors-dependent``, ``residual.unmeasured``
        """
        test, left_out = state.case.test, state.case.left_out
        wanted = [i for i in range(len(test)) if i not in left_out and self._is_asked(test.labels[i])]
        return [self._of_mode(state, i, derivatives) for i in wanted]

    def _is_asked(self, label: str) -> bool:
        return self.labels is None or label in self.labels

    def _of_mode(self, state: CaseState, i: int, derivatives: bool) -> ResidualBlock:
        case, point = state.case.on_full_model, state.full
        value, shape = float(case.test.eigenvalues[i]), case.test.shapes[:, i]
        known = np.flatnonzero(~np.isnan(shape))
        if not np.nan_to_num(shape).any():
            raise _no_shape(case.name, case.test.labels[i])
        scaled = shape[known] / shape[known][np.argmax(np.abs(shape[known]))]
        slopes = zip(point.stiffness_derivatives, point.mass_derivatives) if derivatives else ()
        found = equation_error(
            sp.csr_array(point.stiffness - value * point.mass),
            [sp.csr_array(k - value * m) for k, m in slopes],
            sp.csr_array(case.sensors[known]),
            scaled,
        )
        inertia = value * float(np.linalg.norm(point.mass @ found.shape))
        return self._block(state, case.test.labels[i], found, inertia)

    def _block(self, state: CaseState, label: str, found: LeastEquationError, size: float) -> ResidualBlock:
        """The block, its error told beside the forces of inertia."""
        values, slopes = found.error / self.sd, found.gradient / self.sd
        return ResidualBlock("dynamic", state.case.name, label, values, slopes, self.sd / (size or 1.0))


def _no_shape(name: str, label: str) -> FemtuneError:
    return FemtuneError(
        "residual.unmeasured",
        f"configuration {name}: mode {label} has no measured entry, so its equation error is not defined",
        hint="leave this mode out",
    )
