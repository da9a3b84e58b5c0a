"""Bars whose planes of bending are coupled by a product of inertia I12, with or without transverse shear."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.bending import bending_modes, shapes_on_nodes
from femtune.parameters.jet import Jet

Reals = NDArray[np.float64]
Flags = NDArray[np.bool_]


def skew_bending(at: NDArray[np.int64], ends: Reals, length: Reals, shear: Flags) -> list[Contribution]:
    """Terms of m skew elements at positions `at`; `shear` (m, 2) tells in which planes transverse shear counts.

    Gives E·I12 (curvature of all, antisymmetric bending of the shear-rigid) and the antisymmetric bending of the
    others, for which the flexibilities of both planes are inverted together.
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
        own = (shear == [1 in planes, 2 in planes]).all(axis=1)
        out += _sheared(at[own], [g[own] for g in shapes], length[own], planes)
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
