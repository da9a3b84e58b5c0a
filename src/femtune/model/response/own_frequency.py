"""Complex modes of a model whose stiffness or damping depends on frequency, each at its own frequency |λ|/2π."""

from __future__ import annotations

import numpy as np

from femtune.model.configured import ModelPoint
from femtune.model.eigen.own_frequency import TWO_PI, AtFrequency, OwnFrequencyMode, at_own_frequency
from femtune.model.eigen.solution import solve_modes
from femtune.model.response.complex_derivatives import mean_pole_derivative
from femtune.model.response.complex_eigen import complex_modes


def complex_modes_at_own_frequency(point: ModelPoint, count: int) -> list[OwnFrequencyMode]:
    """Complex modes, each with stiffness and damping at |λ|/2π, in the order of |λ| at that frequency.

    Raises
    ------
    FemtuneError : ``table.own-frequency``, and as `complex_modes`
    """
    out: list[OwnFrequencyMode] = []
    for mode in range(count):
        start_hz = out[-1].freq_hz if out else 0.0
        solved, n = at_own_frequency(point, mode, lambda at, mode=mode: _complex(at, mode), start_hz)  # type: ignore[misc]
        out.append(solved.own(mode, n))
    return out


def _complex(point: ModelPoint, mode: int) -> AtFrequency:
    modes = complex_modes(solve_modes(point, mode + 1), mode + 1)
    pole, psi = complex(modes.poles[mode]), modes.shapes[:, mode]
    K, C, H = (point.by_frequency(kind) @ psi for kind in ("stiffness", "viscous", "hysteretic"))
    slope, size = -complex(psi @ (K + 1j * H + pole * C)), abs(pole)
    in_hz = np.conj(pole) / (TWO_PI * size) if size else 0.0
    return AtFrequency(pole, psi, slope, lambda: mean_pole_derivative(modes, [mode]), size / TWO_PI, in_hz)
