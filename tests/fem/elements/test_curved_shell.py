"""Shells with mid-side nodes: rigid motion, constant strains, thickness that varies, mass, laws, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties, rigid_body_modes
from femtune.fem.elements import contributions
from femtune.fem.elements.shells.curved_strains import QUAD_SHEAR, QUAD_STRAIN, TRI_SHEAR, TRI_STRAIN
from femtune.fem.elements.shells.curved_surface import QUAD8_SHAPE, TRI6_SHAPE, centre_shares
from femtune.fem.elements.shells.normals import areas, shared_normals
from femtune.fem.structure import Structure
from femtune.testing import check_contribution
from structures.shells import (
    Anisotropic,
    Isotropic,
    Section,
    ShellPart,
    cylinder,
    rectangle,
    shell_mesh,
    shell_structure,
)

from .constant_states import AREA, PATCHES, D, G

ISO = Isotropic(200.0, 0.3, 2.0, 0.02)
LAW = {"11": 200.0, "12": 41.0, "13": 13.0, "22": 103.0, "23": -7.0, "33": 50.0}
ANISO = Anisotropic(LAW, {"11": 40.0, "12": 5.0, "22": 30.0}, 2.0)
SURFACES = {
    "flat": rectangle(1.0, 1.3, 0.2),
    "cylinder": cylinder(1.0, 1.0, 0.0, 1.0),
    "warped": lambda u, v: (u + 0.1 * v * v, v + 0.2 * u * v, 0.3 * u * v + 0.2 * u * u - 0.1 * v * v),
}


def turned(n: int, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(n)])


def element(surface: str, cells: str) -> tuple[np.ndarray, np.ndarray]:
    """Grid points and the one cell of an element."""
    mesh = shell_mesh(SURFACES[surface], 1, 1, cells)
    used = np.unique(mesh.cells[0])
    return mesh.xyz[used], np.searchsorted(used, mesh.cells[:1])


def strain_free(structure: Structure) -> int:
    """Number of motions without energy; the six rigid ones must be among them."""
    K = assemble(structure, "stiffness").toarray()
    K = K[np.ix_(*(np.flatnonzero(K.any(axis=0)),) * 2)] if not K.any(axis=0).all() else K
    values = np.linalg.eigvalsh(K)
    # the softest deformation is bending with t³ or drilling with 1e-4 t
    assert (np.abs(values[:6]) < 1e-14 * values[-1]).all()
    return int((values < 1e-11 * values[-1]).sum())


@pytest.mark.quick(0)
@pytest.mark.parametrize("cells", ["quad8", "right6"])
@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize(("material", "z0", "t"), [(ISO, None, 0.1), (ANISO, 0.1, 0.1), (ISO, -0.3, 0.001)])
def test_six_motions_are_strain_free_and_no_more(cells, surface, material, z0, t):
    xyz, cell = element(surface, cells)
    structure = shell_structure(xyz, [ShellPart(cell, Section(material, t, z0), theta=0.3)], frames=turned(len(xyz)))
    K = assemble(structure, "stiffness")
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    assert strain_free(structure) == 6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cells", "lacking"), [("quad8", [5]), ("quad8", [4, 5, 6, 7]), ("right6", [3]), ("right6", [3, 4, 5])]
)
def test_mid_side_nodes_may_be_left_out(cells, lacking):
    """The side is linear then: six strain-free motions, and the matrix of the whole element with the middle tied."""
    xyz, cell = element("warped", cells)
    corners, part = len(xyz) // 2, cell.copy()
    for k in lacking:
        ends = cell[0, [k - corners, (k - corners + 1) % corners]]
        xyz[cell[0, k]] = xyz[ends].mean(axis=0)
    part[0, lacking] = -1
    structure = shell_structure(xyz, [ShellPart(part, Section(ISO, 0.1, 0.05))], consistent_mass=True)
    assert strain_free(structure) == 6
    M = assemble(structure, "mass")
    exact = 0.2 * areas(structure.nodes, structure.batches[0])[0]
    np.testing.assert_allclose(mass_properties(structure.nodes, M).directional_mass, exact, rtol=1e-12)
    for node in cell[0, lacking]:
        assert not assemble(structure, "stiffness").toarray()[6 * node : 6 * node + 6].any()


def test_a_quadrilateral_beside_one_with_fewer_nodes_fits():
    """A shared side without its middle on both elements: a linear field stays one."""
    mesh = shell_mesh(rectangle(2.0, 1.0), 2, 1, "quad8")
    cells = mesh.cells.copy()
    shared = np.intersect1d(cells[0, 4:], cells[1, 4:])
    cells[np.isin(cells, shared)] = -1
    structure = shell_structure(mesh.xyz, [ShellPart(cells, Section(ISO, 0.1))])
    u = np.zeros((len(mesh.xyz), 6))
    u[:, 0] = mesh.xyz[:, 0]
    force = (assemble(structure, "stiffness") @ u.ravel()).reshape(-1, 6)
    inner = np.abs(mesh.xyz[:, 0] - 1.0) < 1e-9
    np.testing.assert_allclose(force[inner, 0], 0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_displacement_frames_only_rename(cells):
    xyz, cell = element("warped", cells)
    frames = turned(len(xyz))
    F = np.zeros((6 * len(xyz), 6 * len(xyz)))
    for i in range(2 * len(xyz)):
        F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = frames[i // 2]
    parts = [ShellPart(cell, Section(ISO, 0.1, 0.2, NSM=0.4))]
    for consistent in (False, True):
        plain, other = (shell_structure(xyz, parts, frames=f, consistent_mass=consistent) for f in (None, frames))
        for kind in ("stiffness", "mass"):
            there = F.T @ assemble(plain, kind).toarray() @ F
            np.testing.assert_allclose(assemble(other, kind).toarray(), there, atol=1e-12 * np.abs(there).max())


def patch(cells: str, name: str) -> tuple:
    """A distorted flat patch with straight sides in space, its stiffness, and a field on it."""
    mesh = shell_mesh(rectangle(3.0, 2.0, 0.3), 4, 3, cells, distort=0.3, seed=3)
    x, y = mesh.xyz[:, 0], mesh.xyz[:, 1]
    local = np.stack([np.broadcast_to(c, x.shape) for c in PATCHES[name][0](x, y)], axis=1)
    Q = turned(1)[0]
    Q = Q * np.sign(np.linalg.det(Q))
    # drilling acts on nothing here, and a soft one would cost digits of the solution
    structure = shell_structure(mesh.xyz @ Q.T, [ShellPart(mesh.cells, Section(ISO, 0.2))], drilling=1e5)
    u = np.concatenate([local[:, :3] @ Q.T, local[:, 3:] @ Q.T], axis=1).ravel()
    return mesh, assemble(structure, "stiffness").tocsr(), u


@pytest.mark.parametrize("cells", ["quad8", "union6"])
@pytest.mark.parametrize("name", PATCHES)
def test_constant_states_have_their_energy_on_distorted_meshes(cells: str, name: str):
    _, K, u = patch(cells, name)
    assert u @ (K @ u) == pytest.approx(PATCHES[name][1] * AREA, rel=1e-10)


@pytest.mark.parametrize("cells", ["quad8", "union6"])
@pytest.mark.parametrize("name", ["membrane", "bending"])
def test_patch(cells: str, name: str):
    mesh, K, u = patch(cells, name)
    rim = (6 * mesh.rim[:, None] + np.arange(6)).ravel()
    inner = np.setdiff1d(np.arange(len(u)), rim)
    found = np.linalg.solve(K[inner][:, inner].toarray(), -(K[inner][:, rim] @ u[rim]))
    np.testing.assert_allclose(found, u[inner], atol=1e-10 * np.abs(u).max())


@pytest.mark.parametrize("shape", [QUAD8_SHAPE, TRI6_SHAPE])
def test_shape_functions(shape):
    """One at their node and zero at the others; derivatives by complex step."""
    np.testing.assert_allclose(shape.functions(shape.nodes)[:, 0], np.eye(len(shape.nodes)), atol=1e-15)
    for k in range(2):
        step = 1e-30j * np.eye(2)[k]
        found = shape.functions(shape.points + step)[:, 0].imag / 1e-30
        np.testing.assert_allclose(shape.functions(shape.points)[:, 1 + k], found, atol=1e-13)


def test_quadratic_functions_of_the_place_are_met_on_any_straight_quadrilateral():
    corners = np.array([[[0.0, 0], [2, 0.3], [1.5, 1.4], [-0.2, 1]]])
    nodes = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))], axis=1)[0]
    centre = np.array([-0.25] * 4 + [0.5] * 4) + centre_shares(corners)[0]
    x, y = nodes.T
    mean = nodes[:4].mean(axis=0)
    for a, b in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
        assert centre @ (x**a * y**b) == pytest.approx(mean[0] ** a * mean[1] ** b, rel=1e-12)
    np.testing.assert_allclose(centre_shares(np.array([[[0.0, 0], [2, 1], [3, 4], [1, 3]]])), 0.0, atol=1e-14)


@pytest.mark.parametrize("shape", [QUAD8_SHAPE, TRI6_SHAPE])
def test_shares_of_the_corners_are_linear_along_the_sides(shape):
    """They give back 1, r, s, and rs of a quadrilateral, from the corners' values."""
    (r, s), (a, b) = shape.points.T, shape.nodes[: shape.corners].T
    fields = [(1.0 + 0 * a, 1.0 + 0 * r), (a, r), (b, s), *([(a * b, r * s)] if shape.corners == 4 else [])]
    for corners, points in fields:
        np.testing.assert_allclose(replace(shape).corner_shares @ corners, points, atol=1e-15)


@pytest.mark.parametrize("shape", [QUAD8_SHAPE, TRI6_SHAPE])
def test_the_second_side_of_a_node_is_to_the_left_of_the_first(shape):
    """At corners the next and the one before; at a middle along the side, and from it into the shape."""
    ahead, other = np.moveaxis(replace(shape).side_directions, 1, 0)
    c, nodes = shape.corners, shape.nodes
    np.testing.assert_array_equal(nodes[:c] + ahead[:c], np.roll(nodes[:c], -1, axis=0))
    np.testing.assert_array_equal(nodes[:c] + other[:c], np.roll(nodes[:c], 1, axis=0))
    assert (ahead[:, 0] * other[:, 1] - ahead[:, 1] * other[:, 0] > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("surface", ["warped", "cylinder"])
@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_the_numbering_does_not_matter(cells: str, surface: str):
    """The same shell from another corner on has the same matrices."""
    xyz, cell = element(surface, cells)
    corners = cell.shape[1] // 2
    for first in range(1, corners):
        order = np.concatenate([np.roll(cell[0, :corners], -first), np.roll(cell[0, corners:], -first)])
        one, other = (
            shell_structure(xyz, [ShellPart(c, Section(ISO, 0.1, 0.04))], consistent_mass=True)
            for c in (cell, order[None])
        )
        for kind in ("stiffness", "mass"):
            here, there = (assemble(s, kind).toarray() for s in (one, other))
            np.testing.assert_allclose(there, here, atol=1e-11 * np.abs(here).max())


@pytest.mark.parametrize("tie", [QUAD_STRAIN, QUAD_SHEAR, TRI_STRAIN, TRI_SHEAR])
def test_ties_keep_linear_strains(tie):
    points = np.random.default_rng(1).uniform(0.1, 0.4, (5, 2))
    components = tie.functionals.shape[2]

    def linear(at: np.ndarray) -> np.ndarray:
        r, s = at.T
        return np.stack([1 + 2 * r + s, 3 - r + 0.5 * s, 0.2 + r], axis=1)[:, :components]

    found = tie.to(points) @ linear(tie.points).ravel()
    np.testing.assert_allclose(found.reshape(-1, components), linear(points), atol=1e-13)


@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_an_offset_bends_and_stretches_together(cells):
    """A strip held at its reference plane: energy of curvature κ is E'(t³/12 + t z0²) κ² A."""
    t, z0 = 0.1, 0.25
    mesh = shell_mesh(rectangle(2.0, 1.0), 1, 1, cells)
    u = np.zeros((len(mesh.xyz), 6))
    u[:, 2], u[:, 4] = 0.5 * mesh.xyz[:, 0] ** 2, -mesh.xyz[:, 0]
    K = assemble(shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, t, z0))]), "stiffness")
    assert u.ravel() @ (K @ u.ravel()) == pytest.approx(D * (t**3 / 12 + t * z0**2) * 2.0, rel=1e-10)


@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_drilling_is_what_k6rot_says(cells):
    mesh = shell_mesh(rectangle(2.0, 1.0), 1, 1, cells)
    turn = np.tile([0, 0, 0, 0, 0, 1.0], len(mesh.xyz))
    K = assemble(shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1))], drilling=100.0), "stiffness")
    assert turn @ (K @ turn) == pytest.approx(1e-4 * G * 0.1 * 2.0, rel=1e-12)


@pytest.mark.parametrize("cells", ["quad8", "right6"])
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("z0", [None, 0.3])
def test_mass(cells: str, consistent: bool, z0: float | None):
    """Of a plate; lumped mass is positive everywhere, as the row sums would not be."""
    mesh = shell_mesh(rectangle(2.0, 1.0, 0.3), 2, 2, cells, distort=0.2)
    part = ShellPart(mesh.cells, Section(ISO, 0.1, z0, NSM=0.05))
    structure = shell_structure(
        mesh.xyz, [part], consistent_mass=consistent, mass_factor=2.0, frames=turned(len(mesh.xyz))
    )
    M = assemble(structure, "mass")
    properties = mass_properties(structure.nodes, M)
    np.testing.assert_allclose(properties.directional_mass, 2.0 * (0.2 + 0.05) * 2.0 * np.cos(0.3), rtol=1e-12)
    if consistent:
        centre = [1.0 + 0.5 * np.sin(0.3), 0.5 * np.cos(0.3), z0 or 0.0]
        np.testing.assert_allclose(properties.centre, centre, atol=1e-12)
    assert np.linalg.eigvalsh(M.toarray())[0] > -1e-14
    if not consistent and z0 is None:
        assert (M.diagonal().reshape(-1, 6)[:, :3] > 0.0).all()
        assert np.count_nonzero(np.abs(M.toarray()) > 1e-15) == 3 * len(mesh.xyz)


def test_lumped_mass_is_in_proportion_to_the_consistent_one():
    """Of a rectangle: 3/76 at corners and 16/76 at middles (Hinton, Rock and Zienkiewicz 1976)."""
    mesh = shell_mesh(rectangle(2.0, 1.0), 1, 1, "quad8")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1))])
    own = assemble(structure, "mass").diagonal().reshape(-1, 6)[mesh.cells[0], 0]
    np.testing.assert_allclose(own, 0.4 * np.array([3 / 76] * 4 + [16 / 76] * 4), rtol=1e-12)


@pytest.mark.parametrize(("cells", "count"), [("quad8", 6), ("union6", 6)])
def test_area_of_a_cylinder(cells: str, count: int):
    mesh = shell_mesh(cylinder(2.0, 3.0, 0.0, 1.5), count, 2, cells)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1))])
    assert areas(structure.nodes, structure.batches[0]).sum() == pytest.approx(9.0, rel=1e-5)


def test_normals_are_those_of_the_surface_and_shared():
    mesh = shell_mesh(cylinder(2.0, 1.0), 16, 2, "quad8", closed=True)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1))])
    normals = shared_normals(structure.batches[0], structure)
    np.testing.assert_allclose(normals, mesh.xyz[mesh.cells] * [0.5, 0.5, 0.0], atol=1e-12)


def test_flat_and_curved_shells_share_their_normals():
    """A fold of 20 degrees between a CQUAD4 and a CQUAD8: both have the mean at the common corners."""
    fold = np.radians(20.0)
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    far = [1 + np.cos(fold), 0, np.sin(fold)]
    other = np.array([flat[1], far, [far[0], 1, far[2]], flat[2]])
    middles = 0.5 * (other + np.roll(other, -1, axis=0))
    xyz = np.concatenate([flat, other[1:3], middles])
    parts = [ShellPart([[0, 1, 2, 3]], Section(ISO, 0.1)), ShellPart([[1, 4, 5, 2, 6, 7, 8, 9]], Section(ISO, 0.1))]
    structure = shell_structure(xyz, parts)
    one, two = (shared_normals(batch, structure)[0] for batch in structure.batches)
    mean = [-np.sin(fold / 2), 0.0, np.cos(fold / 2)]
    np.testing.assert_allclose([one[1], one[2], two[0], two[3]], np.tile(mean, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(two[5], [-np.sin(fold), 0.0, np.cos(fold)], atol=1e-12)


@pytest.mark.quick(0)
@pytest.mark.parametrize("cells", ["quad8", "right6"])
@pytest.mark.parametrize("material", [ISO, ANISO, Anisotropic({"11": 5.0, "12": 1.0}, {"11": 1.0})])
@pytest.mark.parametrize("z0", [None, 0.12])
def test_contributions_keep_their_contract(cells, material, z0):
    xyz, cell = element("warped", cells)
    structure = shell_structure(xyz, [ShellPart(cell, Section(material, 0.1, z0, NSM=0.3), theta=0.3)])
    batch = structure.batches[0]
    parts = contributions(batch, structure)
    for part in parts:
        check_contribution(part, {r: structure.values.values[batch.roles[r][part.at]] for r in part.roles})
    assert any("offset" in part.label for part in parts) == (z0 is not None)


def test_every_coefficient_is_a_product():
    xyz, cell = element("warped", "quad8")
    structure = shell_structure(xyz, [ShellPart(cell, Section(ISO, 0.1, 0.2))])
    roles = {p.label: p.roles for p in contributions(structure.batches[0], structure) if p.matrix != "hysteretic"}
    assert roles == {
        "membrane-11": ("M11", "t"), "membrane-12": ("M12", "t"), "membrane-33": ("M33", "t"),
        "membrane-11-offset": ("M11", "t", "z0"), "membrane-11-offset²": ("M11", "t", "z0"),
        "membrane-12-offset": ("M12", "t", "z0"), "membrane-12-offset²": ("M12", "t", "z0"),
        "membrane-33-offset": ("M33", "t", "z0"), "membrane-33-offset²": ("M33", "t", "z0"),
        "bending-11": ("B11", "t", "RI"), "bending-12": ("B12", "t", "RI"), "bending-33": ("B33", "t", "RI"),
        "shear-11": ("S11", "t", "TS"), "mass": ("rho", "t"), "added-mass": ("NSM",),
        "mass-offset": ("rho", "t", "z0"), "added-mass-offset": ("NSM", "z0"),
        "mass-offset²": ("rho", "t", "z0"), "added-mass-offset²": ("NSM", "z0"),
    }  # fmt: skip


@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_material_axes_start_from_the_line_along_r(cells):
    """A quarter of a ring: stretched around it, the fibres along r carry all, those across nothing."""
    mesh = shell_mesh(lambda u, v: ((1 + v) * np.cos(u), (1 + v) * np.sin(u), 0 * u), 1, 1, cells)
    law = Anisotropic({"11": 7.0, "22": 0.0, "33": 0.0}, {"11": 1.0, "22": 1.0})
    u = np.zeros((len(mesh.xyz), 6))
    u[:, :2] = mesh.xyz[:, :2] / np.linalg.norm(mesh.xyz[:, :2], axis=1)[:, None]
    for theta, exact in ((0.0, 7.0 * np.log(2.0)), (np.pi / 2, 0.0)):
        if cells == "right6" and theta:
            continue
        structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(law, 1.0), theta)])
        energy = u.ravel() @ (assemble(structure, "stiffness") @ u.ravel())
        # the line along r of one of the triangles is no circle
        assert energy == pytest.approx(exact, rel=0.04 if cells == "quad8" else 0.3, abs=0.02)


def test_material_axes_by_a_direction():
    mesh = shell_mesh(cylinder(1.0, 1.0, 0.0, 1.0), 1, 1, "quad8")
    law = Anisotropic({"11": 7.0, "22": 3.0, "33": 1.0}, {"11": 1.0, "22": 1.0})
    u = np.zeros((len(mesh.xyz), 6))
    u[:, 2] = mesh.xyz[:, 2]
    for direction, modulus in (((0.0, 0.0, 1.0), 7.0), ((1.0, -1.0, 0.0), 3.0)):
        structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(law, 1.0), direction=direction)])
        energy = u.ravel() @ (assemble(structure, "stiffness") @ u.ravel())
        assert energy == pytest.approx(modulus * areas(structure.nodes, structure.batches[0])[0], rel=1e-6)


def refused(xyz: np.ndarray, cell: np.ndarray, t: float = 0.1, **more: object) -> FemtuneError:
    structure = shell_structure(xyz, [ShellPart(cell, Section(ISO, t), **more)])
    with pytest.raises(FemtuneError) as caught:
        contributions(structure.batches[0], structure)
    assert "hint:" in str(caught.value)
    assert structure.batches[0].card in str(caught.value)
    return caught.value


@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_bad_shapes_are_refused(cells):
    xyz, cell = element("flat", cells)
    n = len(xyz) // 2
    same, swapped, straight = xyz.copy(), cell.copy(), xyz.copy()
    same[cell[0, n]] = same[cell[0, 0]]
    swapped[0, n:] = swapped[0, n:][::-1] if cells == "right6" else cell[0, [6, 7, 4, 5]]
    straight[cell[0, :n]] = np.outer(np.arange(n), [1.0, 0, 0])
    for points, nodes, words in ((same, cell, "same place"), (xyz, swapped, "folds back"), (straight, cell, "line")):
        error = refused(points, nodes)
        assert error.code == "element.shell-shape"
        assert words in str(error)
    assert refused(xyz, cell, t=0.0).code == "element.shell-thickness"
    assert refused(xyz, cell, direction=(0.0, 0.0, 2.0)).code == "element.material-direction"


@pytest.mark.parametrize("cells", ["quad8", "right6"])
def test_a_middle_beyond_the_quarter_of_its_side_is_refused(cells):
    """There the first base vector turns around at the corner: the surface is folded, though at no point of the rule."""
    xyz, cell = element("flat", cells)
    start, end, middle = cell[0, [0, 1, len(cell[0]) // 2]]
    for place, taken in ((0.7, True), (0.75, False), (0.76, False), (0.24, False), (0.3, True)):
        moved = xyz.copy()
        moved[middle] = xyz[start] + place * (xyz[end] - xyz[start])
        if taken:
            structure = shell_structure(moved, [ShellPart(cell, Section(ISO, 0.1))])
            assert contributions(structure.batches[0], structure)
        else:
            assert "folds back" in str(refused(moved, cell))


def test_several_bad_elements_are_shown_together():
    mesh = shell_mesh(rectangle(2.0, 1.0), 2, 1, "quad8")
    mesh.xyz[mesh.cells[0, 7]] = [3.0, 0.5, 0.0]
    mesh.xyz[mesh.cells[1, 5]] = [-3.0, 0.5, 0.0]
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1))])
    with pytest.raises(FemtuneErrors) as caught:
        contributions(structure.batches[0], structure)
    assert "CQUAD8 1" in str(caught.value)
    assert "CQUAD8 2" in str(caught.value)
