"""Mass of tapered beams, lumped or consistent, on the neutral axis and on the line of the added mass.

μ changes linearly between stations, Σ μ_k h_k(ξ). Lumped: ∫ μ (1 − ξ) dx and ∫ μ ξ dx to the ends, so that mass and
centre of gravity are right. Consistent: Hermite polynomials across, the mean of lumped and consistent mass along,
linear twist. For a constant section these are the forms of `line_mass`. The ends of the mass's line are on arms
(0, n1, n2) that turn with the grid points.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.bending import PLANES
from femtune.fem.elements.line_mass import times_sum
from femtune.fem.elements.tapered_stations import LengthRule
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]
Rows = NDArray[np.int64]


def tapered_mass(
    batch: ElementBatch, structure: Structure, at: Rows, rule: LengthRule, ends: Reals, length: Reals
) -> list[Contribution]:
    """Terms ρA, ρ(I1 + I2), NSM and NSI of the stations of the elements at some positions."""
    consistent, out = structure.consistent_mass, []
    for stations in _alike(batch, at, rule.count):
        share, k = rule.share[stations].sum(axis=0), stations[0]
        line = _line(share, rule, length[at], structure) * structure.mass_factor
        out += _offset_terms(batch, structure, at, ends, line, ("rho", f"A@{k}"), "N", rule.count)
        out += _offset_terms(batch, structure, at, ends, line, (f"NSM@{k}",), "M", rule.count)
        twist = _between(_linear(share, rule, consistent), length[at], (3,)) * structure.mass_factor
        matrices, inertia = placement.carry(ends[at], twist), (f"I1@{k}", f"I2@{k}")
        out.append(Contribution("mass", f"torsional-inertia-{k}", at, matrices, ("rho", *inertia),
                                times_sum("rho", inertia)))  # fmt: skip
        out.append(Contribution("mass", f"added-inertia-{k}", at, matrices, (f"NSI@{k}",), product(f"NSI@{k}")))
    return out


def _alike(batch: ElementBatch, at: Rows, count: int) -> list[list[int]]:
    """Stations in groups that have the same values in every element."""
    groups: dict[bytes, list[int]] = {}
    for k in range(count):
        key = np.stack([batch.roles[f"{name}@{k}"][at] for name in ("A", "I1", "I2", "NSM", "NSI")]).tobytes()
        groups.setdefault(key, []).append(k)
    return list(groups.values())


def _line(share: Reals, rule: LengthRule, length: Reals, structure: Structure) -> Reals:
    """(m, 12, 12) translational mass of a line with density `share` (g,) a length."""
    lumped = _linear(share, rule, False)
    if not structure.consistent_mass:
        return _between(lumped, length, (0, 1, 2))
    part = structure.lumped_along
    out = _between(part * lumped + (1.0 - part) * _linear(share, rule, True), length, (0,))
    for rows, signs in PLANES.values():
        out[np.ix_(np.arange(len(length)), rows, rows)] += _hermite(share, rule, length) * np.outer(signs, signs)
    return out


def _linear(share: Reals, rule: LengthRule, consistent: bool) -> Reals:
    """(2, 2) mass of linear polynomials on [0, 1], or its row sums on the diagonal."""
    N = np.stack([1.0 - rule.xi, rule.xi])
    mass = N * (share * rule.weight)
    return np.asarray(mass @ N.T if consistent else np.diag(mass.sum(axis=1)))


def _hermite(share: Reals, rule: LengthRule, length: Reals) -> Reals:
    """(m, 4, 4) mass of cubic Hermite polynomials on (v, θ) of both ends."""
    x = rule.xi
    N = np.stack([1 - 3 * x**2 + 2 * x**3, x - 2 * x**2 + x**3, 3 * x**2 - 2 * x**3, x**3 - x**2])
    unit, one = (N * (share * rule.weight)) @ N.T, np.ones_like(length)
    scale = np.stack([one, length, one, length], axis=1)
    return np.asarray(unit * scale[:, :, None] * scale[:, None, :] * length[:, None, None])


def _between(shares: Reals, length: Reals, rows: tuple[int, ...]) -> Reals:
    out = np.zeros((len(length), 12, 12))
    for row in rows:
        out[np.ix_(range(len(length)), (row, row + 6), (row, row + 6))] = length[:, None, None] * shares
    return out


def _offset_terms(
    batch: ElementBatch,
    structure: Structure,
    at: Rows,
    ends: Reals,
    line: Reals,
    density: tuple[str, ...],
    axis: str,
    count: int,
) -> list[Contribution]:
    """density · (T₀ + Σ n_e T_e)ᵀ line (T₀ + Σ n_e T_e), a term for each power of the offsets n_e."""
    label = "mass" if axis == "N" else "added-mass"
    out = [Contribution("mass", f"{label}-{density[-1]}", at, placement.carry(ends[at], line), density,
                        product(*density))]  # fmt: skip
    names = [f"{axis}{direction}@{k}" for k in (0, count - 1) for direction in (1, 2)]
    moved = np.any([placement.nominal(batch, structure, name)[at] != 0.0 for name in names], axis=0)
    own = at[moved]
    for powers, term in _powers(dict(zip(names, _arms())), line[moved]) if len(own) else ():
        matrices = placement.carry(ends[own], term)
        roles = tuple(dict.fromkeys((*density, *powers)))
        out.append(Contribution("mass", f"{label}-{density[-1]}-{'-'.join(powers)}", own, matrices, roles,
                                product(*density, *powers)))  # fmt: skip
    return out


def _powers(arms: dict[str, Reals], line: Reals) -> Iterator[tuple[tuple[str, ...], Reals]]:
    """The offsets in each term, and its matrices (m, 12, 12)."""
    for name, T in arms.items():
        once = line @ T
        yield (name,), once + np.swapaxes(once, 1, 2)
    for a, b in combinations_with_replacement(arms, 2):
        twice = arms[a].T @ line @ arms[b]
        if twice.any():
            yield (a, b), twice if a == b else twice + np.swapaxes(twice, 1, 2)


def _arms() -> list[Reals]:
    """What a unit offset along y and along z adds to the displacements θ × r of the end at A, then at B."""
    out = []
    for end in (0, 6):
        along_y, along_z = np.zeros((12, 12)), np.zeros((12, 12))
        along_y[end, end + 5], along_y[end + 2, end + 3] = -1.0, 1.0
        along_z[end, end + 4], along_z[end + 1, end + 3] = 1.0, -1.0
        out += [along_y, along_z]
    return out
