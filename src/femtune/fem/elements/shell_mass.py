"""Mass of shells: ρ·t and NSM, lumped or consistent, at the mid-surface where that is offset.

Translations only, as Nastran forms it. Lumped: each corner gets the row sum of the consistent mass. An offset z0 moves
the mass along the normal n: u + z0 θ × n, so that the terms are 1, z0 and z0², and their sum is positive semidefinite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements.shell_placement import ShellPlane, offset_arms
from femtune.fem.structure import ElementBatch

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShellMass:
    """Matrices for a unit mass an area: of all elements, and those that go with z0 and z0² of offset ones."""

    offset: NDArray[np.int64]
    plain: Reals
    first: Reals
    second: Reals

    @classmethod
    def empty(cls, batch: ElementBatch) -> ShellMass:
        """Room for the matrices of a batch."""
        at, d = np.flatnonzero(batch.facts["offset_given"]), batch.dofs.shape[1]
        return cls(at, np.zeros((len(batch), d, d)), *(np.empty((len(at), d, d)) for _ in range(2)))

    def contributions(self) -> list[Contribution]:
        """ρ·t and NSM times the matrices, which both share."""
        every = np.arange(len(self.plain))
        parts: list[tuple[NDArray[np.int64], Reals, str, tuple[str, ...]]] = [(every, self.plain, "", ())]
        if len(self.offset):
            parts += [
                (self.offset, self.first, "-offset", ("z0",)),
                (self.offset, self.second, "-offset²", ("z0", "z0")),
            ]
        out = []
        for at, matrices, tail, powers in parts:
            for label, factors in (("mass", ("rho", "t")), ("added-mass", ("NSM",))):
                roles = tuple(dict.fromkeys((*factors, *powers)))
                out.append(Contribution("mass", label + tail, at, matrices, roles, product(*factors, *powers)))
        return out


def fill_mass(mass: ShellMass, plane: ShellPlane, shares: Reals, part: slice) -> None:
    """Put the matrices of a part of the batch in place; `shares` (m, n, n) are the integrals of Nᵢ Nⱼ."""
    still, m = np.zeros((*plane.heights.shape, 3, 6)), len(plane)
    still[..., :3] = plane.frames
    spread = np.repeat(np.repeat(shares, 6, axis=1), 6, axis=2)
    mass.plain[part] = _between(still, still) * spread
    lo, hi = np.searchsorted(mass.offset, [part.start, part.start + m])
    if lo == hi:
        return
    own = mass.offset[lo:hi] - part.start
    lifted, spread = offset_arms(plane)[own], spread[own]
    first = _between(still[own], lifted)
    mass.first[lo:hi] = (first + np.swapaxes(first, 1, 2)) * spread
    mass.second[lo:hi] = _between(lifted, lifted) * spread


def _between(a: Reals, b: Reals) -> Reals:
    """(m, 6n, 6n) products of displacements (m, n, 3, 6) of every pair of corners."""
    m, n = a.shape[:2]
    left, right = (np.swapaxes(x, 1, 2).reshape(m, 3, 6 * n) for x in (a, b))
    out = np.swapaxes(left, 1, 2) @ right
    return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)) if a is b else out)


def lumped(shares: Reals) -> Reals:
    """(m, n, n) row sums on the diagonal."""
    return np.asarray(np.eye(shares.shape[1]) * shares.sum(axis=2)[:, :, None])
