"""Straight bars and beams (CBAR, CBEAM): axial, torsion, bending in two planes, rigid ends, released DOFs.

Shear-rigid bars are products of values times constant matrices; shear-flexible bending is rational in A, I, K, G.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags, Reals
from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.bending import PLANES, BendingMode, bending_modes, bending_with_shear, shapes_on_nodes
from femtune.fem.elements.differential import Differential, of_bar
from femtune.fem.elements.kind import BAR_PARTS, ElementKind
from femtune.fem.elements.line_mass import line_mass
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

# ----------------------------------------------------------------------------------------------------
# Bars whose planes of bending are coupled by a product of inertia I12, with or without transverse shear.


def skew_bending(at: NDArray[np.int64], ends: Reals, length: Reals, shear: Flags) -> list[Contribution]:
    """Terms of m skew elements at positions `at`; `shear` (m, 2) tells which planes have transverse shear.

    Gives E·I12 (curvature of all elements, antisymmetric bending of shear-rigid ones) and the antisymmetric bending of
    shear-flexible ones, for which the flexibilities of both planes are inverted together.
    """
    if not len(at):
        return []
    curvature, antisymmetric = bending_modes(length, np.zeros((len(at), 4), bool))
    rigid = ~shear.any(axis=1)
    bent = placement.outer(*(shapes_on_nodes(curvature, p, ends) for p in (1, 2))) / length[:, None, None]
    shapes = [shapes_on_nodes(antisymmetric, p, ends) for p in (1, 2)]
    bent[rigid] += placement.outer(*shapes)[rigid] * (12.0 / length[rigid, None, None] ** 3)
    out = [Contribution("stiffness", "bending-12", at, bent, ("E", "I12"), product("E", "I12"))]
    for planes in ((1,), (2,), (1, 2)):
        group = (shear == [1 in planes, 2 in planes]).all(axis=1)
        out += _sheared(at[group], [g[group] for g in shapes], length[group], planes)
    return out


def _sheared(at: NDArray[np.int64], shapes: list[Reals], length: Reals, planes: tuple[int, ...]) -> list[Contribution]:
    roles = ("E", "I1", "I2", "I12", "G", "A", *(f"K{p}" for p in planes))
    pairs = {(1, 1): placement.outer(shapes[0]), (2, 2): placement.outer(shapes[1]), (1, 2): placement.outer(*shapes)}
    return [
        Contribution(
            "stiffness", f"shear-bending-{i}{j}", at, matrices, roles, coupled(i, j, planes), {"length": length}
        )
        for (i, j), matrices in pairs.items()
        if len(at)
    ]


def coupled(i: int, j: int, planes: tuple[int, ...]) -> Coefficient:
    """Entry (i, j) of the inverse of L³/12E · [[I1, I12], [I12, I2]]⁻¹ + L · diag(1/KAG), the shear in `planes`."""

    def stiffness(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        flexibility = flexibilities(values, facts["length"], planes)
        determinant = flexibility[1, 1] * flexibility[2, 2] - flexibility[1, 2] * flexibility[1, 2]
        if i != j:
            return -flexibility[1, 2] / determinant
        return flexibility[3 - i, 3 - i] / determinant

    return stiffness


def flexibilities(values: Mapping[str, Jet], length: Reals, planes: tuple[int, ...]) -> dict[tuple[int, int], Jet]:
    """Flexibilities of antisymmetric bending of both planes and between them."""
    I1, I2, I12 = values["I1"], values["I2"], values["I12"]
    bending = length**3 / 12.0 / (values["E"] * (I1 * I2 - I12 * I12))
    out = {(1, 1): bending * I2, (2, 2): bending * I1, (1, 2): -(bending * I12)}
    for p in planes:
        out[p, p] = out[p, p] + length / (values[f"K{p}"] * values["A"] * values["G"])
    return out


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

    With the fact "at_ends" it refers to the displacements of the ends of the arms, along the nodes' frames.
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
    """(e,) True if a plane has transverse shear; CBAR ignores it where I12 is not zero."""
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
        raise placement.element_error(batch, int(i), "element.pinned-i12")


def _plane(
    p: int, modes: list[BendingMode], ends: Reals, flexible: NDArray[np.bool_], coupled: NDArray[np.bool_]
) -> list[Contribution]:
    """Terms E·I and rational terms of a plane; antisymmetric bending of `coupled` elements is left out."""
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


def bar_differential(batch: ElementBatch, structure: Structure) -> Differential:
    """Differential stiffness of the axial force; errors as of `bar`."""
    length, ends = bar_placement(batch, structure)
    return of_bar(ends, length, np.asarray(batch.facts["pins"], bool))


BAR = ElementKind("bar", bar, line=True, children=BAR_PARTS, end_offsets=True, differential=bar_differential)
