"""Real modes of a model whose stiffness depends on frequency, each with the stiffness at its own frequency.

f_j(f) is the natural frequency of mode j of the matrices at f. The solution of f_j(f) = f is found by Newton's method
with df_j/df from the mode; the derivatives by the parameters follow from the implicit function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count as numbers

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.derivatives.chosen import subspace_derivative
from femtune.model.derivatives.modes import SubspaceDerivative, inverse_gaps, outside
from femtune.model.eigen.solution import EigenSolution, solve_modes

TWO_PI = 2.0 * np.pi
_MOST_SOLUTIONS = 60
"""Eigen-solutions of one mode; Newton's method converges quadratically, and only a rate near one takes many."""
_CONVERGED = 1e-11
"""Relative change of the frequency of the last step: rounding of an eigenvalue is some 1e-12 to 1e-13."""
_STEEP_RATE = 0.99
"""Rise of the natural frequency in Hz per Hz of the matrices from which on f_j(f) = f has no well-defined solution."""


@dataclass(frozen=True, eq=False)
class OwnFrequencyMode:
    """A mode with the matrices of its own frequency.

    Parameters
    ----------
    number : of the mode among those of these matrices, from 0
    freq_hz : |λ|/2π of a pole, √λ/2π of an eigenvalue
    eigenvalue : λ = ω² in rad²/s² of a real mode, the pole λ in rad/s of a complex one
    gradient : (k,) derivatives of `eigenvalue` by the free parameters, the change of the matrices with its frequency
        included
    shape : (n_free,) of unit modal mass, or with modal A = 1
    iterations : number of eigen-solutions
    """

    number: int
    freq_hz: float
    eigenvalue: complex
    gradient: NDArray
    shape: NDArray
    iterations: int


@dataclass(frozen=True, eq=False)
class AtFrequency:
    """A mode of the matrices at one frequency.

    Parameters
    ----------
    by_frequency : derivative of its eigenvalue by the frequency of the matrices, 1/Hz
    by_parameters : its derivatives by the parameters at that frequency
    freq_hz : its natural frequency
    in_hz : derivative of the natural frequency: that of the real part of `in_hz` times a change of the eigenvalue
    """

    eigenvalue: complex
    shape: NDArray
    by_frequency: complex
    by_parameters: Callable[[], NDArray]
    freq_hz: float
    in_hz: complex

    @property
    def rate(self) -> float:
        """Rise of the natural frequency in Hz per Hz of the matrices."""
        return float(np.real(self.in_hz * self.by_frequency))

    def own(self, number: int, iterations: int) -> OwnFrequencyMode:
        """The mode at its own frequency, with derivatives (error ``table.own-frequency``)."""
        at = self.by_parameters()
        gradient = at + self.by_frequency * np.real(self.in_hz * at) / (1.0 - self.rate)
        return OwnFrequencyMode(number, self.freq_hz, self.eigenvalue, gradient, self.shape, iterations)


Solve = Callable[[ModelPoint], AtFrequency]


def at_own_frequency(point: ModelPoint, mode: int, solve: Solve, start_hz: float = 0.0) -> tuple[AtFrequency, int]:
    """The mode whose natural frequency is that of the matrices, and the number of solutions that this took.

    Raises
    ------
    FemtuneError : ``table.own-frequency``
    """
    freq, change = start_hz, np.inf
    for iteration in range(1, _MOST_SOLUTIONS + 1):
        solved = solve(point.at_frequency(freq))
        if change <= _CONVERGED * max(solved.freq_hz, freq):
            if solved.rate >= _STEEP_RATE:
                raise _not_found(mode, f"its natural frequency rises by {solved.rate:.3g} Hz per Hz of the table")
            return solved, iteration
        # where the rate is one or more Newton's method leads away: the fixed point's own step is taken
        step = (solved.freq_hz - freq) / (1.0 - solved.rate if solved.rate < _STEEP_RATE else 1.0)
        change, freq = abs(step), max(freq + step, 0.0)
    raise _not_found(mode, f"no convergence after {_MOST_SOLUTIONS} solutions")


def _not_found(mode: int, reason: str) -> FemtuneError:
    return FemtuneError("table.own-frequency", mode=mode + 1, reason=reason)


def _real(point: ModelPoint, mode: int) -> AtFrequency:
    modes = solve_modes(point, mode + 1)
    value, phi = float(modes.eigenvalues[mode]), modes.shapes[:, mode]
    omega = float(np.sqrt(max(value, 0.0)))
    slope = float(phi @ (point.by_frequency("stiffness") @ phi))
    in_hz = 0.5 / (TWO_PI * omega) if omega else 0.0
    gradient = lambda: subspace_derivative(modes, [mode]).eigenvalue_gradient  # noqa: E731
    return AtFrequency(value, phi, slope, gradient, omega / TWO_PI, in_hz)


def modes_at_own_frequency(point: ModelPoint, count: int) -> list[OwnFrequencyMode]:
    """Real modes, each with the stiffness at its natural frequency; loss factors and dashpots have no effect.

    Raises
    ------
    FemtuneError : ``table.own-frequency``, and as `solve_modes`
    """
    modes = zip(range(count), _each(point))
    return [mode.own(number, iterations) for number, (mode, iterations) in modes]


def _each(point: ModelPoint) -> Iterator[tuple[AtFrequency, int]]:
    """Mode after mode, each from the frequency of the one before."""
    start_hz = 0.0
    for mode in numbers():
        solved, iterations = at_own_frequency(point, mode, lambda at, mode=mode: _real(at, mode), start_hz)  # type: ignore[misc]
        start_hz = solved.freq_hz
        yield solved, iterations


# ----------------------------------------------------------------------------------------------------
# The same modes as one solution, for residuals and correlation.


def own_frequency_solution(point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
    """Modes at their own frequencies as one solution; they are orthogonal only as far as the stiffness is constant.

    Errors as `modes_at_own_frequency`.
    """
    first = solve_modes(point.at_frequency(0.0), count)
    most = first.wanted if count is None and max_hz is None else count
    modes: list[AtFrequency] = []
    for mode, _ in _each(point):
        if modes and max_hz is not None and mode.freq_hz > max_hz:
            break
        modes.append(mode)
        if len(modes) in (most, point.configured.n_free):
            break
    values = np.array([float(np.real(mode.eigenvalue)) for mode in modes])
    shapes = np.stack([mode.shape for mode in modes], axis=1)
    method = f"{first.method}, each mode at its own frequency"
    # no inertia counts these modes: their matrices differ
    return EigenSolution(point, values, shapes, len(modes), first.shift, first.shift, -1, first.notices, method=method)


def own_frequency_derivative(solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
    """As `subspace_derivative`, for one mode of an `own_frequency_solution`.

    The derivatives of the matrices are K′ + f′ ∂K/∂f with the derivative f′ of the natural frequency.

    Raises
    ------
    FemtuneError : ``table.close-modes`` for a cluster of modes
    """
    if len(members) > 1:
        raise FemtuneError("table.close-modes", modes=" and ".join(str(j + 1) for j in members))
    (mode,) = members
    freq_hz = float(np.sqrt(max(solution.eigenvalues[mode], 0.0))) / TWO_PI
    point = solution.point.at_frequency(freq_hz)
    frozen = solve_modes(point, mode + 1)
    at = subspace_derivative(frozen, [mode], rows)
    phi = frozen.shapes[:, [mode]]
    force = point.by_frequency("stiffness") @ phi
    slope = float((phi.T @ force)[0, 0])
    # natural frequency by the parameters
    by_hz = 4.0 * np.pi * TWO_PI * freq_hz
    freq_gradient = at.eigenvalue_gradient / (by_hz - slope)
    bent = rows @ outside(frozen, frozen.eigenvalues[[mode]], inverse_gaps(frozen, [[mode]]), force)
    # the solution's vector may have the other sign
    side = 1.0 if float(phi[:, 0] @ (point.mass @ solution.shapes[:, mode])) >= 0.0 else -1.0
    stiffness = at.stiffness + slope * freq_gradient[:, None, None]
    moved = side * (at.outside + bent[:, :, None] * freq_gradient)
    return SubspaceDerivative(at.eigenvalues, stiffness, at.mass, moved, side * at.shapes, at.error)
