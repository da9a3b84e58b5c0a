"""Matrices of single solids that commercial Nastran wrote beside ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.fem.solid_parts import dense

from structures.shells import Isotropic
from structures.solids import SolidPart, solid_structure

from .element_matrices import op2, ours

STEEL = Isotropic(2.9e7, 0.32, 0.283)
KINDS = {"CHEXA": "hexa8", "CPENTA": "penta6", "CTETRA": "tetra4"}
DECK, MATRICES = "static_solid_shell_bar_kelm.bdf", "static_solid_shell_bar_kelm.op2"


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    return shared_data / "nastran_decks" / "solid_shell_bar"


@pytest.fixture(scope="module")
def solids(folder: Path) -> dict[int, tuple[str, list[int], np.ndarray]]:
    """Kind, grid points and their places of the solids of the deck, by element number."""
    every = [f for name in (DECK, "geom.inc") for f in cards((folder / name).read_text())]
    places = {int(f[1]): [float(x) for x in f[3:6]] for f in every if f[0] == "GRID"}
    found = {int(f[1]): (KINDS[f[0]], [int(g) for g in f[3:] if g]) for f in every if f[0] in KINDS}
    return {n: (kind, grids, np.array([places[g] for g in grids])) for n, (kind, grids) in found.items()}


def cards(text: str) -> list[list[str]]:
    """Fields of eight columns of each card, continuations joined."""
    found: list[list[str]] = []
    for line in text.splitlines():
        fields = [line[i : i + 8].strip() for i in range(0, 72, 8)]
        if line[:1] == " " and found:
            found[-1] += fields[1:]
        else:
            found.append(fields)
    return found


def both(solids, folder: Path, number: int, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Ours and theirs on the translations of the element's grid points, in the card's order."""
    name, grids, xyz = solids[number]
    theirs = op2.element_matrices(folder / MATRICES, kind[0].replace("s", "K").replace("m", "M"))[number]
    rows = list(ours.dofs_of(theirs))
    at = [rows.index(6 * (g - 1) + c) for g in grids for c in range(3)]
    part = SolidPart(name, [list(range(len(grids)))], STEEL)
    return dense(solid_structure(xyz, [part]), kind), theirs.matrix[np.ix_(at, at)]


@pytest.mark.parametrize("number", [1, 4, 5])
def test_a_cube_and_tetrahedra_have_the_same_stiffness(solids, folder: Path, number: int):
    """The commercial CHEXA with 8 grid points is, as a cube, the hybrid element too."""
    own, theirs = both(solids, folder, number, "stiffness")
    np.testing.assert_allclose(own, theirs, atol=1e-13 * np.abs(theirs).max())


@pytest.mark.parametrize("number", [2, 3])
def test_pentahedra_share_the_energy_of_constant_strains(solids, folder: Path, number: int):
    """And their forces but for transverse shear: there the commercial ones are not those of constant stress.

    Its shear is tied to the sides of the triangle, in a way that depends on which corner comes first. That bends thin
    plates and does not pass the patch test, whose forces ours has.
    """
    own, theirs = both(solids, folder, number, "stiffness")
    xyz = solids[number][2]
    fields = np.stack([np.outer(xyz[:, j], np.eye(3)[i]).ravel() for i in range(3) for j in range(3)], axis=1)
    size = np.abs(theirs).max()
    np.testing.assert_allclose(fields.T @ own @ fields, fields.T @ theirs @ fields, atol=1e-13 * size)
    difference = np.abs((own - theirs) @ fields).max(axis=0).reshape(3, 3) / size
    transverse = np.array([[0, 0, 1], [0, 0, 1], [1, 1, 0]], bool)
    assert difference[~transverse].max() < 1e-13
    assert difference[transverse].min() > 0.01


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_mass(solids, folder: Path, number: int):
    own, theirs = both(solids, folder, number, "mass")
    np.testing.assert_allclose(own, theirs, atol=1e-6 * theirs.max())
