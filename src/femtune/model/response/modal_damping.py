"""Modal damping as a matrix of low rank, MΦ diag(rates) ΦᵀM, and its derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem.structure import ALL_MODES
from femtune.model.configured import ModelPoint
from femtune.model.derivatives.chosen import subspace_derivative
from femtune.model.derivatives.modes import SubspaceDerivative
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.rigid import is_rigid
from femtune.parameters.jet import Jet

_EQUAL = 1e-6
"""Relative difference of eigenvalues below which the quotient of differences has lost too many digits: the mean slope,
whose error is of second order in the difference, is more accurate."""


class DampingRatios(Protocol):
    """Damping of modes by their frequencies, such as `femtune.model.damping.ModalDamping`."""

    @property
    def hysteretic(self) -> bool:
        """True where a mode's damping is an imaginary stiffness 2ζλ instead of a viscous 2ζω."""

    def ratio(self, freq_hz: Reals) -> Reals:
        """(m,) fractions of critical of the first m modes with the natural frequencies (m,)."""

    def slope(self, freq_hz: Reals) -> Reals:
        """(m,) their derivatives by the natural frequencies, 1/Hz."""


@dataclass(frozen=True, eq=False)
class ModalDamper:
    """s MΦ diag(rates) ΦᵀM, or i MΦ diag(rates) ΦᵀM where it is hysteretic, to be added to a dynamic stiffness.

    Parameters
    ----------
    modes : the modes that are damped are its wanted ones; rigid-body modes have the rate 0
    rates : (m,) 2ζω in rad/s, or 2ζλ where it is hysteretic
    slopes : (m,) derivative of the rates by λ
    momentum : MΦ (n_free, m)
    gradients : (m, p) derivatives of the rates by the parameters while the modes stay
    """

    modes: EigenSolution
    hysteretic: bool
    rates: Reals
    slopes: Reals
    momentum: Reals
    gradients: Reals

    def weights(self, s: complex) -> NDArray:
        """(m,) factors of the modes at the frequency s."""
        return 1j * self.rates if self.hysteretic else self.rates * (s.real if s.imag == 0.0 else s)

    def times(self, x: NDArray) -> NDArray:
        """MΦ diag(rates) ΦᵀM x."""
        return np.asarray(self.momentum @ ((self.momentum.T @ x).T * self.rates).T)

    @cached_property
    def _subspace(self) -> SubspaceDerivative:
        return subspace_derivative(self.modes, range(len(self.rates)))

    def derivative_times(self, i: int, x: NDArray) -> NDArray:
        """D′x by parameter i, D = MPM with P = Φ diag(rates)Φᵀ.

        Inside the damped modes P′ follows from divided differences, so that close and repeated modes do no harm
        (Daleckii and Krein's formula); outside them it follows from Φ′.
        """
        point, phi = self.modes.point, self.modes.shapes[:, : len(self.rates)]
        outside = self._subspace.outside[:, :, i]
        driven = (self.momentum.T @ x).T * self.rates
        pushed = point.mass_derivatives[i] @ (phi @ driven.T) + point.mass @ (outside @ driven.T)
        felt = phi.T @ (point.mass_derivatives[i] @ x) + outside.T @ (point.mass @ x)
        inside = self._inside(i) + np.diag(self.gradients[:, i])
        inner = (felt.T * self.rates).T + inside @ (self.momentum.T @ x)
        return np.asarray(pushed + self.momentum @ inner)

    def _inside(self, i: int) -> Reals:
        eigenvalues = self.modes.eigenvalues[: len(self.rates)]
        d, slope = self.rates, self.slopes
        by_stiffness = divided(eigenvalues, d, slope) * self._subspace.stiffness[i]
        return np.asarray(
            by_stiffness - divided(eigenvalues, d * eigenvalues, d + slope * eigenvalues) * self._subspace.mass[i]
        )


def divided(at: Reals, values: Reals, slopes: Reals) -> Reals:
    """(v_i − v_j)/(a_i − a_j), the mean slope where a_i = a_j but for what would cost the quotient its digits."""
    gap = at[:, None] - at[None, :]
    same = np.abs(gap) <= _EQUAL * np.maximum(np.abs(at[:, None]), np.abs(at[None, :]))
    mean = 0.5 * (slopes[:, None] + slopes[None, :])
    return np.where(same, mean, (values[:, None] - values[None, :]) / np.where(same, 1.0, gap))


@dataclass(frozen=True, eq=False)
class ModalRates:
    """What damps modes: s·rates, or i·rates where it is hysteretic; see `ModalDamper`."""

    hysteretic: bool
    rates: Reals
    slopes: Reals
    gradients: Reals


def modal_damper(modes: EigenSolution, damping: DampingRatios | None) -> ModalDamper | None:
    """The damper of the wanted modes of a solution; None without modal damping. Errors as `modal_rates`."""
    model_ratios, m, p = modes.point.mode_ratios, modes.wanted, modes.point.n_parameters
    if damping is None and not model_ratios:
        return None
    of = modal_rates(modes.eigenvalues[:m], is_rigid(modes)[:m], damping, model_ratios, p)
    momentum = np.asarray(modes.point.mass @ modes.shapes[:, :m])
    return ModalDamper(modes, of.hysteretic, of.rates, of.slopes, momentum, of.gradients)


def modal_rates(
    eigenvalues: Reals, rigid: NDArray[np.bool_], damping: DampingRatios | None, model_ratios: Mapping[int, Jet], p: int
) -> ModalRates:
    """The damping of modes with the eigenvalues (m,).

    Ratios that are values of the model, `model_ratios`, take the place of those of `damping` for their modes.

    Raises
    ------
    FemtuneError : ``response.damping-ratio`` for ratios not finite or negative, and what the damping raises
    """
    m = len(eigenvalues)
    eigenvalues = np.where(rigid, 0.0, eigenvalues)
    omega = np.sqrt(eigenvalues)
    freq_hz = omega / (2.0 * np.pi)
    # a rigid-body mode has no damping whatever its ratio: a table need not reach to 0 Hz
    asked = np.where(rigid, freq_hz.max(initial=0.0), freq_hz)
    zeta, slope, gradient = _ratios(model_ratios, damping, asked, p)
    zeta = _checked(np.where(rigid, 0.0, zeta), freq_hz)
    rise = np.where(rigid, 0.0, asked * slope)
    # by λ = ω²; `rise` is ω dζ/dω
    hysteretic = damping is not None and damping.hysteretic
    viscous_slopes = np.divide(zeta + rise, omega, out=np.zeros(m), where=~rigid)
    slopes = 2.0 * zeta + rise if hysteretic else viscous_slopes
    size = 2.0 * (eigenvalues if hysteretic else omega)
    return ModalRates(hysteretic, size * zeta, slopes, size[:, None] * gradient)


def _ratios(
    model_ratios: Mapping[int, Jet], damping: DampingRatios | None, freq_hz: Reals, p: int
) -> tuple[Reals, ...]:
    """Ratios (m,), their slopes by frequency (m,) and their derivatives by the parameters (m, p)."""
    m = len(freq_hz)
    zeta = np.zeros(m) if damping is None else np.array(damping.ratio(freq_hz), float)
    slope = np.zeros(m) if damping is None else np.array(damping.slope(freq_hz), float)
    gradient = np.zeros((m, p))
    # all modes first, then those with a ratio of their own
    for number, ratio in sorted(model_ratios.items()):
        at = slice(None) if number == ALL_MODES else slice(number - 1, number)
        zeta[at], slope[at], gradient[at] = ratio.value, 0.0, ratio.grad
    return zeta, slope, gradient


def _checked(ratios: Reals, freq_hz: Reals) -> Reals:
    bad = ~(np.isfinite(ratios) & (ratios >= 0.0))
    if bad.any():
        raise FemtuneError(
            "response.damping-ratio",
            values={"frequency (Hz)": f"{freq_hz[bad][0]:.6g}", "ratio": f"{ratios[bad][0]:.6g}"},
        )
    return ratios


# ----------------------------------------------------------------------------------------------------
# Whether damping is proportional (classical), so that the complex modes have the shapes of the real ones.
#
# Source: T. K. Caughey, M. E. J. O'Kelly, Journal of Applied Mechanics 32 (1965).


_PROPORTIONAL = 1e-7
"""Coupling of a mode by damping, relative to the largest damping force, that is rounding of proportional damping."""


def is_proportional(modes: EigenSolution) -> bool:
    """True where dashpots and loss factors couple none of the wanted modes with any other motion.

    Then Cφ = cMφ for each: what is left is measured as energy, against the largest Cφ. Modal damping never couples.
    """
    point = modes.point
    return all(_keeps(modes, A) for A in (point.viscous, point.hysteretic) if np.any(A.data))


def _keeps(modes: EigenSolution, damping: sp.csr_array) -> bool:
    phi = modes.shapes[:, : modes.wanted]
    forces, inertia = np.asarray(damping @ phi), np.asarray(modes.point.mass @ phi)
    # close modes are one subspace, in which damping may turn the vectors
    left = forces - inertia @ _near(modes, phi.T @ forces)
    return bool(_energy(modes, left).max() <= _PROPORTIONAL**2 * _energy(modes, forces).max())


def _near(modes: EigenSolution, coupling: NDArray[np.float64]) -> NDArray[np.float64]:
    """The coupling of modes that coincide."""
    values = modes.eigenvalues[: len(coupling)]
    apart = np.abs(values[:, None] - values) > _PROPORTIONAL * (abs(modes.shift) + np.abs(values))
    return np.where(apart, 0.0, coupling)


def _energy(modes: EigenSolution, forces: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(np.einsum("ij,ij->j", forces, modes.factor.solve(forces)))


def may_be_negative(point: ModelPoint) -> bool:
    """True where a dashpot or a loss factor is below zero on the diagonal of its matrix."""
    return any(bool((A.diagonal() < 0.0).any()) for A in (point.viscous, point.hysteretic))
