"""Flexibility of a tapered beam: integrals of the sections' flexibilities with the forces along it.

Axial force N, and in plane p the moment q_s + q_a (2ξ − 1) with the shear 2 q_a/L, about the axis through the shear
centres. The neutral axis may be offset from it by (n1, n2): the moment there is M_p + n_p N. Source: complementary
energy of a Timoshenko beam (Przemieniecki, Theory of Matrix Structural Analysis, 1968, section 5.6 and chapter 8).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient
from femtune.fem.elements.tapered_stations import LengthRule, along, integral
from femtune.parameters.jet import Jet

Matrix = list[list[Jet]]
Values = Mapping[str, Jet]
Flexibility = Callable[[Values, Reals], Matrix]


def axial(rule: LengthRule) -> Flexibility:
    """(1 × 1) ∫ dx/EA."""

    def matrix(values: Values, length: Reals) -> Matrix:
        return [[integral(1.0 / along(values, "A", rule), rule.weight) * length / values["E"]]]

    return matrix


def torsion(rule: LengthRule) -> Flexibility:
    """(1 × 1) ∫ dx/GJ."""

    def matrix(values: Values, length: Reals) -> Matrix:
        return [[integral(1.0 / along(values, "J", rule), rule.weight) * length / values["G"]]]

    return matrix


def plane(p: int, rule: LengthRule, shear: bool) -> Flexibility:
    """(2 × 2) bending in one plane, with transverse shear if `shear`."""
    c = 2.0 * rule.xi - 1.0

    def matrix(values: Values, length: Reals) -> Matrix:
        density, factor = 1.0 / along(values, f"I{p}", rule), length / values["E"]
        both, cross, ends = (integral(density, rule.weight * b) * factor for b in (1.0, c, c**2))
        return [[both, cross], [cross, ends + _shear(p, values, length, rule) if shear else ends]]

    return matrix


def coupled(rule: LengthRule, shear: tuple[bool, bool]) -> Flexibility:
    """(5 × 5) stretching and bending in both planes, joined by I12 and by the offset of the neutral axis."""
    c, one = 2.0 * rule.xi - 1.0, np.ones_like(rule.xi)

    def matrix(values: Values, length: Reals) -> Matrix:
        I1, I2, I12 = (along(values, name, rule) for name in ("I1", "I2", "I12"))
        across = 1.0 / (I1 * I2 - I12 * I12)
        # moment in each plane due to a unit of each force
        first, second = {0: along(values, "N1", rule), 1: one, 2: c}, {0: along(values, "N2", rule), 3: one, 4: c}
        pairs = ((I2 * across, first, first), (I1 * across, second, second),
                 (-(I12 * across), first, second), (-(I12 * across), second, first))  # fmt: skip
        factor = length / values["E"]

        def entry(i: int, j: int) -> Jet:
            terms = [f * m[i] * n[j] for f, m, n in pairs if i in m and j in n]
            terms += [1.0 / along(values, "A", rule)] if i == j == 0 else []
            return sum_of([integral(term, rule.weight) for term in terms]) * factor

        upper = {(i, j): entry(i, j) for i in range(5) for j in range(i, 5)}
        for p, at in ((1, 2), (2, 4)):
            if shear[p - 1]:
                upper[at, at] = upper[at, at] + _shear(p, values, length, rule)
        return [[upper[min(i, j), max(i, j)] for j in range(5)] for i in range(5)]

    return matrix


def _shear(p: int, values: Values, length: Reals, rule: LengthRule) -> Jet:
    """∫ (2/L)² dx/κAG."""
    density = 1.0 / (along(values, f"K{p}", rule) * along(values, "A", rule))
    return integral(density, rule.weight) * (4.0 / length) / values["G"]


def stiffness_entry(flexibility: Flexibility, free: Reals, i: int, j: int) -> Coefficient:
    """Entry (i, j) of the inverse of Zᵀ F Z; the columns of `free` Z (n, r) are forces that released DOFs allow."""

    def coefficient(values: Values, facts: Mapping[str, NDArray]) -> Jet:
        return inverse_entry(_restricted(flexibility(values, facts["length"]), free), i, j)

    return coefficient


def _restricted(F: Matrix, Z: Reals) -> Matrix:
    n, r = Z.shape
    if n == r:
        return F

    def entry(i: int, j: int) -> Jet:
        return sum_of([F[a][b] * (Z[a, i] * Z[b, j]) for a in range(n) for b in range(n)])

    return [[entry(i, j) for j in range(r)] for i in range(r)]


def sum_of(terms: list[Jet]) -> Jet:
    """Sum of jets."""
    out = terms[0]
    for term in terms[1:]:
        out = out + term
    return out


def inverse_entry(F: Matrix, i: int, j: int) -> Jet:
    """Entry (i, j) of the inverse S of a symmetric matrix of jets: dS = −S dF S, applied twice for the Hessian."""
    value, grad, hess = (
        np.stack([np.stack([getattr(x, part) for x in row], axis=1) for row in F], axis=1)
        for part in ("value", "grad", "hess")
    )
    S = np.linalg.inv(value)
    left, right = S[:, i], S[:, :, j]
    first, last = np.einsum("ma,mabk->mbk", left, grad), np.einsum("mabk,mb->mak", grad, right)
    h = hess.shape[-1]
    cross = np.swapaxes(first[..., :h], 1, 2) @ S @ last[..., :h]
    slope = -np.einsum("mbk,mb->mk", first, right)
    curve = cross + np.swapaxes(cross, 1, 2) - np.einsum("ma,mabkl,mb->mkl", left, hess, right)
    return Jet(S[:, i, j], slope, curve)
