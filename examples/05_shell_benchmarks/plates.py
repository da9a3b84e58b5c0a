"""Thin and thick square plates in all 21 combinations of supports, and skew and circular plates."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from ritz import thick, thin

from structures.shells import (
    Isotropic,
    Section,
    ShellMesh,
    ShellPart,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
)

E, NU, RHO = 2.0e11, 0.3, 8000.0
MODES = 6
CANCELLED = 0.005
"""Errors below this part: those of mass, bending and residual flexibility cancel, and the order means little."""
Reals = NDArray[np.float64]


def held(mesh: ShellMesh, edges: str) -> set[int]:
    """Motion in the plane everywhere; the deflection at S and C, the turn about the edge's normal at S, all at C."""
    out = dofs_of(np.arange(len(mesh.xyz)), "126")
    for name, letter in zip(("u0", "v0", "u1", "v1"), edges):
        turns = {"S": "34" if name[0] == "u" else "35", "C": "345", "F": ""}[letter]
        out |= dofs_of(mesh.edge(name), turns)
    return out


def frequency_numbers(mesh: ShellMesh, fixed: set[int], t: float, count: int, consistent: bool) -> Reals:
    """ω L² √(ρt/D) of the lowest modes of a plate with L = 1."""
    parts = [ShellPart(mesh.cells, Section(Isotropic(E, NU, RHO), t))]
    structure = shell_structure(mesh.xyz, parts, held=fixed, consistent_mass=consistent)
    unit = np.sqrt(E * t**2 / (12 * (1 - NU**2) * RHO))
    return natural_frequencies(structure, count) * 2 * np.pi / unit


def rigid_motions(edges: str) -> int:
    """How many of the three rigid motions of a plate its edges leave."""
    if "C" in edges:
        return 0
    return {0: 3, 1: 1}.get(edges.count("S"), 0)


@cache
def reference(edges: str, t: float) -> Reals:
    """Six elastic numbers by the Ritz method: Kirchhoff's plate, Mindlin's from a thickness of a twentieth on."""
    rigid = rigid_motions(edges)
    count = rigid + MODES
    return (thin(edges, count) if t < 0.05 else thick(edges, count, t))[rigid:]


def errors(edges: str, t: float, n: int, cells: str, consistent: bool) -> Reals:
    """Relative errors of six elastic modes of a square plate of n × n cells."""
    mesh, rigid = shell_mesh(rectangle(1.0, 1.0), n, n, cells), rigid_motions(edges)
    found = frequency_numbers(mesh, held(mesh, edges), t, rigid + MODES, consistent)
    return found[rigid : rigid + MODES] / reference(edges, t) - 1.0
