"""A refined mesh against the one that it was made of: numbers, stiffness and mass."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties
from femtune.fem.refine import refine
from structures.frames import bars, make_structure
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure

SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}
NONE_HELD = np.zeros(0, np.int64)


@pytest.mark.parametrize("cells", ["quad", "right"])
def test_every_part_has_a_number_that_no_other_element_has(cells: str):
    """Two batches of shells: the first part of each element keeps its number, the other three have new ones."""
    mesh = shell_mesh(rectangle(3.0, 1.0), 3, 2, cells)
    half, section = len(mesh.cells) // 2, Section(Isotropic(200.0, 0.3), 0.1)
    structure = shell_structure(mesh.xyz, [ShellPart(part, section) for part in (mesh.cells[:half], mesh.cells[half:])])
    refined = refine(structure, NONE_HELD)
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
    refined = refine(structure, NONE_HELD)
    K, whole = (assemble(s, "stiffness").toarray() for s in (refined, structure))
    ends, middle = np.arange(12), np.arange(12, 18)
    condensed = K[np.ix_(ends, ends)] - K[np.ix_(ends, middle)] @ np.linalg.solve(
        K[np.ix_(middle, middle)], K[np.ix_(middle, ends)]
    )
    np.testing.assert_allclose(condensed, whole, atol=1e-11 * np.abs(whole).max())
    one, two = (mass_properties(s.nodes, assemble(s, "mass")) for s in (structure, refined))
    np.testing.assert_allclose(two.directional_mass, one.directional_mass, rtol=1e-12)
    np.testing.assert_allclose(two.centre, one.centre, atol=1e-12)
