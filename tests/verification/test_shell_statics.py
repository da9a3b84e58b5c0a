"""Quadrilateral shells on the static tests of MacNeal and Harder and others: displacement over the published one.

Sources: MacNeal and Harder, Finite Elem. Anal. Des. 1 (1985) 3-20; Belytschko, Wong and Stolarski 1989 (thin twisted
beam); Morley 1963 and Razzaque 1973 (skew plates).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from structures.shells import (
    Isotropic,
    Section,
    ShellMesh,
    ShellPart,
    cylinder,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
    static_displacements,
    uniform_load,
)

Load = list[tuple[int, int, float]]


def displacements(mesh: ShellMesh, section: Section, held: set[int], load: Load | Callable) -> np.ndarray:
    """(nodes, 6) displacements under forces (node, component, force) or a function of the structure."""
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=held)
    force = np.zeros(structure.nodes.n_dofs) if isinstance(load, list) else load(structure)
    for node, component, value in load if isinstance(load, list) else ():
        force[6 * node + component - 1] += value
    return static_displacements(structure, force).reshape(-1, 6)


def tip(mesh: ShellMesh, section: Section, component: int, total: float = 1.0) -> float:
    """Mean displacement of the edge u = 1 under a force spread over it; the edge u = 0 is fixed."""
    edge = mesh.edge("u1")
    share = np.ones(len(edge))
    share[[0, -1]] = 0.5
    share *= total / share.sum()
    u = displacements(
        mesh, section, dofs_of(mesh.edge("u0"), "123456"), [(n, component, s) for n, s in zip(edge, share)]
    )
    return float(u[edge, component - 1].mean())


def straight(shape: str) -> ShellMesh:
    """Beam 6 × .2 of six elements: rectangles, trapezoids or parallelograms with sides at 45 degrees."""
    mesh = shell_mesh(rectangle(6.0, 0.2), 6, 1)
    for i in range(1, 6):
        low, high = {
            "rectangle": (0, 0),
            "trapezoid": (0.1 * (-1) ** i, -0.1 * (-1) ** i),
            "parallelogram": (-0.1, 0.1),
        }[shape]
        mesh.xyz[mesh.rows[i, 0], 0] += low
        mesh.xyz[mesh.rows[i, 1], 0] += high
    return mesh


STRAIGHT = {
    "rectangle": (0.995, 0.993, 0.987),
    "trapezoid": (0.999, 0.052, 0.981),
    "parallelogram": (0.999, 0.632, 0.992),
}


@pytest.mark.parametrize("shape", STRAIGHT)
def test_straight_beam(shape: str):
    """Extension, in plane, out of plane. A four-node membrane that passes the patch test cannot bend as a trapezoid."""
    section, exact = Section(Isotropic(1e7, 0.3), 0.1), (3e-5, 0.1081, 0.4321)
    found = [tip(straight(shape), section, i + 1) / exact[i] for i in range(3)]
    np.testing.assert_allclose(found, STRAIGHT[shape], atol=0.006)


def curved(n: int) -> ShellMesh:
    quarter = np.pi / 2
    return shell_mesh(
        lambda u, v: ((4.32 - 0.2 * v) * np.sin(quarter * u), (4.32 - 0.2 * v) * np.cos(quarter * u), 0 * u), n, 1
    )


def test_curved_beam():
    section = Section(Isotropic(1e7, 0.25), 0.1)
    found = [[abs(tip(curved(n), section, c)) / ref for c, ref in ((1, 0.08734), (3, 0.5022))] for n in (6, 12)]
    np.testing.assert_allclose(found, [[0.888, 0.956], [1.003, 0.961]], atol=0.006)


def twisted(nu: int, nv: int) -> ShellMesh:
    return shell_mesh(
        lambda u, v: (12 * u, 1.1 * (v - 0.5) * np.cos(np.pi / 2 * u), 1.1 * (v - 0.5) * np.sin(np.pi / 2 * u)), nu, nv
    )


@pytest.mark.quick(1)
@pytest.mark.parametrize(
    ("t", "total", "exact", "coarse"),
    [
        (0.32, 1.0, (5.424e-3, 1.754e-3), 0.015),
        (0.05, 1.0, (1.390, 0.3431), 0.02),
        (0.0032, 1e-6, (5.256e-3, 1.294e-3), 0.025),
    ],
)
def test_twisted_beam(t: float, total: float, exact: tuple[float, float], coarse: float):
    """Every element is warped; in plane and out of plane."""
    section = Section(Isotropic(29e6, 0.22), t)
    for n, tolerance in ((12, coarse), (24, 0.007)):
        found = [tip(twisted(n, n // 6), section, c, total) / e for c, e in zip((3, 2), exact)]
        np.testing.assert_allclose(found, 1.0, atol=tolerance)


def roof(n: int) -> float:
    mesh = shell_mesh(lambda u, v: (25 * np.sin(np.radians(40 * u)), 25 * v, 25 * np.cos(np.radians(40 * u))), n, n)
    held = dofs_of(mesh.edge("u0"), "156") | dofs_of(mesh.edge("v0"), "13") | dofs_of(mesh.edge("v1"), "246")
    section = Section(Isotropic(4.32e8, 0.0, 360.0), 0.25)
    u = displacements(mesh, section, held, lambda s: uniform_load(s, (0, 0, -1)))
    return float(-u[mesh.rows[-1, -1], 2] / 0.3024)


def test_scordelis_lo_roof():
    """The value that fine meshes of shear-flexible shells reach is .3012, .996 of the customary one."""
    found = [roof(n) for n in (4, 8, 16)]
    np.testing.assert_allclose(found, [1.066, 1.014, 1.002], atol=0.012)


def pinched(n: int) -> float:
    mesh = shell_mesh(lambda u, v: (300 * np.sin(np.pi / 2 * u), 300 * v, 300 * np.cos(np.pi / 2 * u)), n, n)
    held = dofs_of(mesh.edge("u0"), "156") | dofs_of(mesh.edge("u1"), "345")
    held |= dofs_of(mesh.edge("v0"), "135") | dofs_of(mesh.edge("v1"), "246")
    node = int(mesh.rows[0, -1])
    u = displacements(mesh, Section(Isotropic(3e6, 0.3), 3.0), held, [(node, 3, -0.25)])
    return float(-u[node, 2] / 1.8248e-5)


def test_pinched_cylinder():
    np.testing.assert_allclose([pinched(n) for n in (8, 16)], [0.898, 1.012], atol=0.01)


def hemisphere(n: int) -> float:
    def place(u: np.ndarray, v: np.ndarray) -> tuple:
        a, p = np.pi / 2 * u, np.radians(72 * v)
        return 10 * np.cos(p) * np.cos(a), 10 * np.cos(p) * np.sin(a), 10 * np.sin(p)

    mesh = shell_mesh(place, n, n)
    a, b = int(mesh.rows[0, 0]), int(mesh.rows[-1, 0])
    held = dofs_of(mesh.edge("u0"), "246") | dofs_of(mesh.edge("u1"), "156") | dofs_of(a, "3")
    u = displacements(mesh, Section(Isotropic(6.825e7, 0.3), 0.04), held, [(a, 1, 1.0), (b, 2, -1.0)])
    return float(u[a, 0] / 0.0940)


def test_hemisphere_with_a_hole():
    """Inextensional bending of warped elements; fine meshes reach .0934, .994 of the customary value."""
    np.testing.assert_allclose([hemisphere(n) for n in (8, 16)], 1.0, atol=0.02)


def skew(n: int, angle: float, t: float, two: bool, nu: float) -> float:
    """Deflection of the centre in qL⁴/D under a uniform load, supported on all sides or on two."""
    mesh = shell_mesh(rectangle(100.0, 100.0, np.radians(90 - angle)), n, n)
    edges = ("v0", "v1") if two else ("u0", "u1", "v0", "v1")
    held = dofs_of(np.arange(len(mesh.xyz)), "126").union(*(dofs_of(mesh.edge(e), "3") for e in edges))
    section = Section(Isotropic(12 * (1 - nu**2) / t**3, nu, 1 / t), t)
    u = displacements(mesh, section, held, lambda s: uniform_load(s, (0, 0, 1)))
    return float(u[mesh.rows[n // 2, n // 2], 2] / 1e8)


def test_razzaque_skew_plate():
    found = np.array([skew(n, 60.0, 0.1, True, 0.31) for n in (4, 8, 16)]) / 0.7945e-2
    assert (np.diff(np.abs(found - 1)) < 0).all()
    assert abs(found[-1] - 1) < 0.015


@pytest.mark.slow
def test_morley_skew_plate():
    """30 degrees, singular moments in the obtuse corners: slow, from below."""
    found = np.array([skew(n, 30.0, 1.0, False, 0.3) for n in (8, 16, 32)]) / 0.423e-3
    assert (np.diff(found) > 0.01).all()
    assert 0.97 < found[-1] < 1.0


@pytest.mark.slow
def test_a_curved_shell_does_not_soften_with_refinement():
    """A half cylinder, free: frequencies settle and do not feel K6ROT.

    With a normal of its own in each facet the first would be 10 % lower at the finest mesh, and falling.
    """
    modes = []
    for n in (6, 12, 24):
        mesh = shell_mesh(cylinder(1.0, 4.0, 0.0, np.pi), n, n)
        part = ShellPart(mesh.cells, Section(Isotropic(1e6, 0.3, 1.0), 0.05))
        pair = [shell_structure(mesh.xyz, [part], drilling=k, consistent_mass=True) for k in (1.0, 1e4)]
        first, second = (natural_frequencies(s, 9)[6:] for s in pair)
        np.testing.assert_allclose(first, second, rtol=1e-3)
        modes.append(first)
    steps = np.abs(np.diff(modes, axis=0) / modes[-1])
    assert steps[1].max() < steps[0].max() < 0.006
    assert steps[:, 0].max() < 0.003
