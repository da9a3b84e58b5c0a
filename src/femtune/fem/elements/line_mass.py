"""Mass of rods, bars and beams, lumped or consistent, as Nastran forms it.

Lumped: half of (ρA + NSM)L to the translations of each end. Consistent: Hermite polynomials across a bar, the mean
of the lumped and the consistent matrix along it, 5/12 and 1/12 (MacNeal's choice for Nastran, fourth-order accurate).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements.bending import PLANES
from femtune.fem.elements.placement import carry
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

LUMPED = np.eye(2) / 2.0
# a quantity that is linear along the axis: the twist, or the displacement of a linear shape function
TWIST = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0


def line_mass(
    batch: ElementBatch,
    structure: Structure,
    ends: Reals,
    length: Reals,
    bending: bool,
    torsional: tuple[str, ...] = (),
) -> list[Contribution]:
    """Mass of a batch: ρ·A and NSM, and ρ times the sum of the `torsional` area moments about the axis.

    `ends` (e, 12, 12) transforms the nodes' displacements to those of the element's ends along its axes.
    """
    consistent = structure.consistent_mass
    translating = consistent_matrix(length, bending, structure.lumped_along) if consistent else lumped_matrix(length)
    at = np.arange(len(batch))
    matrices = carry(ends, translating) * structure.mass_factor
    out = [
        Contribution("mass", "mass", at, matrices, ("rho", "A"), product("rho", "A")),
        Contribution("mass", "added-mass", at, matrices, ("NSM",), product("NSM")),
    ]
    if torsional:
        polar = carry(ends, _between_ends(length, 3, TWIST if consistent else LUMPED)) * structure.mass_factor
        coefficient = times_sum("rho", torsional)
        out.append(Contribution("mass", "torsional-inertia", at, polar, ("rho", *torsional), coefficient))
    return out


def lumped_matrix(length: Reals) -> Reals:
    """(e, 12, 12) half of the mass at each end, for a unit mass per length."""
    return np.asarray(sum(_between_ends(length, row, LUMPED) for row in range(3)))


def consistent_matrix(length: Reals, bending: bool, lumped: float) -> Reals:
    """(e, 12, 12) consistent mass for a unit mass per length; without bending only along the axis.

    `lumped` is the share of the lumped mass in the matrix along the axis.
    """
    out = _between_ends(length, 0, lumped * LUMPED + (1.0 - lumped) * TWIST)
    if not bending:
        return np.asarray(out + sum(_between_ends(length, row, LUMPED) for row in (1, 2)))
    for rows, signs in PLANES.values():
        out[np.ix_(np.arange(len(length)), rows, rows)] += hermite_mass(length) * np.outer(signs, signs)
    return out


def hermite_mass(length: Reals) -> Reals:
    """(e, 4, 4) mass of cubic Hermite polynomials on (v, θ) of both ends, for a unit mass per length."""
    L, one = length, np.ones_like(length)
    rows = [
        [156 * one, 22 * L, 54 * one, -13 * L],
        [22 * L, 4 * L**2, 13 * L, -3 * L**2],
        [54 * one, 13 * L, 156 * one, -22 * L],
        [-13 * L, -3 * L**2, -22 * L, 4 * L**2],
    ]
    return np.asarray(np.moveaxis(np.array(rows), 2, 0) * (L / 420.0)[:, None, None])


def _between_ends(length: Reals, row: int, shares: Reals) -> Reals:
    """(e, 12, 12) with length times the 2 × 2 `shares` on one component of both ends."""
    out = np.zeros((len(length), 12, 12))
    out[np.ix_(range(len(length)), (row, row + 6), (row, row + 6))] = length[:, None, None] * shares
    return out


def times_sum(factor: str, terms: tuple[str, ...]) -> Coefficient:
    """The coefficient factor · (term + term + …)."""

    def evaluate(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        total = values[terms[0]]
        for name in terms[1:]:
            total = total + values[name]
        return values[factor] * total

    return evaluate
