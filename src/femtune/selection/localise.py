"""Error localisation by expansion: minimum dynamic residual (MDRE).

A measured mode (ω, ψ at sensors C) is expanded to the φ that the model finds easiest to believe: the load
(K − ω²M)φ that it would take, measured by the strain energy rᵀKr of the displacement r = K⁻¹(K − ω²M)φ that it
causes, is least among all φ that repeat the measurement within its noise. Where the model is right that energy is
nothing; where it is wrong the energy gathers at the elements that are.

The expansion is that of `femtune.correlation.expansion`.

Sources: Chouaki, Ladevèze and Proslier (1998); Balmès (2000).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.correlation import minimum_residual
from femtune.errors import FemtuneError
from femtune.model import EigenSolution
from femtune.model.solvers.interface import SingularMatrixError
from femtune.selection.energies import element_energies


@dataclass(frozen=True)
class ResidualEnergy:
    """Places where a measured mode contradicts the model.

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
    try:
        expansion = minimum_residual(solution, C, freq_hz, noise)
    except SingularMatrixError as problem:
        raise _no_expansion("the dynamic stiffness is singular at the measured frequency") from problem
    f, K = expansion.coefficients(psi), expansion.stiffness
    r, phi = expansion.static @ f, expansion.vectors @ f
    misfit = float(np.linalg.norm(psi - C @ phi) / np.linalg.norm(psi))
    shares, strain = (_in_groups(solution, v, groups) for v in (r, phi))
    # measured in K alone: what the shift of a free structure adds has no place in an element
    whole, elements = float(shares.sum()), float(strain.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        density = np.where(strain > 1e-12 * elements, shares / strain, np.nan)
    error = float(np.sqrt(r @ (K @ r) / (phi @ (K @ phi))))
    return ResidualEnergy(tuple(groups), shares / (whole or 1.0), density, error, misfit, phi)


def _in_groups(solution: EigenSolution, vector: Reals, groups: Mapping[str, Iterable[int]]) -> Reals:
    numbers, energies = element_energies(solution.point, "stiffness", vector[:, None])
    return np.array([energies[np.isin(numbers, list(members))].sum() for members in groups.values()])


def _no_expansion(why: str) -> FemtuneError:
    return FemtuneError("select.expansion", reason=why)
