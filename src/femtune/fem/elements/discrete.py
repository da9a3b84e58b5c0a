"""Scalar springs and masses (CELAS1/2, CMASS1/2): one value between two DOFs, or between one and ground."""

from __future__ import annotations

import numpy as np

from femtune.fem.contribution import Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.kind import ElementKind
from femtune.fem.structure import ElementBatch, Structure

PAIR = np.array([[1.0, -1.0], [-1.0, 1.0]])


def spring(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness K between the two DOFs."""
    matrices = np.tile(PAIR, (len(batch), 1, 1))
    return [Contribution("stiffness", "spring", np.arange(len(batch)), matrices, ("K",), product("K"))]


def scalar_mass(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Mass M that acts on the difference of the two DOFs' accelerations."""
    matrices = np.tile(PAIR * structure.mass_factor, (len(batch), 1, 1))
    return [Contribution("mass", "scalar-mass", np.arange(len(batch)), matrices, ("M",), product("M"))]


# ----------------------------------------------------------------------------------------------------
# Bushes (CBUSH): six springs and dashpots at one place, held by rigid arms to two grid points, or one and ground.


def bush(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffnesses K1 to K6 and damping B1 to B6 along and about the axes of ``frame``, with loss factors GE1 to GE6.

    Rigid motion is strain-free with any arms.
    """
    axes = batch.facts["frame"]
    a, b = (
        placement.arm_transform(axes, batch.facts[arm], placement.node_frames(batch, structure, k))
        for k, arm in enumerate(("arm_a", "arm_b"))
    )
    gaps = np.concatenate([-a, b], axis=2)
    out: list[Contribution] = []
    for i in range(6):
        out += _direction(batch, i + 1, placement.outer(gaps[:, i]))
    return out


def _direction(batch: ElementBatch, i: int, matrices: placement.Reals) -> list[Contribution]:
    """Spring and dashpot of a direction from 1 to 6."""
    at = np.arange(len(batch))
    k, b = f"K{i}", f"B{i}"
    spring = Contribution("stiffness", k, at, matrices, (k,), product(k), loss=f"GE{i}")
    return [spring, *([Contribution("viscous", b, at, matrices, (b,), product(b))] if b in batch.roles else [])]


# ----------------------------------------------------------------------------------------------------
# Dashpots (CDAMP1 to 4), and springs and dashpots along a line (CVISC, CBUSH1D).


Reals = placement.Reals


def dashpot(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Damping coefficient B between two DOFs, or between one and ground."""
    matrices = np.tile(PAIR, (len(batch), 1, 1))
    return [Contribution("viscous", "dashpot", np.arange(len(batch)), matrices, ("B",), product("B"))]


def line_dashpot(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Damping of stretching, CE, and of twisting, CR, along the unit vectors ``axis`` (e, 3) in the basic frame."""
    at = np.arange(len(batch))
    stretch, twist = _along(batch, structure)
    return [
        Contribution("viscous", "stretching", at, stretch, ("CE",), product("CE")),
        Contribution("viscous", "twisting", at, twist, ("CR",), product("CR")),
    ]


def line_spring(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness K and damping C of stretching along the unit vectors ``axis`` (e, 3) in the basic frame."""
    at = np.arange(len(batch))
    stretch, _ = _along(batch, structure)
    return [
        Contribution("stiffness", "spring", at, stretch, ("K",), product("K")),
        Contribution("viscous", "dashpot", at, stretch, ("C",), product("C")),
    ]


def _along(batch: ElementBatch, structure: Structure) -> tuple[Reals, Reals]:
    """(e, 12, 12) matrices of unit stiffness against stretching and against twisting."""
    axis = batch.facts["axis"]
    axes, still = placement.any_axes(axis), 0.0 * axis
    a, b = (placement.arm_transform(axes, still, placement.node_frames(batch, structure, k)) for k in (0, 1))
    gaps = np.concatenate([-a, b], axis=2)
    return placement.outer(gaps[:, 0]), placement.outer(gaps[:, 3])


# ----------------------------------------------------------------------------------------------------
# Masses at grid points (CONM2: mass, centre of gravity, inertia; CONM1: a general 6 × 6 matrix).


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
    """(e, 6, 6) matrix of a unit entry (i, j), and (j, i), on the node's displacements."""
    return placement.outer(turn[:, i]) if i == j else placement.outer(turn[:, i], turn[:, j])


SPRING = ElementKind("spring", spring, line=True)
BUSH = ElementKind("bush", bush, line=True)
DASHPOT = ElementKind("dashpot", dashpot, line=True)
LINE_DASHPOT = ElementKind("line-dashpot", line_dashpot, line=True)
LINE_SPRING = ElementKind("line-spring", line_spring, line=True)
SCALAR_MASS = ElementKind("scalar-mass", scalar_mass)
CONCENTRATED_MASS = ElementKind("concentrated-mass", concentrated_mass)
GENERAL_MASS = ElementKind("general-mass", general_mass)
