"""Mass of shells: ρ·t and NSM, lumped or consistent, at the mid-surface, which may be offset.

Translations only, as Nastran forms it. Lumped: each corner gets the row sum of the consistent mass. An offset z0 moves
the mass along the normal n: u + z0 θ × n, so that the terms are 1, z0 and z0², and their sum is positive semidefinite.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements.shells.placement import PlacedShells, offset_arms
from femtune.fem.elements.shells.uneven import UnevenThickness
from femtune.fem.structure import ElementBatch, Structure


@dataclass(frozen=True)
class _Inertia:
    """A mass per area, times a power of the arm; `point` is the only integration point that is used, None for all."""

    label: str
    roles: tuple[str, ...]
    coefficient: Coefficient
    has: NDArray[np.bool_]
    power: int
    point: int | None = None


@dataclass(frozen=True, eq=False)
class ShellMass:
    """Mass of a batch.

    Parameters
    ----------
    offset : (e,) True for elements whose mass is offset
    arm : name of the value of the offset
    uneven : elements of varying thickness, None if the shape does not permit it
    """

    offset: NDArray[np.bool_]
    arm: str = "z0"
    uneven: UnevenThickness | None = None

    @cached_property
    def _terms(self) -> list[_Inertia]:
        """ρ·t and NSM, times 1, z0 and z0²."""
        terms = []
        for power, tail in enumerate(("", "-offset", "-offset²")):
            arms, has = (self.arm,) * power, self.offset if power else np.ones_like(self.offset)
            terms += [
                _Inertia(label + tail, tuple(dict.fromkeys(f + arms)), product(*f, *arms), has, power)
                for label, f in (("mass", ("rho", "t")), ("added-mass", ("NSM",)))
            ]
        return [part for term in terms for part in self._by_points(term)]

    def _by_points(self, term: _Inertia) -> list[_Inertia]:
        uneven = self.uneven
        if uneven is None or not uneven.has.any() or "t" not in term.roles:
            return [term]
        roles, has = uneven.roles_for(term.roles), term.has & uneven.has
        points = [
            _Inertia(f"{term.label}@{k + 1}", roles, uneven.at(k, term.coefficient), has, term.power, k)
            for k in range(len(uneven.weights))
        ]
        return [replace(term, has=term.has & ~uneven.has), *points]

    def contributions(self, placed: PlacedShells, structure: Structure, part: slice) -> Iterator[Contribution]:
        """Contributions of a part of the batch."""
        known: dict[tuple[int | None, int, int], Reals] = {}
        for term in self._terms:
            elements = np.flatnonzero(term.has[part])
            # masses of one power and the same elements share matrices
            key = (term.point, term.power, len(elements))
            if len(elements) and key not in known:
                shares = placed.shares(structure.consistent_mass, term.point) * structure.mass_factor
                known[key] = _powers[term.power](placed.frames[elements], placed.normals[elements], shares[elements])
            if len(elements):
                yield Contribution("mass", term.label, elements + part.start, known[key], term.roles, term.coefficient)


def shell_mass(batch: ElementBatch, uneven: UnevenThickness | None = None) -> ShellMass:
    """Mass of a batch; if its offset differs from that of the stiffness, the mass has a separate value."""
    return ShellMass(batch.facts["offset_given"], "zm" if "zm" in batch.roles else "z0", uneven)


def plain_mass(frames: Reals, normals: Reals, shares: Reals) -> Reals:
    """(m, 6n, 6n) for a unit mass per area, from `shares` (m, n, n) and the frames (m, n, 3, 3) of displacements."""
    still = _still(frames)
    return np.asarray(_between(still, still) * _spread(shares))


def first_moment(frames: Reals, normals: Reals, shares: Reals) -> Reals:
    """Mass matrix that is multiplied by z0."""
    first = _between(_still(frames), offset_arms(normals, frames))
    return np.asarray((first + np.swapaxes(first, 1, 2)) * _spread(shares))


def second_moment(frames: Reals, normals: Reals, shares: Reals) -> Reals:
    """Mass matrix that is multiplied by z0²."""
    lifted = offset_arms(normals, frames)
    return np.asarray(_between(lifted, lifted) * _spread(shares))


_powers = (plain_mass, first_moment, second_moment)


def _still(frames: Reals) -> Reals:
    """(m, n, 3, 6) basic displacements of each grid point."""
    out = np.zeros((*frames.shape[:3], 6))
    out[..., :3] = frames
    return out


def _spread(shares: Reals) -> Reals:
    return np.repeat(np.repeat(shares, 6, axis=1), 6, axis=2)


def _between(a: Reals, b: Reals) -> Reals:
    """(m, 6n, 6n) products of displacements (m, n, 3, 6) of every pair of corners."""
    m, n = a.shape[:2]
    left, right = (np.swapaxes(x, 1, 2).reshape(m, 3, 6 * n) for x in (a, b))
    out = np.swapaxes(left, 1, 2) @ right
    return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)) if a is b else out)


def lumped(shares: Reals) -> Reals:
    """(m, n, n) row sums on the diagonal."""
    return np.asarray(np.eye(shares.shape[1]) * shares.sum(axis=2)[:, :, None])
