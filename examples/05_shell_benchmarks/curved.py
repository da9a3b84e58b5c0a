"""Cylinders and spheres beside closed forms."""

from __future__ import annotations

import numpy as np
from closed_forms import cylinder_between_diaphragms, free_ring_modes, sphere
from numpy.typing import NDArray
from page import numbers, section, table

from structures.shells import (
    Isotropic,
    Section,
    ShellMesh,
    ShellPart,
    cylinder,
    dofs_of,
    natural_frequencies,
    shell_mesh,
    shell_structure,
)

E, RHO = 2.0e11, 8000.0
R, L = 1.0, 2.0
KINDS = {"quad": "quads", "union": "triangles"}
MASSES = {True: "consistent", False: "lumped"}
Reals = NDArray[np.float64]


def tube(n: int, cells: str) -> ShellMesh:
    """n cells around, a third as many along."""
    return shell_mesh(cylinder(R, L), n, n // 3, cells, closed=True)


def diaphragms(n: int, cells: str, consistent: bool, t: float) -> Reals:
    """Eight elastic modes of the cylinder between diaphragms; it may move along its axis."""
    mesh = tube(n, cells)
    fixed = dofs_of(np.concatenate([mesh.edge("v0"), mesh.edge("v1")]), "12")
    parts = [ShellPart(mesh.cells, Section(Isotropic(E, 0.3, RHO), t))]
    structure = shell_structure(mesh.xyz, parts, held=fixed, consistent_mass=consistent)
    return natural_frequencies(structure, 9)[1:9]


def free_tube(n: int, cells: str, consistent: bool, t: float) -> Reals:
    """The first mode that bends without stretching, without Poisson's ratio; a pair."""
    mesh = tube(n, cells)
    parts = [ShellPart(mesh.cells, Section(Isotropic(E, 0.0, RHO), t))]
    return natural_frequencies(shell_structure(mesh.xyz, parts, consistent_mass=consistent), 8)[6:8]


def cylinder_rows(n: int, masses: dict[bool, str], t: float = 0.01) -> list[list[str]]:
    """Errors on two meshes; asserts the order of every distinct mode of the finest with consistent mass."""
    exact, rows = cylinder_between_diaphragms(R, L, t, E, 0.3, RHO, 8), []
    ring = np.full(2, free_ring_modes(R, t, E, RHO, 2))
    for name, wanted, solve in (("diaphragms", exact, diaphragms), ("free, n = 2", ring, free_tube)):
        for kind, label in KINDS.items():
            for consistent, mass in masses.items():
                coarse, fine = (solve(k, kind, consistent, t) / wanted - 1 for k in (n, 2 * n))
                orders = np.log2(np.abs(coarse / fine))[::2]
                if consistent and n >= 48 and name == "diaphragms":
                    assert np.abs(orders - 2.0).max() < 0.3, (kind, orders)
                assert np.abs(fine).max() < 0.025 * (48 / n) ** 2.2, (name, kind, fine)
                shown = " ".join(f"{x:.2f}" for x in orders) if consistent else ""
                cells = (numbers(100 * coarse[::2]), numbers(100 * fine[::2]), shown)
                rows.append([name, f"{label}, {mass}", " ".join(f"{x:.5g}" for x in wanted[::2]), *cells])
    return rows


def ball(n: int) -> tuple[Reals, NDArray[np.int64]]:
    """A unit sphere of six patches of n × n quadrilaterals, normals outwards."""
    rows: dict[tuple[int, ...], int] = {}
    a = np.tan(np.linspace(-np.pi / 4, np.pi / 4, n + 1))
    grid = np.stack([np.ones((n + 1, n + 1)), *np.meshgrid(a, a, indexing="ij")], axis=-1)
    cells = []
    for axis in range(3):
        for side in (1.0, -1.0):
            points = np.roll(grid * [side, 1.0, 1.0], axis, axis=-1)
            points = points / np.linalg.norm(points, axis=-1, keepdims=True)
            keys = [tuple(key) for key in np.round(points.reshape(-1, 3) * 1e7).astype(int).tolist()]
            at = np.array([rows.setdefault(key, len(rows)) for key in keys]).reshape(n + 1, n + 1)
            quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
            cells.append(quads if side > 0 else quads[:, ::-1])
    return np.array(list(rows)) / 1e7, np.concatenate(cells)


def sphere_modes(n: int, triangles: bool, consistent: bool, t: float = 0.01) -> tuple[Reals, Reals]:
    """ω R √(ρ/E) of the five modes of degree 2 and of the seven of degree 3."""
    xyz, cells = ball(n)
    if triangles:
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    parts = [ShellPart(cells, Section(Isotropic(1.0, 0.3, 1.0), t))]
    found = natural_frequencies(shell_structure(xyz, parts, consistent_mass=consistent), 18) * 2 * np.pi
    return found[6:11], found[11:18]


def sphere_rows(n: int, masses: dict[bool, str]) -> list[list[str]]:
    """Mean errors and spreads of the two lowest clusters of a full sphere; asserts the order of the mean."""
    exact, rows = (sphere(2, 0.3)[0], sphere(3, 0.3)[0]), []
    for triangles, label in ((False, "quads"), (True, "triangles")):
        for consistent, mass in masses.items():
            coarse, fine = (
                [m / e - 1 for m, e in zip(sphere_modes(k, triangles, consistent), exact)] for k in (n, 2 * n)
            )
            orders = [float(np.log2(abs(a.mean() / b.mean()))) for a, b in zip(coarse, fine)]
            if consistent:
                assert abs(orders[0] - 2.0) < 0.3, (label, orders)
            assert max(np.abs(f).max() for f in fine) < 0.02 * (8 / n) ** 2, (label, fine)
            for degree, before, after, order in zip((2, 3), coarse, fine, orders):
                spread = f"{numbers([100 * after.mean()])}, {numbers([100 * after.min(), 100 * after.max()])}"
                start = [f"{degree} ({2 * degree + 1} modes)", f"{label}, {mass}", f"{exact[degree - 2]:.5f}"]
                rows.append([*start, numbers([100 * before.mean()]), spread, f"{order:.2f}" if consistent else ""])
    return rows


def curved(quick: bool) -> str:
    """Both tables."""
    n, m = (24, 4) if quick else (48, 8)
    masses = {True: "consistent"} if quick else MASSES
    head = ("ends", "elements", "exact, Hz", f"{n} around", f"{2 * n} around", "orders")
    tubes = section("Cylinders", TUBE, table(head, cylinder_rows(n, masses)))
    head = (
        "degree",
        "elements",
        "exact",
        f"6 × {m} × {m}, mean",
        f"6 × {2 * m} × {2 * m}: mean, lowest, highest",
        "order",
    )
    return tubes + "\n" + section("Full sphere", BALL, table(head, sphere_rows(m, masses)))


TUBE = """R = 1, L = 2, t = 0.01 m, steel; modes come in pairs, one of each is listed, errors in per cent. Between
diaphragms (v = w = 0, u free): the 3 × 3 equations of Sanders' shell theory, ν = 0.3; these modes have five to eight
waves around, so that 48 elements are six to nine per wave. Free: Rayleigh's inextensional mode, ν = 0. Asserted
order with consistent mass between diaphragms: 2 within 0.3.
"""
BALL = """R/t = 100, ν = 0.3, ω R √(ρ/E) of the membrane's lower branch (Lamb 1882, Baker 1961), errors in per cent;
bending, which the closed-form solution neglects, adds 0.01 and 0.06 %. The 2n + 1 modes of a degree have the same
frequency; the mesh, the six patches of a cube, separates them. The first six modes are rigid-body modes. Asserted
order of the mean of degree 2 with consistent mass: 2 within 0.3.

Very thin spheres require consistent mass or a finer mesh: all short membrane waves of a sphere have ω R √(ρ/E) near
1. With lumped mass, waves with a length of two cells have 0.6, less than the first true mode (0.735), unless bending
increases it. At R/t = 1000 with 6 × 8 × 8 cells the lowest elastic mode with lumped mass is 0.634.
"""
