"""FRFs of a live model: some of its modes, and what all others respond.

H(ω) = Σ_r (c φ_r)(b φ_r)/(λ_r (1 + iη) − ω² + i d_r) + (R₀ + (ω² − σ) R₁)/(1 + iη), with the damping d_r = 2ζωω_r, or
2ζλ_r where it is an imaginary stiffness. R₀ and R₁ are what the modes miss of c A⁻¹b and c A⁻¹MA⁻¹b, A = K − σM: the
other modes respond far below their frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Complexes, Reals
from femtune.modal.frf_set import KINDS
from femtune.modal.kinds import FrfKind
from femtune.model.live.matrices import STILL, LiveModel


@dataclass(frozen=True, eq=False)
class LiveDamping:
    """Damping of the modes of a live model.

    Parameters
    ----------
    ratios : damping ratios by mode, the last one also of those above; with `freq_hz` a table over natural frequencies
    freq_hz : ascending; empty where the ratios are those of modes. Beyond its ends the table stays as it is there
    hysteretic : whether the damping of a mode is an imaginary stiffness
    loss_factor : η of the whole stiffness
    """

    ratios: Reals
    freq_hz: Reals = field(default_factory=lambda: np.zeros(0))
    hysteretic: bool = False
    loss_factor: float = 0.0

    def ratio(self, freq_hz: Reals) -> Reals:
        """(m,) of the first m modes with the natural frequencies (m,)."""
        if len(self.freq_hz):
            return np.interp(freq_hz, self.freq_hz, self.ratios)
        return np.asarray(self.ratios[np.minimum(np.arange(len(freq_hz)), len(self.ratios) - 1)])

    def slope(self, freq_hz: Reals) -> Reals:
        """(m,) zeros: nothing is derived from these functions."""
        return np.zeros(len(freq_hz))


@dataclass(frozen=True, eq=False)
class LivePorts:
    """Functions of a live model.

    Parameters
    ----------
    outputs, inputs : (o, q), (i, q) rows that see motions and take forces
    freq_hz : (l,) lines
    count : modes that are superposed
    """

    kind: FrfKind
    outputs: Reals
    inputs: Reals
    freq_hz: Reals
    count: int
    damping: LiveDamping

    def values(self, model: LiveModel, x: NDArray) -> Complexes:
        """(o, i, l) at normalised parameters; errors as `LiveModel.modes`."""
        modes = model.modes(x, count=self.count)
        stiff, mass = model.matrices(x)
        seen, driven = self.outputs @ modes.shapes, self.inputs @ modes.shapes
        above = modes.eigenvalues - model.shift
        static = la.cho_solve(la.cho_factor(stiff), self.inputs.T)
        inertia = la.cho_solve(la.cho_factor(stiff), mass @ static)
        missed = self.outputs @ static - (seen / above) @ driven.T
        second = self.outputs @ inertia - (seen / above**2) @ driven.T
        rigid = modes.eigenvalues < STILL * abs(model.shift)
        values = np.where(rigid, 0.0, modes.eigenvalues)
        ratios = np.where(rigid, 0.0, self.damping.ratio(np.sqrt(values) / (2.0 * np.pi)))
        omega, loss = 2.0 * np.pi * self.freq_hz, 1.0 + 1j * self.damping.loss_factor
        damped = 2.0 * ratios * (values if self.damping.hysteretic else np.sqrt(values))
        rates = damped[:, None] if self.damping.hysteretic else damped[:, None] * omega
        denominators = loss * values[:, None] - omega**2 + 1j * rates
        found = np.einsum("or,ir,rl->oil", seen, driven, 1.0 / denominators, optimize=True)
        found += (missed[..., None] + second[..., None] * (omega**2 - model.shift)) / loss
        return np.asarray(found * (1j * omega) ** KINDS.index(self.kind))
