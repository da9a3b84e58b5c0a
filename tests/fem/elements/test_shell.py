"""Four-node shells: rigid motion, constant strains, in-plane bending, drilling, mass, laws, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.assemble import assemble, nominal_matrices
from femtune.fem.checks import mass_properties, rigid_body_modes
from femtune.fem.elements import contributions
from femtune.fem.elements.shells.normals import shared_normals
from femtune.testing import check_contribution
from structures.shells import Anisotropic, Isotropic, Section, ShellPart, cylinder, rectangle, shell_mesh
from structures.shells import shell_structure as structure_of

from .constant_states import AREA, PATCHES, D, G

WARPED = np.array([[0, 0, 0], [1.2, 0.1, 0.1], [1.0, 0.9, -0.05], [-0.1, 1.1, 0.2]])
ISO = Isotropic(200.0, 0.3, 2.0, 0.02)
LAW = {"11": 200.0, "12": 41.0, "13": 13.0, "22": 103.0, "23": -7.0, "33": 50.0}
ANISO = Anisotropic(LAW, {"11": 40.0, "12": 5.0, "22": 30.0}, 2.0)
ONE = [[0, 1, 2, 3]]


def turned(n: int, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(n)])


@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("z0", [None, 0.1, -0.3])
@pytest.mark.parametrize("t", [0.1, 0.001])
def test_six_motions_are_strain_free_and_no_more(material, z0, t):
    structure = structure_of(WARPED, [ShellPart(ONE, Section(material, t, z0), theta=0.3)], frames=turned(4))
    K = assemble(structure, "stiffness").toarray()
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    scale = np.linalg.eigvalsh(K)
    assert (scale[:6] < 1e-14 * scale[-1]).all()
    # the softest deformation is bending with t³ or drilling with 1e-4 t
    assert scale[6] > 1e-10 * scale[-1]


def test_displacement_frames_only_rename():
    frames = turned(4)
    F = np.zeros((24, 24))
    for i in range(8):
        F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = frames[i // 2]
    parts = [ShellPart(ONE, Section(ISO, 0.1, 0.2, NSM=0.4))]
    for consistent in (False, True):
        plain, other = (structure_of(WARPED, parts, frames=f, consistent_mass=consistent) for f in (None, frames))
        for kind in ("stiffness", "mass"):
            there = F.T @ assemble(plain, kind).toarray() @ F
            np.testing.assert_allclose(assemble(other, kind).toarray(), there, atol=1e-12 * np.abs(there).max())


def patch(field, section: Section) -> tuple:
    """A distorted flat patch in space, its stiffness, and a field (x, y) -> six components on it."""
    mesh = shell_mesh(rectangle(3.0, 2.0, 0.3), 4, 3, distort=0.3, seed=3)
    x, y = mesh.xyz[:, 0], mesh.xyz[:, 1]
    local = np.stack([np.broadcast_to(c, x.shape) for c in field(x, y)], axis=1)
    Q = turned(1)[0]
    Q = Q * np.sign(np.linalg.det(Q))
    structure = structure_of(mesh.xyz @ Q.T, [ShellPart(mesh.cells, section)])
    u = np.concatenate([local[:, :3] @ Q.T, local[:, 3:] @ Q.T], axis=1).ravel()
    return mesh, assemble(structure, "stiffness").tocsr(), u


@pytest.mark.parametrize("name", PATCHES)
def test_constant_states_have_their_energy_on_distorted_meshes(name: str):
    field, density = PATCHES[name]
    # rigid in bending, a shell has no residual bending flexibility
    _, K, u = patch(field, Section(ISO, 0.2, RI=1e15 if name == "shear" else 1.0))
    assert u @ (K @ u) == pytest.approx(density * AREA, rel=1e-10)


@pytest.mark.parametrize("name", ["membrane", "bending"])
def test_patch(name: str):
    mesh, K, u = patch(PATCHES[name][0], Section(ISO, 0.2))
    rim = (6 * mesh.rim[:, None] + np.arange(6)).ravel()
    inner = np.setdiff1d(np.arange(len(u)), rim)
    found = np.linalg.solve(K[inner][:, inner].toarray(), -(K[inner][:, rim] @ u[rim]))
    np.testing.assert_allclose(found, u[inner], atol=1e-10 * np.abs(u).max())


@pytest.mark.parametrize("aspect", [0.1, 1.0, 20.0])
def test_in_plane_bending_of_a_rectangle(aspect: float):
    """u = κxy, v = −κx²/2, turn −κx: the beam's energy E t b³/12 · κ² a, and that of four springs turned by ¼κa.

    The sides of a corner turn half as much as the beam's sections: the bilinear displacements have no curved sides.
    """
    a, b, t = aspect, 1.0, 0.1
    xyz = np.array([[-a, -b, 0], [a, -b, 0], [a, b, 0], [-a, b, 0]]) / 2
    u = np.zeros((4, 6))
    u[:, 0], u[:, 1], u[:, 5] = xyz[:, 0] * xyz[:, 1], -0.5 * xyz[:, 0] ** 2, -xyz[:, 0]
    for drilling in (0.0, 100.0, 1e6):
        K = assemble(structure_of(xyz, [ShellPart(ONE, Section(ISO, t))], drilling=drilling), "stiffness")
        springs = 4 * 1e-6 * drilling * G * t * a * b * (a / 4) ** 2
        assert u.ravel() @ (K @ u.ravel()) == pytest.approx(200.0 * t * b**3 / 12 * a + springs, rel=1e-10)


@pytest.mark.parametrize("n", [3, 4])
def test_drilling_is_a_spring_at_each_corner(n: int):
    """1e-6 K6ROT G t times the area of the parallelogram of the corner's sides, about their normal, warped or not."""
    xyz = np.array([[0, 0, 0.1], [2.0, 0.2, -0.1], [1.6, 1.1, 0.1], [-0.1, 0.9, -0.1]])[:n]
    sides = [(xyz[(i + 1) % n] - xyz[i], xyz[i - 1] - xyz[i]) for i in range(n)]
    crosses = np.array([np.cross(a, b) for a, b in sides])
    cells = np.arange(n)[None]
    bare, K = (
        assemble(structure_of(xyz, [ShellPart(cells, Section(ISO, 0.1))], drilling=k), "stiffness").toarray()
        for k in (0.0, 1e6)
    )
    springs = K - bare
    for i in range(n):
        area, turn = np.linalg.norm(crosses[i]), np.zeros((n, 6))
        turn[i, 3:] = crosses[i] / area
        assert turn.ravel() @ springs @ turn.ravel() == pytest.approx(G * 0.1 * area, rel=1e-10)


def test_drilling_follows_any_linear_displacement():
    """The rotation of a linear field is that of the sides of every corner, whatever the shape."""
    xyz = np.array([[0, 0, 0], [2.0, 0.2, 0], [1.6, 1.1, 0], [-0.1, 0.9, 0]])
    u = np.zeros((4, 6))
    slope = np.array([[0.3, -0.7], [1.9, 0.4]])
    u[:, :2], u[:, 5] = xyz[:, :2] @ slope.T, 0.5 * (slope[1, 0] - slope[0, 1])
    forces = [
        assemble(structure_of(xyz, [ShellPart(ONE, Section(ISO, 0.1))], drilling=k), "stiffness") @ u.ravel()
        for k in (0.0, 1e6)
    ]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-11 * np.abs(forces[0]).max())


def test_an_offset_bends_and_stretches_together():
    """A strip held at its reference plane: energy of curvature κ is E'(t³/12 + t z0²) κ² A."""
    t, z0 = 0.1, 0.25
    xyz = shell_mesh(rectangle(2.0, 1.0), 1, 1).xyz[[0, 2, 3, 1]]
    u = np.zeros((4, 6))
    u[:, 2], u[:, 4] = 0.5 * xyz[:, 0] ** 2, -xyz[:, 0]
    K = assemble(structure_of(xyz, [ShellPart(ONE, Section(ISO, t, z0))]), "stiffness")
    assert u.ravel() @ (K @ u.ravel()) == pytest.approx(D * (t**3 / 12 + t * z0**2) * 2.0, rel=1e-10)


@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("z0", [None, 0.3])
def test_mass(consistent: bool, z0: float | None):
    xyz = np.array([[0, 0, 0], [2.0, 0.2, 0], [1.6, 1.1, 0], [-0.1, 0.9, 0]])
    part = ShellPart(ONE, Section(ISO, 0.1, z0, NSM=0.05))
    structure = structure_of(xyz, [part], consistent_mass=consistent, mass_factor=2.0, frames=turned(4))
    M = assemble(structure, "mass")
    area = 0.5 * np.linalg.norm(np.cross(xyz[2] - xyz[0], xyz[3] - xyz[1]))
    properties = mass_properties(structure.nodes, M)
    np.testing.assert_allclose(properties.directional_mass, 2.0 * (0.2 + 0.05) * area, rtol=1e-12)
    triangles = [xyz[[0, 1, 2]], xyz[[0, 2, 3]]]
    sizes = [0.5 * np.linalg.norm(np.cross(p[1] - p[0], p[2] - p[0])) for p in triangles]
    centre = sum(s * p.mean(axis=0) for s, p in zip(sizes, triangles)) / area + [0, 0, z0 or 0.0]
    np.testing.assert_allclose(properties.centre, centre, atol=1e-12)
    assert np.linalg.eigvalsh(M.toarray())[0] > -1e-14


def test_lumped_mass_is_on_the_translations_and_in_row_sums():
    structures = [structure_of(WARPED, [ShellPart(ONE, Section(ISO, 0.1))], consistent_mass=c) for c in (False, True)]
    lumped, consistent = (assemble(s, "mass").toarray() for s in structures)
    np.testing.assert_allclose(
        np.diag(lumped), consistent.reshape(24, 4, 6).sum(axis=1)[np.arange(24), np.tile(range(6), 4)]
    )
    assert np.count_nonzero(lumped) == 12


@pytest.mark.slow
@pytest.mark.parametrize("material", [ISO, ANISO, Anisotropic({"11": 5.0, "12": 1.0}, {"11": 1.0})])
@pytest.mark.parametrize("z0", [None, 0.12])
def test_contributions_keep_their_contract(material, z0):
    structure = structure_of(WARPED, [ShellPart(ONE, Section(material, 0.1, z0, NSM=0.3), theta=0.3)])
    batch = structure.batches[0]
    parts = contributions(batch, structure)
    for part in parts:
        check_contribution(part, {r: structure.values.values[batch.roles[r][part.at]] for r in part.roles})
    assert any("offset" in part.label for part in parts) == (z0 is not None)


def test_the_values_that_each_term_depends_on():
    structure = structure_of(WARPED, [ShellPart(ONE, Section(ISO, 0.1, 0.2))])
    roles = {p.label: p.roles for p in contributions(structure.batches[0], structure) if p.matrix != "hysteretic"}
    softened = ("S11", "t", "TS", "S22", "B11", "B22", "RI")
    shear = {f"{kind}{size}": softened for kind in ("shear-11", "varying-shear-11") for size in ("", "-2")}
    assert roles == {
        "membrane-11": ("M11", "t"), "membrane-12": ("M12", "t"), "membrane-33": ("M33", "t"),
        "membrane-11-offset": ("M11", "t", "z0"), "membrane-11-offset²": ("M11", "t", "z0"),
        "membrane-12-offset": ("M12", "t", "z0"), "membrane-12-offset²": ("M12", "t", "z0"),
        "membrane-33-offset": ("M33", "t", "z0"), "membrane-33-offset²": ("M33", "t", "z0"),
        "in-plane-bending": ("M11", "M12", "t"),
        "in-plane-bending-offset": ("M11", "M12", "t", "z0"), "in-plane-bending-offset²": ("M11", "M12", "t", "z0"),
        "bending-11": ("B11", "t", "RI"), "bending-12": ("B12", "t", "RI"), "bending-33": ("B33", "t", "RI"),
        "varying-bending": ("B11", "B12", "t", "RI"), **shear, "mass": ("rho", "t"), "added-mass": ("NSM",),
        "mass-offset": ("rho", "t", "z0"), "added-mass-offset": ("NSM", "z0"),
        "mass-offset²": ("rho", "t", "z0"), "added-mass-offset²": ("NSM", "z0"),
    }  # fmt: skip


def test_each_law_has_its_own_loss_factor():
    section = Section(ISO, 0.1, bending=Isotropic(100.0, 0.3, GE=0.05), shear=Isotropic(100.0, 0.3, GE=0.3))
    structure = structure_of(WARPED, [ShellPart(ONE, section)])
    batch = structure.batches[0]
    loss = {p.label: p.loss for p in contributions(batch, structure) if p.matrix == "hysteretic"}
    assert loss["membrane-33"] == loss["in-plane-bending"] == "GE"
    assert loss["bending-11"] == loss["varying-bending"] == "GEB"
    assert loss["shear-11"] == loss["varying-shear-11"] == "GES"
    assert [structure.values.values[batch.roles[r][0]] for r in ("GE", "GEB", "GES")] == [0.02, 0.05, 0.3]


def test_a_section_may_have_a_membrane_or_bending_alone():
    for section, letters in (
        (Section(ISO, 0.1, has_bending=False), "M"),
        (Section(ISO, 0.1, has_membrane=False), "BS"),
    ):
        structure = structure_of(WARPED, [ShellPart(ONE, section)])
        parts = [p for p in contributions(structure.batches[0], structure) if p.matrix == "stiffness"]
        assert {p.roles[0][0] for p in parts} == set(letters)


def orthotropic_energy(theta: float, direction: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> float:
    """Energy of a unit stretch along x of a unit square whose first side is along y."""
    xyz = np.array([[0, 0, 0], [0, 1, 0], [-1, 1, 0], [-1, 0, 0]], float)
    law = Anisotropic({"11": 7.0, "22": 3.0, "33": 1.0}, {"11": 1.0, "22": 1.0})
    structure = structure_of(xyz, [ShellPart(ONE, Section(law, 1.0), theta, direction)])
    u = np.zeros((4, 6))
    u[:, 0] = xyz[:, 0]
    return float(u.ravel() @ (assemble(structure, "stiffness") @ u.ravel()))


def test_material_axes():
    assert orthotropic_energy(0.0) == pytest.approx(3.0)
    assert orthotropic_energy(np.pi / 2) == pytest.approx(7.0)
    assert orthotropic_energy(0.0, (1.0, 0.0, 5.0)) == pytest.approx(7.0)
    c = np.cos(0.3)
    exact = 7.0 * (1 - c * c) ** 2 + 3.0 * c**4 + (2 * c) ** 2 * (1 - c * c)
    assert orthotropic_energy(0.3) == pytest.approx(exact)


def in_plane_modulus(law: np.ndarray, theta: float) -> float:
    """The factor of in-plane bending along x of a unit square, of a law (3, 3) on axes at θ from x."""
    entries = {f"{i + 1}{j + 1}": law[i, j] for i in range(3) for j in range(i, 3)}
    structure = structure_of(
        shell_mesh(rectangle(1.0, 1.0), 1, 1).xyz[[0, 2, 3, 1]],
        [ShellPart(ONE, Section(Anisotropic(entries, {"11": 1.0, "22": 1.0}), 1.0), theta=theta)],
    )
    batch = structure.batches[0]
    part = next(p for p in contributions(batch, structure) if p.label == "in-plane-bending-1")
    return nominal_matrices(batch, structure, part)[0, 0, 0] / part.matrices[0, 0, 0]


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_in_plane_bending_of_an_orthotropic_strip_along_any_axis(turn: float):
    """The uniaxial modulus along a direction at θ: 1/E = c⁴/E1 + s⁴/E2 + c²s²(1/G − 2ν/E1).

    The law may be written on axes that are turned from those of orthotropy: stress and strain turn there and back.
    """
    E1, E2, nu, G12 = 10.0, 2.0, 0.25, 1.5
    flexible = np.array([[1 / E1, -nu / E1, 0], [-nu / E1, 1 / E2, 0], [0, 0, 1 / G12]])
    # strain on the axes of orthotropy, which are at −turn, from that on the axes of the law
    c, s = np.cos(turn), -np.sin(turn)
    T = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    found = in_plane_modulus(T.T @ np.linalg.inv(flexible) @ T, turn - 0.4)
    c, s = np.cos(0.4), np.sin(0.4)
    modulus = 1.0 / (c**4 / E1 + s**4 / E2 + c * c * s * s * (1.0 / G12 - 2.0 * nu / E1))
    assert found == pytest.approx(modulus, rel=1e-12)


@pytest.mark.parametrize("angles", [(0.3, 1.9), (0.3, -1.2), (-0.5, 0.8), (1.0, 0.2)])
def test_in_plane_bending_of_two_families_of_fibres(angles: tuple[float, float]):
    """A net without a matrix has no uniaxial stress off its fibres: strain along x stretches each by E cos⁴."""
    E, law = (7.0, 3.0), np.zeros((3, 3))
    for modulus, angle in zip(E, angles):
        c, s = np.cos(angle), np.sin(angle)
        stretch = np.array([c * c, s * s, c * s])
        law += modulus * np.outer(stretch, stretch)
    exact = sum(modulus * np.cos(angle + 0.2) ** 4 for modulus, angle in zip(E, angles))
    assert in_plane_modulus(law, 0.2) == pytest.approx(exact, rel=1e-12)


def test_elements_of_a_batch_may_have_their_axis_by_an_angle_or_by_a_direction():
    parts = [ShellPart(ONE, Section(ANISO, 0.1), theta=0.4), ShellPart(ONE, Section(ANISO, 0.1), direction=(1, 2, 0.3))]
    whole = structure_of(WARPED, parts)
    one, two = whole.batches
    together = replace(
        one,
        ids=np.array([1, 2]),
        nodes=np.concatenate([one.nodes, two.nodes]),
        dofs=np.concatenate([one.dofs, two.dofs]),
        roles={role: np.concatenate([one.roles[role], two.roles[role]]) for role in one.roles},
        facts={name: np.concatenate([one.facts[name], two.facts[name]]) for name in one.facts},
    )
    expected, found = (assemble(s, "stiffness").toarray() for s in (whole, replace(whole, batches=(together,))))
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_neighbours_share_normals_on_a_smooth_surface_and_keep_them_at_a_fold():
    mesh = shell_mesh(cylinder(2.0, 1.0), 24, 2, closed=True)
    structure = structure_of(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1))])
    normals = shared_normals(structure.batches[0], structure)
    radial = mesh.xyz[mesh.cells] * [0.5, 0.5, 0.0]
    np.testing.assert_allclose(normals, radial, atol=1e-12)
    # every second element listed the other way around: the same lines, the other side
    cells = mesh.cells.copy()
    cells[::2] = cells[::2, ::-1]
    other = structure_of(mesh.xyz, [ShellPart(cells, Section(ISO, 0.1))])
    signs = np.where(np.arange(len(cells)) % 2 == 0, -1.0, 1.0)[:, None, None]
    np.testing.assert_allclose(
        shared_normals(other.batches[0], other), signs * mesh.xyz[cells] * [0.5, 0.5, 0], atol=1e-12
    )
    box = shell_mesh(cylinder(2.0, 1.0), 4, 1, closed=True)
    folded = structure_of(box.xyz, [ShellPart(box.cells, Section(ISO, 0.1))])
    flat = shared_normals(folded.batches[0], folded)
    np.testing.assert_allclose(flat, np.repeat(flat[:, :1], 4, axis=1), atol=1e-12)


def refused(xyz: list[list[float]], section: Section, **more: object) -> FemtuneError:
    structure = structure_of(xyz, [ShellPart(ONE, section, **more)])
    with pytest.raises(FemtuneError) as caught:
        contributions(structure.batches[0], structure)
    return caught.value


GOOD = Section(ISO, 0.1)
FLAT = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
BAD_SHAPES = {
    "same place": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]],
    "are collinear": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],
    "180 degrees": [[0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]],
    "edges cross": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
}


@pytest.mark.parametrize("name", BAD_SHAPES)
def test_bad_shapes_are_refused_with_their_number(name: str):
    error = refused(BAD_SHAPES[name], GOOD)
    assert error.code == "element.shell-shape"
    assert name in str(error)
    assert "CQUAD4 1" in str(error)
    assert "hint:" in str(error)


def test_a_straight_corner_is_refused():
    assert refused([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], GOOD).code == "element.shell-shape"


@pytest.mark.parametrize("t", [0.0, -1.0])
def test_thickness_must_be_above_zero(t: float):
    error = refused(FLAT, Section(ISO, t))
    assert error.code == "element.shell-thickness"
    assert f"{t:g}" in str(error)


def test_a_material_axis_needs_a_projection():
    assert refused(FLAT, GOOD, direction=(0.0, 0.0, 2.0)).code == "element.material-direction"


def test_several_bad_elements_are_shown_together():
    structure = structure_of([*FLAT, *BAD_SHAPES["180 degrees"]], [ShellPart([[0, 1, 1, 3], [4, 5, 6, 7]], GOOD)])
    with pytest.raises(FemtuneErrors) as caught:
        contributions(structure.batches[0], structure)
    assert "CQUAD4 1" in str(caught.value)
    assert "CQUAD4 2" in str(caught.value)
