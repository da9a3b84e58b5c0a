"""Frequency-domain subspace identification of a state-space model, for even and uneven lines.

The lines are carried to the unit circle by the bilinear map z = (a + iω)/(a − iω), which takes a system of
continuous time exactly to a discrete one of the same order, whatever the lines; there the data matrix
[G; zG; …; z^{q−1}G] is the sum of observability × states and of a known matrix times the inputs' powers, which is
projected out.

Source: T. McKelvey, H. Akcay, L. Ljung (1996), Subspace-based multivariable system identification from frequency
response data, IEEE Trans. Automatic Control 41(7), algorithm 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from femtune.arrays import Complexes, Reals
from femtune.identification.join import complete_lines, enough_lines, line_weights
from femtune.identification.pole_table import PoleTable, table_of
from femtune.modal import FrfSet

MOST_ROWS = 400
"""Rows of the projected data matrix that are aimed at: more cost time, and give no better poles where they repeat."""


@dataclass(frozen=True, eq=False)
class Subspace:
    """The range of the observability matrix, before an order is chosen.

    Parameters
    ----------
    vectors : (block_rows · n, r) left singular vectors
    singular : (r,) singular values
    scale : (n,) that each response was divided by
    a : rad/s of the bilinear map
    frfs : the functions at the lines that were used
    """

    vectors: Reals
    singular: Reals
    scale: Reals
    a: float
    frfs: FrfSet

    @property
    def rows(self) -> int:
        """Rows of one block."""
        return len(self.scale)


def subspace(frfs: FrfSet, largest_order: int, block_rows: int | None = None, sd: Reals | None = None) -> Subspace:
    """Project the data matrix of FRFs, for models up to an order.

    Parameters
    ----------
    frfs : (n, u, k) at even or uneven lines
    largest_order : states
    block_rows : q, with q·n above the order; chosen where None
    sd : (n, u, k) standard deviations of the FRFs, as weights of lines and responses, or None

    Raises
    ------
    FemtuneError : ``identify.few-lines``, ``identify.missing-pair``, ``identify.missing-lines``
    """
    used = complete_lines(frfs)
    n, u, k = used.values.shape
    q = block_rows or _block_rows(largest_order, n, u, k)
    enough_lines(k, u, largest_order, q * u + largest_order, 2 * k * u)
    weights, scale = line_weights(used, None if sd is None else sd[:, :, np.isin(frfs.freq_hz, used.freq_hz)])
    omega = 2.0 * np.pi * used.freq_hz
    a = float(np.sqrt(omega[0] * omega[-1]))
    powers = np.vander((a + 1j * omega) / (a - 1j * omega), q, increasing=True) * weights[:, None]
    vectors, singular = _projected(used.values / scale[:, None, None], powers)
    return Subspace(vectors, singular, scale, a, used)


def subspace_poles(found: Subspace, order: int) -> tuple[Complexes, Complexes]:
    """Poles in rad/s and shapes of one order.

    Returns
    -------
    (order,) and (n, order), conjugates included
    """
    vectors = found.vectors[:, :order]
    A = np.linalg.lstsq(vectors[: -found.rows], vectors[found.rows :], rcond=None)[0]
    mu, v = np.linalg.eig(A)
    away = mu != -1.0
    mu, v = mu[away], v[:, away]
    poles = found.a * (mu - 1.0) / (mu + 1.0)
    return poles.astype(complex), (found.scale[:, None] * vectors[: found.rows]) @ v.astype(complex)


def n4sid_poles(found: Subspace, orders: Sequence[int]) -> PoleTable:
    """Poles of every order of a projection."""
    pairs = [subspace_poles(found, order) for order in orders]
    return table_of([p for p, _ in pairs], [s for _, s in pairs], orders, "N4SID", found.frfs.responses)


def _block_rows(order: int, n: int, u: int, k: int) -> int:
    """At least enough for the order; more, which average noise out, as far as time and lines allow."""
    least = -(-order // n) + 1
    wanted = min(max(2 * least, 12), max(MOST_ROWS // n, least))
    return max(2, min(wanted, max(least, (2 * k * u - order) // (2 * u))))


def _projected(values: Complexes, powers: NDArray) -> tuple[Reals, Reals]:
    """Left singular vectors and values of the data matrix without what the inputs' powers span."""
    n, u, k = values.shape
    q = powers.shape[1]
    data = np.einsum("kq,nuk->ukqn", powers, values, optimize=True).reshape(u * k, q * n)
    inputs = np.einsum("kq,uv->ukqv", powers, np.eye(u)).reshape(u * k, q * u)
    both = np.hstack([inputs, data])
    r = qr(np.vstack([both.real, both.imag]), mode="r", overwrite_a=True, check_finite=False)[0]
    left = r[q * u : q * (u + n), q * u :]
    vectors, singular, _ = np.linalg.svd(left.T, full_matrices=False)
    return vectors, singular
