"""Coefficients of solids as exact functions of the entries of their law, and the turning of strains.

Entries are in the order xx, yy, zz, xy, yz, zx with engineering shears; stress = C strain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Coefficient
from femtune.parameters import jet
from femtune.parameters.jet import Jet

Reals = NDArray[np.float64]
Values = Mapping[str, Jet]
Facts = Mapping[str, NDArray]

ENTRIES = tuple(f"C{i}{j}" for i in range(1, 7) for j in range(i, 7))
"""Roles of the 21 entries, the upper triangle row by row."""

_SHEARS = ((0, 1), (1, 2), (2, 0))


def plane_lame(values: Values, facts: Facts) -> Jet:
    """λ' = 2λμ/(λ + 2μ): in plane stress the stress is λ' tr ε + 2μ ε."""
    lam, mu = values["C12"], values["C44"]
    return 2.0 * lam * mu / (lam + 2.0 * mu)


def young(values: Values, facts: Facts) -> Jet:
    """E = μ(3λ + 2μ)/(λ + μ)."""
    lam, mu = values["C12"], values["C44"]
    return mu * (3.0 * lam + 2.0 * mu) / (lam + mu)


def condensed(kept: Sequence[int], a: int, b: int, eliminate: bool) -> Coefficient:
    """Entry (a, b) of the law between the `kept` stresses and strains along the axes of the fact "frame".

    The other stresses are zero where `eliminate` is true, else the other strains. "frame" is (m, 9): the rows of the
    matrix whose columns are the axes, seen from the material's.

    With z the strains that are free and C t_a in balance with them, zᵀC t_a = 0, the entry is t_aᵀC t_b. As t moves
    along z only, its derivatives are t_aᵀC_p t_b and t_aᵀC_pq t_b − r_apᵀS r_bq − r_aqᵀS r_bp, r_ap = zᵀC_p t_a,
    S = (zᵀC z)⁻¹.
    """
    free = [k for k in range(6) if k not in kept] if eliminate else []
    ends = [kept[a], kept[b]]

    def entry(values: Values, facts: Facts) -> Jet:
        strains = turn_strain(np.swapaxes(facts["frame"].reshape(-1, 3, 3), 1, 2))
        law = _symmetric(jet.stack([values[name] for name in ENTRIES]))
        z, t = strains[:, :, free], strains[:, :, ends]
        inner = np.swapaxes(z, 1, 2) @ law.value
        t = t - z @ np.linalg.solve(inner @ z, inner @ t)
        moved = np.einsum("mijp,mje->mepi", law.grad, t)
        grad = np.einsum("mi,mpi->mp", t[:, :, 0], moved[:, 1])
        r = moved @ z[:, None]
        bent = np.swapaxes(r[:, 0] @ np.linalg.solve(inner @ z, np.swapaxes(r[:, 1], 1, 2)), 1, 2)
        hess = np.einsum("mi,mijpq,mj->mpq", t[:, :, 0], law.hess, t[:, :, 1], optimize=True)
        value = np.einsum("mi,mij,mj->m", t[:, :, 0], law.value, t[:, :, 1])
        return Jet(value, grad, hess - bent - np.swapaxes(bent, 1, 2))

    return entry


_PLACE = np.zeros((6, 6), np.int64)
_PLACE[np.triu_indices(6)] = np.arange(21)
_PLACE = np.maximum(_PLACE, _PLACE.T)


def _symmetric(entries: Jet) -> Jet:
    """(m, 6, 6) law from its entries (21, m)."""
    return Jet(*(np.moveaxis(part[_PLACE], 2, 0) for part in (entries.value, entries.grad, entries.hess)))


def turn_strain(axes: Reals) -> Reals:
    """(m, 6, 6) from strains along some axes to those along `axes` (m, 3, 3), columns seen from the former."""
    out = np.empty((len(axes), 6, 6))
    for row, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), *_SHEARS)):
        x, y, factor = axes[:, :, a], axes[:, :, b], 1.0 if a == b else 2.0
        out[:, row, :3] = factor * x * y
        for k, (i, j) in enumerate(_SHEARS):
            out[:, row, 3 + k] = 0.5 * factor * (x[:, i] * y[:, j] + x[:, j] * y[:, i])
    return out
