"""The hexahedron of eight nodes: hybrid stresses, bending of beams and plates, ν near one half, convergence."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from tests.fem.solid_parts import ANISO, LAW, dense, one, sliding_box, translations_of

from femtune.fem.elements import KINDS
from femtune.fem.elements.solids.first_order import jacobians
from femtune.fem.elements.solids.hexa8 import CORNERS, HEXA8, STRAINS, derivatives
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import SolidFormulation, StrainGroup
from structures.shells import Isotropic, dofs_of, natural_frequencies, static_displacements
from structures.solids import box, isotropic_law, solid_mesh, solid_model


def gauss(count: int):
    x, w = np.polynomial.legendre.leggauss(count)
    for i, j, k in product(range(count), repeat=3):
        yield np.array([x[i], x[j], x[k]]), w[i] * w[j] * w[k]


def strain_matrix(xyz, point) -> tuple[np.ndarray, np.ndarray]:
    """Strains of the trilinear displacements at a point, and the Jacobian matrix (columns g1, g2, g3)."""
    slopes = np.array(
        [[0.125 * c[i] * np.prod([1 + c[j] * point[j] for j in range(3) if j != i]) for c in CORNERS] for i in range(3)]
    )
    J = (slopes @ xyz).T
    d = np.linalg.inv(J).T @ slopes
    B = np.zeros((6, 24))
    for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
        B[row, i::3] = d[j]
        if i != j:
            B[row, j::3] = d[i]
    return B, J


def hybrid(xyz, law) -> np.ndarray:
    """Pian and Tong's stiffness GᵀH⁻¹G with 18 stresses on the axes of the middle, by integration."""
    pairs = {(0, 0): ((), (1,), (2,), (1, 2)), (1, 1): ((), (0,), (2,), (0, 2)), (2, 2): ((), (0,), (1,), (0, 1))}
    pairs |= {(0, 1): ((), (2,)), (1, 2): ((), (0,)), (2, 0): ((), (1,))}
    H, G, compliance = np.zeros((18, 18)), np.zeros((18, 24)), np.linalg.inv(law)
    axes = strain_matrix(xyz, np.zeros(3))[1]
    for point, weight in gauss(3):
        B, J = strain_matrix(xyz, point)
        columns = []
        for (i, j), functions in pairs.items():
            tensor = np.outer(axes[:, i], axes[:, j])
            tensor = tensor + tensor.T
            stress = np.array([tensor[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))])
            columns += [stress * np.prod([point[k] for k in f]) for f in functions]
        P = np.array(columns).T
        volume = weight * np.linalg.det(J)
        H += P.T @ compliance @ P * volume
        G += P.T @ B * volume
    return G.T @ np.linalg.solve(H, G)


def _put(monkeypatch: pytest.MonkeyPatch, key: str, rules: SolidFormulation) -> None:
    """Another formulation in place of that of a kind of solids."""
    kind = replace(KINDS[key], kernel=lambda batch, structure: solid(batch, structure, rules))
    monkeypatch.setitem(KINDS, key, kind)


@pytest.mark.parametrize("law", ["isotropic", "anisotropic"])
def test_a_parallelepiped_is_the_hybrid_element(law: str):
    edges = np.array([[1.0, 0.3, -0.2], [0.4, 0.7, 0.1], [0.2, -0.1, 0.3]])
    xyz = CORNERS @ edges
    matrix, material = (isotropic_law(200.0, 0.3), Isotropic(200.0, 0.3)) if law == "isotropic" else (LAW, ANISO)
    wanted = hybrid(xyz, matrix)
    np.testing.assert_allclose(dense(one("hexa8", xyz, material)), wanted, atol=1e-11 * np.abs(wanted).max())


def leaning_beam(slenderness: float, lean: float):
    """Ten cells in a row, 10 long and 1 wide, their corners moved at random along the row; held at one end."""
    mesh = solid_mesh(box(10.0, 1.0, slenderness), (10, 1, 1))
    inner = (mesh.uvw[:, 0] > 1e-9) & (mesh.uvw[:, 0] < 1 - 1e-9)
    move = np.random.default_rng(2).uniform(-lean, lean, len(mesh.xyz))
    return replace(mesh, xyz=mesh.xyz + np.outer(move * inner, [1.0, 0.0, 0.0]))


def tip_of(K, mesh) -> float:
    """Mean displacement along z of the end face under a unit force."""
    tip, free = mesh.face("u1"), np.setdiff1d(np.arange(len(K)), translations_of(mesh.face("u0")))
    force = np.zeros(len(K))
    force[3 * tip + 2] = 1.0 / len(tip)
    u = np.zeros(len(K))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], force[free])
    return float(u[3 * tip + 2].mean())


@pytest.mark.slow
@pytest.mark.parametrize(("thickness", "lean"), [(1.0, 0.1), (1.0, 0.3), (0.3, 0.1), (0.3, 0.3)])
def test_distorted_cells_are_as_soft_as_hybrid_ones(thickness: float, lean: float):
    mesh, law = leaning_beam(thickness, lean), isotropic_law(1.0, 0.3)
    K = np.zeros((3 * len(mesh.xyz),) * 2)
    for cell in mesh.cells:
        at = translations_of(cell)
        K[np.ix_(at, at)] += hybrid(mesh.xyz[cell], law)
    found = tip_of(dense(solid_model(mesh, Isotropic(1.0, 0.3))), mesh)
    assert found == pytest.approx(tip_of(K, mesh), rel=0.015)


@pytest.mark.parametrize("thickness", [1.0, 0.01])
@pytest.mark.parametrize("along", [0, 1, 2])
def test_one_box_bends_as_a_plate(thickness: float, along: int):
    """Cylindrical, double and twisting curvature: D κ² A times 1, 2 (1 + ν), 2 (1 − ν), with D = E t³/12(1 − ν²)."""
    E, nu, a, b = 200.0, 0.3, 1.5, 0.8
    xyz = CORNERS / 2 * np.array([a, b, thickness])
    x, y, z = xyz.T
    zero = 0 * x
    fields = {
        1.0: (x * z, zero, -(x**2) / 2),
        2.0 * (1 + nu): (x * z, y * z, -(x**2 + y**2) / 2),
        2.0 * (1 - nu): (y * z, x * z, -x * y),
    }
    turn = np.roll(np.eye(3), along, axis=0)
    K = dense(one("hexa8", xyz @ turn, Isotropic(E, nu)))
    for factor, field in fields.items():
        u = (np.stack(field, axis=1) @ turn).ravel()
        assert u @ K @ u == pytest.approx(factor * E * thickness**3 / 12 / (1 - nu**2) * a * b, rel=1e-9)


def tip_displacement(mesh, component: int) -> float:
    """Mean displacement of the face u = 1 under a unit force shared by its nodes; the face u = 0 is held."""
    structure = solid_model(mesh, Isotropic(1e7, 0.3), held=dofs_of(mesh.face("u0"), "123"))
    tip = mesh.face("u1")
    force = np.zeros(structure.nodes.n_dofs)
    force[6 * tip + component] = 1.0 / len(tip)
    return float(static_displacements(structure, force)[6 * tip + component].mean())


def slender(lean_of_layer):
    """MacNeal and Harder's slender beam 6 × 0.2 × 0.1; the layers between its six cells lean by 45 degrees."""

    def place(u, v, w):
        k = np.rint(6 * u)
        inner = (k > 0) & (k < 6)
        return 6 * u + 0.1 * (2 * v - 1) * lean_of_layer(k) * inner, 0.2 * v, 0.1 * w

    return place


SLENDER = {"rectangles": lambda k: 0 * k, "parallelograms": lambda k: 0 * k + 1, "trapezoids": lambda k: (-1.0) ** k}
# extension, bending in the plane of the lean, bending out of it; displacements over those of beam theory. No element
# that passes the patch test on all shapes bends well as a trapezoid (MacNeal, Int. J. Numer. Meth. Engng 24, 1987).
BOUNDS = {
    "rectangles": ((0.98, 1.0), (0.975, 1.0), (0.975, 1.0)),
    "parallelograms": ((0.98, 1.0), (0.6, 1.0), (0.55, 1.0)),
    "trapezoids": ((0.98, 1.0), (0.04, 0.2), (0.025, 0.2)),
}


@pytest.mark.parametrize("shape", SLENDER)
def test_macneal_and_harders_slender_beam(shape: str):
    mesh = solid_mesh(slender(SLENDER[shape]), (6, 1, 1))
    for component, (theory, bounds) in enumerate(zip((3e-5, 0.1081, 0.4321), BOUNDS[shape])):
        assert bounds[0] < tip_displacement(mesh, component) / theory < bounds[1]


@pytest.mark.parametrize("consistent", [False, True])
def test_frequencies_of_a_slender_cantilever_of_one_row(consistent: bool):
    length, width, height, E, rho = 10.0, 0.5, 0.3, 210e9, 7800.0
    mesh = solid_mesh(box(length, width, height), (20, 1, 1))
    held = dofs_of(mesh.face("u0"), "123")
    found = natural_frequencies(solid_model(mesh, Isotropic(E, 0.3, rho), held=held, consistent_mass=consistent), 4)
    euler = [
        beta**2 / (2 * np.pi * length**2) * np.sqrt(E * h**2 / 12 / rho)
        for beta in (1.87510407, 4.69409113)
        for h in (height, width)
    ]
    np.testing.assert_allclose(found[:4], sorted(euler), rtol=0.02)
    np.testing.assert_allclose(found[:2], sorted(euler)[:2], rtol=0.003)


def supported_plate(n: int, thickness: float) -> np.ndarray:
    """Frequencies of a simply supported square plate of one layer over those of Kirchhoff's theory."""
    mesh = solid_mesh(box(1.0, 1.0, thickness), (n, n, 1))
    x, y = (np.concatenate([mesh.face(f"{axis}0"), mesh.face(f"{axis}1")]) for axis in "uv")
    held = dofs_of(x, "23") | dofs_of(y, "13")
    bending = thickness**3 / 12 / (1 - 0.3**2)
    theory = np.array([2, 5, 5, 8]) * np.pi / 2 * np.sqrt(bending / thickness)
    return natural_frequencies(solid_model(mesh, Isotropic(1.0, 0.3, 1.0), held=held), 4)[:4] / theory


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0.01, 0.001])
def test_a_thin_plate_of_one_layer_does_not_lock(thickness: float):
    np.testing.assert_allclose(supported_plate(10, thickness)[:3], 1.0, atol=0.01)


def cylinder(u, v, w):
    """Ten degrees of a thick cylinder with MacNeal and Harder's radii."""
    r = np.interp(u, np.linspace(0, 1, 6), [3, 3.5, 4.2, 5.2, 6.75, 9.0])
    angle = np.radians(10 * v)
    return r * np.cos(angle), r * np.sin(angle), w


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999])
def test_a_thick_cylinder_of_nearly_incompressible_material(nu: float):
    """Plane strain, unit pressure inside, u = (1 + ν) p a²/(E (b² − a²)) (b²/r + (1 − 2ν) r)."""
    mesh = solid_mesh(cylinder, (5, 1, 1))
    angle = np.arctan2(mesh.xyz[:, 1], mesh.xyz[:, 0])
    frames = np.zeros((len(angle), 3, 3))
    frames[:, 0, 0] = frames[:, 1, 1] = np.cos(angle)
    frames[:, 1, 0], frames[:, 0, 1], frames[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    held = dofs_of(np.arange(len(angle)), "23")
    structure = solid_model(mesh, Isotropic(1000.0, nu), frames=frames, held=held)
    inside, force = mesh.face("u0"), np.zeros(structure.nodes.n_dofs)
    force[6 * inside] = 3 * np.radians(10) / 4
    theory = (1 + nu) * 9 / (1000 * 72) * (81 / 3 + (1 - 2 * nu) * 3)
    np.testing.assert_allclose(static_displacements(structure, force)[6 * inside] / theory, 1.0, atol=0.015)


def test_a_nearly_incompressible_strip_bends():
    """A cantilever in plane strain, ν = 0.4999, one row of cells: P L³/(3 E' I) with E' = E/(1 − ν²)."""
    nu, length, height = 0.4999, 10.0, 0.5
    mesh = solid_mesh(box(length, height, 1.0), (20, 1, 1))
    everywhere = np.arange(len(mesh.xyz))
    held = dofs_of(mesh.face("u0"), "12") | dofs_of(everywhere, "3")
    structure = solid_model(mesh, Isotropic(1.0, nu), held=held)
    tip, force = mesh.face("u1"), np.zeros(structure.nodes.n_dofs)
    force[6 * tip + 1] = 1.0 / len(tip)
    theory = length**3 / 3 / (height**3 / 12 / (1 - nu**2))
    assert static_displacements(structure, force)[6 * tip + 1].mean() / theory == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "counts"), [("hexa8", (4, 8)), ("pyram5", (4, 8)), ("penta6", (6, 9)), ("tetra4", (4, 8))]
)
def test_eigenvalues_converge_with_order_two(kind: str, counts: tuple[int, int]):
    errors = [sliding_box(kind, n) for n in counts]
    rate = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    assert 1.8 < rate < 2.3
    assert errors[0] > 0.0


# the plain hexahedron: why the others are there ----------------------------------------------------------------------


def plain_strains(places) -> list[StrainGroup]:
    """Strains of the trilinear displacements at 2 × 2 × 2 points."""
    points = np.array(list(product((-1.0, 1.0), repeat=3))) / np.sqrt(3.0)
    jacobian = jacobians(derivatives(points), places.xyz)
    slopes = np.swapaxes(np.linalg.inv(jacobian), 2, 3) @ derivatives(points)
    slopes = slopes * np.sqrt(np.linalg.det(jacobian))[:, :, None, None]
    rows = np.zeros((*slopes.shape[:2], 6, 8, 3))
    for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
        rows[:, :, row, :, i] = slopes[:, :, j]
        if i != j:
            rows[:, :, row, :, j] = slopes[:, :, i]
    return [StrainGroup(rows)]


PLAIN = SolidFormulation(("full",), plain_strains, HEXA8.shares, STRAINS.checked, "")


def wing_frequency(counts: tuple[int, int, int], kind: str = "hexa8") -> float:
    """First frequency of a swept, tapered wing, three chords long and three hundredths of a chord thick at its root."""

    def place(u, v, w):
        return 0.5 * v + (1.0 - 0.4 * v) * u, 3.0 * v, 0.03 * (1.0 - 0.5 * v) * w

    mesh = solid_mesh(place, counts, kind)
    structure = solid_model(mesh, Isotropic(70e9, 0.33, 2700.0), held=dofs_of(mesh.face("v0"), "123"))
    return float(natural_frequencies(structure, 1)[0])


@pytest.mark.slow
def test_a_wing_of_one_layer(monkeypatch: pytest.MonkeyPatch):
    """One layer of cells is within 0.5 % of quadratic ones; plain hexahedra are several times too stiff there."""
    reference = wing_frequency((6, 20, 1), "hexa20")
    assert wing_frequency((6, 20, 1)) == pytest.approx(reference, rel=0.005)
    _put(monkeypatch, "hexa8", PLAIN)
    assert wing_frequency((6, 20, 1)) > 1.8 * reference


def pressed_block(kind: str, n: int) -> float:
    """Energy of a quarter of a block of ν = 0.4999 whose lower face is glued and whose upper face moves up by one."""
    mesh = solid_mesh(box(1.0, 1.0, 1.0), (n, n, n), kind)
    top = 3 * mesh.face("w1") + 2
    glued = translations_of(mesh.face("w0"))
    held = np.unique(np.concatenate([glued, top, 3 * mesh.face("u0"), 3 * mesh.face("v0") + 1]))
    K = dense(solid_model(mesh, Isotropic(1.0, 0.4999)))
    u, free = np.zeros(len(K)), np.setdiff1d(np.arange(len(K)), held)
    u[top] = 1.0
    u[free] = np.linalg.solve(K[np.ix_(free, free)], -(K @ u)[free])
    return float(u @ K @ u)


@pytest.mark.slow
def test_a_block_of_nearly_incompressible_material_between_plates(monkeypatch: pytest.MonkeyPatch):
    reference = pressed_block("hexa20", 4)
    for kind in ("hexa8", "penta6", "pyram5"):
        assert pressed_block(kind, 4) == pytest.approx(reference, rel=0.04)
    # what has a constraint of volume at each of eight points, or in each tetrahedron, locks
    assert pressed_block("tetra4", 4) > 10.0 * reference
    _put(monkeypatch, "hexa8", PLAIN)
    assert pressed_block("hexa8", 4) > 10.0 * reference
