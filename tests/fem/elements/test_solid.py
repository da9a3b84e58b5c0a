"""Solids of first order: rigid motion, constant strains, laws, frames, numbering, mass, exact coefficients."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from tests.fem.solid_parts import (
    ANISO,
    CORNERS,
    GRADIENT,
    ISO,
    KINDS,
    LAW,
    PYRAMID,
    dense,
    distorted,
    lean,
    one,
    solved_patch,
    translations,
    translations_of,
    turned,
)

from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties, rigid_body_modes
from femtune.fem.elements import contributions
from femtune.fem.elements.solids import penta6, pyram5
from femtune.testing import check_contribution
from structures.solids import Law, SolidPart, box, isotropic_law, solid_mesh, solid_model, solid_structure


@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_six_motions_are_strain_free_and_no_more(kind: str, material):
    xyz = distorted(kind)
    structure = one(kind, xyz, material, turned(1)[0], frames=turned(len(xyz)))
    K = dense(structure)
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))[translations(len(xyz))]
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    scale = np.linalg.eigvalsh(K)
    assert (np.abs(scale[:6]) < 1e-13 * scale[-1]).all()
    assert scale[6] > 1e-3 * scale[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_displacement_frames_only_rename(kind: str):
    xyz = distorted(kind)
    frames = turned(len(xyz))
    F = np.zeros((3 * len(xyz),) * 2)
    for i, frame in enumerate(frames):
        F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = frame
    for consistent in (False, True):
        plain, other = (one(kind, xyz, frames=f, consistent_mass=consistent) for f in (None, frames))
        for matrix in ("stiffness", "mass"):
            there = F.T @ dense(plain, matrix) @ F
            np.testing.assert_allclose(dense(other, matrix), there, atol=1e-12 * np.abs(there).max())


@pytest.mark.parametrize("kind", KINDS)
def test_turning_the_element_with_its_material_turns_the_matrix(kind: str):
    xyz, Q, frame = distorted(kind), turned(1, 8)[0], turned(1, 9)[0]
    F = np.kron(np.eye(len(xyz)), Q)
    there = F @ dense(one(kind, xyz, ANISO, frame)) @ F.T
    np.testing.assert_allclose(dense(one(kind, xyz @ Q.T, ANISO, Q @ frame)), there, atol=1e-11 * np.abs(there).max())


@pytest.mark.quick(0)
@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_numbering_does_not_matter(kind: str, material):
    """Every other way to list the corners of the same solid gives the same matrix."""
    xyz = distorted(kind)
    here = dense(one(kind, xyz, material))
    others = list(renumberings(kind))[:: 1 if material is ISO else 5]
    assert material is ANISO or len(others) == {"hexa8": 24, "penta6": 6, "tetra4": 12, "pyram5": 4}[kind]
    for order in others:
        at = translations_of(order)
        there = dense(one(kind, xyz[order], material))
        np.testing.assert_allclose(there, here[np.ix_(at, at)], atol=1e-11 * np.abs(here).max())


def renumberings(kind: str):
    """Orders of the corners that a proper affine map of the reference shape onto itself makes."""
    corners = CORNERS[kind] if kind != "pyram5" else PYRAMID
    n = len(corners)
    whole = np.concatenate([corners, np.ones((n, 1))], axis=1)
    first = next(list(c) for c in ([0, 1, 3, 4], [0, 1, 2, 3]) if n > max(c) and abs(np.linalg.det(whole[c])) > 1e-9)
    for images in permutations(range(n), 4):
        affine = np.linalg.solve(whole[first], corners[list(images)])
        if np.linalg.det(affine[:3]) < 1e-9:
            continue
        distance = np.linalg.norm((whole @ affine)[:, None] - corners, axis=2)
        if (distance.min(axis=1) < 1e-9).all() and len(set(distance.argmin(axis=1))) == n:
            yield list(distance.argmin(axis=1))


@pytest.mark.parametrize("kind", KINDS)
def test_an_isotropic_law_written_out_is_the_isotropic_solid(kind: str):
    xyz = distorted(kind)
    here = dense(one(kind, xyz, ISO))
    there = dense(one(kind, xyz, Law(isotropic_law(200.0, 0.3)), turned(1)[0]))
    np.testing.assert_allclose(there, here, atol=1e-11 * np.abs(here).max())


# constant strain in a patch of distorted cells ---------------------------------------------------------------------


def strain_energy(law: np.ndarray, gradient: np.ndarray) -> float:
    e = 0.5 * (gradient + gradient.T)
    strain = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1], 2 * e[1, 2], 2 * e[2, 0]])
    return float(strain @ law @ strain)


@pytest.mark.parametrize("law", ["isotropic", "anisotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_patch(kind: str, law: str):
    mesh = solid_mesh(lean, (3, 2, 3), kind, distort=0.25, seed=4)
    matrix = isotropic_law(200.0, 0.3) if law == "isotropic" else LAW
    structure = solid_model(mesh, ISO if law == "isotropic" else ANISO)
    found, wanted, energy = solved_patch(structure, mesh.rim)
    assert len(wanted) >= 3
    np.testing.assert_allclose(found, wanted, atol=1e-10)
    volume = np.linalg.det([[2.0, 0.4, 0.0], [0.0, 1.5, 0.2], [0.3, 0.0, 1.0]])
    assert energy == pytest.approx(volume * strain_energy(matrix, GRADIENT), rel=1e-10)


def test_patch_of_hexahedra_and_pyramids():
    """A distorted grid where every third box is six pyramids, the others one hexahedron."""
    mesh = solid_mesh(lean, (3, 3, 3), "hexa8", distort=0.25, seed=4)
    cut = np.arange(27) % 3 == 2
    hexas, split = mesh.cells[~cut], mesh.cells[cut]
    middles = len(mesh.xyz) + np.arange(len(split))
    xyz = np.concatenate([mesh.xyz, mesh.xyz[split].mean(axis=1)])
    faces = [[0, 1, 2, 3], [7, 6, 5, 4], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
    pyramids = [[*cell[face], m] for cell, m in zip(split, middles) for face in faces]
    parts = [SolidPart("hexa8", hexas, ISO), SolidPart("pyram5", pyramids, ISO)]
    found, wanted, _ = solved_patch(solid_structure(xyz, parts), mesh.rim)
    np.testing.assert_allclose(found, wanted, atol=1e-10)


def test_patch_of_hexahedra_on_pentahedra_and_pyramids_on_tetrahedra():
    """Columns along w: of pentahedra where u < 1/2, of hexahedra beside; and pyramids cut into tetrahedra."""
    mesh = solid_mesh(lean, (4, 2, 2), "hexa8", distort=0.25, seed=6)
    wedge = np.arange(16) // 4 < 2
    split = mesh.cells[wedge]
    wedges = np.concatenate([split[:, [0, 1, 2, 4, 5, 6]], split[:, [0, 2, 3, 4, 6, 7]]])
    parts = [SolidPart("hexa8", mesh.cells[~wedge], ISO), SolidPart("penta6", wedges, ISO)]
    found, wanted, _ = solved_patch(solid_structure(mesh.xyz, parts), mesh.rim)
    np.testing.assert_allclose(found, wanted, atol=1e-10)
    cut = solid_mesh(lean, (2, 2, 2), "pyram5", distort=0.25, seed=6)
    low = np.arange(len(cut.cells)) % 6 == 0
    some = cut.cells[low]
    # bases of the cut ones lie on the rim w = 0 or meet the other half of the same diagonal
    keep = np.isin(some, cut.face("w0")).sum(axis=1) == 4
    some = some[keep]
    rest = np.concatenate([cut.cells[~low], cut.cells[low][~keep]])
    tetras = np.concatenate([some[:, [0, 1, 2, 4]], some[:, [0, 2, 3, 4]]])
    parts = [SolidPart("pyram5", rest, ISO), SolidPart("tetra4", tetras, ISO)]
    found, wanted, _ = solved_patch(solid_structure(cut.xyz, parts), cut.rim)
    np.testing.assert_allclose(found, wanted, atol=1e-10)


@pytest.mark.parametrize("own", [penta6, pyram5], ids=["penta6", "pyram5"])
def test_shape_functions(own):
    """Linear fields are met, each function is one at its own corner, and derivatives agree with complex steps."""
    corners = penta6.CORNERS if own is penta6 else np.array([*np.pad(pyram5.BASE, ((0, 0), (0, 1))), [0, 0, 1.0]])
    # the last corner is an apex, where the functions of the pyramid are limits
    values = own.functions(corners[:-1])
    np.testing.assert_allclose(values, np.eye(len(corners))[:-1], atol=1e-15)
    points = np.random.default_rng(2).dirichlet(np.ones(len(corners)), 5) @ corners
    np.testing.assert_allclose(own.functions(points) @ corners, points, atol=1e-14)
    for k in range(3):
        found = own.functions(points + 1e-30j * np.eye(3)[k]).imag / 1e-30
        np.testing.assert_allclose(own.derivatives(points)[:, k], found, atol=1e-14)


# mass --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_mass(kind: str, consistent: bool):
    """Mass, and of the consistent one the centre and the moments of inertia, of a box of distorted cells."""
    mesh = solid_mesh(box(2.0, 1.0, 0.5), (2, 2, 2), kind, distort=0.3, seed=2)
    structure = solid_model(mesh, ISO, consistent_mass=consistent, mass_factor=3.0, frames=turned(len(mesh.xyz)))
    properties = mass_properties(structure.nodes, assemble(structure, "mass"))
    np.testing.assert_allclose(properties.directional_mass, 6.0, rtol=1e-12)
    if consistent:
        np.testing.assert_allclose(properties.centre, [1.0, 0.5, 0.25], rtol=1e-12)
        wanted = 6.0 / 12 * np.array([1.0 + 0.25, 4.0 + 0.25, 4.0 + 1.0])
        np.testing.assert_allclose(np.diag(properties.central_inertia), wanted, rtol=1e-12)
    else:
        M = dense(structure, "mass")
        np.testing.assert_array_equal(M, np.diag(np.diag(M)))
        assert (np.diag(M) > 0.0).all()


def test_lumped_mass_of_a_tapered_solid_follows_the_consistent_diagonal():
    xyz = distorted("hexa8")
    full, lumped = (np.diag(dense(one("hexa8", xyz, consistent_mass=c), "mass")) for c in (True, False))
    np.testing.assert_allclose(lumped / full, np.full(24, lumped[0] / full[0]), rtol=1e-12)
    assert lumped.max() / lumped.min() > 1.1


# coefficients ------------------------------------------------------------------------------------------------------


@pytest.mark.quick(2)
@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_coefficients_have_exact_derivatives(kind: str, material):
    structure = one(kind, distorted(kind), material, turned(1)[0])
    batch = structure.batches[0]
    # of groups that differ by their axes alone, the first
    alike = ("plane-2", "plane-3", "uniaxial-5", "uniaxial-6")
    parts = [p for p in contributions(batch, structure) if not p.label.startswith(alike) and p.matrix != "hysteretic"]
    assert {p.matrix for p in parts} == {"stiffness", "mass"}
    for part in parts:
        values = {role: structure.values.values[batch.roles[role][part.at]] for role in part.roles}
        check_contribution(part, values)


@pytest.mark.parametrize("kind", KINDS)
def test_an_isotropic_solid_is_few_terms_without_facts(kind: str):
    structure = one(kind, distorted(kind), ISO)
    parts = contributions(structure.batches[0], structure)
    stiffness = [p for p in parts if p.matrix == "stiffness"]
    assert len(stiffness) == {"hexa8": 4, "penta6": 4, "tetra4": 2, "pyram5": 3}[kind]
    assert not any(p.facts for p in parts)
    assert {p.matrix for p in parts} == {"stiffness", "mass", "hysteretic"}


def test_elements_alike_share_the_coefficients_of_an_anisotropic_law():
    """Facts of equal elements are equal to the last bit, wherever the elements are."""
    mesh = solid_mesh(lean, (3, 3, 3))
    structure = solid_model(mesh, ANISO)
    for part in contributions(structure.batches[0], structure):
        for fact in part.facts.values():
            assert len(np.unique(fact, axis=0)) == 1


@pytest.mark.parametrize("rest", [0.0, 1e-20, 1e-12])
@pytest.mark.parametrize("kind", KINDS)
def test_a_law_that_cannot_be_inverted_still_resists(kind: str, rest: float):
    """A honeycomb has stiffness across and transverse shear only, or nearly so: no inverse, and no not-a-number."""
    law = np.diag([rest, rest, 100.0, rest, 20.0, 10.0])
    K = dense(one(kind, distorted(kind), Law(law), turned(1)[0]))
    assert np.isfinite(K).all()
    values = np.linalg.eigvalsh(K)
    assert values[0] > -1e-12 * values[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_solid_without_stiffness_has_its_mass(kind: str):
    structure = one(kind, distorted(kind), Law(np.zeros((6, 6)), 2.0))
    assert not dense(structure).any()
    here, there = (mass_properties(s.nodes, assemble(s, "mass")) for s in (structure, one(kind, distorted(kind), ISO)))
    np.testing.assert_allclose(here.directional_mass, there.directional_mass, rtol=1e-12)


def test_materials_may_be_mixed_in_a_batch():
    """One batch of an isotropic and an anisotropic element is the sum of two batches."""
    mesh = solid_mesh(lean, (2, 1, 1))
    whole = solid_structure(
        mesh.xyz, [SolidPart("hexa8", mesh.cells[:1], ISO), SolidPart("hexa8", mesh.cells[1:], ANISO)]
    )
    first, second = whole.batches
    together = replace(
        first,
        ids=np.array([1, 2]),
        nodes=mesh.cells,
        dofs=np.concatenate([first.dofs, second.dofs]),
        roles={role: np.concatenate([first.roles[role], second.roles[role]]) for role in first.roles},
        facts={name: np.concatenate([first.facts[name], second.facts[name]]) for name in first.facts},
    )
    for matrix in ("stiffness", "mass"):
        a, b = (dense(s, matrix) for s in (whole, replace(whole, batches=(together,))))
        np.testing.assert_allclose(b, a, atol=1e-12 * np.abs(a).max())


@pytest.mark.slow
@pytest.mark.parametrize("middle", [300, 301])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
def test_a_part_of_a_batch_can_be_run_alone(material, kind: str, middle: int):
    """More elements than a chunk holds, whole and in two parts: the same matrices and facts to the last bit."""
    mesh = solid_mesh(lean, {"hexa8": (9, 8, 8), "penta6": (9, 8, 4)}.get(kind, (6, 6, 6)), kind, distort=0.2)
    structure = solid_model(mesh, material)
    whole = structure.batches[0]
    for place in (slice(0, middle), slice(middle, None)):
        part = replace(
            whole,
            ids=whole.ids[place],
            nodes=whole.nodes[place],
            dofs=whole.dofs[place],
            roles={role: at[place] for role, at in whole.roles.items()},
            facts={name: fact[place] for name, fact in whole.facts.items()},
        )
        for all_of, own in zip(contributions(whole, structure), contributions(part, structure)):
            assert (all_of.label, all_of.roles) == (own.label, own.roles)
            np.testing.assert_array_equal(all_of.matrices[all_of.at[place]], own.matrices)
            for name in own.facts:
                np.testing.assert_array_equal(all_of.facts[name][place], own.facts[name])
