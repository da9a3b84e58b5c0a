"""Tapered beams (CBEAM): sections that change along the length, neutral axis and added mass beside the shear centre.

Stiffness is the inverse of the flexibility integrals; the mass of each station is shared by the two ends.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femtune.fem.contribution import Contribution
from femtune.fem.elements import placement, tapered_flexibility
from femtune.fem.elements.bar import bar_placement
from femtune.fem.elements.bending import PLANES
from femtune.fem.elements.tapered_flexibility import Flexibility, stiffness_entry
from femtune.fem.elements.tapered_mass import tapered_mass
from femtune.fem.elements.tapered_stations import LengthRule, length_rule, station_roles
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]
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
    """Terms of the elements at some positions, grouped by releases and by what couples and shears."""
    flags = np.column_stack([batch.facts["pins"], *(_active(batch, structure, rule, k) for k in ("", "1", "2"))])[at]
    out: list[Contribution] = []
    for pattern in np.unique(flags, axis=0):
        own = at[(flags == pattern).all(axis=1)]
        pins, joined, shear = pattern[:12], bool(pattern[12]), (bool(pattern[13]), bool(pattern[14]))
        for part in _parts(rule, joined, shear):
            part.add(out, own, pins, ends[own], length[own])
        out += _torsion(batch, structure, own, pins, rule, ends, length)
    return out


def _active(batch: ElementBatch, structure: Structure, rule: LengthRule, plane: str) -> NDArray[np.bool_]:
    """(e,) whether stretching and both planes are coupled ("") or a plane shears ("1", "2"), by the deck's values."""
    if plane:
        names = station_roles((f"K{plane}", "A"), rule.count)
        return np.all([placement.nominal(batch, structure, n) != 0.0 for n in (*names, "G")], axis=0)
    names = station_roles(("I12", "N1", "N2"), rule.count)
    return np.any([placement.nominal(batch, structure, n) != 0.0 for n in names], axis=0)


class _Part:
    """Forces that a flexibility joins: their labels, shapes on the ends, and roles."""

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


def _parts(rule: LengthRule, joined: bool, shear: tuple[bool, bool]) -> list[_Part]:
    if joined:
        names = ["A", "I1", "I2", "I12", "N1", "N2", *(f"K{p}" for p in (1, 2) if shear[p - 1])]
        roles = ("E", *(("G",) if any(shear) else ()), *station_roles(names, rule.count))
        shapes = ("axial", "curvature-1", "antisymmetric-1", "curvature-2", "antisymmetric-2")
        return [_Part("tapered", shapes, tapered_flexibility.coupled(rule, shear), roles)]
    stretch = _Part("tapered-axial", ("axial",), tapered_flexibility.axial(rule),
                    ("E", *station_roles("A", rule.count)))  # fmt: skip
    return [stretch, *(_plane(p, rule, shear[p - 1]) for p in (1, 2))]


def _plane(p: int, rule: LengthRule, shear: bool) -> _Part:
    names = (f"I{p}", *(("A", f"K{p}") if shear else ()))
    roles = ("E", *(("G",) if shear else ()), *station_roles(names, rule.count))
    shapes = (f"curvature-{p}", f"antisymmetric-{p}")
    return _Part(f"tapered-bending-{p}", shapes, tapered_flexibility.plane(p, rule, shear), roles)


def _torsion(
    batch: ElementBatch, structure: Structure, at: Rows, pins: NDArray, rule: LengthRule, ends: Reals, length: Reals
) -> list[Contribution]:
    """Twisting, where no station's J is zero."""
    names = station_roles("J", rule.count)
    at = at[np.all([placement.nominal(batch, structure, n)[at] != 0.0 for n in names], axis=0)]
    out: list[Contribution] = []
    part = _Part("tapered-torsion", ("torsion",), tapered_flexibility.torsion(rule), ("G", *names))
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
