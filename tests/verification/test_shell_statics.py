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


def tip(mesh: ShellMesh, section: Section, component: int, total: float = 1.0, drilling: float = 100.0) -> float:
    """Mean displacement of the edge u = 1 under a force spread over it; the edge u = 0 is fixed."""
    edge = mesh.edge("u1")
    share = np.ones(len(edge))
    share[[0, -1]] = 0.5
    share *= total / share.sum()
    held = dofs_of(mesh.edge("u0"), "123456")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=held, drilling=drilling)
    force = np.zeros(structure.nodes.n_dofs)
    force[6 * edge + component - 1] += share
    return float(static_displacements(structure, force).reshape(-1, 6)[edge, component - 1].mean())


def straight(shape: str, finer: int = 1) -> ShellMesh:
    """Beam 6 × 0.2 of six rectangles, trapezoids or parallelograms (sides at 45 degrees), each divided by `finer`."""
    x, low, high = np.arange(7.0), np.arange(7.0), np.arange(7.0)
    inner = np.arange(1, 6)
    if shape == "trapezoid":
        low[inner] += 0.1 * (-1.0) ** inner
        high[inner] -= 0.1 * (-1.0) ** inner
    elif shape == "parallelogram":
        low[inner] -= 0.1
        high[inner] += 0.1

    def place(u: np.ndarray, v: np.ndarray) -> tuple:
        return np.interp(6 * u, x, low) * (1 - v) + np.interp(6 * u, x, high) * v, 0.2 * v, 0 * u

    return shell_mesh(place, 6 * finer, finer)


STRIP = Section(Isotropic(1e7, 0.3), 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["rectangle", "trapezoid", "parallelogram"])
def test_straight_beam(shape: str):
    """Extension and out of plane within 2 %, MacNeal's and Harder's grade A; in plane it converges, whatever the shape.

    A single row of trapezoids cannot bend: no four-node membrane does that passes the patch test (MacNeal 1987).
    """
    assert tip(straight(shape), STRIP, 1) / 3e-5 == pytest.approx(1.0, abs=0.02)
    assert tip(straight(shape), STRIP, 3) / 0.4321 == pytest.approx(1.0, abs=0.02)
    found = [tip(straight(shape, finer), STRIP, 2) / 0.1081 for finer in (1, 2, 4, 8)]
    assert (np.diff(found) > 0).all()
    assert found[-1] == pytest.approx(1.0, abs=0.004)


def test_a_row_of_rectangles_has_constant_curvature_in_each():
    """L³/3EI (1 − 1/4n²) + L/GA: the mean curvature of a linear moment, and shear without a factor; no drilling."""
    L, E, inertia, area, n = 6.0, 1e7, 0.1 * 0.2**3 / 12.0, 0.02, 6
    exact = L**3 / (3.0 * E * inertia) * (1.0 - 1.0 / (4.0 * n**2)) + L / (E / 2.6 * area)
    assert tip(straight("rectangle"), STRIP, 2, drilling=1e-3) == pytest.approx(exact, rel=2e-4)


def curved(n: int, across: int = 1) -> ShellMesh:
    quarter = np.pi / 2
    return shell_mesh(
        lambda u, v: ((4.32 - 0.2 * v) * np.sin(quarter * u), (4.32 - 0.2 * v) * np.cos(quarter * u), 0 * u), n, across
    )


@pytest.mark.slow
def test_curved_beam():
    """A quarter ring R 4.22, 0.2 high and 0.1 wide, whose integrals of bending, torsion, shear and tension are closed.

    The customary 0.08734 in plane is 1.4 % below this; out of plane it is 0.3 % above. Torsion needs several elements
    across, a row of them has that of a thin strip.
    """
    R, E, G, h, b = 4.22, 1e7, 4e6, 0.2, 0.1
    quarter, area = np.pi / 4.0 * R, h * b
    in_plane = quarter * R**2 / (E * b * h**3 / 12.0) + 1.2 * quarter / (G * area) + quarter / (E * area)
    J = h * b**3 * (1.0 / 3.0 - 0.21 * b / h * (1.0 - (b / h) ** 4 / 12.0))
    bending, torsion = quarter * R**2 / (E * h * b**3 / 12.0), (0.75 * np.pi - 2.0) * R**3 / (G * J)
    out_of_plane = bending + torsion + 2.4 * quarter / (G * area)
    section = Section(Isotropic(E, 0.25), b)
    errors = np.array([abs(tip(curved(n), section, 1)) / in_plane - 1.0 for n in (6, 12, 24)])
    assert abs(errors[-1]) < 0.003
    assert np.log2(np.abs(errors[:-1] / errors[1:])).min() > 2.0
    assert abs(tip(curved(48, 4), section, 3)) / out_of_plane == pytest.approx(1.0, abs=0.02)


def twisted(nu: int, nv: int) -> ShellMesh:
    return shell_mesh(
        lambda u, v: (12 * u, 1.1 * (v - 0.5) * np.cos(np.pi / 2 * u), 1.1 * (v - 0.5) * np.sin(np.pi / 2 * u)), nu, nv
    )


@pytest.mark.quick(0)
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


@pytest.mark.slow
def test_scordelis_lo_roof():
    """The value that fine meshes of shear-flexible shells reach is 0.3012, 0.996 of the customary one."""
    errors = np.array([roof(n) / 0.996 - 1.0 for n in (4, 8, 16)])
    assert abs(errors[-1]) < 0.01
    assert np.log2(np.abs(errors[:-1] / errors[1:])).min() > 1.5


def pinched(n: int) -> float:
    mesh = shell_mesh(lambda u, v: (300 * np.sin(np.pi / 2 * u), 300 * v, 300 * np.cos(np.pi / 2 * u)), n, n)
    held = dofs_of(mesh.edge("u0"), "156") | dofs_of(mesh.edge("u1"), "345")
    held |= dofs_of(mesh.edge("v0"), "135") | dofs_of(mesh.edge("v1"), "246")
    node = int(mesh.rows[0, -1])
    # the published value is that of a shell without transverse shear, which a force at a point strains without bound
    u = displacements(mesh, Section(Isotropic(3e6, 0.3), 3.0, TS=1000.0), held, [(node, 3, -0.25)])
    return float(-u[node, 2] / 1.8248e-5)


@pytest.mark.slow
def test_pinched_cylinder():
    """It converges to 1.8248e-5 (Lindberg, Olson and Cowper 1969)."""
    errors = np.array([pinched(n) - 1.0 for n in (8, 16, 32)])
    assert abs(errors[-1]) < 0.01
    assert (np.abs(errors[1:]) < 0.35 * np.abs(errors[:-1])).all()


def hemisphere(n: int) -> float:
    def place(u: np.ndarray, v: np.ndarray) -> tuple:
        a, p = np.pi / 2 * u, np.radians(72 * v)
        return 10 * np.cos(p) * np.cos(a), 10 * np.cos(p) * np.sin(a), 10 * np.sin(p)

    mesh = shell_mesh(place, n, n)
    a, b = int(mesh.rows[0, 0]), int(mesh.rows[-1, 0])
    held = dofs_of(mesh.edge("u0"), "246") | dofs_of(mesh.edge("u1"), "156") | dofs_of(a, "3")
    u = displacements(mesh, Section(Isotropic(6.825e7, 0.3), 0.04), held, [(a, 1, 1.0), (b, 2, -1.0)])
    return float(u[a, 0] / 0.0940)


@pytest.mark.slow
def test_hemisphere_with_a_hole():
    """Inextensional bending of warped elements; fine meshes reach 0.0934, 0.994 of the customary value."""
    errors = np.array([hemisphere(n) / 0.994 - 1.0 for n in (8, 16)])
    assert abs(errors[1]) < 0.01
    assert abs(errors[1]) < 0.35 * abs(errors[0])


def skew(n: int, angle: float, t: float, two: bool, nu: float) -> float:
    """Deflection of the centre in qL⁴/D under a uniform load, supported on all sides or on two."""
    mesh = shell_mesh(rectangle(100.0, 100.0, np.radians(90 - angle)), n, n)
    edges = ("v0", "v1") if two else ("u0", "u1", "v0", "v1")
    held = dofs_of(np.arange(len(mesh.xyz)), "126").union(*(dofs_of(mesh.edge(e), "3") for e in edges))
    section = Section(Isotropic(12 * (1 - nu**2) / t**3, nu, 1 / t), t)
    u = displacements(mesh, section, held, lambda s: uniform_load(s, (0, 0, 1)))
    return float(u[mesh.rows[n // 2, n // 2], 2] / 1e8)


@pytest.mark.slow
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
