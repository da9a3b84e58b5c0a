"""Meshes of the static tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from structures.shells import ShellMesh, rectangle, shell_mesh

Reals = NDArray[np.float64]


def strip(n: int, kind: str) -> ShellMesh:
    """The straight beam 6 × 0.2, one row of cells."""
    return shell_mesh(rectangle(6.0, 0.2), n, 1, kind)


def quarter_curve(n: int, kind: str) -> ShellMesh:
    """A quarter of a circle between the radii 4.12 and 4.32, one row of cells."""
    turn = np.pi / 2
    return shell_mesh(
        lambda u, v: ((4.32 - 0.2 * v) * np.sin(turn * u), (4.32 - 0.2 * v) * np.cos(turn * u), 0 * u), n, 1, kind
    )


def twist(u: Reals, v: Reals) -> tuple[Reals, Reals, Reals]:
    """The middle surface of a strip 12 × 1.1 turned by 90°."""
    turn = np.pi / 2 * u
    return 12 * u, 1.1 * (v - 0.5) * np.cos(turn), 1.1 * (v - 0.5) * np.sin(turn)


def twisted(nu: int, nv: int, kind: str) -> ShellMesh:
    """The twisted beam."""
    return shell_mesh(twist, nu, nv, kind)


def roof(n: int, kind: str) -> ShellMesh:
    """A quarter of Scordelis and Lo's roof: R 25, L 50, 40° each side."""
    angle = np.radians(40.0)
    return shell_mesh(lambda u, v: (25 * np.sin(angle * u), 25 * v, 25 * np.cos(angle * u)), n, n, kind)


def hemisphere(n: int, kind: str) -> ShellMesh:
    """A quarter of a hemisphere of radius 10 with a hole of 18° at its top."""

    def place(u: Reals, v: Reals) -> tuple[Reals, Reals, Reals]:
        a, p = np.pi / 2 * u, np.radians(72 * v)
        return 10 * np.cos(p) * np.cos(a), 10 * np.cos(p) * np.sin(a), 10 * np.sin(p)

    return shell_mesh(place, n, n, kind)


def edge_force(mesh: ShellMesh, component: int) -> Reals:
    """A unit force along the edge u = 1, shared as linear functions share it."""
    end = mesh.edge("u1")
    share = np.ones(len(end))
    share[[0, -1]] = 0.5
    force = np.zeros(6 * len(mesh.xyz))
    force[6 * end + component - 1] = share / share.sum()
    return force
