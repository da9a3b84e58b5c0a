"""Modes under a static preload: closed forms of beams, strings, plates, rings and columns, buckling, derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.model.decks import card

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.fem.assemble import assemble
from femtune.fem.elements import KINDS
from femtune.fem.elements.solids.shape import (
    gradients,
    hexahedron_points,
    pentahedron_points,
    tabulated,
    tetrahedron_points,
)
from femtune.files.nastran.build import BuiltDeck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.configured import ConfiguredModel
from femtune.model.parametric import Assignment
from femtune.model.reduce.reduced_model import check_size
from femtune.parameters import Parameter, ParameterSet
from structures.shells import Isotropic
from structures.solids import solid_mesh, solid_model

from .preloaded import AREA, INERTIA, LENGTH, NONE, RHO, E, built, configured, eigenvalues, force

# ----------------------------------------------------------------------------------------------------
# Beams and strings.


EULER = np.pi**2 * E * INERTIA / LENGTH**2


def column(held: Sequence[str], n: int = 12, kind: str = "CBAR", axis: Sequence[float] = (1.0, 0.0, 0.0)) -> list[str]:
    """A straight beam along an axis; every other point has a displacement frame along the beam."""
    x = np.array(axis) / np.linalg.norm(axis)
    y = np.cross([0.3, 0.5, -0.8], x)
    system = card("CORD2R", 7, 0, 0.0, 0.0, 0.0, *np.cross(x, y).tolist(), *x.tolist())
    grids = [card("GRID", i + 1, 0, *(LENGTH / n * i * x).tolist(), 7) for i in range(n + 1)]
    bars = [card(kind, i, 1, i, i + 1, *y.tolist()) for i in range(1, n + 1)]
    # shear factors of 1e6: no shear deformation in beams either
    beam = card("PBEAM", 1, 1, AREA, INERTIA, INERTIA, 0.0, 1.6e-7, 0.0, *[0.0] * 8, 1e6, 1e6)
    bar = card("PBAR", 1, 1, AREA, INERTIA, INERTIA, 1.6e-7)
    rod = card("PROD", 1, 1, AREA, 1.6e-7)
    section = {"CBAR": bar, "CBEAM": beam, "CROD": rod}[kind]
    if kind == "CROD":
        bars = [card(kind, i, 1, i, i + 1) for i in range(1, n + 1)]
    return [system, *grids, *bars, section, card("MAT1", 1, E, None, 0.3, RHO), "PARAM,COUPMASS,1", *held]


def pinned(n: int = 12) -> list[str]:
    # one plane of bending: the frame's x axis is along the beam
    return ["SPC1,1,1234,1", f"SPC1,1,234,{n + 1}", f"SPC1,1,345,1,THRU,{n + 1}"]


def end_load(size: float, axis: Sequence[float] = (1.0, 0.0, 0.0), n: int = 12) -> list[str]:
    return [force(n + 1, (size * np.array(axis) / np.linalg.norm(axis)).tolist())]


@pytest.mark.quick(0)
@pytest.mark.parametrize("kind", ["CBAR", "CBEAM"])
@pytest.mark.parametrize("ratio", [0.0, 5.0, -0.5, -0.9])
def test_a_beam_under_axial_force(kind: str, ratio: float) -> None:
    """f_k = f_k0 √(1 + P / k² P_cr); Blevins, Formulas for Natural Frequency and Mode Shape, 1979, section 8.1."""
    axis = (2.0, -1.0, 2.0)
    found = eigenvalues(column(pinned(), kind=kind, axis=axis), end_load(ratio * EULER, axis), 2)
    k = np.arange(1, 3)
    exact = (k * np.pi / LENGTH) ** 4 * E * INERTIA / (RHO * AREA) * (1 + ratio / k**2)
    np.testing.assert_allclose(found, exact, rtol=5e-4)


ENDS = {
    "pinned": (pinned(), 1.0),
    "clamped and free": (["SPC1,1,123456,1", "SPC1,1,345,1,THRU,13"], 0.25),
    "clamped": (["SPC1,1,123456,1", "SPC1,1,2346,13", "SPC1,1,345,1,THRU,13"], 4.0),
    "clamped and pinned": (
        ["SPC1,1,123456,1", "SPC1,1,234,13", "SPC1,1,345,1,THRU,13"],
        4.493409457909064**2 / np.pi**2,
    ),
}


@pytest.mark.quick(0)
@pytest.mark.parametrize("ends", ENDS)
def test_the_lowest_eigenvalue_vanishes_at_the_buckling_load(ends: str) -> None:
    """Euler's four columns."""
    held, factor = ENDS[ends]
    below, above = (eigenvalues(column(held), end_load(-s * factor * EULER), 1)[0] for s in (1 - 2e-3, 1 - 1e-3))
    # λ is linear in the load as near as this
    critical = 1 - 1e-3 + 1e-3 * above / (below - above)
    assert critical == pytest.approx(1.0, abs=2e-4)


def test_a_bar_with_releases_is_a_chain_of_links() -> None:
    """Two bars with a hinge between them, on a spring: k = 4 P / L under compression makes it unstable."""
    spring, length = 1000.0, LENGTH / 2
    cards = column(["SPC1,1,123456,1", "SPC1,1,23456,3", "SPC1,1,3456,2"], n=2)
    cards = [c for c in cards if not c.startswith("CBAR")]
    y = (0.3, 0.5, -0.8)
    y = tuple(np.cross(y, [1.0, 0.0, 0.0]).tolist())
    cards += [card("CBAR", 1, 1, 1, 2, *y, None, 56, 56), card("CBAR", 2, 1, 2, 3, *y, None, 56, 56)]
    cards += [card("CELAS2", 9, spring, 2, 2), "CONM2,8,2,,5."]
    cards = ["PARAM,COUPMASS,-1" if c.startswith("PARAM") else c for c in cards]
    mass = 5.0 + RHO * AREA * length
    for load in (0.0, 300.0, -400.0):
        (found,) = eigenvalues(cards, end_load(load, n=2), 1)
        assert found == pytest.approx((spring + 2 * load / length) / mass, rel=1e-9)


def test_a_string_of_rods() -> None:
    """f_k = k/2L √(P/ρA): rods have stiffness across by the preload alone."""
    n, tension = 40, 5e4
    held = [f"SPC1,1,123456,1,{n + 1}", f"SPC1,1,3456,1,THRU,{n + 1}", "SPC1,2,123456,1", f"SPC1,2,23456,{n + 1}"]
    cards = column([*held, "SPC1,2,3456,1,THRU,41"], n=n, kind="CROD")
    model = configured(cards, end_load(tension, n=n), spc=(2, 1))
    found = solve_modes(model.at(np.zeros(0)), 3).freq_hz
    exact = np.arange(1, 4) / (2 * LENGTH) * np.sqrt(tension / (RHO * AREA))
    np.testing.assert_allclose(found, exact, rtol=3e-3)


def test_a_heavy_column_buckles_under_its_weight() -> None:
    """q_cr = 7.837 EI/L³ (Timoshenko and Gere, Theory of Elastic Stability, 1961, section 2.12)."""
    held = ["SPC1,1,123456,1", "SPC1,1,345,1,THRU,25"]
    critical = 7.83735 * E * INERTIA / LENGTH**3 / (RHO * AREA)

    def lowest(part: float) -> float:
        return float(eigenvalues(column(held, n=24), [card("GRAV", 3, 0, part * critical, -1.0, 0.0, 0.0)], 1)[0])

    near, nearer = lowest(0.98), lowest(0.99)
    assert 0.99 + 1e-2 * nearer / (near - nearer) == pytest.approx(1.0, abs=1e-3)


RING, SPRING = 96, 3000.0


def ring() -> list[str]:
    """A ring of radius 1 with springs along its circumference: against a rotation, loads of fixed direction push."""
    angles = 2 * np.pi * np.arange(RING) / RING
    grids = [card("GRID", i + 1, 0, np.cos(a), np.sin(a), 0.0, 8) for i, a in enumerate(angles)]
    bars = [card("CBAR", i + 1, 1, i + 1, (i + 1) % RING + 1, 0.0, 0.0, 1.0) for i in range(RING)]
    springs = [card("CELAS2", 1001 + i, SPRING, i + 1, 2) for i in range(RING)]
    system = card("CORD2C", 8, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    # bars along z as orientation, in the displacement frame of the points
    section = [card("PBAR", 1, 1, AREA, INERTIA, INERTIA, 1.6e-7), card("MAT1", 1, E, None, 0.3, RHO)]
    return [system, *grids, *bars, *springs, *section, "PARAM,COUPMASS,1", f"SPC1,1,345,1,THRU,{RING}"]


@pytest.mark.slow
def test_a_ring_under_pressure() -> None:
    """q_cr = 4 EI/R³ for pressure of constant direction (Bodner, J. Aeronaut. Sci. 25, 1958).

    The mode of two waves has a fifth of its motion along the circumference.
    """
    critical = 4 * E * INERTIA
    angles = 2 * np.pi * np.arange(RING) / RING
    unloaded = E * INERTIA / (RHO * AREA) * 36 / 5
    by_springs = 0.2 * SPRING * RING / (2 * np.pi * RHO * AREA)

    def lowest(part: float) -> float:
        size = -part * critical * 2 * np.pi / RING
        loads = [force(i + 1, (size * np.cos(a), size * np.sin(a), 0.0)) for i, a in enumerate(angles)]
        found = eigenvalues(ring(), loads, 6) - by_springs
        return float(found[np.argmin(np.abs(found - (1 - part) * unloaded))])

    half, nearly = lowest(0.5), lowest(0.9)
    assert half == pytest.approx(0.5 * unloaded, rel=1e-2)
    assert 0.9 + 0.4 * nearly / (half - nearly) == pytest.approx(1.0, abs=3e-3)


# ----------------------------------------------------------------------------------------------------
# Plates of shells and of solids under forces in their plane.


SIDE, THICK, MODULUS, NU, DENSITY = 1.0, 0.01, 7e10, 0.3, 2700.0
RIGIDITY = MODULUS * THICK**3 / 12 / (1 - NU**2)


def sheet(kind: str, n: int) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Cards of a square plate, coordinates of its points, and lengths of the points of an edge."""
    middle = kind in ("CQUAD8", "CTRIA6")
    m = 2 * n if middle else n
    h = SIDE / m
    at = lambda i, j: i * (m + 1) + j  # noqa: E731
    xyz = np.array([(h * i, h * j, 0.0) for i in range(m + 1) for j in range(m + 1)])
    elements = []
    step = 2 if middle else 1
    for i in range(0, m, step):
        for j in range(0, m, step):
            a, b, c, d = at(i, j), at(i + step, j), at(i + step, j + step), at(i, j + step)
            if kind == "CQUAD4":
                elements.append((a, b, c, d))
            elif kind == "CTRIA3":
                elements += [(a, b, c), (a, c, d)]
            elif kind == "CQUAD8":
                elements.append((a, b, c, d, at(i + 1, j), at(i + 2, j + 1), at(i + 1, j + 2), at(i, j + 1)))
            elif kind == "CTRIA6":
                centre = at(i + 1, j + 1)
                elements += [
                    (a, b, c, at(i + 1, j), at(i + 2, j + 1), centre),
                    (a, c, d, centre, at(i + 1, j + 2), at(i, j + 1)),
                ]
    cards = [card("GRID", k + 1, 0, *x.tolist()) for k, x in enumerate(xyz)]
    cards += [card(kind, e + 1, 1, *(k + 1 for k in nodes)) for e, nodes in enumerate(elements)]
    cards += [card("PSHELL", 1, 1, THICK, 1, None, 1), card("MAT1", 1, MODULUS, None, NU, DENSITY), "PARAM,COUPMASS,1"]
    weights = np.full(m + 1, h)
    weights[[0, -1]] = h / 2
    if middle:
        weights = np.where(np.arange(m + 1) % 2, 4 * h / 3, 2 * h / 3)
        weights[[0, -1]] = h / 3
    return cards, xyz, weights


def plate(kind: str, n: int, forces: tuple[float, float, float]) -> tuple[list[str], list[str]]:
    """A simply supported square plate and loads that make the membrane forces Nx, Ny, Nxy in it."""
    cards, xyz, weights = sheet(kind, n)
    nx, ny, nxy = forces
    loads, m = [], len(weights) - 1
    index = np.arange(len(xyz)).reshape(m + 1, m + 1)
    edges = [(index[-1], nx, nxy), (index[0], -nx, -nxy), (index[:, -1], nxy, ny), (index[:, 0], -nxy, -ny)]
    for nodes, fx, fy in edges:
        loads += [force(int(k) + 1, (w * fx, w * fy, 0.0)) for k, w in zip(nodes, weights)]
    edge = np.unique(np.concatenate([e[0] for e in edges])) + 1
    held = [card("SPC1", 1, 3, int(k)) for k in edge]
    # hard supports: no rotation along the edge
    held += [card("SPC1", 1, 4, int(k) + 1) for k in (*index[0], *index[-1])]
    held += [card("SPC1", 1, 5, int(k) + 1) for k in (*index[:, 0], *index[:, -1])]
    middle = index[m // 2, m // 2] + 1
    held += [card("SPC1", 1, 12, int(middle)), card("SPC1", 1, 2, int(index[-1, m // 2]) + 1)]
    return [*cards, *held], loads


def exact_plate(forces: tuple[float, float, float], count: int) -> np.ndarray:
    """ω² = [D (α² + β²)² + Nx α² + Ny β²] / ρh with α = mπ/a; Leissa, NASA SP-160, section 10.1."""
    m, n = (np.pi / SIDE * k for k in np.meshgrid(np.arange(1, 9), np.arange(1, 9)))
    own = (RIGIDITY * (m**2 + n**2) ** 2 + forces[0] * m**2 + forces[1] * n**2) / (DENSITY * THICK)
    return np.sort(own.ravel())[:count]


CRITICAL = 4 * np.pi**2 * RIGIDITY / SIDE**2


@pytest.mark.parametrize(
    ("kind", "n", "tolerance"), [("CQUAD4", 16, 5e-3), ("CTRIA3", 16, 1.5e-2), ("CQUAD8", 4, 2e-3), ("CTRIA6", 4, 5e-3)]
)
@pytest.mark.parametrize("forces", [(2.0, -0.3, 0.0), (-0.8, 0.0, 0.0)])
@pytest.mark.slow
def test_a_plate_under_forces_in_its_plane(
    kind: str, n: int, tolerance: float, forces: tuple[float, float, float]
) -> None:
    own = tuple(CRITICAL * f for f in forces)
    found = eigenvalues(*plate(kind, n, own), 1)  # type: ignore[arg-type]
    unloaded = eigenvalues(*plate(kind, n, (0.0, 0.0, 0.0)), 1)
    # what the forces add, free of the errors of the unloaded mesh
    added = exact_plate(own, 1) - exact_plate((0.0, 0.0, 0.0), 1)  # type: ignore[arg-type]
    np.testing.assert_allclose(found - unloaded, added, rtol=tolerance)


@pytest.mark.parametrize(
    ("direction", "k", "tolerance"), [((-1.0, 0.0, 0.0), 4.0, 1e-3), ((0.0, 0.0, 1.0), 9.325, 6e-3)]
)
@pytest.mark.slow
def test_a_plate_buckles_in_compression_and_in_shear(
    direction: tuple[float, float, float], k: float, tolerance: float
) -> None:
    """k = 4 and k = 9.325 of π²D/a² (Timoshenko and Gere, section 9.2; Stein and Neff, NACA TN 1222, 1947)."""
    unit = k * np.pi**2 * RIGIDITY / SIDE**2
    far, near = (
        eigenvalues(*plate("CTRIA6", 8, tuple(part * unit * d for d in direction)), 1)[0]  # type: ignore[arg-type]
        for part in (0.9, 0.95)
    )
    assert 0.95 + 0.05 * near / (far - near) == pytest.approx(1.0, abs=tolerance)


# ----------------------------------------------------------------------------------------------------
# Solids.


def block(kind: str, n: int) -> tuple[list[str], np.ndarray]:
    """A slender column of solids along x, and its points; halved where the element has middles."""
    middle = kind in ("CHEXA20", "CTETRA10")
    s = 2 if middle else 1
    side, shape = 0.1, (n * s + 1, 2 * s + 1, 2 * s + 1)
    grid = np.stack(np.meshgrid(*(np.arange(k) for k in shape), indexing="ij"), axis=-1).reshape(-1, 3)
    xyz = grid * np.array([LENGTH / (n * s), side / (2 * s), side / (2 * s)])
    number = {tuple(g): i + 1 for i, g in enumerate(grid.tolist())}
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)]
    six = [(0, 1, 3, 7), (1, 2, 3, 7), (0, 4, 1, 7), (4, 5, 1, 7), (1, 6, 2, 7), (1, 5, 6, 7)]
    ten = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    elements: list[str] = []
    for i, j, k in np.ndindex(n, 2, 2):
        at = s * (np.array([i, j, k]) + corners)
        if kind.startswith("CHEXA"):
            points = [*at, *((at[a] + at[b]) // 2 for a, b in edges)] if middle else at
            elements.append(card("CHEXA", len(elements) + 1, 1, *(number[tuple(p.tolist())] for p in points)))
        else:
            for tetra in six:
                own = at[list(tetra)]
                points = [*own, *((own[a] + own[b]) // 2 for a, b in ten)] if middle else own
                elements.append(card("CTETRA", len(elements) + 1, 1, *(number[tuple(p.tolist())] for p in points)))
    cards = [card("GRID", i + 1, 0, *x.tolist()) for i, x in enumerate(xyz)]
    cards += [*elements, "PSOLID,1,1", card("MAT1", 1, E, None, 0.0, RHO), "PARAM,COUPMASS,1"]
    return cards, grid


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "n", "tolerance"), [("CHEXA", 20, 4e-3), ("CHEXA20", 8, 4e-3), ("CTETRA10", 8, 4e-3)])
def test_a_column_of_solids_buckles(kind: str, n: int, tolerance: float) -> None:
    """Clamped at one end, with shear: P = P_E / (1 + P_E / κGA) with κ = 5/6 (Timoshenko and Gere, section 2.17)."""
    cards, grid = block(kind, n)
    held = [card("SPC1", 1, 123, i + 1) for i in np.flatnonzero(grid[:, 0] == 0)]
    area, inertia = 0.01, 0.1**4 / 12
    euler = np.pi**2 * E * inertia / (4 * LENGTH**2)
    critical = euler / (1 + euler / (5 / 6 * E / 2 * area))
    end = np.flatnonzero(grid[:, 0] == grid[:, 0].max())
    share = _shares(grid[end, 1:], kind)
    share /= share.sum()

    def lowest(part: float) -> float:
        loads = [force(int(i) + 1, (-part * critical * s, 0.0, 0.0)) for i, s in zip(end, share)]
        return float(eigenvalues([*cards, *held], loads, 1)[0])

    far, near = lowest(0.8), lowest(0.9)
    assert 0.9 + 0.1 * near / (far - near) == pytest.approx(1.0, abs=tolerance)


def _shares(place: np.ndarray, kind: str) -> np.ndarray:
    """Shares of the points of a face of two by two elements in a uniform pressure; `place` (n, 2)."""
    if kind == "CHEXA":
        return np.prod(np.where(place == 1, 2.0, 1.0), axis=1)
    adjacent = np.prod(np.where(np.isin(place, (2,)), 2.0, 1.0), axis=1)
    odd = (place % 2).sum(axis=1)
    if kind == "CHEXA20":
        return adjacent * np.select([odd == 0, odd == 1], [-1.0, 4.0], 0.0)
    # middles of the sides of triangles: two triangles at an inner side
    on_edge = ((place == 0) | (place == 4)).any(axis=1)
    return np.where(odd == 0, 0.0, np.where(on_edge, 1.0, 2.0))


# ----------------------------------------------------------------------------------------------------
# Derivatives: exact, beside complex steps.


def frame() -> BuiltDeck:
    """A frame of bars with a plate in it, loaded by a force, a moment, pressure and its weight."""
    cards = [
        card("GRID", 1, 0, 0.0, 0.0, 0.0), card("GRID", 2, 0, 1.0, 0.1, 0.0), card("GRID", 3, 0, 1.1, 1.0, 0.05),
        card("GRID", 4, 0, 0.0, 1.0, 0.0), card("GRID", 5, 0, 0.5, 0.4, 1.0), card("GRID", 6, 0, 2.0, 0.2, 0.3),
        "CQUAD4,1,1,1,2,3,4", "CBAR,2,2,1,5,0.,1.,0.", "CBAR,3,2,3,5,0.,1.,0.", "CROD,4,3,4,5", "CTRIA3,5,1,2,6,3",
        "CBEAM,6,4,5,6,0.,1.,0.",
        card("PSHELL", 1, 1, 0.02, 1, None, 1),
        card("PBAR", 2, 1, 1e-3, 8e-8, 6e-8, 1e-7, None, None, *[0.0] * 8, 0.8, 0.8),
        card("PROD", 3, 2, 2e-4, 1e-8), card("PBEAM", 4, 1, 1e-3, 8e-8, 6e-8, 0.0, 1e-7),
        card("MAT1", 1, 7e10, None, 0.3, 2700.0), card("MAT1", 2, 2e11, None, 0.3, 7800.0),
        "SPC1,1,123456,1,4", "CONM2,7,6,,3.",
    ]  # fmt: skip
    loads = ["LOAD,3,1.,2.,11,1.,12,.5,13\n,1.,14", "FORCE,11,6,,1000.,1.,.3,-2.", "MOMENT,11,2,,100.,0.,1.,0.",
             "GRAV,12,,9.81,0.,0.,-1.", "PLOAD4,13,1,5000.", "FORCE1,14,5,300.,5,6"]  # fmt: skip
    return built(cards, loads)


LARGEST_LOAD = 5000.0
FIELDS = ["MAT1 1 E", "MAT1 1 RHO", "PSHELL 1 T", "PBAR 2 I1", "PROD 3 A", "PBEAM 4 A"]


def parametric_frame() -> ConfiguredModel:
    names = [f"p{i}" for i in range(len(FIELDS))]
    parameters = ParameterSet(tuple(Parameter(name, lower=0.5, upper=2.0) for name in names))
    refs = [FieldRef(c, int(n), f) for c, n, f in (f.split() for f in FIELDS)]
    assignments = [Assignment(name, ref) for name, ref in zip(names, refs)]
    return configure(parametric_model(frame().structure, parameters, assignments), Configuration())


@pytest.mark.slow
def test_derivatives_are_exact() -> None:
    """First derivatives of the stiffness beside complex steps of it, second ones beside those of the first."""
    model, h = parametric_frame(), 1e-30
    x = np.random.default_rng(3).uniform(-0.2, 0.2, len(FIELDS))
    point = model.at(x)
    # small derivatives are differences of forces of the size of the loads, which have the rounding of these
    rounding = 1e-11 * LARGEST_LOAD
    for i in range(len(x)):
        step = model.at(x + 1j * h * np.eye(len(x))[i])
        for found, complex_step in [(point.stiffness_derivatives[i], step.stiffness)] + [
            (point.stiffness_second_derivative(i, j), step.stiffness_derivatives[j]) for j in range(len(x))
        ]:
            expected = complex_step.toarray().imag / h
            np.testing.assert_allclose(found.toarray(), expected, atol=1e-9 * np.abs(expected).max() + rounding, rtol=0)
    of_model = model.model
    bare = ParameterSet(of_model.parameters.parameters, curved=False)
    short = configure(parametric_model(frame().structure, bare, of_model.assignments), Configuration()).at(x)
    for first, other in zip(point.stiffness_derivatives, short.stiffness_derivatives):
        np.testing.assert_array_equal(other.toarray(), first.toarray())


def test_a_shortage_of_memory_is_said_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    model = parametric_model(frame().structure, NONE, ())
    monkeypatch.setattr("femtune.model.linear.memory.free_memory", lambda: 0)
    monkeypatch.setattr("femtune.model.linear.memory.NEGLIGIBLE_BYTES", 0)
    monkeypatch.setattr("femtune.model.configured.require_memory", lambda *args, **facts: None)
    with pytest.raises(FemtuneError, match="internal forces") as caught:
        configure(model, Configuration())
    assert caught.value.code == "model.memory"


@pytest.mark.slow
def test_a_reduction_names_the_preload_that_makes_it_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femtune.model.reduce.reduced_model.MOST_BYTES", 1)
    with pytest.raises(FemtuneError, match="STATSUB") as caught:
        check_size(parametric_frame(), 10)
    assert caught.value.code == "reduce.too-many-terms"


def test_the_forces_of_a_determinate_structure_do_not_depend_on_its_stiffness() -> None:
    cards = column(["SPC1,1,123456,1"])
    model = built(cards, [*end_load(-0.3 * EULER), "GRAV,3,,9.81,0.,1.,0."])
    parameters = ParameterSet((Parameter("E", lower=0.5, upper=2.0),))
    own = configure(
        parametric_model(model.structure, parameters, [Assignment("E", FieldRef("MAT1", 1, "E"))]), Configuration()
    )
    zero, one = own.at(np.zeros(1)), own.at(np.ones(1))
    # K(E) − K(2E) of the elements alone is the whole of dK/dE
    np.testing.assert_allclose(
        zero.stiffness_derivatives[0].toarray(), (one.stiffness - zero.stiffness).toarray(),
        atol=1e-9 * np.abs(one.stiffness.data).max(), rtol=0,
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# What is refused.


def test_a_preload_without_supports_is_refused() -> None:
    with pytest.raises(FemtuneError) as caught:
        configured(column(["SPC1,1,345,1,THRU,13"]), end_load(1.0))
    assert caught.value.code == "configuration.preload-not-held"


# ----------------------------------------------------------------------------------------------------
# Stresses that vary within solids with mid-side nodes.


TURN = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]


@pytest.mark.parametrize("kind", ["hexa20", "penta15", "tetra10"])
def test_a_linear_stress_of_a_solid_enters_as_it_is(kind: str) -> None:
    """Displacements that are quadratic in the place have linear strains; the law is that of an isotropic material."""
    mesh = solid_mesh(
        lambda *x: np.moveaxis(np.stack(x, axis=-1) @ np.diag([1.3, 0.8, 0.6]) @ TURN, -1, 0), (1, 1, 1), kind
    )
    frames = np.array([np.linalg.qr(np.random.default_rng(i).standard_normal((3, 3)))[0] for i in range(len(mesh.xyz))])
    structure = solid_model(mesh, Isotropic(2.1e11, 0.3, 1.0), frames=frames)
    batch = next(b for b in structure.batches if b.kind == kind).some(np.array([0]))
    alone = replace(structure, batches=(batch,))
    factors = np.random.default_rng(2).standard_normal((3, 3, 3))

    def stress(x: np.ndarray) -> np.ndarray:
        slopes = np.einsum("iab,b->ia", factors, x) + np.einsum("iab,a->ib", factors, x)
        strain = 0.5 * (slopes + slopes.T)
        shear = 2.1e11 / 2.6
        return 2 * shear * (strain + 0.3 / 0.4 * np.trace(strain) * np.eye(3))

    rows = batch.nodes[0]
    xyz = structure.nodes.xyz[rows]
    u = np.einsum("iab,na,nb->ni", factors, xyz, xyz)
    local = np.einsum("nji,nj->ni", frames[rows], u).ravel()
    K = assemble(alone, "stiffness").toarray()[np.ix_(batch.dofs[0], batch.dofs[0])]
    own = KINDS[kind].differential(batch, alone)
    found = np.einsum("k,kij->ij", own.patterns[0] @ K @ local, own.matrices[0])
    shape = KINDS[kind].volume
    rule = {"hexa20": hexahedron_points(4), "penta15": pentahedron_points(3), "tetra10": tetrahedron_points()}[kind]
    at = gradients(tabulated(shape, rule), xyz[None])
    places = shape.values(rule.places) @ xyz
    across = sum(w * G @ stress(x) @ G.T for w, G, x in zip(at.volume[0], at.along[0], places))
    expected = np.einsum("ab,aji,bjk->aibk", across, frames[rows], frames[rows]).reshape(found.shape)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
