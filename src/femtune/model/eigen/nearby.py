"""Modes of a model from those of one nearby, by one factorisation just above them, whose inertia counts them too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.model.eigen.accuracy import NEGLIGIBLE_RESIDUAL, Above, energy_bound_from_above
from femtune.model.eigen.krylov import KrylovPairs, begin, iterate
from femtune.model.eigen.mass_space import MassSpace
from femtune.model.eigen.pairs import check_negative
from femtune.model.eigen.pencil import Pencil, pieces
from femtune.model.eigen.sturm import Count, count_below, cut_above, with_repeats
from femtune.model.linear.dense_products import in_any_order
from femtune.model.linear.sparse_products import column_major
from femtune.model.solvers.interface import Factor

_MARGIN = 1.01
"""τ over the last wanted eigenvalue, at least, if no gap above it is known: 0.5 % in frequency."""
_EXTRA_BELOW = 20
"""Modes below τ, beyond twice the wanted ones, up to which this way costs less than a search from below."""
_LARGEST_CHANGE = 4.0
"""Factor by which the last wanted eigenvalue may have grown: a frequency twice as high, beyond which the known shapes
are a poor start."""
_BLOCK = 12
"""Columns of a block, as in the iteration from below."""
_SEED = 5
"""Seed of the random start, so that a solution can be repeated bit by bit; any other would do."""
_TOLERANCE = 3e-9
"""Residual of θ for modes near τ. It is scaled by √(σ/τ): the same residual weighs more in the lowest modes, which have
less energy."""
_LARGEST_TOLERANCE = 3e-10
"""Largest residual of θ, where τ is not much above σ."""
_SEPARATION = 1e-6
"""Distance of the last mode from τ relative to τ − σ: nearer modes cannot be told from those above τ."""


@dataclass(frozen=True, eq=False)
class Nearby:
    """Modes of another value of the parameters, and what was requested.

    Parameters
    ----------
    values, shapes : (m,) and (n, m) of the model nearby, ascending
    shift : σ below the spectrum with which they were found
    above : a value between the modes wanted there and the others
    wanted : number of modes
    """

    values: Reals
    shapes: Reals
    shift: float
    above: float
    wanted: int


@dataclass(frozen=True, eq=False)
class NearbyModes:
    """All modes below τ, as many as the inertia counts; `whole` of them are wanted; and the factors of K − τM."""

    values: Reals
    shapes: Reals
    whole: int
    above: Count


def modes_nearby(pencil: Pencil, nearby: Nearby, limit: Count | None) -> NearbyModes | None:
    """The modes, or None if this way does not find them well and they must be sought from below.

    With τ just above the wanted modes their θ = 1/(λ − τ) are all those below zero, and end at −1/τ where the others
    begin above zero: one factorisation counts and finds them, with somewhat fewer solves than from below.

    Parameters
    ----------
    limit : τ with its count and factors, if an upper limit of the frequency gave them
    """
    if nearby.shapes.shape[1] < nearby.wanted or not np.isfinite(nearby.shapes).all():
        return None
    try:
        values, vectors = _projected(pencil, nearby.shapes)
    except la.LinAlgError:  # shapes that are not independent
        return None
    if not _is_near(nearby, values):
        return None
    count = limit if limit is not None and limit.factor is not None else count_below(pencil, _above(nearby, values))
    if not _is_usable(count, nearby.wanted):
        return None
    return _proven(pencil, nearby, count, vectors * np.abs(values - count.value))


def _start(shapes: Reals, vectors: Reals) -> Reals:
    """(n, b) a block that holds all known shapes."""
    mixed = np.random.default_rng(_SEED).standard_normal((vectors.shape[1], min(_BLOCK, vectors.shape[1])))
    return column_major(shapes @ (vectors @ mixed))


def _is_near(nearby: Nearby, estimates: Reals) -> bool:
    """True if the old shapes are as good a basis as those of a model with a few times the stiffness."""
    last = nearby.wanted - 1
    moved = (estimates[last] - nearby.shift) / (nearby.values[last] - nearby.shift)
    return bool(moved < _LARGEST_CHANGE)


def _projected(pencil: Pencil, shapes: Reals) -> tuple[Reals, Reals]:
    """Rayleigh and Ritz: the best estimates in the span of known shapes, ascending, and their coefficients."""
    stiff, heavy = np.empty((2, shapes.shape[1], shapes.shape[1]))
    for part in pieces(0, shapes.shape[1]):
        # row by row, as the library for sparse products requires
        some = np.ascontiguousarray(shapes[:, part])
        for projected, matrix in ((stiff, pencil.stiffness), (heavy, pencil.mass)):
            projected[:, part] = in_any_order(shapes.T, matrix @ some)
    values, vectors = la.eigh(0.5 * (stiff + stiff.T), 0.5 * (heavy + heavy.T))
    return values, vectors


def _above(nearby: Nearby, estimates: Reals) -> float:
    """In the widest gap above the wanted estimates, or as far above them as it was."""
    cut = cut_above(estimates, nearby.wanted, len(estimates), nearby.shift, False)
    if cut is not None:
        return cut[0]
    last = nearby.wanted - 1
    moved = nearby.above * float(np.median(estimates[last // 2 : last + 1] / nearby.values[last // 2 : last + 1]))
    return max(moved, _MARGIN * float(estimates[last]))


def _is_usable(count: Count, wanted: int) -> bool:
    """True where the pivots tell the count, and the modes below τ are not many more than wanted."""
    told = count.below is not None and count.factor is not None
    return told and count.value > 0.0 and wanted <= (count.below or 0) <= 2 * wanted + _EXTRA_BELOW


def _proven(pencil: Pencil, nearby: Nearby, count: Count, vectors: Reals) -> NearbyModes | None:
    """As many pairs as were counted, if they are separated from those above and accurate.

    `vectors` are the coefficients of the known shapes that the iteration starts from.
    """
    assert count.factor is not None
    tolerance = min(_LARGEST_TOLERANCE, _TOLERANCE * float(np.sqrt(abs(nearby.shift) / count.value)))
    pairs = _below(pencil, count, (nearby.shapes, vectors), tolerance)
    if pairs is None:
        return None
    above = Above(count.factor.solve, count.value, max(-pairs.least, 0.0))
    values, shapes = count.value - 1.0 / pairs.theta[::-1], pairs.shapes[:, ::-1]
    if count.value - values[-1] <= _SEPARATION * (count.value - nearby.shift):
        return None
    check_negative(pencil, values, shapes)
    if energy_bound_from_above(pencil, above, nearby.shift, values, shapes) > NEGLIGIBLE_RESIDUAL:
        return None
    return NearbyModes(values, shapes, with_repeats(values, nearby.wanted, nearby.shift), count)


def _below(pencil: Pencil, count: Count, start: tuple[Reals, Reals], tolerance: float) -> KrylovPairs | None:
    """All eigenpairs below τ by −(K − τM)⁻¹M; None if the iteration did not find all."""
    number = count.below or 0
    assert count.factor is not None
    space = MassSpace(pencil, _negated(count.factor))
    operator = space.operator
    if 2 * number > operator.rank:
        return None
    block = _start(space.start(start[0]), start[1])
    pairs = iterate(operator, begin(operator, number, block, _BLOCK), number, number, space.looser * tolerance)
    if len(pairs.theta) == number and (pairs.theta > 0.0).all():
        pairs = space.finished(pairs)
    return pairs if len(pairs.theta) == number and (pairs.theta > 0.0).all() else None


def _negated(factor: Factor) -> Callable[[Reals], Reals]:
    def solve(b: Reals) -> Reals:
        x = factor.solve(b)
        return np.negative(x, out=x)

    return solve
