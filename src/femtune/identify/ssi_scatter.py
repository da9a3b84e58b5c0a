"""Standard deviations of modes from covariance-driven subspace identification, by first-order perturbation.

The scatter of the correlations over pieces of the record moves the Hankel matrix, that its singular vectors, these the
state matrix, and this the poles and shapes. Sources: E. Reynders, R. Pintelon, G. De Roeck (2008), Mechanical Systems
and Signal Processing 22; M. Döhler, L. Mevel (2013), Mechanical Systems and Signal Processing 38.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.identify.realisation import Poles
from femtune.identify.ssi import CovarianceModel
from femtune.modal.real_axis import turn_to_real_axis

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class PoleScatter:
    """How poles and shapes of one order move with each piece of the record; squares add up to variances.

    Parameters
    ----------
    found : the poles themselves
    poles : (b, m) movements of λ, rad/s
    shapes : (b, s, m) movements of the shapes as they are scaled in `found`
    """

    found: Poles
    poles: Complexes
    shapes: Complexes

    @property
    def freq_sd_hz(self) -> Reals:
        """(m,) standard deviations of the frequencies."""
        unit = self.found.poles / np.abs(self.found.poles)
        return _root_sum((unit.conj() * self.poles).real / (2.0 * np.pi))

    @property
    def damping_sd(self) -> Reals:
        """(m,) standard deviations of the damping ratios."""
        pole, size = self.found.poles, np.abs(self.found.poles)
        growth = (pole.conj() * self.poles).real / size**2
        return _root_sum(-self.poles.real / size - self.found.damping_ratio * growth)

    @property
    def shapes_sd(self) -> Reals:
        """(s, m) standard deviations of the real shapes of unit norm that belong to the complex ones."""
        turned, moved = _real_parts(self.found.shapes, self.shapes)
        along = np.einsum("sm,bsm->bm", turned, moved)
        return _root_sum(moved - turned[None] * along[:, None])


def _root_sum(moves: Reals) -> Reals:
    return np.asarray(np.sqrt((moves**2).sum(axis=0)))


def _real_parts(shapes: Complexes, moves: Complexes) -> tuple[Reals, Reals]:
    """Real parts, unit norm, of shapes turned to the real axis, and their movements."""
    phase = turn_to_real_axis(shapes)
    real = (shapes * phase).real
    length = np.linalg.norm(real, axis=0)
    return real / length, (moves * phase).real / length


def scatter_of_order(model: CovarianceModel, order: int) -> PoleScatter:
    """Poles of one order with their movements under the scatter of the record's pieces."""
    seen = model.observability
    basis = model.left[:, :order]
    moved = _moved_basis(model, order)
    s = seen.channels
    upper, lower = basis[:-s], basis[s:]
    inverse = np.linalg.pinv(upper)
    a = inverse @ lower
    rest = lower - upper @ a
    gram = inverse @ inverse.T
    moved_a = inverse @ (moved[:, s:] - moved[:, :-s] @ a) + gram @ (np.swapaxes(moved[:, :-s], 1, 2) @ rest)
    return _of_state_matrix(order, a, moved_a, basis[:s], moved[:, :s], seen.step_s)


def _moved_basis(model: CovarianceModel, order: int) -> Reals:
    """(b, rows, n) first-order movements of the leading left singular vectors out of their own span.

    Movements inside the span change the coordinates of the states and no mode.
    """
    u, s = model.left, model.singular_values
    within, outside = model.images
    ahead, behind = s[None, :order], s[order:, None]
    gap = ahead**2 - behind**2
    turned = (ahead * within[:, order:, :order] + behind * np.swapaxes(within[:, :order, order:], 1, 2)) / gap
    return np.asarray(u[:, order:] @ turned + outside[:, :, :order] / s[:order])


def _of_state_matrix(order: int, a: Reals, moved_a: Reals, c: Reals, moved_c: Reals, step_s: float) -> PoleScatter:
    discrete, right = np.linalg.eig(a)
    left = np.linalg.inv(right)
    coupled = left @ moved_a @ right
    keep = np.flatnonzero(discrete.imag > 1e-12 * np.abs(discrete))
    continuous = np.log(discrete[keep]) / step_s
    keep = keep[np.argsort(np.abs(continuous))]
    gaps = discrete[None, :] - discrete[:, None]
    np.fill_diagonal(gaps, np.inf)
    turned = right @ (coupled / gaps)[:, :, keep]
    poles = np.diagonal(coupled, axis1=1, axis2=2)[:, keep] / (discrete[keep] * step_s)
    shapes = c @ turned + moved_c @ right[:, keep]
    found = Poles(order, np.log(discrete[keep]) / step_s, c @ right[:, keep])
    return PoleScatter(found, np.asarray(poles), np.asarray(shapes))
