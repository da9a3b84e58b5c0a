"""Equal damping: poles of a state-space model moved to one damping ratio, and frequency lines for the comparison.

A model of unknown damping and a test of uneven damping are compared after both have been given one damping ratio ζ. A
pole λ becomes λ′ = |λ|(−ζ + i√(1 − ζ²)): its natural frequency is unchanged. A mode of the receptance with the real
shape φ has the residue φφᵀ/(λ − λ̄) at its pole, and λ^k φφᵀ/(λ − λ̄) for mobility (k = 1) and accelerance (k = 2),
with a direct term that does not depend on the damping. Residues are therefore multiplied by the ratio of these factors
at λ′ and λ, so that the equalised model of a system with real shapes is that system with the damping ratio ζ, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal.frf_set import KINDS
from femtune.modal.state_space import StateSpace, freq_and_damping, pole_of, system_modes

LARGEST_DAMPING_RATIO = 0.5
"""Damping ratio from which on a pole is not a mode.

Structures have less than 0.1; larger ratios belong to real or nearly real poles that a fit adds for other effects.
"""
_COUNT_ROUNDING = 1e-9
"""Rounding error that is subtracted before a number of lines is rounded up, so that exact multiples stay."""

Band = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Equalised:
    """A system with one damping ratio inside a band.

    Parameters
    ----------
    system : in real modal form
    freq_hz, damping_ratio : (m,) of the moved poles, before the move, ascending
    """

    system: StateSpace
    freq_hz: Reals
    damping_ratio: Reals


def equalise_damping(
    system: StateSpace, damping_ratio: float, band_hz: Band, left_out_hz: Sequence[Band] = ()
) -> Equalised:
    """Move the poles inside a band to one damping ratio.

    Poles outside are not changed: rigid-body poles, and residual poles, which represent modes outside the band. Nor are
    real and nearly real poles, and those in bands that are left out.

    Parameters
    ----------
    system : of continuous time, with distinct poles inside the band
    damping_ratio : ζ, above 0 and below 1
    band_hz : natural frequencies that are moved
    left_out_hz : bands inside it whose poles stay

    Raises
    ------
    FemtuneError : ``system.equalise``

    Examples
    --------
    >>> from femtune.dofs import DofSet, parse_dof
    >>> one = DofSet([parse_dof("1X+")])
    >>> A = np.array([[0.0, 1.0], [-1e4, -2.0]])
    >>> B, C, D = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
    >>> equal = equalise_damping(StateSpace(A, B, C, D, one, one, "receptance"), 0.02, (1.0, 100.0))
    >>> freq_and_damping(equal.system.poles())[1].round(9).tolist(), equal.damping_ratio.round(9).tolist()
    ([0.02, 0.02], [0.01])
    """
    if system.sampling_hz is not None:
        raise FemtuneError("system.equalise/sampled")
    if not 0.0 < damping_ratio < 1.0:
        raise FemtuneError("system.equalise/ratio", ratio=damping_ratio)
    poles, shapes, participations = system_modes(system)
    hertz, zeta = freq_and_damping(poles)
    upper = np.flatnonzero(poles_to_move(poles, band_hz, left_out_hz))
    pairs = [_conjugate_of(poles, int(j)) for j in upper]
    to = pole_of(hertz[upper], np.full(len(upper), damping_ratio))
    factor = residue_factors(poles[upper], to, system.kind)
    # the rest of the system is an invariant subspace; it need not be diagonalisable
    stays = np.setdiff1d(np.arange(len(poles)), np.concatenate([upper, pairs]).astype(int))
    rest = _real_part(system, poles, stays)
    moved_part = _real_modes(to, shapes[:, upper], factor[:, None] * participations[upper])
    A, B, C = (_joined(a, b, way) for a, b, way in zip(rest, moved_part, ("both", "rows", "columns")))
    order = np.argsort(hertz[upper])
    return Equalised(
        replace(system, A=A, B=B, C=C, source=f"{system.source}, damping ratio {damping_ratio:g}".lstrip(", ")),
        hertz[upper][order], zeta[upper][order],
    )  # fmt: skip


def poles_to_move(poles: Complexes, band_hz: Band, left_out_hz: Sequence[Band] = ()) -> NDArray[np.bool_]:
    """(m,) True for the poles that get the damping ratio, one of each conjugate pair."""
    hertz, zeta = freq_and_damping(poles)
    moved = (poles.imag > 0.0) & (zeta < LARGEST_DAMPING_RATIO) & _inside(hertz, band_hz)
    for band in left_out_hz:
        moved &= ~_inside(hertz, band)
    return np.asarray(moved)


def _inside(hertz: Reals, band: Band) -> NDArray[np.bool_]:
    return np.asarray((hertz >= band[0]) & (hertz <= band[1]))


def _conjugate_of(poles: Complexes, j: int) -> int:
    return int(np.argmin(np.abs(poles - poles[j].conj())))


def residue_factors(poles: Complexes, to: Complexes, kind: str) -> Complexes:
    """(m,) factors of the residues of FRFs of a kind when poles are moved."""
    k = KINDS.index(kind)
    return np.asarray((to / poles) ** k * (poles.imag / to.imag))


def _real_part(system: StateSpace, poles: Complexes, stays: NDArray[np.int64]) -> tuple[Reals, Reals, Reals]:
    """A, B and C on the invariant subspace of some poles."""
    if not len(stays):
        n, y, u = 0, len(system.responses), len(system.references)
        return np.zeros((n, n)), np.zeros((n, u)), np.zeros((y, n))
    values, right = np.linalg.eig(system.A)
    if len(stays) == len(values):
        return np.asarray(system.A), np.asarray(system.B), np.asarray(system.C)
    left = np.linalg.inv(right)
    V, W = right[:, stays], left[stays]
    # a real basis: real and imaginary parts span the same space as conjugates
    Q = np.linalg.svd(np.hstack([V.real, V.imag]), full_matrices=False)[0][:, : len(stays)]
    project = (V @ W).real
    return Q.T @ system.A @ project @ Q, Q.T @ project @ system.B, system.C @ Q


def _real_modes(poles: Complexes, shapes: Complexes, participations: Complexes) -> tuple[Reals, Reals, Reals]:
    """State x = (Re ξ, Im ξ) of ξ̇ = λξ + wᵀu, y = 2 Re ψξ."""
    m = len(poles)
    A = np.zeros((2 * m, 2 * m))
    even, odd = np.arange(0, 2 * m, 2), np.arange(1, 2 * m, 2)
    A[even, even] = A[odd, odd] = poles.real
    A[even, odd], A[odd, even] = -poles.imag, poles.imag
    B, C = np.zeros((2 * m, participations.shape[1])), np.zeros((len(shapes), 2 * m))
    B[even], B[odd] = participations.real, participations.imag
    C[:, even], C[:, odd] = 2.0 * shapes.real, -2.0 * shapes.imag
    return A, B, C


def _joined(a: Reals, b: Reals, way: str) -> Reals:
    if way == "both":
        return np.block([[a, np.zeros((len(a), len(b)))], [np.zeros((len(b), len(a))), b]])
    return np.vstack([a, b]) if way == "rows" else np.hstack([a, b])


MOST_LINES = 100_000
"""Largest number of frequency lines; with 100 responses and 10 inputs, complex values take 1.6 GB."""


def half_band_lines(
    band_hz: Band, damping_ratio: float, per_half_band: float = 3.0, left_out_hz: Sequence[Band] = ()
) -> Reals:
    """(k,) lines of a band with a constant ratio, `per_half_band` of them in a half-power bandwidth 2ζf.

    Parameters
    ----------
    left_out_hz : bands without lines

    Raises
    ------
    FemtuneError : ``system.equalise``

    Examples
    --------
    >>> half_band_lines((100.0, 101.0), 0.01, 2.0).round(3).tolist()
    [100.0, 101.0]
    """
    if not 0.0 < damping_ratio < 1.0:
        raise FemtuneError("system.equalise/ratio", ratio=damping_ratio)
    low, high = band_hz
    count = int(np.ceil(per_half_band * np.log(high / low) / (2.0 * damping_ratio) - _COUNT_ROUNDING)) + 1
    if count > MOST_LINES:
        raise FemtuneError("system.equalise/too-many-lines", lines=f"{count:,}", most=f"{MOST_LINES:,}")
    lines = np.geomspace(low, high, max(count, 2))
    for band in left_out_hz:
        lines = lines[~_inside(lines, band)]
    return lines
