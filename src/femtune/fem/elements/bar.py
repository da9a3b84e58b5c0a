"""Straight bars and beams (CBAR, CBEAM): axial, torsion, bending in two planes, rigid ends, released DOFs.

Shear-rigid bars are products of values times constant matrices; shear-flexible bending is rational in A, I, K, G.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.bending import PLANES, BendingMode, bending_modes, bending_with_shear, shapes_on_nodes
from femtune.fem.elements.line_mass import line_mass
from femtune.fem.elements.skew_bending import skew_bending
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]


def bar(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and mass of CBAR and CBEAM.

    Raises
    ------
    FemtuneError : ``element.zero-length``, ``element.orientation``, ``element.pinned-i12``
    """
    length, ends = bar_placement(batch, structure)
    stretch = _along(batch, ends, length, 0, "axial", product("E", "A"))
    twist = _along(batch, ends, length, 3, "torsion", product("G", "J"))
    bend = _bending(batch, structure, ends, length)
    torsional = ("I1", "I2") if batch.card == "CBEAM" else ()
    mass = line_mass(batch, structure, ends, length, bending=True, torsional=torsional)
    return [c for c in [stretch, twist, *bend, *mass] if len(c.at)]


def bar_placement(batch: ElementBatch, structure: Structure) -> tuple[Reals, Reals]:
    """Lengths (e,) and the transformation (e, 12, 12) onto the nodes' displacements.

    With the fact "at_ends" it leads onto those of the ends of the arms, along the nodes' frames.
    """
    arm_a, arm_b = batch.facts["offset_a"], batch.facts["offset_b"]
    start = placement.node_positions(batch, structure, 0) + arm_a
    end = placement.node_positions(batch, structure, 1) + arm_b
    x, length = placement.line_axes(batch, start, end)
    axes = placement.oriented_axes(batch, x, batch.facts["orientation"])
    if "at_ends" in batch.facts:
        arm_a = arm_b = np.zeros_like(arm_a)
    a = placement.arm_transform(axes, arm_a, placement.node_frames(batch, structure, 0))
    b = placement.arm_transform(axes, arm_b, placement.node_frames(batch, structure, 1))
    return length, placement.join_ends(a, b)


def _along(
    batch: ElementBatch, ends: Reals, length: Reals, row: int, label: str, coefficient: Coefficient
) -> Contribution:
    """Stretching (row 0) or twisting (row 3) of the elements in which neither end is released."""
    pins = batch.facts["pins"]
    at = np.flatnonzero(~(pins[:, row] | pins[:, row + 6]))
    g = ends[at, row + 6] - ends[at, row]
    roles = ("E", "A") if row == 0 else ("G", "J")
    return Contribution("stiffness", label, at, placement.outer(g) / length[at, None, None], roles, coefficient)


def shear_flexible(batch: ElementBatch, structure: Structure, plane: int) -> NDArray[np.bool_]:
    """(e,) True where transverse shear of a plane counts; CBAR ignores it where I12 is not zero."""
    values = [placement.nominal(batch, structure, r) for r in (f"K{plane}", "A", "G", f"I{plane}")]
    out = np.all([v != 0.0 for v in values], axis=0)
    return np.asarray(out & ~skewed(batch, structure) if batch.card == "CBAR" else out)


def skewed(batch: ElementBatch, structure: Structure) -> NDArray[np.bool_]:
    """(e,) True where the planes are coupled by I12."""
    return np.asarray(placement.nominal(batch, structure, "I12") != 0.0)


def _bending(batch: ElementBatch, structure: Structure, ends: Reals, length: Reals) -> list[Contribution]:
    skew = skewed(batch, structure)
    _refuse_skew_pins(batch, skew)
    flexible = {p: shear_flexible(batch, structure, p) for p in PLANES}
    coupled = skew & (flexible[1] | flexible[2])
    modes = {p: bending_modes(length, batch.facts["pins"][:, PLANES[p][0]]) for p in PLANES}
    out = []
    for p in PLANES:
        out += _plane(p, modes[p], ends, flexible[p], coupled)
    at = np.flatnonzero(skew)
    active = np.stack([flexible[1], flexible[2]], axis=1)[at]
    return [*out, *skew_bending(at, ends[at], length[at], active)]


def _refuse_skew_pins(batch: ElementBatch, skew: NDArray[np.bool_]) -> None:
    bending = [row for rows, _ in PLANES.values() for row in rows]
    for i in np.flatnonzero(skew & batch.facts["pins"][:, bending].any(axis=1)):
        what = "bending DOFs are released on a bar whose product of inertia I12 is not zero"
        hint = "orient the bar along its principal axes, so that I12 is zero"
        raise placement.element_error(batch, int(i), "element.pinned-i12", what, hint)


def _plane(
    p: int, modes: list[BendingMode], ends: Reals, flexible: NDArray[np.bool_], coupled: NDArray[np.bool_]
) -> list[Contribution]:
    """Terms E·I and rational ones of a plane; antisymmetric bending of `coupled` elements is left out."""
    count, scaled, out = np.zeros(len(ends), np.int64), np.zeros((len(ends), 2, 12)), []
    for mode in modes:
        shapes = shapes_on_nodes(mode, p, ends)
        shears = mode.shear > 0.0
        rigid = ~(shears & (flexible | coupled)[mode.at])
        here = mode.at[rigid]
        scaled[here, count[here]] = shapes[rigid] / np.sqrt(mode.bending[rigid, None])
        count[here] += 1
        out.append(_rational(p, mode, shapes, shears & (flexible & ~coupled)[mode.at]))
    at = np.flatnonzero(count)
    total = placement.sum_of_squares(scaled[at])
    return [Contribution("stiffness", f"bending-{p}", at, total, ("E", f"I{p}"), product("E", f"I{p}")), *out]


def _rational(p: int, mode: BendingMode, shapes: Reals, keep: NDArray[np.bool_]) -> Contribution:
    facts = {"bending": mode.bending[keep], "shear": mode.shear[keep]}
    roles = ("E", f"I{p}", "G", "A", f"K{p}")
    label, coefficient = f"shear-bending-{p}", bending_with_shear(f"I{p}", f"K{p}")
    return Contribution("stiffness", label, mode.at[keep], placement.outer(shapes[keep]), roles, coefficient, facts)
