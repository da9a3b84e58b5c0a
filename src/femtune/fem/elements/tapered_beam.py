"""Tapered beams (CBEAM): varying sections, neutral axis and added mass off the shear centre.

Stiffness is the inverse of the flexibility integrals; the mass of each station is shared by the two ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement, tapered_flexibility
from femtune.fem.elements.bar import bar_differential, bar_placement
from femtune.fem.elements.bending import PLANES
from femtune.fem.elements.kind import BAR_PARTS, ElementKind
from femtune.fem.elements.line_mass import times_sum
from femtune.fem.elements.tapered_flexibility import Flexibility, stiffness_entry
from femtune.fem.elements.tapered_stations import LengthRule, length_rule, station_roles
from femtune.fem.structure import ElementBatch, Structure

# ----------------------------------------------------------------------------------------------------
# Mass of tapered beams, lumped or consistent, on the neutral axis and on the line of the added mass.
#
# μ changes linearly between stations, Σ μ_k h_k(ξ). Lumped: ∫ μ (1 − ξ) dx and ∫ μ ξ dx to the ends, so that mass and
# centre of gravity are correct. Consistent: Hermite polynomials for transverse displacements, the mean of lumped and
# consistent mass along the axis, linear twist. For a constant section these are the matrices of `line_mass`. The ends
# of the line of mass are on arms (0, n1, n2) that rotate with the grid points.


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
    """Groups of stations with the same values in every element."""
    groups: dict[bytes, list[int]] = {}
    for k in range(count):
        key = np.stack([batch.roles[f"{name}@{k}"][at] for name in ("A", "I1", "I2", "NSM", "NSI")]).tobytes()
        groups.setdefault(key, []).append(k)
    return list(groups.values())


def _line(share: Reals, rule: LengthRule, length: Reals, structure: Structure) -> Reals:
    """(m, 12, 12) translational mass of a line with density `share` (g,) per length."""
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
    elements = at[moved]
    for powers, term in _powers(dict(zip(names, _arms())), line[moved]) if len(elements) else ():
        matrices = placement.carry(ends[elements], term)
        roles = tuple(dict.fromkeys((*density, *powers)))
        out.append(Contribution("mass", f"{label}-{density[-1]}-{'-'.join(powers)}", elements, matrices, roles,
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
    """Displacements θ × r added by a unit offset along y and along z, of end A, then of end B."""
    out = []
    for end in (0, 6):
        along_y, along_z = np.zeros((12, 12)), np.zeros((12, 12))
        along_y[end, end + 5], along_y[end + 2, end + 3] = -1.0, 1.0
        along_z[end, end + 4], along_z[end + 1, end + 3] = 1.0, -1.0
        out += [along_y, along_z]
    return out


Rows = NDArray[np.int64]


def tapered_beam(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of beams with stations.

    The batch has the fact "stations" (e, s), ascending from 0 to 1, and the roles A I1 I2 I12 J K1 K2 NSM NSI N1 N2
    M1 M2 of each station, ``A@0`` … ``A@s-1``.

    Raises
    ------
    FemtuneError : ``element.zero-length``, ``element.orientation``
    """
    length, ends = bar_placement(batch, structure)
    out: list[Contribution] = []
    for stations in np.unique(batch.facts["stations"], axis=0):
        at = np.flatnonzero((batch.facts["stations"] == stations).all(axis=1))
        rule = length_rule(stations)
        out += _stiffness(batch, structure, at, rule, ends, length)
        out += tapered_mass(batch, structure, at, rule, ends, length)
    return [c for c in out if len(c.at)]


def _stiffness(
    batch: ElementBatch, structure: Structure, at: Rows, rule: LengthRule, ends: Reals, length: Reals
) -> list[Contribution]:
    """Terms of the elements at some positions, grouped by releases, coupling and shear."""
    flags = np.column_stack([batch.facts["pins"], *(_active(batch, structure, rule, k) for k in ("", "1", "2"))])[at]
    out: list[Contribution] = []
    for pattern in np.unique(flags, axis=0):
        group = at[(flags == pattern).all(axis=1)]
        pins, joined, shear = pattern[:12], bool(pattern[12]), (bool(pattern[13]), bool(pattern[14]))
        for part in _parts(rule, joined, shear):
            part.add(out, group, pins, ends[group], length[group])
        out += _torsion(batch, structure, group, pins, rule, ends, length)
    return out


def _active(batch: ElementBatch, structure: Structure, rule: LengthRule, plane: str) -> NDArray[np.bool_]:
    """(e,) True if stretching and both planes are coupled ("") or a plane has shear ("1", "2") in the deck."""
    if plane:
        names = station_roles((f"K{plane}", "A"), rule.count)
        return np.all([placement.nominal(batch, structure, n) != 0.0 for n in (*names, "G")], axis=0)
    names = station_roles(("I12", "N1", "N2"), rule.count)
    return np.any([placement.nominal(batch, structure, n) != 0.0 for n in names], axis=0)


class _ForceGroup:
    """Forces that are coupled by a flexibility: their labels, shapes on the ends, and roles."""

    def __init__(self, label: str, shapes: tuple[str, ...], flexibility: Flexibility, roles: tuple[str, ...]) -> None:
        self.label, self.shapes, self.flexibility, self.roles = label, shapes, flexibility, roles

    def add(self, out: list[Contribution], at: Rows, pins: NDArray, ends: Reals, length: Reals) -> None:
        """Append Σ k_ij (g_i g_jᵀ + g_j g_iᵀ) of the forces that the released DOFs allow."""
        local = np.stack([_shape(name, length) for name in self.shapes], axis=1)
        unit = np.stack([_shape(name, np.array([2.0]))[0] for name in self.shapes])
        free = _free_forces(unit, pins)
        g = np.einsum("ar,mad,mdn->mrn", free, local, ends)
        for i in range(free.shape[1]):
            for j in range(i, free.shape[1]):
                matrices = placement.outer(g[:, i]) if i == j else placement.outer(g[:, i], g[:, j])
                coefficient = stiffness_entry(self.flexibility, free, i, j)
                out.append(Contribution("stiffness", f"{self.label}-{i}{j}", at, matrices, self.roles, coefficient,
                                        {"length": length}))  # fmt: skip


def _parts(rule: LengthRule, joined: bool, shear: tuple[bool, bool]) -> list[_ForceGroup]:
    if joined:
        names = ["A", "I1", "I2", "I12", "N1", "N2", *(f"K{p}" for p in (1, 2) if shear[p - 1])]
        roles = ("E", *(("G",) if any(shear) else ()), *station_roles(names, rule.count))
        shapes = ("axial", "curvature-1", "antisymmetric-1", "curvature-2", "antisymmetric-2")
        return [_ForceGroup("tapered", shapes, tapered_flexibility.coupled(rule, shear), roles)]
    stretch = _ForceGroup("tapered-axial", ("axial",), tapered_flexibility.axial(rule),
                    ("E", *station_roles("A", rule.count)))  # fmt: skip
    return [stretch, *(_plane(p, rule, shear[p - 1]) for p in (1, 2))]


def _plane(p: int, rule: LengthRule, shear: bool) -> _ForceGroup:
    names = (f"I{p}", *(("A", f"K{p}") if shear else ()))
    roles = ("E", *(("G",) if shear else ()), *station_roles(names, rule.count))
    shapes = (f"curvature-{p}", f"antisymmetric-{p}")
    return _ForceGroup(f"tapered-bending-{p}", shapes, tapered_flexibility.plane(p, rule, shear), roles)


def _torsion(
    batch: ElementBatch, structure: Structure, at: Rows, pins: NDArray, rule: LengthRule, ends: Reals, length: Reals
) -> list[Contribution]:
    """Torsion of the elements in which no station's J is zero."""
    names = station_roles("J", rule.count)
    at = at[np.all([placement.nominal(batch, structure, n)[at] != 0.0 for n in names], axis=0)]
    out: list[Contribution] = []
    part = _ForceGroup("tapered-torsion", ("torsion",), tapered_flexibility.torsion(rule), ("G", *names))
    part.add(out, at, pins, ends[at], length[at])
    return out


def _shape(name: str, length: Reals) -> Reals:
    """(m, 12) displacements of the ends that a force works on, along the element's axes."""
    out = np.zeros((len(length), 12))
    kind, _, plane = name.partition("-")
    if not plane:
        row = 0 if kind == "axial" else 3
        out[:, row], out[:, row + 6] = -1.0, 1.0
        return out
    rows, signs = PLANES[int(plane)]
    tilt = 2.0 / length if kind == "antisymmetric" else 0.0 * length
    start = np.ones_like(length) if kind == "antisymmetric" else -np.ones_like(length)
    out[:, rows] = np.stack([tilt, start, -tilt, np.ones_like(length)], axis=1) * signs
    return out


def _free_forces(shapes: Reals, pins: NDArray) -> Reals:
    """(n, r) combinations of the n forces that do not load the released DOFs."""
    loaded = shapes[:, pins.astype(bool)].T
    return scipy.linalg.null_space(loaded) if loaded.any() else np.eye(len(shapes))


TAPERED_BEAM = ElementKind(
    "tapered-beam", tapered_beam, line=True, children=BAR_PARTS, end_offsets=True, differential=bar_differential
)
