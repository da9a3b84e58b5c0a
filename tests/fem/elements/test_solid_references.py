"""Solids with mid-side nodes against matrices, displacements and frequencies that other programs listed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.fem.solid_parts import dense

from femtune.fem.elements import KINDS
from femtune.fem.elements.solids.quadratic import LINEAR, MEAN, Projection, Quadratic, constant_function
from femtune.fem.elements.solids.shape import HEXA20_SHAPE as HEXA20
from femtune.fem.elements.solids.shape import TETRA10_SHAPE as TETRA10
from femtune.fem.elements.solids.shape import SolidPoints, hexahedron_points, tetrahedron_points
from femtune.fem.elements.solids.solid import solid
from femtune.fem.elements.solids.strains import SolidFormulation
from femtune.fem.structure import Structure
from structures.shells import Isotropic, dofs_of, natural_frequencies
from structures.solids import SolidPart, box, solid_mesh, solid_model, solid_structure

ALL_STRAINS = Projection(constant_function, np.ones_like)


def irons() -> SolidPoints:
    """Fourteen points of the cube, degree 5 (Irons 1971): six on the axes, eight on the diagonals."""
    axes = np.sqrt(19.0 / 30.0) * np.concatenate([np.eye(3), -np.eye(3)])
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    weights = np.array([320.0] * 6 + [121.0] * 8) / 361.0
    return SolidPoints(np.concatenate([axes, np.sqrt(19.0 / 33.0) * signs]), weights)


def hex_beam(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and cells of a .cdb whose node numbers start at 1 without a gap; the upright middles come last there."""
    lines = path.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("NBLOCK")) + 2
    count = int(lines[first - 2].split(",")[3])
    xyz = np.array(
        [[float(line[c : c + 21].strip() or 0) for c in (27, 48, 69)] for line in lines[first : first + count]]
    )
    first = next(i for i, line in enumerate(lines) if line.startswith("EBLOCK")) + 2
    count = int(lines[first - 2].split(",")[3])
    rows = [" ".join(lines[first + 2 * k : first + 2 * k + 2]).split()[11:] for k in range(count)]
    cells = np.array(rows, int) - 1
    return xyz, cells[:, [*range(12), *range(16, 20), *range(12, 16)]]


LISTED_BEAM = np.array([1283.200, 1283.200, 5781.975, 6919.399, 6919.399, 10172.615])


def beam_frequencies(path: Path) -> np.ndarray:
    xyz, cells = hex_beam(path)
    held = dofs_of(np.flatnonzero(xyz[:, 2] == 0.0), "123")
    # the material with which the .full file was made: not that of the .cdb beside it
    part = SolidPart("hexa20", cells, Isotropic(16.9e6, 0.31, 4.1408e-4))
    return natural_frequencies(solid_structure(xyz, [part], held=held, consistent_mass=True), 6)[:6]


def _put(monkeypatch: pytest.MonkeyPatch, key: str, rules: SolidFormulation) -> None:
    """Another formulation in place of that of a kind of solids."""
    kind = replace(KINDS[key], kernel=lambda batch, structure: solid(batch, structure, rules))
    monkeypatch.setitem(KINDS, key, kind)


def test_hex_beam_with_the_rules_of_solid186(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight points for the stiffness, Irons' fourteen for the mass: the listed frequencies to seven digits."""
    rules = Quadratic(HEXA20, hexahedron_points(2), irons(), ALL_STRAINS).formulation("")
    _put(monkeypatch, "hexa20", rules)
    found = beam_frequencies(shared_data / "ansys_full" / "HexBeam.cdb")
    np.testing.assert_allclose(found, LISTED_BEAM, rtol=3e-7)


def test_hex_beam(shared_data: Path) -> None:
    """Ours on the same coarse mesh."""
    np.testing.assert_allclose(beam_frequencies(shared_data / "ansys_full" / "HexBeam.cdb"), LISTED_BEAM, rtol=0.01)


# two tetrahedra of commercial Nastran ------------------------------------------------------------------------------

LISTED_TETRA = np.array([87278.5, 91000.0, 102379.0, 266861.0, 283122.0, 343509.0, 489764.0])


def two_tetrahedra(folder: Path, **settings) -> tuple[Structure, list[int], np.ndarray]:
    """The deck, its grid points, and its listed displacements at 0 Hz under a unit force along x on grid point 2154."""
    text = (folder / "tet10.bdf").read_text()
    lines = text.splitlines()
    grids = {
        int(line[8:16]): [_real(line[c : c + 8]) for c in (24, 32, 40)] for line in lines if line.startswith("GRID")
    }
    ids = sorted(grids)
    cells = [
        [ids.index(int(n)) for n in (line[24:72] + lines[i + 1][8:40]).split()]
        for i, line in enumerate(lines)
        if line.startswith("CTETRA")
    ]
    held = dofs_of([ids.index(n) for n in (2128, 2260, 2488, 2551)], "123")
    part = SolidPart("tetra10", cells, Isotropic(1.705e7, 0.31, 4.14413e-4))
    structure = solid_structure([grids[n] for n in ids], [part], held=held, **settings)
    static = (folder / "tet10.f06").read_text().split("FREQUENCY =  0.000000E+00")[1]
    rows = re.findall(r"^0 +(\d+) +G +(\S+) +(\S+) +(\S+)", static, re.M)
    listed = {int(n): [float(x) for x in place] for n, *place in rows}
    return structure, ids, np.array([listed[n] for n in ids])


def _real(text: str) -> float:
    """Nastran's number without an E."""
    return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"e\1", text.strip()))


def deflected(K: np.ndarray, structure: Structure, ids: list[int]) -> np.ndarray:
    at = np.concatenate([6 * np.arange(len(ids))[:, None] + np.arange(3)]).ravel()
    free = ~np.isin(at, structure.permanent)
    force = np.zeros(len(at))
    force[3 * ids.index(2154)] = 1.0
    u = np.zeros(len(at))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], force[free])
    return u.reshape(-1, 3)


def test_static_displacements_of_two_tetrahedra_with_nastrans_rule(
    shared_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Five points, one of negative weight: every listed digit, which settles the order of nodes and curved sides."""
    structure, ids, listed = two_tetrahedra(shared_data / "nastran_decks")
    corner = np.array([[0.5, 1 / 6, 1 / 6], [1 / 6, 0.5, 1 / 6], [1 / 6, 1 / 6, 0.5], [1 / 6, 1 / 6, 1 / 6]])
    parts = []
    for places, weight in ((corner, 0.45), (np.full((1, 3), 0.25), 0.8)):
        rule = SolidPoints(places, np.full(len(places), weight / 6.0))
        rules = Quadratic(TETRA10, rule, tetrahedron_points(), ALL_STRAINS).formulation("")
        monkeypatch.setitem(
            KINDS,
            "tetra10",
            replace(KINDS["tetra10"], kernel=lambda batch, structure, rules=rules: solid(batch, structure, rules)),
        )
        parts.append(dense(structure))
    found = deflected(parts[0] - parts[1], structure, ids)
    np.testing.assert_allclose(found, listed, atol=2e-7 * np.abs(listed).max())


def test_static_displacements_of_two_tetrahedra(shared_data: Path) -> None:
    """Ours has eight points: the first solid's sides are off the straight by a twentieth of its length."""
    structure, ids, listed = two_tetrahedra(shared_data / "nastran_decks")
    found = deflected(dense(structure), structure, ids)
    np.testing.assert_allclose(found, listed, atol=0.015 * np.abs(listed).max())


def test_listed_frequencies_of_two_tetrahedra_lie_between_the_two_masses(shared_data: Path) -> None:
    """Nastran's own mass of these solids is neither consistent nor a diagonal one that we found."""
    low, high = (
        natural_frequencies(two_tetrahedra(shared_data / "nastran_decks", consistent_mass=consistent)[0], 7)[:7]
        for consistent in (False, True)
    )
    assert (low < LISTED_TETRA).all()
    assert (high > LISTED_TETRA).all()


# published -----------------------------------------------------------------------------------------------------------

FV52 = np.array([45.897, 109.44, 109.44, 167.89, 193.59, 206.19, 206.19])


def fv52(kind: str, counts: tuple[int, int, int], hard: bool) -> np.ndarray:
    """Thick square plate: z held on the sides over the whole depth; `hard` holds what is along the sides too."""
    mesh = solid_mesh(box(10.0, 10.0, 1.0), counts, kind)
    x, y = (np.concatenate([mesh.face(f"{axis}0"), mesh.face(f"{axis}1")]) for axis in "uv")
    held = dofs_of(x, "23") | dofs_of(y, "13") if hard else dofs_of(x, "3") | dofs_of(y, "3")
    structure = solid_model(mesh, Isotropic(200e9, 0.3, 8000.0), held=held, consistent_mass=True)
    found = natural_frequencies(structure, 11)
    return found[found > 1.0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "counts", "within"),
    [("hexa20", (8, 8, 2), 0.006), ("penta15", (10, 10, 1), 0.022), ("tetra10", (10, 10, 1), 0.035)],
)
def test_bending_of_nafems_fv52(kind: str, counts: tuple[int, int, int], within: float) -> None:
    """The reference is plate theory, whose support holds the turns about the sides' normals: the hard one."""
    found = fv52(kind, counts, hard=True)
    bending = found[[0, 1, 2, 5]]
    np.testing.assert_allclose(bending, FV52[:4], rtol=within)


@pytest.mark.slow
def test_stretching_of_nafems_fv52() -> None:
    """The fifth reference is a mode in the plane, which only the soft support leaves."""
    assert fv52("hexa20", (8, 8, 1), hard=False)[4] == pytest.approx(FV52[4], rel=1e-3)


def test_waves_along_a_bar() -> None:
    """Held across, pressure waves f = k/(2L) √((λ + 2μ)/ρ); held along, shear waves with √(μ/ρ)."""
    nu, mesh = 0.3, solid_mesh(box(3.0, 0.2, 0.2), (10, 1, 1), "hexa20")
    everywhere, ends = np.arange(len(mesh.xyz)), np.concatenate([mesh.face("u0"), mesh.face("u1")])
    mu = 1.0 / (2 + 2 * nu)
    for free, squared in (("1", mu * (2 - 2 * nu) / (1 - 2 * nu)), ("2", mu)):
        held = dofs_of(everywhere, "123".replace(free, "")) | dofs_of(ends, free)
        structure = solid_model(mesh, Isotropic(1.0, nu, 1.0), held=held, consistent_mass=True)
        found = natural_frequencies(structure, 3)
        np.testing.assert_allclose(found[:3], np.arange(1, 4) / 6.0 * np.sqrt(squared), rtol=1e-3)


def test_the_projections_of_the_solids_are_those_documented() -> None:
    np.testing.assert_array_equal(LINEAR.share(np.array([0.0, 0.3, 0.4999])), 0.0)
    np.testing.assert_allclose(MEAN.share(np.array([0.0, 0.45, 0.48])) ** 2, [1.0, 1.0, 0.04 / 1.48])
