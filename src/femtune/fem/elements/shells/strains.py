"""Strains of a flat shell as rows on its corners' displacements, and the same rows on the grid points.

A formulation gives rows, each multiplied by the root of its integration weight, so that energies are sums of squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.shells.placement import ShellPlane

Rows = dict[str, Reals]

IN_PLANE, OUT_OF_PLANE, ABOUT_NORMAL = (0, 1), (2, 3, 4), (0, 1, 5)

OFFSET = "+"
"""Ends the name of a row that gives the strain for a unit offset of the mid-surface."""


@dataclass(frozen=True, eq=False)
class ShellStrains:
    """Strain rows of m shells with n corners, on (u, v, w, θx, θy, θz) of each along the axes of the mean plane.

    Weights are within; the number of places r may differ from one to the other. ``placed`` makes six components.

    Parameters
    ----------
    membrane : (m, r, 3, n, 6) strains xx, yy and engineering xy
    uniaxial : (m, q, n, 6) strains along `along` that meet uniaxial stress: in-plane bending
    along : (m, q, 2) unit directions of these
    drilling : (m, r, n, 6) turn about the normal less the membrane's own rotation
    bending : (m, r, 3, n, 6) curvatures θy,x, −θx,y and θy,y − θx,x
    shear : (m, r, 2, n, 6) transverse shear w,x + θy and w,y − θx
    roots : (m, r) roots of the weights of the curvatures
    """

    membrane: Reals
    uniaxial: Reals
    along: Reals
    drilling: Reals
    bending: Reals
    shear: Reals
    roots: Reals

    @property
    def mean_curvature(self) -> Reals:
        """Curvatures where the membrane's strains are: at the same places, or their mean where those are one mean."""
        if self.membrane.shape[1] == self.bending.shape[1]:
            return self.bending
        shares = self.roots / np.sqrt((self.roots**2).sum(axis=1))[:, None]
        return np.einsum("mr,mrkna->mkna", shares, self.bending)[:, None]


@dataclass(frozen=True)
class ShellFormulation:
    """What a shape of shell adds to the parts that all shells share.

    Parameters
    ----------
    uniaxial : number q of uniaxial strain rows
    strains : mean plane -> strain rows
    shares : corners (m, n, 2) -> (m, n, n) integrals of products of the shape functions over the area
    residual : grid points (e, n, 3) -> (e,) 12h²/15 of the residual bending flexibility; None where there is none
    """

    uniaxial: int
    strains: Callable[[ShellPlane], ShellStrains]
    shares: Callable[[Reals], Reals]
    residual: Callable[[Reals], Reals] | None = None


def nodal_rows(strains: ShellStrains, plane: ShellPlane, offsets: bool, coupling: bool = False) -> Rows:
    """Rows (m, r, 6n) by name on the grid points' displacements, strains along the material's axes.

    ``m1 m2 m12`` membrane, ``a1 …`` uniaxial, ``drill``, ``b1 b2 b12`` bending, ``s1 s2`` shear; with `offsets` also
    those of the membrane that a unit offset adds, with `coupling` also ``c1 c2 c12``, the curvatures that meet the
    membrane. The twelfth of t³/12 is within the bending rows.
    """
    c, s = plane.material[:, 0], plane.material[:, 1]
    membrane = _named("m", _turn_strain(strains.membrane, c, s))
    uniaxial = {f"a{i + 1}": strains.uniaxial[:, i : i + 1] for i in range(strains.uniaxial.shape[1])}
    in_plane = {**membrane, **uniaxial}
    in_plane["drill"] = strains.drilling
    bending = _named("b", _turn_strain(strains.bending * np.sqrt(1.0 / 12.0), c, s))
    sheared = dict(zip(("s1", "s2"), np.moveaxis(_turn_vector(strains.shear, c, s), 2, 0)))
    every = in_plane | bending | sheared
    if coupling:
        every |= _named("c", _turn_strain(strains.mean_curvature, c, s))
    if offsets:
        every |= {name + OFFSET: _by_turn(rows) for name, rows in in_plane.items()}
    return {name: _lift(rows, plane) for name, rows in every.items()}


def placed(rows: Reals, components: tuple[int, ...]) -> Reals:
    """Rows (…, n, 6) from rows (…, n, k) on some of the six components."""
    out = np.zeros((*rows.shape[:-1], 6))
    out[..., list(components)] = rows
    return out


def _named(letter: str, rows: Reals) -> Rows:
    return {f"{letter}{k}": rows[:, :, i] for i, k in enumerate(("1", "2", "12"))}


def _by_turn(rows: Reals) -> Reals:
    """What a unit offset adds: it moves u by θy and v by −θx."""
    return placed(np.stack([-rows[..., 1], rows[..., 0]], axis=-1), (3, 4))


def _turn_strain(rows: Reals, c: Reals, s: Reals) -> Reals:
    """Strains xx, yy, xy (axis 2) along axes at the angle with cosine c and sine s (m,)."""
    turn = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    return _turned(turn, rows)


def _turn_vector(rows: Reals, c: Reals, s: Reals) -> Reals:
    return _turned(np.array([[c, s], [-s, c]]), rows)


def _turned(turn: Reals, rows: Reals) -> Reals:
    m, r, k = rows.shape[:3]
    flat = rows.reshape(m, r, k, -1)
    return np.asarray((np.moveaxis(turn, 2, 0)[:, None] @ flat).reshape(rows.shape))


def _lift(rows: Reals, plane: ShellPlane) -> Reals:
    """(m, r, 6n) rows on the grid points' displacements from rows (m, r, n, 6) on the axes of the mean plane."""
    m, r, n, _ = rows.shape
    lifted = np.swapaxes(rows, 1, 2) @ plane.carry
    return np.asarray(np.swapaxes(lifted, 1, 2).reshape(m, r, 6 * n))
