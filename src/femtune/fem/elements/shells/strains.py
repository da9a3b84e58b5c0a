"""Strains of a flat shell as rows on its corners' displacements, and the same rows on the grid points.

A formulation gives rows, each multiplied by the square root of its integration weight, so that energies are sums of
squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.shells.placement import ShellPlane
from femtune.fem.elements.shells.residual import ResidualFlexibility

Rows = dict[str, Reals]

# of the components u, v, w, θx, θy, θz
IN_PLANE = (0, 1)
OUT_OF_PLANE = (2, 3, 4)
ABOUT_NORMAL = (0, 1, 5)

OFFSET = "+"
"""Suffix of the names of rows of the strain due to a unit offset of the mid-surface."""

TIES = "ties"
"""Name of the rows of the shears at the ties."""
LETTERS_ON_TIES = frozenset({"s", "v", "n", "w"})
"""First letters of the rows that are combinations of the shears at the ties, see `nodal_rows`.

They are the mean shear (s), the varying rest (v), and their parts in the narrow (n) and in the wide direction (w).
"""


@dataclass(frozen=True, eq=False)
class UniaxialStrains:
    """q strains that vary across the shell and have uniaxial stress, each along a direction.

    Parameters
    ----------
    along : (m, q, 2) unit directions
    in_plane : (m, q, n, 6) strains of the membrane
    bending : (m, q, n, 6) curvatures
    """

    along: Reals
    in_plane: Reals
    bending: Reals


@dataclass(frozen=True, eq=False)
class TiedShear:
    """Transverse shear that is a combination of few shears, those at the ties.

    Parameters
    ----------
    ties : (m, k, n, 6) rows of the shears at the ties
    mean : (m, 1, 2, k) the mean shear, as combinations of the ties
    varying : (m, r, 2, k) the shear minus its mean
    narrow : (m, 2) unit vector of the narrow direction, for the residual flexibility of the mean
    """

    ties: Reals
    mean: Reals
    varying: Reals
    narrow: Reals


@dataclass(frozen=True, eq=False)
class ShellStrains:
    """Strain rows of m shells with n corners, on (u, v, w, θx, θy, θz) of each along the axes of the mean plane.

    Weights are included; the number of points r may differ, but is the same for membrane and bending. ``placed``
    extends rows to six components.

    Parameters
    ----------
    membrane : (m, r, 3, n, 6) strains xx, yy and engineering xy
    uniaxial : strains and curvatures with uniaxial stress, or None
    drilling : (m, r, n, 6) rotation about the normal relative to that of the membrane
    bending : (m, r, 3, n, 6) curvatures θy,x, −θx,y and θy,y − θx,x
    shear : (m, r, 2, n, 6) transverse shear w,x + θy and w,y − θx; or combinations of the shears at ties
    """

    membrane: Reals
    uniaxial: UniaxialStrains | None
    drilling: Reals
    bending: Reals
    shear: Reals | TiedShear


@dataclass(frozen=True)
class ShellFormulation:
    """The parts of a shell that depend on its shape.

    Parameters
    ----------
    uniaxial : number q of uniaxial strain rows
    strains : mean plane -> strain rows
    shares : corners (m, n, 2) -> (m, n, n) integrals of products of the shape functions over the area
    residual : grid points (e, n, 3) -> sizes of the residual bending flexibility in the transverse shear
    """

    uniaxial: int
    strains: Callable[[ShellPlane], ShellStrains]
    shares: Callable[[Reals], Reals]
    residual: Callable[[Reals], ResidualFlexibility]


def nodal_rows(strains: ShellStrains, plane: ShellPlane, offsets: bool, coupling: bool = False) -> Rows:
    """Rows (m, r, 6n) by name on the grid points' displacements, strains along the material's axes.

    ``m1 m2 m12`` membrane, ``b1 b2 b12`` bending, ``a1 …`` and ``k1 …`` their uniaxial strains, ``drill``, ``s1 s2``
    shear. If the shear is tied, ``ties`` are the shears at the ties, and the rows (m, r, k) on these are ``s1 s2`` the
    mean, ``v1 v2`` the rest, ``n1 n2`` the part of the mean in the narrow direction, ``w1 w2`` that of the rest in the
    wide direction. With `offsets` also those that a unit offset adds to the membrane, with `coupling` also
    ``c1 c2 c12``, the curvatures coupled to the membrane. The factor 1/12 of t³/12 is included in the rows of bending.
    """
    c, s = plane.material[:, 0], plane.material[:, 1]
    in_plane = _named("m", _turn_strain(strains.membrane, c, s))
    curvature, twelfth = _turn_strain(strains.bending, c, s), np.sqrt(1.0 / 12.0)
    every, tied = _named("b", curvature * twelfth), Rows()
    if isinstance(strains.shear, TiedShear):
        every[TIES], tied = strains.shear.ties, _tied(strains.shear, c, s)
    else:
        every |= _pair("s", _turn_vector(strains.shear, c, s))
    if strains.uniaxial is not None:
        in_plane |= _numbered("a", strains.uniaxial.in_plane)
        every |= _numbered("k", strains.uniaxial.bending * twelfth)
    in_plane["drill"] = strains.drilling
    every |= in_plane
    if coupling:
        every |= _named("c", curvature)
    if offsets:
        every |= {name + OFFSET: _by_turn(rows) for name, rows in in_plane.items()}
    return {name: _lift(rows, plane) for name, rows in every.items()} | tied


def placed(rows: Reals, components: tuple[int, ...]) -> Reals:
    """Rows (…, n, 6) from rows (…, n, k) on some of the six components."""
    out = np.zeros((*rows.shape[:-1], 6))
    out[..., list(components)] = rows
    return out


def _named(letter: str, rows: Reals) -> Rows:
    return {f"{letter}{k}": rows[:, :, i] for i, k in enumerate(("1", "2", "12"))}


def _numbered(letter: str, rows: Reals) -> Rows:
    return {f"{letter}{i + 1}": rows[:, i : i + 1] for i in range(rows.shape[1])}


def _pair(letter: str, rows: Reals) -> Rows:
    return {f"{letter}{i + 1}": rows[:, :, i] for i in range(2)}


def _tied(shear: TiedShear, c: Reals, s: Reals) -> Rows:
    """Transverse shear and its parts, as rows on the shears at the ties."""
    x, y = shear.narrow.T
    narrow = np.stack([c * x + s * y, c * y - s * x], axis=1)
    wide = np.stack([-narrow[:, 1], narrow[:, 0]], axis=1)
    mean, rest = (_turn_vector(rows, c, s) for rows in (shear.mean, shear.varying))
    out = _pair("s", mean) | _pair("v", rest)
    for letter, way, every in (("n", narrow, mean), ("w", wide, rest)):
        along = np.einsum("mi,mrik->mrk", way, every)
        out |= _pair(letter, way[:, None, :, None] * along[:, :, None])
    return out


def _by_turn(rows: Reals) -> Reals:
    """Contribution of a unit offset, which moves u by θy and v by −θx."""
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
