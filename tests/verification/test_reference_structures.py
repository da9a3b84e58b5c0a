"""Frequencies that commercial Nastran lists for small bar structures, rebuilt here by hand.

The structures are those of well-known verification decks (their f06 or op2 list the frequencies). They settle
conventions that no closed form knows: lumped and consistent mass, torsional inertia, shear factors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from femtune.fem.checks import rigid_body_modes
from femtune.fem.structure import Structure
from structures.beams import SOLAR_ARRAY, solar_array
from structures.frames import Part, bars, bushes, dense_matrices, dense_modes, make_structure, masses, rods, scalars


def chain(x: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Points along x and the bars between successive ones."""
    xyz = np.stack([np.array(x), 0.0 * np.array(x), 0.0 * np.array(x)], axis=1)
    return xyz, np.stack([np.arange(len(x) - 1), np.arange(1, len(x))], axis=1)


def svanberg(card: str) -> tuple[Structure, list[int]]:
    xyz, pairs = chain([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    E = 1440e6
    section = {"E": E, "G": E / 2.66, "A": 15000.0, "I1": 2500.0, "I2": 250.0, "J": 25000.0, "rho": 5.37078819}
    return make_structure(xyz, [bars(pairs, section, card=card)]), list(range(6))


def cantilever() -> tuple[Structure, list[int]]:
    xyz, pairs = chain(list(np.arange(11.0)))
    section = {"E": 2.9e7, "G": 1.1e7, "A": 0.1, "I1": 0.01, "I2": 0.01, "J": 0.001, "rho": 7.357e-4}
    return make_structure(xyz, [bars(pairs, section)]), [
        *range(6),
        *(6 * i + c for i in range(11) for c in (0, 2, 3, 4)),
    ]


def swept_wing() -> tuple[Structure, list[int]]:
    """Bars in a rotated displacement frame with consistent mass; torsional inertia by scalar masses."""
    x = np.array([0.96593, -0.25882, 0.0])
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross([0.0, 0.0, 1.0], x), [0.0, 0.0, 1.0]], axis=1)
    span = 0.572 * np.arange(11)[:, None] * frame[:, 1]
    section = {"E": 10.4e6, "G": 3.9e6, "A": 7.175e-2, "I1": 9.83e-6, "I2": 0.0, "J": 36.8e-6, "rho": 2.61e-4}
    pairs = chain(list(range(11)))[1]
    twist = scalars("scalar-mass", [[6 * i + 4, -1] for i in range(1, 11)], "M", [2.8e-6] * 9 + [1.4e-6])
    parts = [bars(pairs, section, orientation=(0.0, 0.0, 1.0)), twist]
    held = [2, 3, 4, *(6 * i + c for i in range(11) for c in (0, 1, 5))]
    return make_structure(span, parts, np.tile(frame, (11, 1, 1)), consistent_mass=True), held


def ten_bar_truss() -> tuple[Structure, list[int]]:
    xyz = [[720.0, 0, 0], [720.0, 0, -360], [360.0, 0, 0], [360.0, 0, -360], [0.0, 0, 0], [0.0, 0, -360]]
    pairs = np.array([[5, 3], [3, 1], [6, 4], [4, 2], [3, 4], [1, 2], [5, 4], [6, 3], [3, 2], [4, 1]]) - 1
    section = {"E": 1e7, "G": 1e7 / 2.66, "A": 9.5318, "J": 25000.0, "rho": 2.59e-4}
    mass = scalars("scalar-mass", [[6 * i + c, -1] for i in range(4) for c in range(3)], "M", 2.588)
    held = [*range(24, 36), *(6 * i + c for i in range(4) for c in (1, 3, 4, 5))]
    return make_structure(xyz, [rods(pairs, section), mass], consistent_mass=True), held


def round_bar(radius: float, E: float, nu: float, rho: float, G: float | None = None) -> dict[str, float]:
    inertia = np.pi / 4.0 * radius**4
    shear = {"K1": 0.9, "K2": 0.9}
    G = E / (2.0 * (1.0 + nu)) if G is None else G
    return {"E": E, "G": G, "A": np.pi * radius**2, "I1": inertia, "I2": inertia, "J": 2 * inertia, "rho": rho} | shear


def beam_with_tip_mass() -> tuple[Structure, list[int]]:
    """Nine CBAR and one CBEAM, shear-flexible round sections; the mass has rotary inertia."""
    xyz, pairs = chain(list(np.arange(11.0)))
    section = round_bar(1.0, 3.0e7, 0.29, 7.4851e-4, 1.1628e7)
    inertia = dict.fromkeys(("M", "I11", "I22", "I33"), 2.59e-3)
    parts = [bars(pairs[:9], section), bars(pairs[9:], section, card="CBEAM"), masses([10], inertia)]
    return make_structure(xyz, parts), list(range(6))


def satellite_mast() -> tuple[Structure, list[int]]:
    xyz, pairs = chain([0.0, 20.0, 40.0, 60.0, 80.0, 100.0])
    parts: list[Part] = [bars(pairs, round_bar(10.0, 6.898e7, 0.33, 2.711e-6)), masses([5], {"M": 5.0})]
    return make_structure(xyz, parts), list(range(6))


RHO_BUSH = 2.7957e-6


def bushed_mast(rotary: bool = False) -> tuple[Structure, list[int]]:
    xyz, pairs = chain([0.0, 20.0, 40.0, 60.0, 80.0, 100.0])
    points = np.vstack([xyz, [[0.0, 0.0, 0.0]]])
    section = round_bar(10.0, 7.1019e7, 0.33, RHO_BUSH)
    bush = bushes([[6, 0]], {f"K{i}": 1e12 for i in range(1, 7)})
    parts = [bars(pairs, section), masses([5], {"M": 10.0}), bush]
    if rotary:
        share = RHO_BUSH * section["I1"] * 20.0 * np.array([0.5, 1.0, 1.0, 1.0, 1.0, 0.5])
        parts.append(masses(range(6), {"M": 0.0, "I22": share, "I33": share}))
    return make_structure(points, parts), list(range(36, 42))


COMMON = [46.464, 146.93, 279.02, 752.99, 815.35, 882.35, 1405.5]
# modes of each structure, listed frequencies in Hz, and how well they must be met
LISTED = {
    "svanberg bar": (lambda: svanberg("CBAR"), [*COMMON, 2059.2], 5e-5),
    "svanberg beam": (lambda: svanberg("CBEAM"), [*COMMON, 1507.3], 5e-5),
    "cantilever": (cantilever, [349.73, 2167.3, 6007.8, 11650.0, 19045.0], 3e-5),
    "swept wing": (swept_wing, [39.961, 236.41, 250.44, 701.40, 703.42, 1153.1, 1375.4, 1574.4, 1956.9, 2277.2], 3e-5),
    "ten-bar truss": (ten_bar_truss, [8.9495, 26.957, 27.250, 49.931, 56.885, 62.997, 65.084, 77.128], 2e-5),
    "beam with tip mass": (
        beam_with_tip_mass,
        [456.660, 456.660, 2674.588, 2674.588, 3554.923, 4507.487, 6626.104, 6626.104, 11111.59, 11111.59],
        1e-6,
    ),
    "satellite mast": (satellite_mast, [89.5607, 89.5607, 1044.76], 3e-5),
    # with_se.dat of pyYeti, superelements 300 and 400: all 31 modes, of which the last six stretch the bars
    "solar array": (solar_array, SOLAR_ARRAY, 5e-7),
    "bushed mast": (bushed_mast, [63.8038, 63.8038, 750.561], 2e-5),
}


@pytest.mark.parametrize("name", LISTED)
def test_listed_frequencies(name: str):
    make, listed, tolerance = LISTED[name]
    found = dense_modes(*make())[: len(listed)]
    np.testing.assert_allclose(found, listed, rtol=tolerance)


def test_the_consistent_mass_along_bars_is_not_the_textbooks():
    """1/3 and 1/6 along the axis give the bending modes of the solar array, but 5 to 34 % in its axial ones."""
    structure, held = solar_array()
    found = dense_modes(replace(structure, lumped_along=0.0), held)[:31] / np.array(SOLAR_ARRAY) - 1.0
    assert (found[26:] > 0.04).all()
    assert np.abs(found[:19]).max() < 1e-6


def test_bushed_mast_with_rotary_inertia_and_residual_vectors():
    """The op2 lists eight values, of which the deck's range holds three: the others are residual vectors.

    The program that wrote it gives its lumped bars rotary inertia ρI·L/2 across the axis. With that, the modes below
    2000 Hz and the static answers to inertia loads of the rigid motions give all eight to seven digits.
    """
    structure, held = bushed_mast(rotary=True)
    K, M = dense_matrices(structure, held)
    load = M @ rigid_body_modes(structure.nodes)[:36]
    load = load[:, np.abs(load).max(axis=0) > 1e-12]
    static = np.linalg.solve(K, load)
    eigenvalues, vectors = np.linalg.eig(np.linalg.solve(K, M))
    modes = vectors[:, np.argsort(-eigenvalues.real)[:3]].real
    basis = np.hstack([modes / np.abs(modes).max(axis=0), static / np.abs(static).max(axis=0)])
    u, s, _ = np.linalg.svd(basis, full_matrices=False)
    basis = u[:, s > 1e-9 * s[0]]
    ritz = scipy.linalg.eigh(basis.T @ K @ basis, basis.T @ M @ basis, eigvals_only=True)
    listed = [63.80382, 63.80382, 750.5609, 5522.769, 5522.769, 16707.48, 16707.48, 25385.58]
    np.testing.assert_allclose(np.sqrt(ritz) / (2 * np.pi), listed, rtol=3e-7)


def test_bar_matrices_of_a_punch_file():
    """Stiffness and mass of one bar as an external superelement lists them."""
    E = 1440e6
    section = {"E": E, "G": E / 2.66, "A": 15000.0, "I1": 2500.0, "I2": 250.0, "J": 25000.0, "rho": 5.37078819}
    K, M = dense_matrices(make_structure([[0.0, 0, 0], [1.0, 0, 0]], [bars([[0, 1]], section)]))
    listed = {
        (0, 0): 2.16e13, (1, 1): 4.32e13, (2, 2): 4.32e12, (3, 3): 1.353383459e13, (4, 2): -2.16e12, (4, 4): 1.44e12,
        (5, 1): 2.16e13, (5, 5): 1.44e13, (6, 0): -2.16e13, (7, 1): -4.32e13, (7, 5): -2.16e13, (8, 4): 2.16e12,
        (9, 3): -1.353383459e13, (10, 4): 7.2e11, (10, 2): -2.16e12, (11, 1): 2.16e13, (11, 5): 7.2e12,
    }  # fmt: skip
    for at, value in listed.items():
        assert K[at] == pytest.approx(value, rel=1e-9), at
    assert np.count_nonzero(M - np.diag(np.diag(M))) == 0
    np.testing.assert_allclose(np.diag(M)[:6], [5.37078819 * 15000 / 2] * 3 + [0.0] * 3)


def three_beams(modulus: float, offset: float) -> tuple[Structure, list[int]]:
    """Ten elements of 0.1 m; the four in the middle are half as deep and lie `offset` off the line of nodes."""
    xyz, pairs = chain(list(0.1 * np.arange(11)))

    def section(depth: float) -> dict[str, float]:
        A, I1, I2 = 0.2 * depth, 0.2 * depth**3 / 12.0, 0.2**3 * depth / 12.0
        return {"E": modulus, "G": modulus / 2.6, "A": A, "I1": I1, "I2": I2, "J": I1, "rho": 7850.0}

    aside = ((0.0, offset, 0.0), (0.0, offset, 0.0))
    parts = [bars(pairs[[0, 1, 2, 7, 8, 9]], section(0.1)), bars(pairs[3:7], section(0.05), offsets=aside)]
    held = [*range(6), *range(60, 66), *(6 * i + c for i in range(11) for c in (2, 3, 4))]
    return make_structure(xyz, parts, consistent_mass=True), held


def test_three_beams_with_offset():
    """Published: bending modes to 0.1 %; the axial one differs, its mass here is not the textbook's."""
    found = dense_modes(*three_beams(210e9, 0.025))
    np.testing.assert_allclose(found[[0, 1, 2, 4]], [563.90, 1030.52, 2126.51, 3808.26], rtol=1e-3)
    np.testing.assert_allclose(dense_modes(*three_beams(210e9, -0.025)), found, rtol=1e-9)
