"""A refined mesh against the one that it was made of, and against a mesh that was made as fine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties
from femtune.fem.constraints import rigid_element_rows
from femtune.fem.refine import CannotRefineError, Refined, refine
from femtune.fem.structure import Structure, join_constraints
from structures.frames import bars, make_structure, scalars
from structures.shells import (
    Isotropic,
    Section,
    ShellPart,
    cylinder,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
)
from structures.solids import box, solid_mesh, solid_model

SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}
NONE_HELD = np.zeros(0, np.int64)
STEEL = Isotropic(200.0, 0.3, 2.0)


@pytest.mark.parametrize("cells", ["quad", "right"])
def test_every_part_has_a_number_that_no_other_element_has(cells: str):
    """Two batches of shells: the first part of each element keeps its number, the other three have new ones."""
    mesh = shell_mesh(rectangle(3.0, 1.0), 3, 2, cells)
    half, section = len(mesh.cells) // 2, Section(Isotropic(200.0, 0.3), 0.1)
    structure = shell_structure(mesh.xyz, [ShellPart(part, section) for part in (mesh.cells[:half], mesh.cells[half:])])
    refined = refine(structure, NONE_HELD).structure
    ids = np.concatenate([b.ids for b in refined.batches])
    assert len(np.unique(ids)) == len(ids) == 4 * len(mesh.cells)
    old = np.concatenate([b.ids for b in structure.batches])
    assert set(old) < set(ids)
    assert min(set(ids) - set(old)) > old.max()


@pytest.mark.parametrize("values", [SECTION, {**SECTION, "K1": 0.8, "K2": 0.6}], ids=["slender", "shear"])
def test_two_halves_of_a_bar_with_offsets_are_the_bar(values: dict):
    """The middle condensed: the bar's own stiffness; as a rigid body, the bar's own mass; releases stay at the ends."""
    part = bars([[0, 1]], values, offsets=((0.1, 0.3, -0.2), (0.0, -0.4, 0.5)), pins=(5, 10))
    structure = make_structure([[0.2, 0.1, 0.0], [1.4, 0.3, -0.5]], [part], consistent_mass=True)
    _middle_condensed_is_the_whole(structure, 1e-11)


@pytest.mark.slow
def test_two_halves_of_a_tapered_beam_are_the_beam():
    """Three stations, of which the halves have other ones; neutral axis and mass beside the shear centre."""
    varying = {"A": (3.0, 2.6, 1.0), "I1": (0.7, 0.5, 0.2), "I2": (0.4, 0.3, 0.1), "I12": (0.05, 0.02, 0.0),
               "J": (0.9, 0.6, 0.3), "NSM": (0.2, 0.1, 0.4), "NSI": (0.0, 0.1, 0.2), "N1": (0.02, 0.044, 0.1),
               "N2": (0.0, 0.015, 0.05), "M1": (0.1, 0.07, 0.0), "M2": (0.0, 0.03, 0.1)}  # fmt: skip
    values = {"E": 200.0, "G": 80.0, "rho": 2.0, "K1": 0.8, "K2": 0.6}
    values |= {f"{name}@{k}": v for name, own in varying.items() for k, v in enumerate(own)}
    values |= {f"K{p}@{k}": 0.8 for p in (1, 2) for k in range(3)}
    part = bars([[0, 1]], values, card="CBEAM", offsets=((0.1, 0.3, -0.2), (0.0, -0.4, 0.5)))
    facts = {**part.facts, "stations": np.array([[0.0, 0.3, 1.0]])}
    part = type(part)("tapered-beam", "CBEAM", part.connection, part.values, facts)
    structure = make_structure([[0.2, 0.1, 0.0], [1.4, 0.3, -0.5]], [part])
    _middle_condensed_is_the_whole(structure, 1e-7)


def _middle_condensed_is_the_whole(structure: Structure, tolerance: float) -> None:
    refined = refine(structure, NONE_HELD).structure
    K, whole = (assemble(s, "stiffness").toarray() for s in (refined, structure))
    ends, middle = np.arange(12), np.arange(12, 18)
    condensed = K[np.ix_(ends, ends)] - K[np.ix_(ends, middle)] @ np.linalg.solve(
        K[np.ix_(middle, middle)], K[np.ix_(middle, ends)]
    )
    np.testing.assert_allclose(condensed, whole, atol=tolerance * np.abs(whole).max())
    one, two = (mass_properties(s.nodes, assemble(s, "mass")) for s in (structure, refined))
    np.testing.assert_allclose(two.directional_mass, one.directional_mass, rtol=1e-12)
    np.testing.assert_allclose(two.centre, one.centre, atol=1e-12)


def _plate(n: int, cells: str, **how: float) -> Structure:
    """1 × 0.7 clamped along one side, simply supported along the opposite one."""
    mesh = shell_mesh(rectangle(1.0, 0.7, **how), n, n, cells)
    ends = (mesh.edge("u0"), "123456"), (mesh.edge("u1"), "3")
    held = set().union(*(dofs_of(nodes[nodes >= 0], components) for nodes, components in ends))
    return shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))], held=held)


@pytest.mark.slow
@pytest.mark.parametrize("cells", ["quad", "right", "quad8", "right6"])
def test_a_refined_plate_is_a_plate_with_twice_as_many_elements(cells: str):
    structure = _plate(3, cells, skew=0.2)
    refined = refine(structure, structure.permanent).structure
    assert natural_frequencies(refined, 5) == pytest.approx(natural_frequencies(_plate(6, cells, skew=0.2), 5))


@pytest.mark.quick(1)
@pytest.mark.parametrize("kind", ["hexa8", "penta6", "hexa20", "penta15"])
def test_a_refined_block_is_a_block_with_twice_as_many_elements(kind: str):
    def block(n: int) -> Structure:
        mesh = solid_mesh(lambda u, v, w: (u + 0.2 * v, v, 0.4 * w + 0.1 * u), (n, n, n), kind)
        return solid_model(mesh, STEEL, held=dofs_of(mesh.face("u0"), "123"))

    refined = refine(block(2), block(2).permanent).structure
    assert natural_frequencies(refined, 5) == pytest.approx(natural_frequencies(block(4), 5), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["tetra4", "pyram5", "tetra10", "pyram13"])
def test_refined_tetrahedra_and_pyramids_fill_the_volume_and_are_in_balance(kind: str):
    """Mass as before; forces of a constant strain are zero inside, so that neighbours share all their points."""
    mesh = solid_mesh(box(1.0, 0.8, 0.7), (2, 2, 2), kind, distort=0.2)
    structure = solid_model(mesh, STEEL)
    refined = refine(structure, NONE_HELD)
    before, after = (assemble(s, "mass").sum() / 3.0 for s in (structure, refined.structure))
    assert after == pytest.approx(before, rel=1e-12)
    strained = np.zeros((len(refined.structure.nodes.ids), 6))
    xyz = refined.structure.nodes.xyz
    strained[:, :3] = xyz @ np.array([[0.1, 0.2, -0.1], [0.0, 0.3, 0.2], [0.1, -0.2, 0.1]])
    force = (assemble(refined.structure, "stiffness") @ strained.ravel()).reshape(-1, 6)
    outside = (np.minimum(xyz, np.array([1.0, 0.8, 0.7]) - xyz) < 1e-9).any(axis=1)
    assert np.abs(force[outside]).max() > 0.1
    assert np.abs(force[~outside]).max() < 1e-10


@pytest.mark.parametrize("cells", ["quad", "union", "quad8", "union6"])
def test_a_linear_field_stays_linear(cells: str):
    """The prolongation, with displacement frames that turn from point to point."""
    mesh = shell_mesh(rectangle(1.0, 0.7, skew=0.3), 2, 2, cells, distort=0.2)
    angle = 0.2 * mesh.xyz[:, 0]
    frames = np.tile(np.eye(3), (len(mesh.xyz), 1, 1))
    frames[:, 0, 0] = frames[:, 1, 1] = np.cos(angle)
    frames[:, 1, 0], frames[:, 0, 1] = np.sin(angle), -np.sin(angle)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))], frames=frames)
    refined = refine(structure, NONE_HELD)

    def field(s: Structure) -> np.ndarray:
        basic = np.stack([s.nodes.xyz @ np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]])] * 2, axis=1)
        return np.asarray(np.einsum("nji,nkj->nki", s.nodes.frames, basic).ravel())

    assert refined.prolongation @ field(structure) == pytest.approx(field(refined.structure), abs=1e-12)


# ----------------------------------------------------------------------------------------------------
# Surfaces, supports, and what stays at the old grid points.


@pytest.mark.parametrize("cells", ["quad", "union", "quad8"])
def test_new_points_of_a_curved_panel_lie_on_its_surface(cells: str):
    """Also along the edges, where a normal is that of one facet alone."""
    mesh = shell_mesh(cylinder(1.0, 0.6, 0.0, np.pi / 2), 4, 3, cells)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))])
    xyz = refine(structure, NONE_HELD).structure.nodes.xyz
    assert np.linalg.norm(xyz[:, :2], axis=1) == pytest.approx(1.0, abs=2e-3)
    # facets are 1 − cos(π/16) = 0.019 inside
    new = refine(structure, NONE_HELD).structure.nodes.xyz[len(mesh.xyz) :]
    assert len(new) > 0


def test_a_fold_stays_a_fold():
    """A sheet that is bent by 90 degrees along the middle: new points are on its two planes."""
    mesh = shell_mesh(lambda u, v: (np.minimum(u, 0.5), v, np.maximum(u - 0.5, 0.0)), 4, 2)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))])
    x, _, z = refine(structure, NONE_HELD).structure.nodes.xyz.T
    assert np.minimum(np.abs(z), np.abs(x - 0.5)).max() < 1e-12


def _held_new(structure: Structure, refined: Refined) -> np.ndarray:
    """(n, 6) what is held of the new points."""
    n = len(structure.nodes.ids)
    flags = np.zeros((len(refined.structure.nodes.ids), 6), bool)
    flags.reshape(-1)[refined.structure.permanent] = True
    return flags[n:]


def test_supports_go_on_along_edges_and_lines_but_not_between_points():
    """Held: an edge, and a line of three points through the middle; not held: between two neighbours inside."""
    mesh = shell_mesh(rectangle(4.0, 4.0), 4, 4)
    near = {tuple(np.round(p[:2]).astype(int)): i for i, p in enumerate(mesh.xyz)}
    edge = [near[0, j] for j in range(5)]
    line, pair = [near[2, j] for j in (1, 2, 3)], [near[3, 1], near[3, 2]]
    held = dofs_of(edge, "3") | dofs_of(line, "2") | dofs_of(pair, "1")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))], held=held)
    refined = refine(structure, structure.permanent)
    new, flags = refined.structure.nodes.xyz[25:], _held_new(structure, refined)
    assert sorted(map(tuple, new[flags[:, 2]][:, :2])) == [(0.0, 0.5), (0.0, 1.5), (0.0, 2.5), (0.0, 3.5)]
    assert sorted(map(tuple, new[flags[:, 1]][:, :2])) == [(2.0, 1.5), (2.0, 2.5)]
    assert not flags[:, [0, 3, 4, 5]].any()


def test_supports_of_a_solid_go_on_over_its_faces():
    mesh = solid_mesh(box(2.0, 2.0, 2.0), (2, 2, 2))
    held = dofs_of(mesh.face("u0"), "12")
    structure = solid_model(mesh, STEEL, held=held)
    refined = refine(structure, structure.permanent)
    new, flags = refined.structure.nodes.xyz[27:], _held_new(structure, refined)
    assert flags[:, 3:].all()
    np.testing.assert_array_equal(flags[:, 0], np.abs(new[:, 0]) < 1e-12)
    np.testing.assert_array_equal(flags[:, 1], flags[:, 0])
    assert not flags[:, 2].any()


def _rigid_new(structure: Structure, refined: Refined) -> np.ndarray:
    """Rows of the new points that follow a rigid element in all components."""
    rows, count = np.unique(refined.structure.rigid.dependent // 6, return_counts=True)
    return rows[(count == 6) & (rows >= len(structure.nodes.ids))]


def test_rigid_elements_go_on_along_edges_and_lines_but_not_between_points():
    """As supports do; not between points of two rigid elements, nor where one leaves a component free."""
    mesh = shell_mesh(rectangle(4.0, 4.0), 4, 4)
    near = {tuple(np.round(p[:2]).astype(int)): i for i, p in enumerate(mesh.xyz)}
    edge, line, pair = [near[0, j] for j in range(5)], [near[2, j] for j in (1, 2, 3)], [near[3, 1], near[3, 2]]
    other, loose = [near[4, j] for j in (0, 1)], [near[4, j] for j in (3, 4)]
    plain = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))])
    ids = plain.nodes.ids
    bodies = [(edge, range(1, 7)), (line, range(1, 7)), (pair, range(1, 7)), (other, range(1, 7)), (loose, range(1, 6))]
    rows = [
        rigid_element_rows(plain.nodes, first, follow, list(components), 100 + k)
        for k, (points, components) in enumerate(bodies)
        for first, *follow in [ids[points].tolist()]
    ]
    structure = replace(plain, rigid=join_constraints(rows))
    refined = refine(structure, NONE_HELD)
    new = refined.structure.nodes.xyz[_rigid_new(structure, refined)]
    expected = [(0.0, 0.5), (0.0, 1.5), (0.0, 2.5), (0.0, 3.5), (2.0, 1.5), (2.0, 2.5), (4.0, 0.5)]
    assert sorted(map(tuple, new[:, :2])) == expected
    off = refine(structure, NONE_HELD, [100])
    assert sorted(map(tuple, off.structure.nodes.xyz[_rigid_new(structure, off)][:, :2])) == expected[4:]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["shell", "solid"])
def test_an_edge_or_face_that_follows_a_held_point_is_a_held_one(kind: str):
    """The frequencies of the refined mesh are those of the mesh whose supports go on."""
    if kind == "shell":
        mesh = shell_mesh(rectangle(3.0, 1.0), 3, 2)
        plain = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.1))])
        root = [i for i, p in enumerate(mesh.xyz) if p[0] < 1e-9]
    else:
        block = solid_mesh(box(3.0, 1.0, 1.0), (3, 2, 2))
        plain, root = solid_model(block, STEEL), list(block.face("u0"))
    held = np.array(sorted(6 * i + k for i in root for k in range(6)))
    clamped = refine(replace(plain, permanent=held), held).structure
    ids = plain.nodes.ids
    carried = rigid_element_rows(plain.nodes, int(ids[root[0]]), [int(i) for i in ids[root[1:]]], range(1, 7), 99)
    first = 6 * root[0] + np.arange(6)
    rigid = refine(replace(plain, rigid=carried, permanent=first), first).structure
    np.testing.assert_allclose(natural_frequencies(rigid, 5), natural_frequencies(clamped, 5), rtol=1e-8)


def test_scalar_points_and_springs_stay():
    """Grid points come in before them: a bar on a spring to a scalar point with a mass."""
    part = bars([[0, 1]], SECTION)
    held = np.array(sorted(dofs_of([0], "123456")))
    bare = make_structure([[0.0, 0, 0], [1.0, 0, 0]], [part], permanent=held)
    nodes = type(bare.nodes)(bare.nodes.ids, bare.nodes.xyz, bare.nodes.frames, np.array([90]))
    more = make_structure(
        bare.nodes.xyz, [part, scalars("spring", [[8, 12]], "K", 5.0), scalars("scalar-mass", [[12, -1]], "M", 3.0)]
    )
    structure = Structure(nodes, more.values, more.batches, permanent=held)
    refined = refine(structure, held).structure
    assert refined.nodes.n_dofs == 19
    spring = next(b for b in refined.batches if b.kind == "spring")
    np.testing.assert_array_equal(spring.dofs, [[8, 18]])
    K = assemble(refined, "stiffness")
    assert K[18, 18] == pytest.approx(5.0)
    assert K[8, 18] == pytest.approx(-5.0)


def test_thickness_that_varies_goes_on_linearly():
    mesh = shell_mesh(rectangle(1.0, 0.7), 1, 1, "quad8")
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.05))])
    (batch,) = structure.batches
    table = structure.values
    first = len(table.refs)
    thick = (0.02, 0.04, 0.07, 0.03)
    refs = tuple(type(table.refs[0])("CQUAD8", 1, f"T{i + 1}") for i in range(4))
    values = type(table)((*table.refs, *refs), np.concatenate([table.values, thick]), table.derived)
    roles = {**batch.roles, **{f"t{i + 1}": np.array([first + i]) for i in range(4)}}
    own = type(batch)(batch.kind, batch.card, batch.ids, batch.nodes, batch.dofs, roles,
                      {**batch.facts, "uneven": np.array([True])})  # fmt: skip
    structure = Structure(structure.nodes, values, (own,), consistent_mass=True)
    one, two = (
        mass_properties(s.nodes, assemble(s, "mass")) for s in (structure, refine(structure, NONE_HELD).structure)
    )
    assert two.mass == pytest.approx(one.mass, rel=1e-12)
    np.testing.assert_allclose(two.centre, one.centre, atol=1e-12)


def test_nothing_to_divide():
    structure = make_structure([[0.0, 0, 0]], [scalars("spring", [[0, -1]], "K", 5.0)])
    with pytest.raises(CannotRefineError, match="no straight bars, shells or solids"):
        refine(structure, NONE_HELD)
