"""Functions of frequency that the modal model is a sum of, and their derivatives by the poles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.modal.frf_set import KINDS

Reals = NDArray[np.float64]
Complex = NDArray[np.complex128]

OUT_OF_BAND = ("lower", "upper")
"""Real terms for what lies outside the band: a mass below it, a stiffness above it."""


@dataclass(frozen=True, eq=False)
class Basis:
    """Columns of H(ω) = (iω)^d [Σ_r R_r/(iω − λ_r) + R̄_r/(iω − λ̄_r) + L/(iω)² + U].

    Parameters
    ----------
    columns : (k, 2m + terms) complex; those of Re R of every pole, then those of Im R, then the terms
    slopes : (k, 4m) derivatives by Re λ of the columns of Re R and of Im R, then those by Im λ
    """

    columns: NDArray
    slopes: NDArray


def modal_basis(freq_hz: Reals, poles: Complex, kind: str, terms: tuple[str, ...] = OUT_OF_BAND) -> Basis:
    """The columns at frequency lines.

    Parameters
    ----------
    freq_hz : (k,) above 0
    poles : (m,) in rad/s, upper half plane
    kind : of the functions
    terms : names out of OUT_OF_BAND
    """
    i_omega = 2j * np.pi * freq_hz[:, None]
    factor = i_omega ** KINDS.index(kind)
    up, down = 1.0 / (i_omega - poles), 1.0 / (i_omega - poles.conj())
    columns = [up + down, 1j * (up - down)]
    columns += [{"lower": i_omega**-2, "upper": np.ones_like(i_omega)}[name] for name in terms]
    a, b = up**2, down**2
    slopes = [a + b, 1j * (a - b), 1j * (a - b), -(a + b)]
    return Basis(factor * np.hstack(columns), factor * np.hstack(slopes))


def real_rows(values: NDArray) -> Reals:
    """Real parts above imaginary parts, (2k, …)."""
    return np.concatenate([values.real, values.imag])
