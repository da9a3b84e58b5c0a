"""Triangular shells: motions without strain, patch tests, terms exact for every value, mass, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import rigid_body_modes
from femtune.fem.elements import contributions
from femtune.fem.elements.shells.tri import tri_residual
from femtune.fem.structure import Structure
from femtune.parameters import jet
from femtune.testing.contributions import check_contribution
from structures.shells import (
    Anisotropic,
    Isotropic,
    Section,
    ShellPart,
    cylinder,
    dofs_of,
    rectangle,
    shell_mesh,
    shell_structure,
)

STEEL = Isotropic(200.0, 0.3, 2.0, 0.01)
PLY = Anisotropic(
    {"11": 150.0, "12": 20.0, "13": 5.0, "22": 60.0, "23": -3.0, "33": 25.0}, {"11": 30.0, "12": 2.0, "22": 20.0}, 1.5
)
PLAIN = Section(STEEL, 0.2)
FULL = Section(STEEL, 0.2, z0=0.15, NSM=0.3, RI=1.2, TS=0.8)
LAYERED = replace(FULL, material=PLY)
SECTIONS = {"plain": PLAIN, "offset": FULL, "anisotropic": LAYERED}
CORNERS = np.array([[0.2, 0.1, 0.4], [1.3, 0.3, -0.2], [0.5, 0.9, 0.7]])
PAIR = np.array([*CORNERS, [1.4, 1.2, 0.3]])


def turned(n: int, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(n)])


def triangle(section: Section, xyz: np.ndarray = CORNERS, **settings) -> Structure:
    cells = np.array([[0, 1, 2], [2, 1, 3]][: len(xyz) - 2])
    return shell_structure(xyz, [ShellPart(cells, section, theta=0.4)], **settings)


@pytest.mark.parametrize("name", SECTIONS)
@pytest.mark.parametrize("xyz", [CORNERS, PAIR], ids=["one", "two"])
def test_six_motions_are_strain_free_and_no_more(name: str, xyz: np.ndarray):
    structure = triangle(SECTIONS[name], xyz, frames=turned(len(xyz)))
    K = assemble(structure, "stiffness").toarray()
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    energies = np.linalg.eigvalsh(K)
    assert energies[0] > -1e-12 * energies[-1]
    # drilling is the softest of what resists
    assert np.sum(energies < 1e-8 * energies[-1]) == 6


@pytest.mark.parametrize("cells", ["right", "mixed"])
def test_rigid_motion_of_a_curved_mesh_is_strain_free(cells: str):
    """Offsets, shared normals, displacement frames, a ring of triangles alone and with quadrilaterals between."""
    mesh = shell_mesh(cylinder(0.8, 0.5), 12, 2, "right", closed=True)
    parts = [ShellPart(mesh.cells, LAYERED, direction=(0.1, 0.2, 1.0))]
    if cells == "mixed":
        quads = shell_mesh(cylinder(0.8, 0.5), 12, 2, "quad", closed=True).cells
        parts = [ShellPart(mesh.cells[:24], FULL), ShellPart(quads[12:], FULL)]
    structure = shell_structure(mesh.xyz, parts, frames=turned(len(mesh.xyz)))
    K = assemble(structure, "stiffness").toarray()
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    energies = np.linalg.eigvalsh(K)
    assert np.sum(energies < 1e-9 * energies[-1]) == 6


@pytest.mark.parametrize("fold", [0.0, 0.3, 1.2])
def test_only_drilling_resists_a_turn_about_the_shared_normal(fold: float):
    """Two triangles that meet at an angle: smooth (0.3 rad) they share a normal, folded (1.2 rad) they do not."""
    height = 0.5 * np.tan(0.5 * fold)
    xyz = np.array([[0.0, -0.5, 0.0], [0.5, 0.0, height], [-0.5, 0.0, height], [0.0, 0.5, 0.0]])
    structure = triangle(PLAIN, xyz, drilling=0.0)
    K = assemble(structure, "stiffness").toarray()
    turn = K[6 + 5, 6 + 5] / np.abs(np.diag(K)[9:12]).max()
    assert turn > 0.01 if fold == 1.2 else turn < 1e-12


@pytest.mark.parametrize("consistent", [False, True])
def test_displacement_frames_only_rename(consistent: bool):
    frames = turned(3)
    plain, other = (triangle(LAYERED, frames=f, consistent_mass=consistent) for f in (None, frames))
    F = np.zeros((18, 18))
    for i in range(6):
        F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = frames[i // 2]
    for kind in ("stiffness", "mass", "hysteretic"):
        there = F.T @ assemble(plain, kind).toarray() @ F
        np.testing.assert_allclose(assemble(other, kind).toarray(), there, atol=1e-12 * np.abs(there).max(initial=1.0))


@pytest.mark.parametrize("order", [(1, 2, 0), (2, 0, 1), (0, 2, 1)])
def test_the_order_of_the_corners_does_not_matter(order: tuple[int, int, int]):
    """A turned-over triangle has its normal, and so its offset, the other way."""
    over = order == (0, 2, 1)
    section = replace(FULL, z0=-FULL.z0) if over else FULL
    one = triangle(FULL, consistent_mass=True)
    two = shell_structure(CORNERS, [ShellPart(np.array([order]), section)], consistent_mass=True)
    for kind in ("stiffness", "mass"):
        a, b = (assemble(s, kind).toarray() for s in (one, two))
        np.testing.assert_allclose(b, a, atol=1e-13 * np.abs(a).max())


def patch_error(field: np.ndarray, section: Section, components: str) -> float:
    """Largest error inside a distorted mesh whose rim moves as `field` (n, 6) says, relative to the field."""
    mesh = shell_mesh(rectangle(1.0, 1.0), 4, 4, "union", distort=0.3, seed=2)
    exact = field_on(mesh.xyz, field)
    rest = "".join(c for c in "123456" if c not in components)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section, direction=(1.0, 0.3, 0.2))])
    known = np.array(sorted(dofs_of(mesh.rim, components) | dofs_of(range(len(mesh.xyz)), rest)))
    free = np.setdiff1d(np.arange(exact.size), known)
    K = assemble(structure, "stiffness").toarray()
    found = np.linalg.solve(K[np.ix_(free, free)], -K[np.ix_(free, known)] @ exact[known])
    return float(np.abs(found - exact[free]).max() / np.abs(exact).max())


def field_on(xyz: np.ndarray, strains: np.ndarray) -> np.ndarray:
    """Displacements (6n,) of constant membrane strains (3) and curvatures (3): w is quadratic, θx = w,y, θy = −w,x."""
    x, y = xyz[:, 0], xyz[:, 1]
    e, k = strains[:3], strains[3:]
    out = np.zeros((len(xyz), 6))
    out[:, 0], out[:, 1] = e[0] * x + 0.7 * e[2] * y, e[1] * y + 0.3 * e[2] * x
    out[:, 2] = -0.5 * (k[0] * x * x + k[1] * y * y + k[2] * x * y)
    out[:, 3], out[:, 4] = -(k[1] * y + 0.5 * k[2] * x), k[0] * x + 0.5 * k[2] * y
    out[:, 5] = 0.5 * (0.3 - 0.7) * e[2]
    return out.ravel()


@pytest.mark.quick(4)
@pytest.mark.parametrize("i", range(6))
@pytest.mark.parametrize("t", [0.5, 1e-3])
def test_constant_strains_and_curvatures_are_exact(i: int, t: float):
    components = "126" if i < 3 else "345"
    for section in (PLAIN, LAYERED):
        flat = replace(section, t=t, z0=None)
        assert patch_error(np.eye(6)[i], flat, components) < (1e-8 if i < 3 else 1e-11)


@pytest.mark.parametrize("t", [0.01, 0.2, 5.0])
def test_constant_shear_has_shear_and_residual_bending_flexibility(t: float):
    """w = γx with rotations held: strain energy ½ γ² A / (1/S + h²/15D)."""
    mesh = shell_mesh(rectangle(1.0, 1.0), 4, 4, "right")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, replace(PLAIN, t=t))])
    u = np.zeros((len(mesh.xyz), 6))
    u[:, 2] = mesh.xyz[:, 0]
    energy = 0.5 * u.ravel() @ assemble(structure, "stiffness") @ u.ravel()
    S, D = 200.0 / 2.6 * t * 5.0 / 6.0, 200.0 / 0.91 * t**3 / 12.0
    h2 = (2.0 + 1.0 + 1.0) / 3.0 / 16.0
    assert energy == pytest.approx(0.5 / (1.0 / S + h2 / (15.0 * D)), rel=1e-12)


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", SECTIONS)
def test_terms_and_their_derivatives(name: str):
    structure = triangle(SECTIONS[name], PAIR)
    batch = structure.batches[0]
    terms = contributions(batch, structure)
    assert {"stiffness", "mass"} <= {term.matrix for term in terms}
    for term in terms:
        check_contribution(term, {r: structure.values.values[batch.roles[r][term.at]] for r in term.roles})


def matrix_at(structure: Structure, kind: str, values: np.ndarray) -> np.ndarray:
    """Sum of the terms that were made at the structure's own values, taken at other values."""
    batch, table = structure.batches[0], jet.constant(values, 0)
    out = np.zeros((18, 18))
    for term in contributions(batch, structure):
        if term.matrix == kind:
            roles = {r: table[batch.roles[r][term.at]] for r in term.roles}
            out += np.einsum("e,eij->ij", term.coefficient(roles, term.facts).value, term.matrices)
    return out


@pytest.mark.parametrize("change", [{"t": 0.31}, {"z0": -0.2}, {"NSM": 1.0}, {"TS": 0.5}, {"RI": 2.0}])
@pytest.mark.parametrize("name", ["offset", "anisotropic"])
def test_terms_are_exact_far_from_where_they_were_made(name: str, change: dict[str, float]):
    section = SECTIONS[name]
    here, there = triangle(section, consistent_mass=True), triangle(replace(section, **change), consistent_mass=True)
    for kind in ("stiffness", "mass"):
        exact = assemble(there, kind).toarray()
        found = matrix_at(here, kind, there.values.values)
        np.testing.assert_allclose(found, exact, atol=1e-12 * np.abs(exact).max())


def test_terms_of_isotropic_material_are_exact_in_young_and_poisson():
    here, there = triangle(FULL), triangle(replace(FULL, material=Isotropic(150.0, 0.4, 3.0, 0.01)))
    for kind in ("stiffness", "mass"):
        exact = assemble(there, kind).toarray()
        np.testing.assert_allclose(
            matrix_at(here, kind, there.values.values), exact, atol=1e-12 * np.abs(exact).max(initial=1.0)
        )


@pytest.mark.parametrize("consistent", [False, True])
def test_mass_and_its_moments(consistent: bool):
    """Translations weigh (ρt + NSM)A; with an offset the mass is at the mid-surface."""
    structure = triangle(FULL, consistent_mass=consistent)
    M = assemble(structure, "mass").toarray()
    normal = np.cross(CORNERS[1] - CORNERS[0], CORNERS[2] - CORNERS[0])
    area = 0.5 * np.linalg.norm(normal)
    centre = CORNERS.mean(axis=0) + 0.15 * normal / np.linalg.norm(normal)
    motions = rigid_body_modes(structure.nodes, centre)
    rigid = motions.T @ M @ motions
    weight = (2.0 * 0.2 + 0.3) * area
    np.testing.assert_allclose(rigid[:3, :3], weight * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rigid[:3, 3:], 0.0, atol=1e-12)
    arms = CORNERS - CORNERS.mean(axis=0)
    if not consistent:
        inertia = weight / 3.0 * sum(r @ r * np.eye(3) - np.outer(r, r) for r in arms)
    else:
        # of a uniform triangle: its corners with a twelfth of the mass each
        inertia = weight / 12.0 * sum(r @ r * np.eye(3) - np.outer(r, r) for r in arms)
    np.testing.assert_allclose(rigid[3:, 3:], inertia, atol=1e-12)


def test_regular_meshes_share_coefficients():
    """Sizes come in classes of √2 in h², the largest first; a class is never off by more."""
    xyz = np.array([CORNERS * s for s in np.geomspace(1.0, 1e-3, 50)])
    h2 = ((np.roll(xyz, -1, axis=1) - xyz) ** 2).sum(axis=(1, 2)) / 3.0
    found = tri_residual(xyz).sizes[:, 0] / 0.8 / h2
    assert found[0] == pytest.approx(1.0)
    assert found.min() > 2.0**-0.25 * 0.93
    assert found.max() < 2.0**0.25 * 1.08
    mesh = shell_mesh(rectangle(2.0, 1.0), 8, 4, "union")
    assert len(np.unique(tri_residual(mesh.xyz[mesh.cells] + 1e3).sizes)) == 1


def test_membrane_or_bending_alone():
    flat = triangle(replace(PLAIN, has_bending=False))
    labels = {term.label for term in contributions(flat.batches[0], flat) if term.matrix == "stiffness"}
    assert labels == {"membrane-11", "membrane-12", "membrane-33"}
    bent = triangle(replace(PLAIN, has_membrane=False))
    labels = {term.label for term in contributions(bent.batches[0], bent) if term.matrix == "stiffness"}
    assert labels == {"bending-11", "bending-12", "bending-33", "shear-11"}


def test_without_bending_stiffness_the_shear_stands_alone():
    nothing = Anisotropic({})
    structure = triangle(replace(PLAIN, bending=nothing, shear=STEEL))
    shear = [term for term in contributions(structure.batches[0], structure) if term.label == "shear-11"]
    assert [term.roles for term in shear if term.matrix == "stiffness"] == [("S11", "t", "TS")]
    assert np.isfinite(assemble(structure, "stiffness").toarray()).all()


COLLAPSED = {
    "use a CTRIA3": np.array([CORNERS[0], CORNERS[0], CORNERS[2]]),
    "corners on a line": np.array([CORNERS[0], CORNERS[1], 0.3 * CORNERS[0] + 0.7 * CORNERS[1]]),
}


@pytest.mark.parametrize("name", COLLAPSED)
def test_a_collapsed_triangle_is_refused_by_its_number(name: str):
    with pytest.raises(FemtuneError, match="CTRIA3 1") as caught:
        assemble(triangle(PLAIN, COLLAPSED[name]), "stiffness")
    assert caught.value.code == "element.shell-shape"
    assert "quadrilateral" not in str(caught.value)


def test_a_thickness_of_zero_is_refused():
    with pytest.raises(FemtuneError, match="CTRIA3 1") as caught:
        assemble(triangle(replace(PLAIN, t=0.0)), "stiffness")
    assert caught.value.code == "element.shell-thickness"
