"""Solids with mid-side nodes: patches, rigid motion, numbering, missing nodes, mass, ν near one half, convergence."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from tests.fem.quadratic_parts import SHAPES, curved, one
from tests.fem.solid_parts import ANISO, GRADIENT, ISO, LAW, dense, lean, solved_patch, translations_of, turned

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties, rigid_body_modes
from femtune.fem.elements import contributions
from femtune.fem.elements.solids.shape import (
    HEXA20_SHAPE as HEXA20,
)
from femtune.fem.elements.solids.shape import (
    TETRA10_SHAPE as TETRA10,
)
from femtune.fem.structure import Structure
from femtune.testing import check_contribution
from structures.shells import Isotropic
from structures.solids import Law, SolidPart, box, isotropic_law, solid_mesh, solid_model, solid_structure

KINDS = list(SHAPES)


@pytest.mark.parametrize("nu", [0.3, 0.4999])
@pytest.mark.parametrize("kind", KINDS)
def test_six_motions_are_strain_free_and_no_more(kind: str, nu: float) -> None:
    """Neither does the projection add any: the softest deformation is that of the element without it."""
    xyz = curved(kind)
    structure = one(kind, xyz, Isotropic(200.0, nu), frames=turned(len(xyz)))
    K = dense(structure)
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))[translations(len(xyz))]
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    values, shear = np.linalg.eigvalsh(K), 200.0 / (2 + 2 * nu)
    assert (np.abs(values[:6]) < 1e-13 * values[-1]).all()
    assert values[6] > 0.005 * shear


def translations(n: int) -> np.ndarray:
    return (6 * np.arange(n)[:, None] + np.arange(3)).ravel()


@pytest.mark.parametrize("kind", KINDS)
def test_an_isotropic_law_written_out_is_the_isotropic_solid(kind: str) -> None:
    """The strains row by row, in turned frames or not, and the products of gradients are one matrix."""
    xyz = curved(kind)
    for nu in (0.3, 0.47):
        here = dense(one(kind, xyz, Isotropic(200.0, nu)))
        there = dense(one(kind, xyz, Law(isotropic_law(200.0, nu))))
        np.testing.assert_allclose(there, here, atol=1e-12 * np.abs(here).max())
        frames = turned(len(xyz))
        F = np.zeros_like(here)
        for i, frame in enumerate(frames):
            F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = frame
        rows = dense(one(kind, xyz, Isotropic(200.0, nu), frames=frames))
        np.testing.assert_allclose(rows, F.T @ here @ F, atol=1e-12 * np.abs(here).max())


@pytest.mark.parametrize("kind", KINDS)
def test_turning_the_element_turns_its_matrix(kind: str) -> None:
    xyz, Q = curved(kind), turned(1, 8)[0]
    F = np.kron(np.eye(len(xyz)), Q)
    there = F @ dense(one(kind, xyz)) @ F.T
    np.testing.assert_allclose(dense(one(kind, xyz @ Q.T + 30.0)), there, atol=1e-12 * np.abs(there).max())


def renumberings(kind: str) -> list[list[int]]:
    """Orders of the nodes that turns of the reference shape onto itself make, by three corners and what follows."""
    shape = SHAPES[kind]
    # the pentahedron's triangle is not equilateral: one that is has the same numbering
    places = (
        shape.nodes @ np.array([[1.0, 0, 0], [0.5, np.sqrt(0.75), 0], [0, 0, 1]]) if kind == "penta15" else shape.nodes
    )
    if kind == "tetra10":
        places = shape.nodes @ np.array([[1.0, 0, 0], [0.5, np.sqrt(0.75), 0], [0.5, np.sqrt(1 / 12), np.sqrt(2 / 3)]])
    places = places - places[: shape.corners].mean(axis=0)
    if kind == "pyram13":
        places = shape.nodes - [0, 0, 0.25]
    basis = [0, 1, {"hexa20": 4, "penta15": 3, "tetra10": 3, "pyram13": 4}[kind]]
    out = []
    for images in product(range(shape.corners), repeat=3):
        if len(set(images)) < 3:
            continue
        turn = np.linalg.solve(places[basis], places[list(images)])
        if np.allclose(turn @ turn.T, np.eye(3), atol=1e-9) and np.linalg.det(turn) > 0:
            distance = np.linalg.norm((places @ turn)[:, None] - places, axis=2)
            if (distance.min(axis=1) < 1e-9).all():
                out.append(list(distance.argmin(axis=1)))
    return out


@pytest.mark.quick(0)
@pytest.mark.parametrize("kind", KINDS)
def test_the_numbering_does_not_matter(kind: str) -> None:
    xyz = curved(kind)
    orders = renumberings(kind)
    assert len(orders) == {"hexa20": 24, "penta15": 6, "tetra10": 12, "pyram13": 4}[kind]
    for matrix in ("stiffness", "mass"):
        here = dense(one(kind, xyz, consistent_mass=True), matrix)
        for order in orders:
            at = translations_of(order)
            there = dense(one(kind, xyz[order], consistent_mass=True), matrix)
            np.testing.assert_allclose(there, here[np.ix_(at, at)], atol=1e-12 * np.abs(here).max())


# patches -----------------------------------------------------------------------------------------------------------


def wavy(u, v, w):
    """A box whose inside is curved; its rim moves within itself, so that its volume is known."""
    bump = 0.05 * np.sin(np.pi * u) * np.sin(np.pi * v) * np.sin(np.pi * w)
    return 2.0 * (u + bump), 1.5 * (v - bump), w + 2.0 * bump


@pytest.mark.quick(0)
@pytest.mark.parametrize("law", ["isotropic", "anisotropic", "nearly incompressible"])
@pytest.mark.parametrize("kind", KINDS)
def test_patch_of_constant_strain_in_curved_cells(kind: str, law: str) -> None:
    material = {"isotropic": ISO, "anisotropic": ANISO, "nearly incompressible": Isotropic(200.0, 0.4999)}[law]
    matrix = LAW if law == "anisotropic" else isotropic_law(200.0, 0.4999 if law.startswith("nearly") else 0.3)
    mesh = solid_mesh(wavy, (2, 2, 2), kind, distort=0.2, seed=4)
    found, wanted, energy = solved_patch(solid_model(mesh, material), mesh.rim)
    assert len(wanted) >= 21
    np.testing.assert_allclose(found, wanted, atol=1e-10)
    e = (GRADIENT + GRADIENT.T) / 2
    strain = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1], 2 * e[1, 2], 2 * e[2, 0]])
    assert energy == pytest.approx(3.0 * strain @ matrix @ strain, rel=1e-10)


def quadratic_field(xyz: np.ndarray, nu: float) -> np.ndarray:
    """Pure bending about two axes, twist, and a stretch whose stresses are in balance without a load."""
    x, y, z = xyz.T
    zero = 0 * x
    bend = np.stack([x * z, -nu * y * z, -(x**2 - nu * y**2 + nu * z**2) / 2], axis=1)
    across = np.stack([-nu * x * z, y * z, -(y**2 - nu * x**2 + nu * z**2) / 2], axis=1)
    twist = np.stack([y * z, x * z, -x * y], axis=1)
    harmonic = np.stack([x**2 - y**2, -2 * x * y, zero], axis=1)
    return bend + 0.7 * across + 0.4 * twist + 0.3 * harmonic


@pytest.mark.parametrize(
    ("kind", "nu"),
    [("hexa20", 0.3), ("hexa20", 0.4999), ("penta15", 0.3), ("penta15", 0.45), ("tetra10", 0.3), ("tetra10", 0.45)],
)
def test_patch_of_linear_strain_in_straight_cells(kind: str, nu: float) -> None:
    """Exact where cells are affine images of their reference: parallelepipeds, oblique prisms, straight tetrahedra."""
    mesh = solid_mesh(lean, (2, 2, 2), kind)
    structure = solid_model(mesh, Isotropic(200.0, nu))
    K, u = dense(structure), quadratic_field(mesh.xyz, nu).ravel()
    outer = translations_of(mesh.rim)
    inner = np.setdiff1d(np.arange(len(u)), outer)
    found = np.linalg.solve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ u[outer])
    np.testing.assert_allclose(found, u[inner], atol=1e-10)


def test_patch_of_linear_strain_in_tetrahedra_of_any_straight_shape() -> None:
    shaken = solid_mesh(box(1.0, 1.0, 1.0), (2, 2, 2), "tetra4", distort=0.3, seed=2)
    mesh = solid_mesh(box(1.0, 1.0, 1.0), (2, 2, 2), "tetra10", distort=0.3, seed=2)
    np.testing.assert_array_equal(mesh.xyz[: len(shaken.xyz)], shaken.xyz)
    K, u = dense(solid_model(mesh, ISO)), quadratic_field(mesh.xyz, 0.3).ravel()
    outer = translations_of(mesh.rim)
    inner = np.setdiff1d(np.arange(len(u)), outer)
    found = np.linalg.solve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ u[outer])
    np.testing.assert_allclose(found, u[inner], atol=1e-10)


def test_patch_of_all_four_shapes() -> None:
    """Hexahedra, pyramids on them, tetrahedra and pentahedra: distorted boxes of one grid cut in different ways."""
    whole = solid_mesh(lean, (3, 1, 1), "hexa20")
    cut = {kind: solid_mesh(lean, (3, 1, 1), kind) for kind in ("penta15", "pyram13")}
    points, parts = [np.zeros((0, 3))], []
    for kind, cells in (
        ("hexa20", whole.cells[:1]),
        ("pyram13", cut["pyram13"].cells[6:12]),
        ("penta15", cut["penta15"].cells[4:6]),
    ):
        mesh = whole if kind == "hexa20" else cut[kind]
        used, local = np.unique(cells, return_inverse=True)
        known = np.concatenate(points)
        place = mesh.xyz[used]
        distance = np.linalg.norm(place[:, None] - known, axis=2) if len(known) else np.full((len(place), 1), 1.0)
        old, new = distance.min(axis=1) < 1e-9, np.cumsum(distance.min(axis=1) >= 1e-9) - 1 + len(known)
        points.append(place[~old])
        parts.append(SolidPart(kind, np.where(old, distance.argmin(axis=1), new)[local].reshape(cells.shape), ISO))
    xyz = np.concatenate(points)
    uvw = np.linalg.solve(np.array([[2.0, 0.4, 0.0], [0.0, 1.5, 0.2], [0.3, 0.0, 1.0]]), xyz.T).T
    rim = np.flatnonzero((np.minimum(uvw, 1 - uvw) < 1e-9).any(axis=1))
    found, wanted, _ = solved_patch(solid_structure(xyz, parts), rim)
    assert len(wanted) >= 27
    np.testing.assert_allclose(found, wanted, atol=1e-10)


# mid-side nodes that are left out ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_without_any_middle_a_solid_has_the_corners_shape_functions(kind: str) -> None:
    """Mass and volume of a box of solids of first order; displacements linear along sides stay."""
    shape, first = (
        SHAPES[kind],
        {"hexa20": "hexa8", "penta15": "penta6", "tetra10": "tetra4", "pyram13": "pyram5"}[kind],
    )
    corners = curved(kind)[: shape.corners]
    xyz = np.concatenate([corners, np.full((len(shape.edges), 3), 1e3)])
    missing = tuple(range(shape.corners, len(xyz)))
    found = dense(one(kind, xyz, missing=missing, consistent_mass=True), "mass")
    at = translations_of(range(shape.corners))
    assert not np.delete(found, at, axis=0).any()
    wanted = dense(one(first, corners, consistent_mass=True), "mass")
    np.testing.assert_allclose(found[np.ix_(at, at)], wanted, atol=1e-12 * wanted.max())


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_missing_middle_is_a_middle_that_follows_its_ends(kind: str) -> None:
    shape, xyz = SHAPES[kind], curved(kind)
    missing = (shape.corners, shape.corners + 2, len(xyz) - 1)
    follow = np.eye(len(xyz))
    for node in missing:
        ends = list(shape.edges[node - shape.corners])
        xyz[node] = xyz[ends].mean(axis=0)
        follow[node] = 0.0
        follow[node, ends] = 0.5
    T = np.kron(follow, np.eye(3))
    for material in (ISO, ANISO):
        for matrix in ("stiffness", "mass"):
            whole = dense(one(kind, xyz, material, consistent_mass=True), matrix)
            lost = xyz.copy()
            lost[list(missing)] = 7.0
            found = dense(one(kind, lost, material, missing, consistent_mass=True), matrix)
            np.testing.assert_allclose(found, T.T @ whole @ T, atol=1e-12 * np.abs(whole).max())


def test_cells_with_and_without_middles_in_one_batch() -> None:
    """A curved patch in which the middles of one face's sides are missing for all that touch them."""
    mesh = solid_mesh(wavy, (2, 2, 2), "hexa20", distort=0.2, seed=4)
    cells, middle = mesh.cells.copy(), np.flatnonzero(np.abs(mesh.uvw[:, 2] - 0.5) < 0.2)
    lost = [n for n in np.unique(cells[:, 8:]) if n in middle and n not in mesh.rim][:3]
    cells[np.isin(cells, lost)] = -1
    assert lost
    structure = solid_structure(mesh.xyz, [SolidPart("hexa20", cells, ISO)])
    found, wanted = solved_without(structure, mesh.rim, lost)
    np.testing.assert_allclose(found, wanted, atol=1e-10)


def solved_without(structure: Structure, rim: np.ndarray, lost: list[int]) -> tuple[np.ndarray, np.ndarray]:
    K, u = dense(structure), (structure.nodes.xyz @ GRADIENT.T).ravel()
    outer = translations_of(rim)
    inner = np.setdiff1d(np.arange(len(u)), np.concatenate([outer, translations_of(lost)]))
    return np.linalg.solve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ u[outer]), u[inner]


# mass --------------------------------------------------------------------------------------------------------------


@pytest.mark.quick(4)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_mass(kind: str, consistent: bool) -> None:
    """Mass, and of the consistent one the centre and the moments of inertia, of a box of curved cells."""

    def place(u, v, w):
        x, y, z = wavy(u, v, w)
        return x, y / 1.5, z / 2.0

    mesh = solid_mesh(place, (2, 2, 2), kind, distort=0.2, seed=2)
    structure = solid_model(mesh, ISO, consistent_mass=consistent, mass_factor=3.0, frames=turned(len(mesh.xyz)))
    properties = mass_properties(structure.nodes, assemble(structure, "mass"))
    np.testing.assert_allclose(properties.directional_mass, 6.0, rtol=1e-12)
    M = dense(structure, "mass")
    if consistent:
        # curved sides: the integrands' degree is beyond the rules'
        np.testing.assert_allclose(properties.centre, [1.0, 0.5, 0.25], rtol=1e-3)
        wanted = 6.0 / 12 * np.array([1.0 + 0.25, 4.0 + 0.25, 4.0 + 1.0])
        np.testing.assert_allclose(np.diag(properties.central_inertia), wanted, rtol=1e-3)
        assert np.linalg.eigvalsh(M)[0] > 1e-3 * M.max()
    else:
        np.testing.assert_array_equal(M, np.diag(np.diag(M)))
        assert (np.diag(M) > 0.0).all()


def test_lumped_mass_of_a_straight_tetrahedron() -> None:
    """Closed form: the diagonal of the consistent mass is 6/420 at corners and 32/420 at middles of the whole."""
    M = np.diag(dense(one("tetra10", TETRA10.nodes), "mass"))[::3]
    whole = 2.0 / 6.0
    np.testing.assert_allclose(M, whole * np.array([6.0] * 4 + [32.0] * 6) / 216.0, rtol=1e-12)


# coefficients, refusals ----------------------------------------------------------------------------------------------


@pytest.mark.quick(2)
@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("kind", KINDS)
def test_coefficients_have_exact_derivatives(kind: str, material: Isotropic | Law) -> None:
    structure = one(kind, curved(kind), material)
    batch = structure.batches[0]
    parts = contributions(batch, structure)
    assert len([p for p in parts if p.matrix == "stiffness"]) == (2 if material is ISO else 21)
    for part in parts:
        assert not part.facts
        check_contribution(part, {r: structure.values.values[batch.roles[r][part.at]] for r in part.roles})


@pytest.mark.parametrize("kind", KINDS)
def test_a_solid_that_is_turned_inside_out_is_refused(kind: str) -> None:
    xyz = SHAPES[kind].nodes * [1.0, 1.0, -1.0]
    structure = one(kind, xyz)
    with pytest.raises(FemtuneError, match="the opposite order") as caught:
        contributions(structure.batches[0], structure)
    assert caught.value.code == "element.solid-shape"


def test_a_side_that_is_too_curved_is_refused_at_its_corner() -> None:
    xyz = HEXA20.nodes.copy()
    xyz[8, 0] += 0.95
    structure = one("hexa20", xyz)
    with pytest.raises(FemtuneError, match="corner 2"):
        contributions(structure.batches[0], structure)


def test_a_node_beside_a_missing_one_may_not_be_twice() -> None:
    xyz = HEXA20.nodes.copy()
    xyz[10] = xyz[2]
    structure = one("hexa20", xyz, missing=(9,))
    with pytest.raises(FemtuneError, match="grid points 3 and 11"):
        contributions(structure.batches[0], structure)
