"""Effect of the noise of measured shapes on MAC and orthogonality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals


@dataclass(frozen=True)
class NoiseShare:
    """Loss 1 − MAC of one pair beside the loss that noise alone gives on average.

    Parameters
    ----------
    loss : 1 − MAC as compared
    expected : mean loss from independent noise of the known standard deviations
    limit : mean plus two standard deviations: a loss below it is no evidence against the model
    """

    loss: float
    expected: float
    limit: float

    @property
    def explains(self) -> bool:
        """True if noise alone could explain the loss."""
        return self.loss <= self.limit

    def __str__(self) -> str:
        if self.explains:
            return f"noise alone could explain the MAC loss of {self.loss:.2g} (expected {self.expected:.2g})"
        return f"noise explains {self.expected:.2g} of the MAC loss of {self.loss:.2g}"


def noise_share(mac_value: float, shape: NDArray, shape_sd: Reals) -> NoiseShare:
    """Noise's part of a MAC loss.

    With independent noise of standard deviation σ_k at entry k of a shape ψ, only its part across ψ lowers the
    MAC: to second order 1 − MAC ≈ Σ σ_k² (1 − |ψ_k|²/|ψ|²) / |ψ|², with variance 2 Σ (σ_k²/|ψ|²)² for real noise.

    Parameters
    ----------
    shape, shape_sd : (n,) measured entries and their standard deviations; NaN entries are left out
    """
    known = ~(np.isnan(shape) | np.isnan(shape_sd))
    power = np.abs(shape[known]) ** 2
    total = power.sum()
    across = shape_sd[known] ** 2 * (1.0 - power / total) / total
    mean, spread = float(across.sum()), float(np.sqrt(2.0 * np.sum(across**2)))
    ceiling = mean + 2.0 * spread
    # noise as large as the shape itself: the loss v turns into v/(1 + v)
    return NoiseShare(1.0 - mac_value, mean / (1.0 + mean), ceiling / (1.0 + ceiling))


def orthogonality_noise(psi: NDArray, phi: Reals, sd: Reals, mass: Reals) -> tuple[Reals, Reals]:
    """Standard deviations of cross- and self-orthogonality due to noise of the test shapes, to first order.

    With c = (ψᵀMψ)^-½ and φ of unit modal mass, an entry cψ_iᵀMφ_j has the standard deviation c_i √((Mφ_j)ᵀΣ_i(Mφ_j))
    with Σ_i = diag(σ_i²); an entry of the self-orthogonality by both of its shapes. On the diagonal noise takes
    ½ c_i² Σ_k σ_ik² (M_kk − (Mφ_i)_k²) from the one of the cross-orthogonality, on average and to second order.

    Parameters
    ----------
    psi, phi : (n, p) paired shapes
    sd : (n, p) standard deviations of psi
    mass : (n, n) symmetric

    Returns
    -------
    two matrices (p, p) of standard deviations; on the diagonal of the first is the mean loss, that of the second means
    nothing
    """
    unit_test, unit_model = _unit_mass(psi, mass), _unit_mass(phi, mass)
    scale = 1.0 / np.sqrt(np.einsum("ni,nm,mi->i", psi.conj(), mass, psi).real)
    variance = (sd * scale) ** 2
    cross = variance.T @ np.abs(mass @ unit_model) ** 2
    test_variance = variance.T @ np.abs(mass @ unit_test) ** 2
    total = np.sum(variance * np.diag(mass)[:, None], axis=0)
    spread = np.sqrt(cross)
    np.fill_diagonal(spread, 0.5 * np.maximum(total - np.diag(cross), 0.0))
    return spread, np.sqrt(test_variance + test_variance.T)


def _unit_mass(shapes: NDArray, mass: Reals) -> NDArray:
    return shapes / np.sqrt(np.einsum("ni,nm,mi->i", shapes.conj(), mass, shapes).real)
