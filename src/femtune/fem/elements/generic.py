"""Generic elements: the stiffness of a group of elements by its own eigenvalues and shapes.

K = Φ κ Φᵀ with Φ = Φ₀ S: the eigenvalues κ of the group's matrix and rotations S among its shapes are the values. The
batch adds the difference from the elements' matrices, Φ₀ (S κ Sᵀ − κ₀) Φ₀ᵀ, which vanishes at the deck's values. The
rigid-body modes are not among the shapes, so they remain for any values.
Source: Gladwell and Ahmadian (1995), Mechanical Systems and Signal Processing 9(6), 601-614.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Coefficient, Contribution
from femtune.fem.elements.kind import ElementKind
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters import jet
from femtune.parameters.jet import Jet


def generic(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """The change of the group's stiffness, linear in its κ.

    Facts of the only element: "kappa" (1, n) eigenvalues of the deck, "shapes" (1, d, r) with the number of their
    eigenvalue "owner" (1, r) from 0, "angles" (1, s, 2) pairs of eigenvalues that rotations mix. Roles: K0 … K(n−1),
    and S0 … S(s−1), the angles in rad.
    """
    kappa, owner, angles = (batch.facts[name][0] for name in ("kappa", "owner", "angles"))
    shapes = batch.facts["shapes"][0]
    mixed = sorted({int(i) for i in angles.ravel()})
    out = []
    for i, nominal in enumerate(kappa):
        if i not in mixed:
            repeated = shapes[:, owner == i]
            out.append(_part(f"kappa-{i}", repeated @ repeated.T, (f"K{i}",), _change(i, float(nominal))))
    roles = (*(f"K{i}" for i in mixed), *(f"S{s}" for s in range(len(angles))))
    for a, i in enumerate(mixed):
        for b, j in list(enumerate(mixed))[a:]:
            both = shapes[:, owner == i] @ shapes[:, owner == j].T
            place = [(mixed.index(p), mixed.index(q)) for p, q in angles.tolist()]
            matrix = both if i == j else 2.0 * both
            out.append(_part(f"kappa-{i}-{j}", matrix, roles, _entry(a, b, mixed, place, float(kappa[i]))))
    return out


def _part(label: str, matrix: NDArray, roles: tuple[str, ...], coefficient: Coefficient) -> Contribution:
    symmetric = 0.5 * (matrix + matrix.T)
    return Contribution("stiffness", label, np.zeros(1, np.int64), symmetric[None], roles, coefficient)


def _change(i: int, nominal: float) -> Coefficient:
    def coefficient(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        return values[f"K{i}"] - nominal

    return coefficient


def _entry(a: int, b: int, mixed: Sequence[int], pairs: Sequence[tuple[int, int]], nominal: float) -> Coefficient:
    """Entry (a, b) of S κ Sᵀ − κ₀ among the mixed shapes; S is the product of plane rotations in the pairs' order."""

    def coefficient(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        kappa = [values[f"K{i}"] for i in mixed]
        S = _rotation(kappa[0] * 0.0, len(mixed), pairs, [values[f"S{s}"] for s in range(len(pairs))])
        out = kappa[0] * 0.0 - (nominal if a == b else 0.0)
        for c, k in enumerate(kappa):
            out = out + S[a][c] * k * S[b][c]
        return out

    return coefficient


def _rotation(zero: Jet, n: int, pairs: Sequence[tuple[int, int]], angles: Sequence[Jet]) -> list[list[Jet]]:
    """(n × n) orthogonal matrix: a rotation of shape p towards shape q by each angle."""
    S = [[zero + (1.0 if i == j else 0.0) for j in range(n)] for i in range(n)]
    for (p, q), angle in zip(pairs, angles):
        c, s = jet.cos(angle), jet.sin(angle)
        for row in S:
            row[p], row[q] = row[p] * c + row[q] * s, row[q] * c - row[p] * s
    return S


GENERIC = ElementKind("generic", generic, papers=("gladwell1995",))
