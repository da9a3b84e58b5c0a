"""Masses at grid points (CONM2: mass, centre of gravity, inertia; CONM1: a general 6 × 6 matrix)."""

from __future__ import annotations

import numpy as np

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.structure import ElementBatch, Structure


def concentrated_mass(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Mass M at `offset` and inertia about that point along `frame`; products of inertia enter negative."""
    frames = placement.node_frames(batch, structure, 0)
    axes = batch.facts["frame"]
    lift = placement.arm_transform(axes, batch.facts["offset"], frames)
    at, factor = np.arange(len(batch)), structure.mass_factor
    mass = placement.carry(lift, np.tile(np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), (len(batch), 1, 1))) * factor
    out = [Contribution("mass", "mass", at, mass, ("M",), product("M"))]
    for i in range(3):
        for j in range(i + 1):
            role, sign = f"I{i + 1}{j + 1}", 1.0 if i == j else -1.0
            matrices = _entry(lift, 3 + i, 3 + j) * (sign * factor)
            out.append(Contribution("mass", role, at, matrices, (role,), product(role)))
    return out


def general_mass(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """The lower triangle M11, M21 … M66 of a symmetric matrix along `frame`."""
    frames = placement.node_frames(batch, structure, 0)
    axes = batch.facts["frame"]
    turn = placement.arm_transform(axes, np.zeros((len(batch), 3)), frames)
    return [
        Contribution(
            "mass",
            f"M{i + 1}{j + 1}",
            np.arange(len(batch)),
            _entry(turn, i, j) * structure.mass_factor,
            (f"M{i + 1}{j + 1}",),
            product(f"M{i + 1}{j + 1}"),
        )
        for i in range(6)
        for j in range(i + 1)
    ]


def _entry(turn: placement.Reals, i: int, j: int) -> placement.Reals:
    """(e, 6, 6) matrix that a unit entry (i, j), and (j, i), becomes on the node's displacements."""
    return placement.outer(turn[:, i]) if i == j else placement.outer(turn[:, i], turn[:, j])
