"""Mass of shells: ρ·t and NSM, lumped or consistent, at the mid-surface where that is offset.

Translations only, as Nastran forms it. Lumped: each corner gets the row sum of the consistent mass. An offset z0 moves
the mass along the normal n: u + z0 θ × n, so that the terms are 1, z0 and z0², and their sum is positive semidefinite.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements.shell_placement import ShellPlane, offset_arms

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShellMass:
    """Mass of a batch; `offset` are its elements whose mass is offset, `arm` is the value that tells how far."""

    offset: NDArray[np.int64]
    arm: str = "z0"

    @cached_property
    def _terms(self) -> list[tuple[str, tuple[str, ...], Coefficient]]:
        """Label, values and coefficient of ρ·t and NSM, times 1, z0 and z0²."""
        z = self.arm
        powers: tuple[tuple[str, tuple[str, ...]], ...] = (("", ()), ("-offset", (z,)), ("-offset²", (z, z)))
        masses = (("mass", ("rho", "t")), ("added-mass", ("NSM",)))
        return [(label + tail, f + z, product(*f, *z)) for tail, z in powers for label, f in masses]

    def contributions(self, plane: ShellPlane, shares: Reals, part: slice) -> Iterator[Contribution]:
        """Those of a part of the batch; `shares` (m, n, n) are the integrals of Nᵢ Nⱼ."""
        lo, hi = np.searchsorted(self.offset, [part.start, part.stop])
        offset = self.offset[lo:hi]
        found = [(np.arange(part.start, part.stop), plain_mass(plane, shares))]
        if len(offset):
            found += [(offset, m) for m in offset_mass(plane, shares, offset - part.start)]
        # both masses of a power of z0 share its matrices
        for i, (at, matrices) in enumerate(found):
            for label, roles, coefficient in self._terms[2 * i : 2 * i + 2]:
                yield Contribution("mass", label, at, matrices, tuple(dict.fromkeys(roles)), coefficient)


def plain_mass(plane: ShellPlane, shares: Reals) -> Reals:
    """(m, 6n, 6n) for a unit mass an area."""
    still = _still(plane)
    return np.asarray(_between(still, still) * _spread(shares))


def offset_mass(plane: ShellPlane, shares: Reals, own: NDArray[np.int64]) -> tuple[Reals, Reals]:
    """What goes with z0 and z0² of some of the elements."""
    still, lifted, spread = _still(plane)[own], offset_arms(plane)[own], _spread(shares)[own]
    first = _between(still, lifted)
    return (first + np.swapaxes(first, 1, 2)) * spread, _between(lifted, lifted) * spread


def _still(plane: ShellPlane) -> Reals:
    """(m, n, 3, 6) basic displacements of each grid point."""
    out = np.zeros((*plane.heights.shape, 3, 6))
    out[..., :3] = plane.frames
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
