"""Poly-reference least-squares complex frequency domain (pLSCF) identification of poles, for any lines.

The functions are a right matrix fraction H(z) = B(z) A(z)⁻¹ with complex coefficients in z = e^{iωT + iα}, where T and
α carry the band to most of the unit circle, so that powers of z stay nearly orthogonal. The numerators are eliminated;
of the denominator the coefficient of the lowest power is the identity, which puts computational poles outside the
circle: they grow, and thus can be distinguished from those of the structure. The price is that noise lowers the damping
of all poles at low orders.

Sources: P. Guillaume et al. (2003), A poly-reference implementation of the least-squares complex frequency-domain
estimator, Proc. IMAC 21; B. Cauberghe et al. (2005), On the influence of the parameter constraint on the stability of
the poles and the discrimination capabilities of the stabilisation diagrams, Mechanical Systems and Signal Processing
19.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from femtune.arrays import Complexes, Reals
from femtune.identification.join import complete_lines, enough_lines, line_weights
from femtune.identification.pole_table import PoleTable, table_of
from femtune.modal import FrfSet

ARC = 0.95
"""Part of the unit circle that the band is carried to: below 1, since the functions do not join at the band's ends."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations up to the largest order; those of smaller orders are their leading parts.

    Parameters
    ----------
    cross : (n, p + 1, (p + 1)u) L⁻¹XᴴY of each response, LLᴴ = XᴴX and X the powers of z
    square : ((p + 1)u, (p + 1)u) Σ YᴴY
    seconds, shift : T and α of z = e^{iωT + iα}
    frfs : the functions at the lines that were used
    """

    cross: Complexes
    square: Complexes
    seconds: float
    shift: float
    frfs: FrfSet


def normal_equations(frfs: FrfSet, largest_order: int, sd: Reals | None = None) -> NormalEquations:
    """Sums over the lines for polynomials up to a degree, which is the number of poles a reference.

    Parameters
    ----------
    frfs : (n, u, k)
    largest_order : degree p of the polynomials
    sd : (n, u, k) standard deviations of the FRFs, as weights of lines and responses, or None

    Raises
    ------
    FemtuneError : ``identify.few-lines``, ``identify.missing-pair``, ``identify.missing-lines``
    """
    used = complete_lines(frfs)
    _, u, k = used.values.shape
    enough_lines(k, u, largest_order, largest_order + 1 + u * largest_order, k)
    omega = 2.0 * np.pi * used.freq_hz
    seconds = 2.0 * np.pi * ARC / (omega[-1] - omega[0])
    shift = -seconds * 0.5 * (omega[-1] + omega[0])
    powers = np.exp(1j * np.outer(omega * seconds + shift, np.arange(largest_order + 1)))
    weights, scale = line_weights(used, None if sd is None else sd[:, :, np.isin(frfs.freq_hz, used.freq_hz)])
    parts = _sums(powers * weights[:, None], used.values / scale[:, None, None])
    return NormalEquations(*parts, seconds, shift, used)


def plscf_poles(equations: NormalEquations, orders: Sequence[int]) -> PoleTable:
    """Poles of ascending orders, with shapes from residues fitted to the functions.

    Only poles that decay and lie in the band have shapes and are in the table.
    """
    reduced, done, pairs = equations.square.copy(), 0, []
    for order in orders:
        new = equations.cross[:, done : order + 1].reshape(-1, len(reduced))
        reduced -= new.conj().T @ new
        done = order + 1
        poles = _decaying(equations, _roots(equations, reduced, order))
        pairs.append((poles, residue_shapes(equations.frfs, poles)))
    return table_of([p for p, _ in pairs], [s for _, s in pairs], orders, "pLSCF", equations.frfs.responses)


def residue_shapes(frfs: FrfSet, poles: Complexes) -> Complexes:
    """(n, m) shapes of poles: residues by least squares, of several references their leading direction.

    What lies outside the band is a polynomial of second degree and a term of a rigid mass.
    """
    n, u, k = frfs.values.shape
    i_omega = 2j * np.pi * frfs.freq_hz / (2.0 * np.pi * frfs.freq_hz[-1])
    near = 1.0 / (i_omega[:, None] - poles / (2.0 * np.pi * frfs.freq_hz[-1]))
    basis = np.hstack([near, np.vander(i_omega, 3), i_omega[:, None] ** -2])
    size = np.linalg.norm(basis, axis=0)
    Q, R = qr(basis / size, mode="economic", check_finite=False)
    residues = np.linalg.lstsq(R, Q.conj().T @ frfs.values.reshape(n * u, k).T, rcond=1e-13)[0][: len(poles)]
    residues = residues / size[: len(poles), None]
    left, s, _ = np.linalg.svd(residues.reshape(len(poles), n, u), full_matrices=False)
    return (left[:, :, 0] * s[:, :1]).T


def _roots(equations: NormalEquations, reduced: Complexes, order: int) -> Complexes:
    """Roots of det A as poles in rad/s."""
    u = equations.frfs.values.shape[1]
    size = order * u
    above = np.linalg.lstsq(reduced[u : size + u, u : size + u], -reduced[u : size + u, :u], rcond=None)[0]
    # in 1/μ the identity stands at the highest power, and the rest is a companion matrix
    companion = np.eye(size, k=u, dtype=complex)
    companion[-u:] = -above.reshape(order, u, u)[::-1].transpose(1, 0, 2).reshape(u, size)
    inverse = np.linalg.eigvals(companion)
    return (-np.log(inverse[np.abs(inverse) > 0.0]) - 1j * equations.shift) / equations.seconds


def _decaying(equations: NormalEquations, poles: Complexes) -> Complexes:
    lines = equations.frfs.freq_hz
    freq = poles.imag / (2.0 * np.pi)
    return poles[(poles.real < 0.0) & (freq >= lines[0]) & (freq <= lines[-1])]


def _sums(powers: NDArray, values: Complexes) -> tuple[Complexes, Complexes]:
    """All sums; those of products of two powers depend on the difference of the two alone."""
    n, u, k = values.shape
    p = powers.shape[1]
    weighted = powers[:, 0].conj()[:, None] * powers
    differences = np.hstack([weighted[:, :0:-1].conj(), weighted])
    at = np.arange(p)[None, :] - np.arange(p)[:, None] + p - 1
    # the triangle of a QR factorisation, since XᴴX itself may be singular to working precision
    factor = qr(powers, mode="r", check_finite=False)[0][:p].conj().T
    single = (-values.reshape(n * u, k) @ differences).reshape(n, u, 2 * p - 1)
    cross = single[:, :, at].transpose(2, 0, 3, 1).reshape(p, n * p * u)
    cross = solve_triangular(factor, cross, lower=True).reshape(p, n, p * u).transpose(1, 0, 2)
    double = np.einsum("nuk,nvk->uvk", values.conj(), values, optimize=True).reshape(u * u, k)
    square = (double @ differences).reshape(u, u, 2 * p - 1)[:, :, at].transpose(2, 0, 3, 1).reshape(p * u, p * u)
    return cross, square
