"""How well eigenpairs meet their equation, in energy and in forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.model.eigen.krylov import column_products
from femtune.model.eigen.pencil import Inverse, Pencil, pieces
from femtune.model.linear.dense_products import multiply, transposed_times

_RANDOM_SUMS = 8
"""Sums of residuals with random signs: a residual hides from all of them with a probability of 2⁻⁸."""
NEGLIGIBLE_RESIDUAL = 1e-8
"""Relative residual of the wanted modes below which no mode needs a residual of its own: half of the digits of a
double, and the error of an eigenvalue is of the order of its square."""
_NEGLIGIBLE = np.array([NEGLIGIBLE_RESIDUAL, 1e-5])
"""Of the wanted modes and of the others, which need only be accurate enough to serve the derivatives."""


def energy_residuals(inverse: Inverse, values: Reals, shapes: Reals, wanted: int) -> Reals:
    """Relative residuals √(rᵀ(K − σM)⁻¹r/(λ − σ)) with r = Kφ − λMφ, or upper bounds if these are small.

    If there are many modes, a few sums of the residuals with random signs are solved for instead: the larger of two
    sums that differ in the sign of one r has at least its energy, so that a residual hides from all of them with a
    probability of 2⁻⁸. Such a bound is given for the wanted modes together, and for the others.
    """
    groups = [slice(0, wanted), slice(wanted, len(values))]
    if len(values) > 2 * _RANDOM_SUMS:
        bounds = _bounds(inverse, values, shapes, groups)
        if (bounds <= _NEGLIGIBLE).all():
            return np.repeat(bounds, [g.stop - g.start for g in groups])
    return _each(inverse, values, shapes)


@dataclass(frozen=True, eq=False)
class Above:
    """(K − τM)⁻¹ with τ just above known modes, and its largest eigenvalue 1/(λ − τ) of the others."""

    solve: Callable[[Reals], Reals]
    value: float
    largest: float


def energy_bound_from_above(pencil: Pencil, above: Above, shift: float, values: Reals, shapes: Reals) -> float:
    """An upper bound of the residuals if (K − τM)⁻¹ is known and the modes are all those below τ.

    It is computed from sums with random signs, and from each mode if that bound is not small.

    In the span of the modes the energy of a residual is known from its products with them. Outside of it
    B = K − τM and A = K − σM are positive, and the eigenvalues x of B⁻¹A lie between 1 and g = (λ − σ)/(λ − τ) of the
    next mode: with z = B⁻¹r the energy rᵀA⁻¹r is at most (1 + 1/g) rᵀz − zᵀAz/g, as 1/x is at most 1 + 1/g − x/g.
    """
    bound = _from_above(pencil, above, shift, (values, shapes, _weights(values, shift)))
    if bound <= NEGLIGIBLE_RESIDUAL:
        return bound
    each = np.diag(1.0 / np.sqrt(np.abs(values - shift)))
    columns = pieces(0, len(values))
    return max(_from_above(pencil, above, shift, (values, shapes, each[:, some])) for some in columns)


def _from_above(pencil: Pencil, above: Above, shift: float, summed: tuple[Reals, Reals, Reals]) -> float:
    """The largest bound of some sums of residuals, of values and shapes with weights (m, sums)."""
    values, shapes, weights = summed
    sums = _summed(pencil, values, shapes, weights)
    within = transposed_times(shapes, sums)
    inside = np.sum(within**2 / np.abs(values - shift)[:, None], axis=0)
    outside = sums - pencil.mass @ multiply(shapes, within)
    z = above.solve(outside)
    first, second = column_products(z, outside), column_products(z, pencil.mass @ z) * (above.value - shift)
    ratio = 1.0 / (1.0 + (above.value - shift) * above.largest)
    energy = np.maximum(first - ratio * second, first**2 / np.maximum(first + second, np.finfo(float).tiny))
    return float(np.sqrt((inside + energy).max()))


def _summed(pencil: Pencil, values: Reals, shapes: Reals, weights: Reals) -> Reals:
    """Σ w (Kφ − λMφ), by as many products as there are sums."""
    shapes = np.asfortranarray(shapes)
    elastic = pencil.stiffness @ multiply(shapes, weights)
    elastic -= pencil.mass @ multiply(shapes, values[:, None] * weights)
    return elastic


def _weights(values: Reals, shift: float) -> Reals:
    """(m, probes) random signs that give each residual the energy of its mode."""
    signs = np.random.default_rng(3).choice([-1.0, 1.0], (len(values), _RANDOM_SUMS))
    return np.asarray(signs / np.sqrt(np.abs(values - shift))[:, None])


def _bounds(inverse: Inverse, values: Reals, shapes: Reals, groups: list[slice]) -> Reals:
    sums = np.zeros((inverse.pencil.n, _RANDOM_SUMS * len(groups)), order="F")
    weights = _weights(values, inverse.shift)
    for i, group in enumerate(groups):
        members = shapes[:, group], weights[group]
        sums[:, i * _RANDOM_SUMS : (i + 1) * _RANDOM_SUMS] = _summed(inverse.pencil, values[group], *members)
    energy = column_products(sums, inverse.solve(sums)).reshape(len(groups), _RANDOM_SUMS)
    return np.asarray(np.sqrt(np.abs(energy).max(axis=1)))


def _each(inverse: Inverse, values: Reals, shapes: Reals) -> Reals:
    out = np.zeros(len(values))
    for part in pieces(0, len(values)):
        r = inverse.pencil.residual(values, shapes, part)
        energy = column_products(r, inverse.solve(r))
        out[part] = np.sqrt(np.abs(energy) / (values[part] - inverse.shift))
    return out
