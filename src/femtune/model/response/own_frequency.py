"""Modes of a model whose stiffness or damping depends on frequency, each at its own frequency.

f_j(f) is the natural frequency of mode j of the matrices at f. The solution of f_j(f) = f is found by Newton's method
with df_j/df from the modes; the derivatives by the parameters follow from the implicit function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.derivatives.chosen import subspace_derivative
from femtune.model.eigen.solution import EigenSolution, solve_modes
from femtune.model.response.complex_derivatives import mean_pole_derivative
from femtune.model.response.complex_eigen import ComplexModes, complex_modes

_TWO_PI = 2.0 * np.pi
_MOST, _SAME, _STEEP = 60, 1e-11, 0.99


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


def modes_at_own_frequency(point: ModelPoint, count: int) -> list[OwnFrequencyMode]:
    """Real modes, each with the stiffness at its natural frequency; loss factors and dashpots have no effect.

    Raises
    ------
    FemtuneError : ``table.own-frequency``, and as `solve_modes`
    """
    return [_iterated(point, j, lambda at, j=j: _real(at, j)) for j in range(count)]  # type: ignore[misc]


def complex_modes_at_own_frequency(point: ModelPoint, count: int) -> list[OwnFrequencyMode]:
    """Complex modes, each with stiffness and damping at |λ|/2π; errors as `modes_at_own_frequency`, `complex_modes`."""
    return [_iterated(point, j, lambda at, j=j: _complex(at, j)) for j in range(count)]  # type: ignore[misc]


@dataclass(frozen=True, eq=False)
class _Frozen:
    """A mode of the matrices at one frequency, with the derivatives of its eigenvalue by frequency and parameters."""

    eigenvalue: complex
    shape: NDArray
    by_frequency: complex
    by_parameters: Callable[[], NDArray]
    to_hz: Callable[[complex], tuple[float, complex]]

    @property
    def freq_hz(self) -> float:
        """Natural frequency."""
        return self.to_hz(self.eigenvalue)[0]

    def in_hz(self, change: NDArray | complex) -> Reals:
        """Change of the natural frequency for a change of the eigenvalue."""
        return np.asarray(np.real(self.to_hz(self.eigenvalue)[1] * np.asarray(change)))


def _real(point: ModelPoint, mode: int) -> _Frozen:
    modes: EigenSolution = solve_modes(point, mode + 1)
    value, phi = float(modes.eigenvalues[mode]), modes.shapes[:, mode]

    def to_hz(eigenvalue: complex) -> tuple[float, complex]:
        omega = float(np.sqrt(max(eigenvalue.real, 0.0)))
        return omega / _TWO_PI, 0.5 / (_TWO_PI * omega) if omega else 0.0

    slope = float(phi @ (point.by_frequency("stiffness") @ phi))
    return _Frozen(value, phi, slope, lambda: subspace_derivative(modes, [mode]).eigenvalue_gradient, to_hz)


def _complex(point: ModelPoint, mode: int) -> _Frozen:
    modes: ComplexModes = complex_modes(solve_modes(point, mode + 1), mode + 1)
    pole, psi = complex(modes.poles[mode]), modes.shapes[:, mode]
    K, C, H = (point.by_frequency(kind) @ psi for kind in ("stiffness", "viscous", "hysteretic"))  # type: ignore[arg-type]

    def to_hz(eigenvalue: complex) -> tuple[float, complex]:
        size = abs(eigenvalue)
        return size / _TWO_PI, np.conj(eigenvalue) / (_TWO_PI * size) if size else 0.0

    slope = -complex(psi @ (K + 1j * H + pole * C))
    return _Frozen(pole, psi, slope, lambda: mean_pole_derivative(modes, [mode]), to_hz)


def _iterated(point: ModelPoint, mode: int, solve: Callable[[ModelPoint], _Frozen]) -> OwnFrequencyMode:
    """Newton's method on f_j(f) − f, from the mode of the matrices at 0 Hz."""
    freq, change = 0.0, np.inf
    for iteration in range(1, _MOST + 1):
        found = solve(point.at_frequency(freq))
        rate = float(found.in_hz(found.by_frequency))
        if change <= _SAME * max(found.freq_hz, freq):
            return _at_own_frequency(mode, found, rate, iteration)
        # a rate of one or more has no solution nearby: the fixed point's own step is taken
        step = (found.freq_hz - freq) / (1.0 - rate if rate < _STEEP else 1.0)
        freq, change = max(freq + step, 0.0), abs(step)
    raise FemtuneError("table.own-frequency", mode=mode + 1, reason=f"no convergence after {_MOST} solutions")


def _at_own_frequency(mode: int, found: _Frozen, rate: float, iterations: int) -> OwnFrequencyMode:
    if rate >= _STEEP:
        reason = f"its natural frequency rises by {rate:.3g} Hz per Hz of the table"
        raise FemtuneError("table.own-frequency", mode=mode + 1, reason=reason)
    own = found.by_parameters()
    freq_gradient = found.in_hz(own) / (1.0 - rate)
    gradient = own + found.by_frequency * freq_gradient
    return OwnFrequencyMode(mode, found.freq_hz, found.eigenvalue, gradient, found.shape, iterations)
