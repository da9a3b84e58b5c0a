"""Triangular shells against closed forms and published solutions, with measured orders of convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from structures.beams import orders
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

E, NU, RHO = 2.0e11, 0.3, 7800.0
STEEL = Isotropic(E, NU, RHO)
KAPPA = 5.0 / 6.0
# Leissa's clamped square plate, ω L² √(ρt/D)
CLAMPED = np.array([35.985, 73.394, 73.394, 108.22, 131.58, 132.20])


def bending_stiffness(t: float) -> float:
    return E * t**3 / 12.0 / (1.0 - NU**2)


def simply_supported(t: float, shear: float = E / (2.0 + 2.0 * NU)) -> np.ndarray:
    """First six frequencies in Hz of a unit plate with shear flexibility: ω²ρt = Dk⁴/(1 + Dk²/κGt)."""
    waves = np.array([m * m + n * n for m in range(1, 8) for n in range(1, 8)])
    k2, D = np.pi**2 * np.sort(waves)[:6], bending_stiffness(t)
    return np.sqrt(D * k2**2 / (1.0 + D * k2 / (KAPPA * shear * t)) / (RHO * t)) / (2.0 * np.pi)


def clamped(t: float) -> np.ndarray:
    return CLAMPED * np.sqrt(bending_stiffness(t) / (RHO * t)) / (2.0 * np.pi)


def held(mesh: ShellMesh, support: str) -> set[int]:
    """In-plane motion held everywhere; deflection on the rim, and the turns that the support holds there."""
    out = dofs_of(range(len(mesh.xyz)), "126") | dofs_of(mesh.rim, "3")
    if support == "clamped":
        return out | dofs_of(mesh.rim, "45")
    along_y, along_x = (np.concatenate([mesh.edge(f"{c}0"), mesh.edge(f"{c}1")]) for c in "uv")
    return out | dofs_of(along_y, "4") | dofs_of(along_x, "5")


def plate_errors(n: int, cells: str, section: Section, exact: np.ndarray, support: str, **settings) -> np.ndarray:
    """Relative errors of the first six frequencies of a unit plate of n × n cells."""
    distort = settings.pop("distort", 0.0)
    mesh = shell_mesh(rectangle(1.0, 1.0), n, n, cells, distort=distort)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=held(mesh, support), **settings)
    return natural_frequencies(structure, len(exact)) / exact - 1.0


@pytest.mark.quick(0)
@pytest.mark.parametrize("t", [0.1, 0.01, 0.0001])
@pytest.mark.parametrize(("cells", "distort"), [("right", 0.0), ("union", 0.3)])
def test_plates_of_every_thickness_are_alike(t: float, cells: str, distort: float):
    """No locking: the same mesh is as good at L/t = 10,000 as at 10, simply supported and clamped."""
    section = Section(STEEL, t, TS=KAPPA)
    errors = plate_errors(12, cells, section, simply_supported(t), "simple", distort=distort)
    assert np.abs(errors).max() < 0.015
    if t <= 0.01:
        errors = plate_errors(12, cells, section, clamped(t), "clamped", distort=distort)
        assert np.abs(errors).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("t", [0.1, 0.001])
def test_frequencies_converge_with_the_square_of_the_size(t: float):
    """Consistent mass; with lumped mass stiffness and mass errors nearly cancel, so that the order shows nothing."""
    section, exact = Section(STEEL, t, TS=KAPPA), simply_supported(t)
    errors = np.array([plate_errors(n, "union", section, exact, "simple", consistent_mass=True) for n in (8, 16)])
    np.testing.assert_allclose(orders(errors), 2.0, atol=0.15)


@pytest.mark.parametrize("t", [0.1, 0.0001])
def test_stretched_cells_do_not_lock(t: float):
    """Cells 4 : 1; two cells a half wave, which is what modes 5 and 6 have here, leave 5 %, thick or thin."""
    mesh = shell_mesh(rectangle(1.0, 1.0), 6, 24, "right")
    parts = [ShellPart(mesh.cells, Section(STEEL, t, TS=KAPPA))]
    structure = shell_structure(mesh.xyz, parts, held=held(mesh, "simple"))
    errors = natural_frequencies(structure, 6) / simply_supported(t) - 1.0
    assert np.abs(errors).max() < 0.05
    assert abs(errors[0]) < 0.005


def test_lumped_mass_is_the_better_one():
    section, exact = Section(STEEL, 0.01, TS=KAPPA), simply_supported(0.01)
    lumped, consistent = (
        np.abs(plate_errors(8, "union", section, exact, "simple", consistent_mass=c)).max() for c in (False, True)
    )
    assert lumped < 0.012
    assert 0.1 < consistent < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-2, 1e-4])
def test_soft_cores_keep_their_shear_flexibility(factor: float):
    """A sandwich: the residual flexibility counts against bending, so that it is small beside a soft core's own."""
    section = Section(STEEL, 0.02, TS=KAPPA, shear=Isotropic(E * factor, NU))
    exact = simply_supported(0.02, E * factor / (2.0 + 2.0 * NU))
    errors = np.array([plate_errors(n, "union", section, exact, "simple") for n in (8, 16)])
    assert np.abs(errors[1]).max() < 0.02
    np.testing.assert_allclose(orders(errors), 2.0, atol=0.25)


@pytest.mark.slow
def test_plates_rigid_in_shear_are_kirchhoff_plates():
    """Shear stiffness without bound is a finite number here: what a PSHELL without MID3 asks for."""
    k2 = np.pi**2 * np.array([2.0, 5.0, 5.0, 8.0, 10.0, 10.0])
    exact = k2 * np.sqrt(bending_stiffness(0.05) / (RHO * 0.05)) / (2.0 * np.pi)
    section = Section(STEEL, 0.05, shear=Isotropic(1e8 * E, NU))
    errors = np.array([plate_errors(n, "union", section, exact, "simple") for n in (8, 16)])
    assert np.abs(errors[1]).max() < 0.005
    assert np.abs(errors[1]).max() < 0.4 * np.abs(errors[0]).max()


def centre_deflection(mesh: ShellMesh, at: int, t: float, fixed: set[int]) -> float:
    """w of a grid point, times D, under a unit load an area."""
    section = Section(replace(STEEL, rho=1.0 / t), t)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=fixed)
    u = static_displacements(structure, uniform_load(structure, (0.0, 0.0, 1.0)))
    return float(u[6 * at + 2] * bending_stiffness(t))


@pytest.mark.quick(1)
@pytest.mark.parametrize(("cells", "tolerance"), [("right", 0.08), ("left", 0.01), ("union", 0.02)])
def test_skew_plate(cells: str, tolerance: float):
    """Simply supported rhombus of 30°, L/t = 100: .423e-3 qL⁴/D (three-dimensional, Babuška and Scapolla 1989).

    The obtuse corners have a singular moment, so that meshes with long diagonals there converge slowly.
    """
    mesh = shell_mesh(rectangle(1.0, 1.0, np.pi / 3.0), 16, 16, cells)
    fixed = dofs_of(range(len(mesh.xyz)), "126") | dofs_of(mesh.rim, "3")
    found = centre_deflection(mesh, int(mesh.rows[8, 8]), 0.01, fixed)
    assert found == pytest.approx(0.423e-3, rel=tolerance)


def disc(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The unit square's rings of squares onto rings of a unit disc."""
    x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
    ring = np.maximum(np.abs(x), np.abs(y))
    size = np.hypot(x, y)
    scale = np.divide(ring, size, out=np.zeros_like(size), where=size > 0.0)
    return x * scale, y * scale, 0.0 * u


@pytest.mark.slow
@pytest.mark.parametrize("t", [0.1, 0.01, 0.0001])
@pytest.mark.parametrize("support", ["clamped", "simple"])
def test_circular_plate(t: float, support: str):
    """w = q/64D (clamped) or (5+ν)/(1+ν) q/64D (simply supported) plus q/4κGt, of a unit disc."""
    mesh = shell_mesh(disc, 16, 16, "union")
    fixed = dofs_of(range(len(mesh.xyz)), "126") | dofs_of(mesh.rim, "345" if support == "clamped" else "3")
    bent = (1.0 if support == "clamped" else (5.0 + NU) / (1.0 + NU)) / 64.0
    sheared = bending_stiffness(t) * (2.0 + 2.0 * NU) / E / KAPPA / t / 4.0
    found = centre_deflection(mesh, int(mesh.rows[8, 8]), t, fixed)
    assert found == pytest.approx(bent + sheared, rel=0.02)


@pytest.mark.slow
def test_bending_in_the_plane_converges_slowly():
    """Constant strains: a cantilever 10 × 1 under a transverse force needs many triangles across its depth."""
    found = np.array([cantilever(n) for n in (1, 2, 4, 8)])
    errors = 1.0 - found
    assert 0.65 < errors[0] < 0.75
    assert errors[-1] < 0.05
    assert 1.6 < np.log2(errors[2] / errors[3]) < 2.1


def cantilever(n: int) -> float:
    """Tip deflection of a strip 10 × 1, n cells deep, over that of a beam with shear."""
    mesh = shell_mesh(rectangle(10.0, 1.0), 10 * n, n, "union")
    fixed = dofs_of(mesh.edge("u0"), "123456") | dofs_of(range(len(mesh.xyz)), "345")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(Isotropic(1.0, 0.3), 0.1))], held=fixed)
    tip = mesh.edge("u1")
    u = static_displacements(structure, edge_load(mesh, 1))
    exact = 1000.0 / 3.0 / (0.1 / 12.0) + 10.0 * 2.6 / KAPPA / 0.1
    return float(u[6 * tip[n // 2] + 1] / exact)


def edge_load(mesh: ShellMesh, component: int) -> np.ndarray:
    """A unit force along the edge u = 1, shared as linear functions share it."""
    tip = mesh.edge("u1")
    weights = np.full(len(tip), 1.0)
    weights[[0, -1]] = 0.5
    force = np.zeros(6 * len(mesh.xyz))
    force[6 * tip + component] = weights / weights.sum()
    return force


@pytest.mark.slow
@pytest.mark.parametrize(("n", "tolerance"), [(8, 0.12), (16, 0.035)])
def test_cylindrical_roof(n: int, tolerance: float):
    """Scordelis and Lo: R 25, L 50, t 0.25, 40° each side, 90 an area downwards: 0.3024 at the free edge's middle."""
    angle = np.deg2rad(40.0)
    mesh = shell_mesh(lambda u, v: (25 * np.sin(angle * u), 25 * v, 25 * np.cos(angle * u)), n, n, "union")
    fixed = dofs_of(mesh.edge("u0"), "156") | dofs_of(mesh.edge("v0"), "13") | dofs_of(mesh.edge("v1"), "246")
    section = Section(Isotropic(4.32e8, 0.0, 90.0 / 0.25), 0.25)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=fixed)
    u = static_displacements(structure, uniform_load(structure, (0.0, 0.0, -1.0)))
    assert u[6 * mesh.rows[-1, -1] + 2] == pytest.approx(-0.3024, rel=tolerance)


def test_pinched_cylinder():
    """R 300, L 600, t 3, rigid diaphragms, two unit forces: 1.8248e-5 under each."""
    mesh = shell_mesh(cylinder(300.0, 300.0, 0.0, np.pi / 2.0), 16, 16, "union")
    ends, middle, beside, under = (mesh.edge(name) for name in ("v0", "v1", "u0", "u1"))
    fixed = dofs_of(ends, "12") | dofs_of(middle, "345") | dofs_of(beside, "246") | dofs_of(under, "156")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(Isotropic(3e6, 0.3), 3.0))], held=fixed)
    force = np.zeros(6 * len(mesh.xyz))
    force[6 * mesh.rows[-1, -1] + 1] = -0.25
    u = static_displacements(structure, force)
    assert u[6 * mesh.rows[-1, -1] + 1] == pytest.approx(-1.8248e-5, rel=0.04)


# MacNeal and Harder 1985 (thick); Belytschko 1989 (thin): tip displacement along a unit force in and out of the plane
TWISTED = {0.32: (0.005424, 0.001754), 0.0032: (5256.0, 1294.0)}


@pytest.mark.slow
@pytest.mark.parametrize("t", TWISTED)
def test_twisted_beam(t: float):
    """A strip 12 × 1.1 turned by 90°: with normals of their own, facets would lose twisting moments to drilling."""
    errors = np.array([twisted_beam(t, n) for n in (4, 8)])
    assert np.abs(errors).max() < 0.07
    assert np.abs(errors[1]).max() < 0.025


def twisted_beam(t: float, n: int) -> list[float]:
    mesh = shell_mesh(
        lambda u, v: (12 * u, 1.1 * (v - 0.5) * np.cos(np.pi / 2 * u), 1.1 * (v - 0.5) * np.sin(np.pi / 2 * u)),
        6 * n,
        n,
        "union",
    )
    parts = [ShellPart(mesh.cells, Section(Isotropic(29e6, 0.22), t))]
    structure = shell_structure(mesh.xyz, parts, held=dofs_of(mesh.edge("u0"), "123456"))
    tip, out = mesh.edge("u1")[n // 2], []
    for component, exact in zip((2, 1), TWISTED[t]):
        u = static_displacements(structure, edge_load(mesh, component))
        out.append(float(u[6 * tip + component] / exact - 1.0))
    return out


def test_quadrilaterals_and_triangles_in_one_mesh():
    """Every other row of cells of a plate is triangles."""
    quads = shell_mesh(rectangle(1.0, 1.0), 12, 12, "quad")
    halves = shell_mesh(rectangle(1.0, 1.0), 12, 12, "right").cells.reshape(-1, 2, 3)
    mixed = np.arange(144) % 2 == 0
    for t in (0.1, 0.001):
        section = Section(STEEL, t, TS=KAPPA)
        parts = [ShellPart(quads.cells[mixed], section), ShellPart(halves[~mixed].reshape(-1, 3), section)]
        structure = shell_structure(quads.xyz, parts, held=held(quads, "simple"))
        errors = natural_frequencies(structure, 6) / simply_supported(t) - 1.0
        assert np.abs(errors).max() < 0.025
