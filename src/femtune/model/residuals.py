"""How well eigenpairs meet their equation, in energy and in forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.model.krylov import column_products
from femtune.model.pencil import Inverse, Pencil, pieces

Reals = NDArray[np.float64]

_PROBES = 8
_SMALL = np.array([1e-8, 1e-5])


def energy_residuals(inverse: Inverse, values: Reals, shapes: Reals, wanted: int) -> Reals:
    """Relative residuals √(rᵀ(K − σM)⁻¹r/(λ − σ)) with r = Kφ − λMφ, or bounds of them where they are small.

    Where there are many modes, a few sums of the residuals with random signs are solved for instead: the larger of two
    sums that differ in the sign of one r has at least its energy, so that a residual hides from all of them with a
    probability of 2⁻⁸. Such a bound is given for the wanted modes together, and for the others.
    """
    groups = [slice(0, wanted), slice(wanted, len(values))]
    if len(values) > 2 * _PROBES:
        bounds = _bounds(inverse, values, shapes, groups)
        if (bounds <= _SMALL).all():
            return np.repeat(bounds, [g.stop - g.start for g in groups])
    return _each(inverse, values, shapes)


def _bounds(inverse: Inverse, values: Reals, shapes: Reals, groups: list[slice]) -> Reals:
    sums = np.zeros((inverse.pencil.n, _PROBES * len(groups)), order="F")
    signs = np.random.default_rng(3).choice([-1.0, 1.0], (len(values), _PROBES))
    weights = signs / np.sqrt(np.abs(values - inverse.shift))[:, None]
    for i, group in enumerate(groups):
        own = sums[:, i * _PROBES : (i + 1) * _PROBES]
        for part in pieces(group.start, group.stop):
            own += inverse.pencil.residual(values, shapes, part) @ weights[part]
    energy = column_products(sums, inverse.solve(sums)).reshape(len(groups), _PROBES)
    return np.asarray(np.sqrt(np.abs(energy).max(axis=1)))


def _each(inverse: Inverse, values: Reals, shapes: Reals) -> Reals:
    out = np.zeros(len(values))
    for part in pieces(0, len(values)):
        r = inverse.pencil.residual(values, shapes, part)
        energy = column_products(r, inverse.solve(r))
        out[part] = np.sqrt(np.abs(energy) / (values[part] - inverse.shift))
    return out


def force_residuals(pencil: Pencil, values: Reals, shapes: Reals) -> Reals:
    """‖Kφ − λMφ‖/(‖Kφ‖ + |λ|‖Mφ‖) with each row measured by its stiffness, ‖f‖² = Σ f_i²/k_ii.

    Forces and moments differ in unit, and stiffness by decades; f_i²/k_ii is energy everywhere. For the lowest modes
    this measure ends at the rounding of the product Kφ, which is a small difference of large forces.
    """
    scale = 1.0 / np.sqrt(np.maximum(pencil.K.diagonal(), np.finfo(float).tiny))[:, None]
    out = np.zeros(len(values))
    for part in pieces(0, len(values)):
        some = np.asfortranarray(shapes[:, part])
        elastic, inertial = scale * (pencil.stiffness @ some), scale * (pencil.mass @ some) * values[part]
        size = np.linalg.norm(elastic, axis=0) + np.linalg.norm(inertial, axis=0)
        out[part] = np.linalg.norm(elastic - inertial, axis=0) / size
    return out
