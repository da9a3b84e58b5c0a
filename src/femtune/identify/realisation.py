"""State matrices of all orders from one factorised block Hankel matrix, and the modes of each order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Poles:
    """Oscillating poles of one model order.

    Parameters
    ----------
    order : number of states
    poles : (m,) λ = −ζω ± iω√(1−ζ²) of the upper half plane in rad/s, by frequency
    shapes : (s, m) complex shapes at the channels
    """

    order: int
    poles: Complexes
    shapes: Complexes

    @property
    def freq_hz(self) -> Reals:
        """(m,) undamped natural frequencies."""
        return np.asarray(np.abs(self.poles) / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> Reals:
        """(m,) fractions of critical; negative where a pole is unstable."""
        return np.asarray(-self.poles.real / np.abs(self.poles))


@dataclass(frozen=True, eq=False)
class Observability:
    """Column space of the future of a record: O (p·s, n) in the balanced basis, ordered by singular value.

    Parameters
    ----------
    matrix : O, for the largest order
    channels : s
    step_s : sampling interval
    """

    matrix: Reals
    channels: int
    step_s: float

    def state_matrices(self, orders: Iterable[int]) -> Iterator[tuple[int, Reals, Reals]]:
        """Order, A (n, n) and C (s, n) by the shift invariance of O; one QR serves all orders.

        Source: M. Döhler, L. Mevel, Mechanical Systems and Signal Processing 26 (2012), fast multi-order computation.
        """
        s = self.channels
        q, r = np.linalg.qr(self.matrix[:-s])
        turned = q.T @ self.matrix[s:]
        for n in orders:
            yield n, np.linalg.solve(r[:n, :n], turned[:n, :n]), self.matrix[:s, :n]

    def poles(self, orders: Iterable[int]) -> Iterator[Poles]:
        """Poles of each order."""
        for n, a, c in self.state_matrices(orders):
            yield modes_of(n, a, c, self.step_s)


def modes_of(order: int, a: Reals, c: Reals, step_s: float) -> Poles:
    """Poles of a discrete state matrix and shapes C v, one of each conjugate pair; real poles are no vibrations."""
    discrete, vectors = np.linalg.eig(a)
    keep = discrete.imag > 1e-12 * np.abs(discrete)
    continuous = np.log(discrete[keep]) / step_s
    by_frequency = np.argsort(np.abs(continuous))
    return Poles(order, continuous[by_frequency], (c @ vectors[:, keep])[:, by_frequency])
