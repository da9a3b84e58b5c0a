"""Bending and transverse shear of four-node shells: varying curvature, residual flexibility, shapes, coarse meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.fem.elements import contributions
from femtune.fem.elements.shells.quad import quad_residual
from femtune.fem.elements.shells.residual import LARGEST_STEP, few_sizes
from femtune.fem.structure import Structure
from femtune.parameters import jet
from structures.shells import (
    Anisotropic,
    Isotropic,
    Section,
    ShellPart,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
    static_displacements,
)

E, NU = 200.0, 0.3
ISO = Isotropic(E, NU, 2.0, 0.02)
LAW = {"11": 200.0, "12": 41.0, "13": 13.0, "22": 103.0, "23": -7.0, "33": 50.0}
ANISO = Anisotropic(LAW, {"11": 40.0, "12": 5.0, "22": 30.0}, 2.0)
ONE = [[0, 1, 2, 3]]


def square(a: float, b: float) -> np.ndarray:
    return np.array([[-a, -b, 0.0], [a, -b, 0.0], [a, b, 0.0], [-a, b, 0.0]]) / 2.0


def stiffness(xyz: np.ndarray, section: Section, **more: float) -> np.ndarray:
    return np.asarray(assemble(shell_structure(xyz, [ShellPart(ONE, section, **more)]), "stiffness").toarray())


@pytest.mark.parametrize("aspect", [0.1, 1.0, 20.0])
def test_curvature_that_varies_across_meets_uniaxial_stress(aspect: float) -> None:
    """θy = κxy with w = 0: energy E t³/12 · κ² a b³/12 of the strips, and shear that its own tests look at."""
    a, b, t = aspect, 1.0, 0.1
    xyz, u = square(a, b), np.zeros((4, 6))
    u[:, 4] = xyz[:, 0] * xyz[:, 1]
    structure = shell_structure(xyz, [ShellPart(ONE, Section(ISO, t))])
    batch, energy = structure.batches[0], 0.0
    for part in contributions(batch, structure):
        if part.matrix == "stiffness" and "bending" in part.label:
            roles = {r: jet.constant(structure.values.values[batch.roles[r]], 0) for r in part.roles}
            energy += part.coefficient(roles, part.facts).value[0] * (u.ravel() @ part.matrices[0] @ u.ravel())
    assert energy == pytest.approx(E * t**3 / 12.0 * a * b**3 / 12.0, rel=1e-12)


@pytest.mark.parametrize("t", [0.01, 0.2, 5.0])
@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (3.0, 0.5)])
def test_the_mean_shear_of_a_rectangle_has_residual_bending_flexibility(t: float, a: float, b: float) -> None:
    """w = γx or γy with rotations held: energy γ² A / (1/S + a²/12D), and b² along y."""
    S, D = E / (2.0 + 2.0 * NU) * t * 5.0 / 6.0, E * t**3 / 12.0 / (1.0 - NU**2)
    K, xyz = stiffness(square(a, b), Section(ISO, t)), square(a, b)
    for axis, size in ((0, a), (1, b)):
        u = np.zeros((4, 6))
        u[:, 2] = xyz[:, axis]
        exact = a * b / (1.0 / S + size**2 / (12.0 * D))
        assert u.ravel() @ K @ u.ravel() == pytest.approx(exact, rel=1e-12)


def test_anisotropic_shear_keeps_its_law_where_bending_is_rigid() -> None:
    """Then no residual flexibility is left, whatever the directions of the sides and the material."""
    xyz = square(3.0, 0.5) @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    K = stiffness(xyz, Section(ANISO, 0.1, RI=1e15), direction=(1.0, 0.0, 0.0))
    law = 5.0 / 6.0 * 0.1 * 1.5 * np.array([[40.0, 5.0], [5.0, 30.0]])
    for slope in ((1.0, 0.0), (0.0, 1.0), (0.6, -0.8)):
        u = np.zeros((4, 6))
        u[:, 2] = xyz[:, :2] @ slope
        assert u.ravel() @ K @ u.ravel() == pytest.approx(np.array(slope) @ law @ slope, rel=1e-9)


# ----------------------------------------------------------------------------------------------------
# Few sizes that stand for all.


def factor(squares: np.ndarray, stiff: float, which: int) -> np.ndarray:
    """The factor of shear of elements with h² (e, 2) whose 𝒮/12D is `stiff`."""
    found = few_sizes(squares)
    shares = found.wide if which else found.narrow
    return np.asarray((shares / (1.0 + found.sizes * stiff)).sum(axis=1))


def some_sizes(ratio: float) -> np.ndarray:
    squares = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, (200, 2)), axis=1)
    squares[0, 0], squares[-1, 1] = 0.0, 1.0
    return np.asarray(2.0 * ratio ** (squares - 1.0))


@pytest.mark.parametrize("ratio", [1.5, LARGEST_STEP, 300.0])
@pytest.mark.parametrize("which", [0, 1])
def test_few_sizes_are_exact_where_shear_or_bending_is_by_far_the_larger(ratio: float, which: int) -> None:
    squares = some_sizes(ratio)
    np.testing.assert_allclose(factor(squares, 1e-12, which), 1.0, rtol=1e-8)
    np.testing.assert_allclose(factor(squares, 1e12, which), 1e-12 / squares[:, which], rtol=1e-8)


@pytest.mark.parametrize("ratio", [1.5, LARGEST_STEP, 300.0])
def test_few_sizes_are_within_their_bound_between(ratio: float) -> None:
    squares, root = some_sizes(ratio), np.sqrt(min(ratio, LARGEST_STEP))
    least = 4.0 * root / (1.0 + root) ** 2
    for stiff in np.geomspace(0.01, 1000.0, 13):
        for which in (0, 1):
            part = factor(squares, stiff, which) * (1.0 + squares[:, which] * stiff)
            assert part.min() > least - 1e-12
            assert part.max() < 1.0 + 1e-12
    found = few_sizes(squares)
    assert found.wide.min() >= 0.0
    assert found.narrow.min() >= 0.0
    assert len(np.unique(np.round(found.sizes, 9))) <= 2 + np.ceil(np.log(ratio) / np.log(LARGEST_STEP))


def test_sizes_of_equal_elements_are_their_own() -> None:
    mesh = shell_mesh(rectangle(3.0, 2.0), 3, 4)
    found = quad_residual(mesh.xyz[mesh.cells] + 1e3)
    np.testing.assert_allclose((found.sizes * found.wide).sum(axis=1), 1.0, rtol=1e-9)
    np.testing.assert_allclose((found.sizes * found.narrow).sum(axis=1), 0.25, rtol=1e-9)


# ----------------------------------------------------------------------------------------------------
# Shapes of all kinds.


def random_quad(seed: int, aspect: float = 1.0, warp: float = 0.0) -> np.ndarray:
    """Random corners that bound an area with no reflex corner, as long as `aspect`, and heights."""
    random = np.random.default_rng(seed)
    xyz = square(1.0, 1.0)
    xyz[:, :2] += random.uniform(-0.3, 0.3, (4, 2))
    xyz[:, 2] = warp * random.uniform(-1.0, 1.0, 4)
    return np.asarray(xyz * [aspect, 1.0, 1.0])


SHAPES = {
    "flat": (1.0, 0.0), "long": (100.0, 0.0), "wide": (0.01, 0.0), "warped": (1.0, 0.3), "long and warped": (10.0, 0.3),
}  # fmt: skip


@pytest.mark.quick(8)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("t", [0.3, 1e-3])
def test_any_shape_has_six_strain_free_motions(seed: int, shape: str, material: Isotropic, t: float) -> None:
    K = stiffness(random_quad(seed, *SHAPES[shape]), Section(material, t, 0.1 * t), theta=0.4)
    # bending, membrane and drilling apart by powers of ten: look at ratios to the diagonal
    scale = 1.0 / np.sqrt(np.diag(K))
    found = np.linalg.eigvalsh(scale[:, None] * K * scale)
    assert np.abs(found[:6]).max() < 1e-12
    assert found[6] > 1e-11


@pytest.mark.quick(0)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("first", [1, 2, 3])
@pytest.mark.parametrize("material", [ISO, ANISO], ids=["isotropic", "anisotropic"])
def test_the_first_corner_does_not_matter(seed: int, first: int, material: Isotropic) -> None:
    xyz = random_quad(seed, 2.0, 0.2)
    section, more = Section(material, 0.05, 0.02), {"direction": (1.0, 0.2, 0.1)}
    K, other = stiffness(xyz, section, **more), stiffness(np.roll(xyz, -first, axis=0), section, **more)
    at = np.roll(np.arange(24), -6 * first)
    np.testing.assert_allclose(other, K[np.ix_(at, at)], atol=1e-12 * np.abs(K).max())


@pytest.mark.slow
@pytest.mark.parametrize("section", [
    Section(ISO, 0.1), Section(ISO, 0.1, bending=ANISO), Section(ANISO, 0.1, bending=ISO), Section(ANISO, 0.1, 0.03),
])  # fmt: skip
def test_terms_are_exact_far_from_where_they_were_made(section: Section) -> None:
    mesh = shell_mesh(rectangle(3.0, 1.0, 0.2), 4, 3, distort=0.25)
    for change in ({"t": 0.35}, {"TS": 0.4}, {"RI": 3.0}):
        here, there = (
            shell_structure(mesh.xyz, [ShellPart(mesh.cells, s)]) for s in (section, replace(section, **change))
        )
        exact = assemble(there, "stiffness").toarray()
        np.testing.assert_allclose(at_values(here, there.values.values), exact, atol=1e-12 * np.abs(exact).max())


def at_values(structure: Structure, values: np.ndarray) -> np.ndarray:
    """Stiffness by the terms that were made at the structure's own values, taken at others."""
    batch, table, n = structure.batches[0], jet.constant(values, 0), structure.nodes.n_dofs
    out = np.zeros((n, n))
    for term in contributions(batch, structure):
        if term.matrix == "stiffness":
            roles = {r: table[batch.roles[r][term.at]] for r in term.roles}
            matrices = term.coefficient(roles, term.facts).value[:, None, None] * term.matrices
            for dofs, matrix in zip(batch.dofs[term.at], matrices):
                out[np.ix_(dofs, dofs)] += matrix
    return out


# ----------------------------------------------------------------------------------------------------
# Coarse meshes.


def on_its_corners(n: int, nu12: float) -> float:
    """First frequency of a square panel that is supported at its corners, of an orthotropic law."""
    law = {"11": 1.0 / (1.0 - nu12**2), "12": nu12 / (1.0 - nu12**2), "22": 1.0 / (1.0 - nu12**2), "33": 0.385}
    mesh = shell_mesh(rectangle(1.0, 1.0), n, n)
    held = dofs_of(np.arange(len(mesh.xyz)), "126") | dofs_of(mesh.rows[[0, 0, -1, -1], [0, -1, 0, -1]], "3")
    section = Section(Anisotropic(law, {"11": 0.385, "22": 0.385}, 1.0), 0.01)
    return float(natural_frequencies(shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=held), 1)[0])


@pytest.mark.quick(0)
@pytest.mark.parametrize("nu12", [0.3, 0.98])
def test_strongly_coupled_laws_do_not_lock(nu12: float) -> None:
    coarse, fine = (on_its_corners(n, nu12) for n in (4, 16))
    assert coarse == pytest.approx(fine, rel=0.12)


def clamped_centre(n: int) -> float:
    """Deflection under a point load at the centre of a clamped plate 2 × 10, a quarter of n × n cells, 1000 times D."""
    mesh = shell_mesh(rectangle(1.0, 5.0), n, n)
    held = dofs_of(np.arange(len(mesh.xyz)), "126") | dofs_of([*mesh.edge("u0"), *mesh.edge("v0")], "345")
    held |= dofs_of(mesh.edge("u1"), "5") | dofs_of(mesh.edge("v1"), "4")
    t = 1e-4
    section = Section(Isotropic(12.0 * 0.91 / t**3, 0.3), t)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, section)], held=held)
    force, centre = np.zeros(structure.nodes.n_dofs), 6 * mesh.rows[-1, -1] + 2
    force[centre] = 0.25
    return float(1000.0 * static_displacements(structure, force)[centre])


def test_long_cells_are_neither_too_stiff_nor_too_soft() -> None:
    """Timoshenko: 0.00725 P a²/D for a plate 1 : 5."""
    exact = 1000.0 * 0.00725 * 4.0
    np.testing.assert_allclose([clamped_centre(n) / exact for n in (4, 8)], [0.93, 1.0], atol=0.02)
