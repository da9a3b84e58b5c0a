"""Supports of a rectangular plate that only bends."""

from __future__ import annotations

import numpy as np

from structures.shells import ShellMesh, dofs_of


def bending_only(mesh: ShellMesh) -> set[int]:
    return dofs_of(np.arange(len(mesh.xyz)), "126")


def simply_supported(mesh: ShellMesh) -> set[int]:
    """Edges that cannot move out of the plane nor turn about the edge's normal."""
    along_x = np.concatenate([mesh.edge("v0"), mesh.edge("v1")])
    along_y = np.concatenate([mesh.edge("u0"), mesh.edge("u1")])
    return bending_only(mesh) | dofs_of(along_x, "35") | dofs_of(along_y, "34")


def clamped(mesh: ShellMesh) -> set[int]:
    return bending_only(mesh) | dofs_of(mesh.rim, "345")
