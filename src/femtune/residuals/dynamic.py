"""Modal dynamic residual: the forces (K − λ_e M)ψ that the measured modes would need in the model.

Source: Friswell and Mottershead (1995), equation error; the unmeasured entries of ψ are unknowns of the least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.residuals.asked import Asked
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.weights import ResidualBlock, Weights

# ----------------------------------------------------------------------------------------------------
# Equation errors Aψ − f of a shape that was measured in part: what was not measured is chosen for the least error.
#
# That is variable projection (Golub and Pereyra 1973) of the unmeasured entries: the minimum of |Aψ − f|² under Sψ =
# m is one symmetric linear system, regular even where A itself is singular (at an eigenvalue), and its derivative
# another with the same matrix.


_SOLUTION_ACCURACY = 1e-6
"""Relative residual of a saddle-point solution beyond which its matrix is singular."""


@dataclass(frozen=True, eq=False)
class LeastEquationError:
    """The least equation error.

    Parameters
    ----------
    error, gradient : r = Aψ − f (n,) and ∂r/∂x (n, k)
    shape : ψ (n,), equal to what was measured at the sensors
    """

    error: Reals
    gradient: Reals
    shape: Reals


def equation_error(
    matrix: sp.csr_array,
    derivatives: Sequence[sp.csr_array],
    sensors: sp.csr_array,
    measured: Reals,
    force: Reals | None = None,
) -> LeastEquationError:
    """The least |Aψ − f| of all ψ with Sψ = m.

    Parameters
    ----------
    matrix, derivatives : A (n, n) symmetric and ∂A/∂x of k parameters
    sensors, measured : S (s, n) and m (s,)
    force : f (n,), none where it is zero

    Raises
    ------
    FemtuneError : ``residual.sensors-dependent`` where the measured combinations of DOFs depend on one another, or
        leave a motion without any error
    """
    n, s = matrix.shape[0], sensors.shape[0]
    f = np.zeros(n) if force is None else force
    size = float(np.abs(matrix.data).max(initial=0.0)) or 1.0
    saddle = _saddle(matrix, sensors, size)
    factor = _factorised(saddle)
    first = _solved(saddle, factor, np.concatenate([f, np.zeros(n), size * measured])[:, None])[:, 0]
    scaled, shape = first[:n], first[n : 2 * n]
    loads = [np.concatenate([-(d @ shape), -(d @ scaled), np.zeros(s)]) for d in derivatives]
    slopes = _solved(saddle, factor, np.stack(loads, axis=1))[:n] if loads else np.zeros((n, 0))
    return LeastEquationError(size * scaled, size * slopes, shape)


def _saddle(matrix: sp.csr_array, sensors: sp.csr_array, size: float) -> sp.csc_array:
    """For (r/β, ψ, multipliers) with β the size of A, so that all blocks have one size."""
    n = matrix.shape[0]
    observe = size * sp.csr_array(sensors)
    return sp.csc_array(
        sp.block_array([[-size * sp.eye_array(n), matrix, None], [matrix, None, observe.T], [None, observe, None]])
    )


def _factorised(saddle: sp.csc_array) -> SuperLU:
    try:
        return splu(saddle)
    except RuntimeError as error:
        raise _dependent() from error


def _solved(saddle: sp.csc_array, factor: SuperLU, loads: Reals) -> Reals:
    """Solution with one step of iterative refinement; an error if it is still not accurate."""
    solution = factor.solve(loads)
    solution = solution + factor.solve(loads - saddle @ solution)
    left = np.linalg.norm(loads - saddle @ solution, axis=0)
    if not (left <= _SOLUTION_ACCURACY * np.linalg.norm(loads, axis=0)).all():
        raise _dependent()
    return np.asarray(solution)


def _dependent() -> FemtuneError:
    return FemtuneError("residual.sensors-dependent")


@dataclass(frozen=True)
class DynamicResidual(Residual):
    """Equation error of every test mode that is not left out; no mode of the model is solved, nothing is paired.

    Parameters
    ----------
    sd : standard deviation of a force, for the test shape with its largest entry scaled to one
    labels : test modes; all that are not left out where None
    """

    sd: float
    labels: tuple[str, ...] | None = None
    key = "dynamic"
    label = "dynamic"
    of_modes = True

    @classmethod
    def of_study(cls, asked: Asked) -> DynamicResidual:
        """See `Residual`."""
        _ = asked.modes
        return cls(asked.entry.sd, asked.entry.modes)

    def __post_init__(self) -> None:
        Weights(self.sd)

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One value for each free DOF and mode, of which as many are independent as entries were measured.

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
        equation = equation_error(
            sp.csr_array(point.stiffness - value * point.mass),
            [sp.csr_array(k - value * m) for k, m in slopes],
            sp.csr_array(case.sensors[known]),
            scaled,
        )
        inertia = value * float(np.linalg.norm(point.mass @ equation.shape))
        return self._block(state, case.test.labels[i], equation, inertia, len(known))

    def _block(
        self, state: CaseState, label: str, equation: LeastEquationError, size: float, measured: int
    ) -> ResidualBlock:
        """The block, its error relative to the inertia forces."""
        values, slopes = equation.error / self.sd, equation.gradient / self.sd
        # the entries that were not measured take the part of the forces that they can produce
        lost = len(values) - measured
        return self.block(state.case.name, label, values, slopes, self.sd / (size or 1.0), lost=lost)


def _no_shape(name: str, label: str) -> FemtuneError:
    return FemtuneError("residual.unmeasured/equation-error", configuration=name, mode=label)
