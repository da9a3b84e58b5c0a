"""Error localisation by expansion: minimum dynamic residual (MDRE).

A measured mode (ω, ψ at sensors C) is expanded to the φ that the model finds easiest to believe: the load
(K − ω²M)φ that it would take, measured by the strain energy rᵀKr of the displacement r = K⁻¹(K − ω²M)φ that it
causes, is least among all φ that repeat the measurement within its noise. Where the model is right that energy is
nothing; where it is wrong the energy gathers at the elements that are.

With Z = K − ω²M and X = Z⁻¹Cᵀ every solution is r = X f, φ = Z⁻¹K r, and the misfit ψ − Cφ = (I + γS)⁻¹ψ with
S = XᵀKX, so that one factorisation serves for any weight γ. γ is the largest at which the misfit is the noise.

Sources: Chouaki, Ladevèze and Proslier (1998); Balmès (2000).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq
from scipy.sparse.linalg import splu

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model import EigenSolution
from femtune.selection.energies import element_energies

_OFF_RESONANCE, _RIGID = 1e-9, 1e-8


@dataclass(frozen=True)
class ResidualEnergy:
    """Where a measured mode contradicts the model.

    Parameters
    ----------
    groups : names of g groups of elements
    share : (g,) part of the residual's strain energy in each
    density : (g,) residual energy by the strain energy of the expanded mode in the same elements: how wrong, not how
        large; NaN where the mode does not strain them
    error : √(rᵀKr/φᵀKφ), zero where the model repeats the mode
    misfit : |ψ − Cφ|/|ψ| at the sensors
    expanded : (n_free,) φ
    """

    groups: tuple[str, ...]
    share: Reals
    density: Reals
    error: float
    misfit: float
    expanded: Reals


def residual_energy(
    solution: EigenSolution, sensors: sp.csr_array, shape: Reals, freq_hz: float,
    groups: Mapping[str, Iterable[int]], noise: float = 0.01,
) -> ResidualEnergy:  # fmt: skip
    """Expand one measured mode and map the energy of its residual.

    Parameters
    ----------
    solution : of the model; its shift makes K positive definite where the structure is free
    sensors : (s, n_free)
    shape : (s,) real, in any scale; NaN where it was not measured
    groups : element numbers by name
    noise : |ψ − Cφ|/|ψ| that the measurement may have, above 0 and below 1

    Raises
    ------
    FemtuneError : ``select.expansion`` where nothing was measured, the noise makes no sense, or Z is singular
    """
    known = np.isfinite(shape)
    if not known.any() or not np.any(shape[known]) or not 0.0 < noise < 1.0:
        raise _no_expansion("the shape has no measured entry, or the noise is not between 0 and 1")
    psi, C = shape[known], sp.csr_array(sensors[np.flatnonzero(known)])
    X, phi_of, K = _responses(solution, C, (2.0 * np.pi * freq_hz) ** 2)
    f = _forces(X.T @ (K @ X), psi, noise)
    r = X @ f
    phi = phi_of(r)
    misfit = float(np.linalg.norm(psi - C @ phi) / np.linalg.norm(psi))
    shares, strain = (_in_groups(solution, v, groups) for v in (r, phi))
    # measured in K alone: what the shift of a free structure adds has no place in an element
    whole, own = float(shares.sum()), float(strain.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        density = np.where(strain > 1e-12 * own, shares / strain, np.nan)
    error = float(np.sqrt(r @ (K @ r) / (phi @ (K @ phi))))
    return ResidualEnergy(tuple(groups), shares / (whole or 1.0), density, error, misfit, phi)


def _responses(solution: EigenSolution, C: sp.csr_array, eigenvalue: float) -> tuple:
    """X = Z⁻¹Cᵀ (n, s), the map r ↦ Z⁻¹K r, and K; of a free structure K − σM in its place, which is definite."""
    point, values = solution.point, solution.eigenvalues
    shift = 0.0 if values[0] > _RIGID * values.max() else min(solution.shift, 0.0)
    K = sp.csc_array(point.stiffness - shift * point.mass)
    near = np.abs(solution.eigenvalues - eigenvalue).min(initial=np.inf) <= _OFF_RESONANCE * eigenvalue
    Z = sp.csc_array(point.stiffness - eigenvalue * (1.0 + _OFF_RESONANCE * 10 * near) * point.mass)
    try:
        factor = splu(Z)
    except RuntimeError as error:
        raise _no_expansion("the dynamic stiffness is singular at the measured frequency") from error
    return factor.solve(C.toarray().T), lambda r: factor.solve(K @ r), K


def _forces(S: Reals, psi: Reals, noise: float) -> Reals:
    """f = γ(I + γS)⁻¹ψ with |(I + γS)⁻¹ψ| = noise·|ψ|."""
    values, vectors = np.linalg.eigh(0.5 * (S + S.T))
    values = np.maximum(values, 0.0)
    inside = vectors.T @ (psi / np.linalg.norm(psi))

    def excess(log_weight: float) -> float:
        return float(np.linalg.norm(inside / (1.0 + np.exp(log_weight) * values))) - noise

    low, high = (np.log(1e-6 / values.max()), np.log(1e16 / values.max()))
    weight = np.exp(brentq(excess, low, high)) if excess(high) < 0.0 else np.exp(high)
    return np.asarray(vectors @ (weight * (vectors.T @ psi) / (1.0 + weight * values)))


def _in_groups(solution: EigenSolution, vector: Reals, groups: Mapping[str, Iterable[int]]) -> Reals:
    numbers, energies = element_energies(solution.point, "stiffness", vector[:, None])
    return np.array([energies[np.isin(numbers, list(members))].sum() for members in groups.values()])


def _no_expansion(why: str) -> FemtuneError:
    return FemtuneError("select.expansion", reason=why)
