"""Condensation on master DOFs: Guyan, dynamic at a frequency, IRS and iterated IRS, SEREP.

K and M are symmetric matrices (n, n), dense or sparse, without constraints; `masters` are positions of the DOFs that
are kept. The formulas are written for u = [u_a, u_o] with slaves o.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike, NDArray

from femtune.errors import FemtuneError
from femtune.model.factorise import Factor, SingularMatrixError, factorise
from femtune.model.reduce.masters import Matrix, Partition, Reduction

Reals = NDArray[np.float64]

_SINGULAR, _LOST = 1e-12, 1e-4


def guyan(K: Matrix, M: Matrix, masters: ArrayLike) -> Reduction:
    """Static condensation u_o = −K_oo⁻¹K_oa u_a: exact for static loads on the masters.

    Source: Guyan 1965. Raises FemtuneError ``reduce.masters``, ``reduce.slaves-loose``.
    """
    parts = Partition.of(K, M, masters)
    return parts.reduced(parts.transformation(static_shapes(parts, slaves_factor(parts))))


def dynamic(K: Matrix, M: Matrix, masters: ArrayLike, freq_hz: float) -> Reduction:
    """Condensation u_o = −(K − ω²M)_oo⁻¹(K − ω²M)_oa u_a: exact for motion at `freq_hz`.

    Source: Leung 1978. Raises FemtuneError ``reduce.masters``, and ``reduce.slaves-loose`` where the frequency is a
    natural one of the slaves with the masters held.
    """
    parts = Partition.of(K, M, masters)
    square = (2.0 * np.pi * freq_hz) ** 2
    shifted = Partition(parts.K - square * parts.M, parts.M, parts.masters)
    return parts.reduced(parts.transformation(static_shapes(shifted, slaves_factor(shifted))))


def irs(K: Matrix, M: Matrix, masters: ArrayLike, iterations: int = 1) -> Reduction:
    """Improved reduced system: the inertia of the slaves acts as it does in the condensed model before.

    T_o = −K_oo⁻¹K_oa + K_oo⁻¹(M_oa + M_oo T_o)M_a⁻¹K_a; more `iterations` tend to the lowest modes exactly.
    Source: O'Callahan 1989; Friswell, Garvey and Penny 1995 (iterated). Raises as `guyan`.
    """
    parts = Partition.of(K, M, masters)
    factor = slaves_factor(parts)
    static = static_shapes(parts, factor)
    oa, oo = (parts.block(parts.M, parts.slaves, c) for c in (parts.masters, parts.slaves))
    reduced, of_slaves = parts.reduced(parts.transformation(static)), static
    for _ in range(iterations):
        inertia = oa.toarray() + oo @ of_slaves
        of_slaves = static + _solved(factor, inertia @ la.solve(reduced.mass, reduced.stiffness, assume_a="sym"))
        reduced = parts.reduced(parts.transformation(of_slaves))
    return reduced


def serep(K: Matrix, M: Matrix, masters: ArrayLike, shapes: Reals) -> Reduction:
    """System equivalent reduction expansion: T = Φ Φ_a⁺, exact for the modes Φ (n, k ≤ m) that are kept.

    With fewer modes than masters the reduced matrices are singular: they have the rank k.
    Source: O'Callahan, Avitabile and Riemer 1989. Raises FemtuneError ``reduce.masters``, and
    ``reduce.modes-unseen`` where the masters do not tell the modes apart.
    """
    parts = Partition.of(K, M, masters)
    at_masters = shapes[parts.masters]
    singular = la.svdvals(at_masters / np.linalg.norm(shapes, axis=0))
    if shapes.shape[1] > len(parts.masters) or singular[-1] <= _SINGULAR * singular[0]:
        raise FemtuneError(
            "reduce.modes-unseen",
            f"{shapes.shape[1]} modes cannot be told apart at {len(parts.masters)} masters",
            hint="keep fewer modes or more masters, where the modes move differently",
        )
    return parts.reduced(shapes @ la.pinv(at_masters))


def static_shapes(parts: Partition, factor: Factor | None) -> Reals:
    return -_solved(factor, parts.block(parts.K, parts.slaves, parts.masters).toarray())


def _solved(factor: Factor | None, b: Reals) -> Reals:
    return b if factor is None else factor.solve(np.asfortranarray(b))


def slaves_factor(parts: Partition) -> Factor | None:
    """Factors of K_oo, None without slaves (error ``reduce.slaves-loose``)."""
    if not parts.slaves.size:
        return None
    A = parts.block(parts.K, parts.slaves, parts.slaves)
    try:
        factor = factorise(A)
    except SingularMatrixError as error:
        raise _loose() from error
    # a pivot that rounding kept from zero shows in what the factors solve
    probe = np.random.default_rng(3).standard_normal(A.shape[0])
    left = np.linalg.norm(A @ factor.solve(probe) - probe)
    if not left <= _LOST * np.linalg.norm(probe):
        raise _loose()
    return factor


def _loose() -> FemtuneError:
    return FemtuneError(
        "reduce.slaves-loose",
        "the slaves can move without stiffness while the masters are held",
        hint="keep masters that hold every part; at a frequency, take another one",
    )
