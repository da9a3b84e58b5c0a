"""Curved bars (CBEND): a circular arc between two grid points, by its flexibility.

A force and a moment at end B cause N, two shear forces, the twisting moment and two bending moments along the arc.
Their complementary energy is integrated, and the inverse of the flexibility is the stiffness. The arc is slender: its
neutral axis is that of the centroids. Motions in the plane of the arc and out of it are not coupled. Source:
Castigliano's theorem for arcs (Timoshenko, Strength of Materials, Part I, 1955, section 80).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.tapered_flexibility import inverse_entry, sum_of
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

_GAUSS_POINTS = 24
"""Gauss points along an arc.

The integrands are products of two first-order polynomials in cos φ and sin φ, which this rule integrates to rounding
errors for any arc of less than a full circle.
"""
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
# of the forces at end B along (e_r, e_t, e_z) of end A, followed by the moments: those in the plane of the arc, those
# out
_IN_PLANE_FORCES = (0, 1, 5)
_OUT_OF_PLANE_FORCES = (2, 3, 4)
# stiffnesses of the section, by their roles, in the order of the internal forces
_RESISTS = {
    "in": (_IN_PLANE_FORCES, (("E", "A"), ("G", "A", "K1"), ("E", "I1"))),
    "out": (_OUT_OF_PLANE_FORCES, (("G", "A", "K2"), ("G", "J"), ("E", "I2"))),
}


def curved_bar(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness and lumped mass of arcs.

    The batch has the facts "axes" (e, 3, 3), whose columns are e_r, e_t and e_z at end A in the basic frame, "radius"
    (e,) and "angle" (e,) in rad, and the roles E G rho A I1 I2 J K1 K2 NSM; I1 is for bending in the arc's plane.
    """
    radius, angle, at = batch.facts["radius"], batch.facts["angle"], np.arange(len(batch))
    gaps, parts = _gaps(batch, structure), _flexibilities(radius, angle)
    out: list[Contribution] = []
    for name, (forces, stiff) in _RESISTS.items():
        shears = np.all([placement.nominal(batch, structure, role) != 0.0 for role in stiff[_SHEAR[name]]], axis=0)
        for sheared in np.unique(shears):
            group = at[shears == sheared]
            kept = [k for k in range(3) if sheared or k != _SHEAR[name]]
            flex = {k: parts[name][k][group] for k in kept}
            facts = {f"f{k}{i}{j}": flex[k][:, i, j] for k in kept for i, j in _PAIRS}
            roles = tuple(dict.fromkeys(role for k in kept for role in stiff[k]))
            g = gaps[group][:, forces]
            for i, j in _PAIRS:
                matrices = placement.outer(g[:, i]) if i == j else placement.outer(g[:, i], g[:, j])
                entry = _entry(stiff, tuple(kept), i, j)
                out.append(Contribution("stiffness", f"arc-{name}-{i}{j}", group, matrices, roles, entry, facts))
    return [*out, *_mass(batch, structure, radius * angle)]


# which of them is the transverse shear
_SHEAR = {"in": 1, "out": 0}


def _entry(stiff: tuple[tuple[str, ...], ...], kept: tuple[int, ...], i: int, j: int) -> Coefficient:
    """Entry (i, j) of the inverse of Σ f / stiffness."""

    def coefficient(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        soft = {k: 1.0 / product(*stiff[k])(values, {}) for k in kept}

        def flexibility(a: int, b: int) -> Jet:
            return sum_of([soft[k] * facts[f"f{k}{min(a, b)}{max(a, b)}"] for k in kept])

        return inverse_entry([[flexibility(a, b) for b in range(3)] for a in range(3)], i, j)

    return coefficient


def _gaps(batch: ElementBatch, structure: Structure) -> Reals:
    """(e, 6, 12) displacements of end B relative to a rigid body that moves with end A, on the axes at A."""
    axes = batch.facts["axes"]
    start, end = (placement.node_positions(batch, structure, k) for k in (0, 1))
    frames = [placement.node_frames(batch, structure, k) for k in (0, 1)]
    a = placement.arm_transform(axes, end - start, frames[0])
    b = placement.arm_transform(axes, 0.0 * start, frames[1])
    return np.concatenate([-a, b], axis=2)


def _flexibilities(radius: Reals, angle: Reals) -> dict[str, Reals]:
    """(3, e, 3, 3) integrals of the squared internal forces of each kind, in the plane and out of it."""
    points, weights = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    phi = 0.5 * angle[:, None] * (points + 1.0)
    ds = 0.5 * (radius * angle)[:, None] * weights
    c, s, one, none = np.cos(phi), np.sin(phi), np.ones_like(phi), np.zeros_like(phi)
    # from the section to end B, on the axes at A
    x = radius[:, None] * (np.cos(angle)[:, None] - c)
    y = radius[:, None] * (np.sin(angle)[:, None] - s)
    plane = ((-s, c, none), (c, s, none), (-y, x, one))  # N, V and the moment about z of F_r, F_t and M_z
    # moments of F_z, M_r and M_t along the arc and about the radius
    moment_x, moment_y = (y, one, none), (-x, none, one)
    twist = tuple(c * my - s * mx for mx, my in zip(moment_x, moment_y))
    bend = tuple(c * mx + s * my for mx, my in zip(moment_x, moment_y))
    across = ((one, none, none), twist, bend)
    return {
        name: np.stack([np.einsum("ieg,jeg,eg->eij", np.stack(f), np.stack(f), ds) for f in kinds])
        for name, kinds in (("in", plane), ("out", across))
    }


def _mass(batch: ElementBatch, structure: Structure, length: Reals) -> list[Contribution]:
    """Half of the mass at each end."""
    at = np.arange(len(batch))
    unit = np.diag(np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], 2)) * structure.mass_factor
    matrices = 0.5 * length[:, None, None] * unit
    return [
        Contribution("mass", "mass", at, matrices, ("rho", "A"), product("rho", "A")),
        Contribution("mass", "added-mass", at, matrices, ("NSM",), product("NSM")),
    ]


CURVED_BAR = ElementKind("curved-bar", curved_bar, line=True)
