"""Tapered beams against constant bars, closed forms, published frequencies and fine meshes of constant bars."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
import scipy.linalg as la
from numpy.typing import ArrayLike

from femtune.arrays import Reals
from femtune.fem.assemble import assemble
from femtune.fem.elements import contributions
from femtune.fem.structure import Structure
from femtune.testing import check_contribution
from structures.frames import bars, dense_matrices, dense_modes, make_structure

from .tapered_parts import tapered

Law = Callable[[Reals], Reals]

XYZ = [[0.0, 0.0, 0.0], [1.3, 0.2, -0.1], [2.0, 1.0, 0.4]]
PAIRS = [[0, 1], [1, 2]]
MATERIAL = {"E": 2.1e11, "G": 8.1e10, "rho": 7850.0}
SECTION = {"A": 2e-4, "I1": 1.5e-8, "I2": 6e-9, "J": 1.1e-8, "NSM": 0.3, "K1": 0.8, "K2": 0.6}
OFFSETS = ((0.1, 0.2, 0.0), (0.0, -0.1, 0.3))
FRAMES = np.array([np.linalg.qr(np.random.default_rng(i).standard_normal((3, 3)))[0] for i in range(3)])
LINE = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]


def one_value(values: dict[str, float]) -> dict[str, list[float]]:
    return {name: [x] for name, x in values.items()}


@pytest.mark.quick(0)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize(
    ("I12", "pins"), [(0.0, ()), (0.0, (5,)), (0.0, (5, 10)), (0.0, (1, 4, 9)), (0.0, (0, 1, 7)), (2e-9, ())]
)
def test_a_constant_section_gives_the_matrices_of_a_bar(consistent: bool, I12: float, pins: tuple[int, ...]):
    section = SECTION | {"I12": I12}
    settings = {"consistent_mass": consistent, "mass_factor": 0.5}
    plain = bars(PAIRS, {**MATERIAL, **section}, card="CBEAM", offsets=OFFSETS, pins=pins)
    stations = tapered(PAIRS, MATERIAL, [0.0, 0.3, 1.0], one_value(section), offsets=OFFSETS, pins=pins)
    expected, found = (make_structure(XYZ, [part], FRAMES, **settings) for part in (plain, stations))
    for kind in ("stiffness", "mass"):
        exact = assemble(expected, kind).toarray()
        np.testing.assert_allclose(assemble(found, kind).toarray(), exact, rtol=0, atol=1e-14 * np.abs(exact).max())


def test_tip_of_a_tapered_cantilever():
    """I and A linear from a to b: ∫ x² dx/EI and ∫ dx/EA in closed form, with shear ∫ dx/κAG."""
    L, values = 2.0, {"A": [3e-4, 1e-4], "I1": [8e-8, 2e-8], "I2": [1e-8], "J": [4e-8, 1e-8], "K1": [0.8], "K2": [0.0]}
    K, _ = dense_matrices(make_structure(LINE, [tapered([[0, 1]], MATERIAL, [0.0, 1.0], values)]), range(6))
    flexibility = np.linalg.inv(K)

    def reciprocal(ends: list[float]) -> float:
        return L * np.log(ends[0] / ends[1]) / (ends[0] - ends[1])

    # tip load at ξ = 1: moment L(1 − ξ), I = 8e-8 − 6e-8 ξ = 2e-8 (1 + 3 s) with s = 1 − ξ
    bending = L**3 / (MATERIAL["E"] * 2e-8) * ((0.5 - 1 / 3) / 3 + np.log(4.0) / 27)
    shear = reciprocal(values["A"]) / (0.8 * MATERIAL["G"])
    assert flexibility[0, 0] == pytest.approx(reciprocal(values["A"]) / MATERIAL["E"], rel=1e-10)
    assert flexibility[1, 1] == pytest.approx(bending + shear, rel=1e-10)
    assert flexibility[2, 2] == pytest.approx(L**3 / (3 * MATERIAL["E"] * 1e-8), rel=1e-10)
    assert flexibility[3, 3] == pytest.approx(reciprocal(values["J"]) / MATERIAL["G"], rel=1e-10)


def wedge(n: int, stations: int, consistent: bool = True) -> Structure:
    """A cantilever of unit length whose height falls to nearly nothing; clamped at the thick end, node n."""
    points = [[i / n, 0.0, 0.0] for i in range(n + 1)]
    inner = np.linspace(0.0, 1.0, stations)
    tip = 1e-4
    at = [np.array([(i + s) / n for i in range(n)]) + tip for s in inner]
    values = {"A": [x * 1e-3 for x in at], "I1": [x**3 * 1e-8 for x in at], "I2": [x**3 * 1e-8 for x in at],
              "J": [1e-8]}  # fmt: skip
    part = tapered([[i, i + 1] for i in range(n)], MATERIAL, list(inner), values)
    return make_structure(points, [part], consistent_mass=consistent)


def test_frequencies_of_a_wedge():
    """Kirchhoff's sharp wedge: ω = 5.315 √(E I0/ρ A0)/L², then 15.207 (Timoshenko, Vibration Problems, 5.12)."""
    structure = wedge(48, 5)
    held = {*range(6 * 48, 6 * 49), *(6 * i + k for i in range(48) for k in (0, 2, 3, 4))}
    found = 2 * np.pi * dense_modes(structure, held)[:2] / np.sqrt(MATERIAL["E"] * 1e-8 / (MATERIAL["rho"] * 1e-3))
    np.testing.assert_allclose(found, [5.315, 15.207], rtol=1e-3)


def cantilever(n: int, constant: bool) -> Structure:
    """A beam with A from 4 to 1 and I from 8 to 1, as n tapered or n constant elements of the mean section."""
    points = [[2.0 * i / n, 0.0, 0.0] for i in range(n + 1)]
    pairs = [[i, i + 1] for i in range(n)]
    left = np.arange(n) / n
    ends = [left, left + 1 / n]
    section = {"A": [4e-4 - 3e-4 * x for x in ends], "I1": [8e-8 - 7e-8 * x for x in ends],
               "I2": [4e-8 - 3.5e-8 * x for x in ends], "J": [8e-8 - 7e-8 * x for x in ends],
               "NSM": [0.5 - 0.3 * x for x in ends]}  # fmt: skip
    if constant:
        mean = {name: (a + b) / 2 for name, (a, b) in section.items()}
        return make_structure(points, [bars(pairs, {**MATERIAL, **mean}, card="CBEAM")], consistent_mass=True)
    return make_structure(points, [tapered(pairs, MATERIAL, [0.0, 1.0], section)], consistent_mass=True)


def test_tapered_and_stepped_beams_meet():
    fine = dense_modes(cantilever(64, constant=False), range(6))[:6]
    errors = [dense_modes(cantilever(n, constant=True), range(6))[:6] / fine - 1 for n in (8, 16, 32)]
    assert np.abs(errors[-1]).max() < 1e-3
    rates = (
        np.log2(np.abs(errors[0]).max() / np.abs(errors[1]).max()),
        np.log2(np.abs(errors[1]).max() / np.abs(errors[2]).max()),
    )
    assert min(rates) > 1.85
    # four tapered elements are as good as many constant ones
    few = dense_modes(cantilever(4, constant=False), range(6))[:3]
    np.testing.assert_allclose(few, fine[:3], rtol=2e-3)


def by_polynomials(area: Law, inertia: Law, count: int, degree: int = 24) -> np.ndarray:
    """(count,) frequencies in Hz of a clamped-free Euler beam of unit length with A(x), I(x): Ritz's method.

    The functions are x² times Legendre polynomials, which converge faster than any power of their number.
    """
    points, weights = np.polynomial.legendre.leggauss(200)
    x, w = (points + 1.0) / 2.0, weights / 2.0
    polynomials = [np.polynomial.Legendre.basis(k, [0.0, 1.0]) for k in range(degree)]
    square = np.polynomial.Polynomial([0.0, 0.0, 1.0])
    shape = np.array([square(x) * p(x) for p in polynomials])
    curve = np.array([2.0 * p(x) + 4.0 * x * p.deriv(1)(x) + x**2 * p.deriv(2)(x) for p in polynomials])
    K = MATERIAL["E"] * (curve * (w * inertia(x))) @ curve.T
    M = MATERIAL["rho"] * (shape * (w * area(x))) @ shape.T
    return np.sqrt(la.eigvalsh(K, M)[:count]) / (2.0 * np.pi)


def bending_modes(n: int, values: Mapping[str, Sequence[ArrayLike]], stations: Sequence[float]) -> np.ndarray:
    """(3,) of a clamped-free beam of unit length with n elements, bending in plane 1 only."""
    points = [[i / n, 0.0, 0.0] for i in range(n + 1)]
    part = tapered([[i, i + 1] for i in range(n)], MATERIAL, stations, values)
    across = {6 * i + k for i in range(n + 1) for k in (0, 2, 3, 4)}
    return dense_modes(make_structure(points, [part], consistent_mass=True), across | set(range(6)))[:3]


@pytest.mark.slow
@pytest.mark.parametrize("thin", [(0.25, 0.125), (0.1, 0.01), (0.03, 0.001)])
def test_frequencies_of_linear_area_and_inertia(thin: tuple[float, float]) -> None:
    """A and I fall linearly to these parts, as between the stations of PBEAM: the rest is the cubic mass."""

    def area(x: Reals) -> Reals:
        return 1e-3 * (1.0 - (1.0 - thin[0]) * x)

    def inertia(x: Reals) -> Reals:
        return 1e-8 * (1.0 - (1.0 - thin[1]) * x)

    exact = by_polynomials(area, inertia, 3)
    np.testing.assert_allclose(by_polynomials(area, inertia, 3, 20), exact, rtol=1e-6)
    errors = []
    for n in (8, 16):
        ends = np.arange(n) / n, (np.arange(n) + 1.0) / n
        values = {"A": [*map(area, ends)], "I1": [*map(inertia, ends)], "I2": [*map(inertia, ends)], "J": [1e-8]}
        errors.append(np.abs(bending_modes(n, values, [0.0, 1.0]) / exact - 1.0))
    assert errors[0].max() < 1.2e-3
    assert errors[1].max() < 1e-4
    assert np.log2(errors[0][-1] / errors[1][-1]) > 3.0


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.5, 0.2])
def test_frequencies_of_linear_dimensions(height: float) -> None:
    """A and I of a bar whose width and height change linearly, given at stations: the error falls with their distance.

    Between stations A and I are linear, so that I is too large: stations in an element are as good as more elements.
    """

    def sizes(x: Reals) -> tuple[Reals, Reals]:
        return 0.03 * (1.0 - 0.4 * x), 0.02 * (1.0 - (1.0 - height) * x)

    def area(x: Reals) -> Reals:
        return sizes(x)[0] * sizes(x)[1]

    def inertia(x: Reals) -> Reals:
        return sizes(x)[0] * sizes(x)[1] ** 3 / 12.0

    exact = by_polynomials(area, inertia, 3)

    def errors(n: int, stations: int) -> np.ndarray:
        inner = np.linspace(0.0, 1.0, stations)
        at = [(np.arange(n) + s) / n for s in inner]
        values = {"A": [*map(area, at)], "I1": [*map(inertia, at)], "I2": [*map(inertia, at)], "J": [1e-8]}
        return np.asarray(bending_modes(n, values, list(inner)) / exact - 1.0)

    coarse, fine, finest = errors(8, 2), errors(16, 2), errors(32, 2)
    assert np.log2(np.abs(coarse) / np.abs(fine)).min() > 1.7
    assert np.abs(finest).max() < 1e-3
    # as many stations, fewer elements
    assert np.abs(errors(8, 5)).max() < 1e-3


@pytest.mark.slow
def test_neutral_axis_beside_the_shear_centre_is_a_rigid_arm():
    """Where twist is held, bending about an offset neutral axis is that of a bar on offset arms, mass and all."""
    arm = (0.0, 0.05, -0.03)
    section = SECTION | {"I12": 1e-9}
    offset = bars([[0, 1]], {**MATERIAL, **section}, card="CBEAM", offsets=(arm, arm))
    beside = tapered([[0, 1]], MATERIAL, [0.0, 1.0],
                     one_value(section | {"N1": arm[1], "N2": arm[2], "M1": arm[1], "M2": arm[2]}))  # fmt: skip
    for consistent in (False, True):
        K, M = zip(*(dense_matrices(make_structure(LINE, [p], consistent_mass=consistent), (3, 9))
                     for p in (offset, beside)))  # fmt: skip
        np.testing.assert_allclose(K[1], K[0], rtol=0, atol=1e-12 * np.abs(K[0]).max())
        np.testing.assert_allclose(M[1], M[0], rtol=0, atol=1e-13 * np.abs(M[0]).max())


@pytest.mark.slow
@pytest.mark.parametrize(("consistent", "tolerance"), [(False, 4e-3), (True, 2e-3)])
def test_neutral_axis_beside_the_shear_centre_couples_bending_and_torsion(consistent: bool, tolerance: float):
    """Forks at both ends: v and θ are sines, and bending of the shear centre and torsion meet by the mass alone.

    With the mass at n from the shear centre v − nθ moves it: [[EI k⁴, 0], [0, GJ k²]] against
    [[m, −mn], [−mn, ρ(I1 + I2) + mn²]], k = iπ/L (Timoshenko, Vibration Problems in Engineering, coupled vibrations).
    """
    L, n, elements = 2.0, 0.04, 40
    section = SECTION | {"N2": n, "NSM": 0.0, "K1": 0.0, "K2": 0.0}
    points = [[L * i / elements, 0.0, 0.0] for i in range(elements + 1)]
    part = tapered([[i, i + 1] for i in range(elements)], MATERIAL, [0.0, 1.0], one_value(section))
    across = {6 * i + c for i in range(elements + 1) for c in (2, 4)}
    forks = {0, *(6 * i + c for i in (0, elements) for c in (1, 3))}
    found = dense_modes(make_structure(points, [part], consistent_mass=consistent), across | forks)

    def sines(n: float) -> np.ndarray:
        k, mass = np.pi * np.arange(1, 6) / L, MATERIAL["rho"] * section["A"]
        inertia = MATERIAL["rho"] * (section["I1"] + section["I2"]) + mass * n**2
        stiffness = MATERIAL["E"] * section["I1"] * k**4, MATERIAL["G"] * section["J"] * k**2
        M = np.array([[mass, -mass * n], [-mass * n, inertia]])
        pairs = [np.linalg.eigvals(np.linalg.solve(M, np.diag(pair))) for pair in zip(*stiffness)]
        return np.sort(np.sqrt(np.concatenate(pairs)))[:5] / (2 * np.pi)

    assert np.abs(sines(n) / sines(0.0) - 1.0).max() > 0.1
    np.testing.assert_allclose(found[:5], sines(n), rtol=tolerance)


@pytest.mark.parametrize("consistent", [False, True])
def test_mass_and_rigid_motion(consistent: bool):
    """Mass, first moments and rotary inertia of linear densities on arms; no rigid motion strains the beam."""
    values = {"A": [3e-4, 1e-4], "I1": [1e-8, 2e-8], "I2": [2e-8, 1e-8], "J": [1e-8], "NSM": [0.2, 0.6],
              "N1": [0.03, 0.01], "N2": [-0.02, 0.04], "M1": [0.05, 0.02], "M2": [0.01], "NSI": [2e-3, 4e-3],
              "K1": [0.8], "K2": [0.0], "I12": [0.0, 1e-9]}  # fmt: skip
    part = tapered([[0, 1]], MATERIAL, [0.0, 1.0], values)
    K, M = dense_matrices(make_structure(LINE, [part], consistent_mass=consistent))
    rigid = np.zeros((12, 6))
    rigid[:6] = rigid[6:] = np.eye(6)
    rigid[8, 4], rigid[7, 5] = -2.0, 2.0
    assert np.abs(K @ rigid).max() < 1e-9 * np.abs(K).max()
    inertia = rigid.T @ M @ rigid
    steel, added = MATERIAL["rho"] * np.array([3e-4, 1e-4]), np.array([0.2, 0.6])
    mass = float((steel + added).sum())
    np.testing.assert_allclose(np.diag(inertia)[:3], mass)
    centre = 2.0 * (steel @ [1 / 6, 1 / 3] + added @ [1 / 6, 1 / 3]) * 2.0
    assert inertia[1, 5] == pytest.approx(centre)
    # lumps at the ends, arms there: first moment of the mass about the x axis
    lumps = 2.0 * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]])
    assert inertia[2, 3] == pytest.approx(
        (lumps @ steel) @ [0.03, 0.01] + (lumps @ added) @ [0.05, 0.02], rel=2e-2 if consistent else 1e-12
    )


CASES = {
    "planes apart": {"I12": [0.0]},
    "planes joined": {"I12": [1e-9, 2e-9], "N1": [0.01, 0.02], "N2": [-0.02, 0.01], "M1": [0.01], "M2": [0.02]},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_derivatives_by_every_role(name: str):
    values = {"A": [2e-4, 3e-4], "I1": [1e-8, 3e-8], "I2": [6e-9, 9e-9], "J": [1e-8, 2e-8], "NSM": [0.1, 0.2],
              "K1": [0.8], "K2": [0.6], "NSI": [1e-3, 2e-3], **CASES[name]}  # fmt: skip
    structure = make_structure(XYZ[:2], [tapered([[0, 1]], MATERIAL, [0.0, 1.0], values, pins=(5,))], FRAMES[:2])
    batch = structure.batches[0]
    terms = contributions(batch, structure)
    roles = {role for term in terms for role in term.roles}
    given = {f"{n}@{k}" for n, x in values.items() if any(x) for k in (0, 1)}
    assert given - {"M1@1", "M2@1"} <= roles | {"M1@1", "M2@1"}
    # one entry of each flexibility suffices, they differ in nothing but indices
    for term in [t for t in terms if t.matrix == "mass" or t.label.endswith(("00", "01", "13"))]:
        check_contribution(term, {r: structure.values.values[batch.roles[r][term.at]] for r in term.roles})
