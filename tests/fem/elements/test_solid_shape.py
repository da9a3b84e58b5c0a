"""Shape functions and integration points of solids with mid-side nodes, against their definitions."""

from __future__ import annotations

from itertools import product
from math import factorial

import numpy as np
import pytest
import scipy.special

from femtune.fem.elements.solids.shape import (
    HEXA20_SHAPE as HEXA20,
)
from femtune.fem.elements.solids.shape import (
    PENTA15_SHAPE as PENTA15,
)
from femtune.fem.elements.solids.shape import (
    PYRAM13_SHAPE as PYRAM13,
)
from femtune.fem.elements.solids.shape import (
    TETRA10_SHAPE as TETRA10,
)
from femtune.fem.elements.solids.shape import (
    SolidPoints,
    SolidShape,
    eight_points,
    gauss_jacobi,
    hexahedron_points,
    pentahedron_points,
    pyramid_points,
    tetrahedron_points,
)

SHAPES = {"hexa20": HEXA20, "penta15": PENTA15, "tetra10": TETRA10, "pyram13": PYRAM13}
RULES = {
    "hexa20": hexahedron_points(3),
    "penta15": pentahedron_points(3),
    "tetra10": tetrahedron_points(),
    "pyram13": pyramid_points(3),
}
# middles of the sides as the Quick Reference Guide draws them, corners from 1
CARDS = {
    "hexa20": "1-2 2-3 3-4 4-1 1-5 2-6 3-7 4-8 5-6 6-7 7-8 8-5",
    "penta15": "1-2 2-3 3-1 1-4 2-5 3-6 4-5 5-6 6-4",
    "tetra10": "1-2 2-3 3-1 1-4 2-4 3-4",
    "pyram13": "1-2 2-3 3-4 4-1 1-5 2-5 3-5 4-5",
}


@pytest.fixture(params=SHAPES)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def inside(kind: str) -> np.ndarray:
    """Some places within a shape, none of them special: averages of its integration points."""
    places = RULES[kind].places
    return np.random.default_rng(3).dirichlet(np.ones(len(places)), 7) @ places


def test_shape_functions_are_one_at_their_own_node_and_zero_at_the_others(kind: str) -> None:
    shape = SHAPES[kind]
    np.testing.assert_allclose(shape.values(shape.nodes), np.eye(len(shape.nodes)), atol=1e-14)


def test_middle_nodes_follow_the_corners_in_the_order_of_the_card(kind: str) -> None:
    shape = SHAPES[kind]
    pairs = [tuple(int(x) - 1 for x in pair.split("-")) for pair in CARDS[kind].split()]
    assert [set(edge) for edge in shape.edges] == [set(pair) for pair in pairs]
    middles = [(shape.nodes[a] + shape.nodes[b]) / 2 for a, b in pairs]
    np.testing.assert_array_equal(shape.nodes[shape.corners :], middles)


def test_every_quadratic_is_represented(kind: str) -> None:
    shape, points = SHAPES[kind], inside(kind)
    values, slopes = shape.values(points), shape.slopes(points)
    for powers in (p for p in product(range(3), repeat=3) if sum(p) <= 2):
        field = (shape.nodes ** np.array(powers)).prod(axis=1)
        np.testing.assert_allclose(values @ field, (points ** np.array(powers)).prod(axis=1), atol=1e-14)
        for k in range(3):
            lower = np.array(powers) - (np.arange(3) == k)
            exact = powers[k] * (points ** np.maximum(lower, 0)).prod(axis=1)
            np.testing.assert_allclose(slopes[:, k] @ field, exact, atol=1e-13)


def test_shape_functions_sum_to_one(kind: str) -> None:
    points = inside(kind)
    np.testing.assert_allclose(SHAPES[kind].values(points).sum(axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(SHAPES[kind].slopes(points).sum(axis=2), 0.0, atol=1e-13)


def test_slopes_agree_with_complex_steps(kind: str) -> None:
    shape, points = SHAPES[kind], inside(kind)
    for k in range(3):
        stepped = points + 1e-30j * np.eye(3)[k]
        np.testing.assert_allclose(shape.slopes(points)[:, k], shape.values(stepped).imag / 1e-30, atol=1e-13)


def test_a_pyramid_meets_its_neighbours() -> None:
    """On a triangular side the functions are those of a tetrahedron, and those of the other nodes vanish."""
    side, middles = [0, 1, 4], [5, 10, 9]
    u, v = 0.2, 0.3
    point = (1 - u - v) * PYRAM13.nodes[0] + u * PYRAM13.nodes[1] + v * PYRAM13.nodes[4]
    found = PYRAM13.values(point[None])[0]
    flat = TETRA10.values(np.array([[u, v, 0.0]]))[0, [0, 1, 2, 4, 5, 6]]
    np.testing.assert_allclose(found[side + middles], flat, atol=1e-14)
    np.testing.assert_allclose(np.delete(found, side + middles), 0.0, atol=1e-14)


def integral(kind: str, a: int, b: int, c: int) -> float:
    """Closed form of the integral of r^a s^b t^c over a reference shape."""

    def even(n: int) -> float:
        return (1 + (-1) ** n) / (n + 1)

    if kind == "hexa20":
        return even(a) * even(b) * even(c)
    if kind == "penta15":
        return factorial(a) * factorial(b) / factorial(a + b + 2) * even(c)
    if kind == "tetra10":
        return factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 3)
    return even(a) * even(b) * factorial(c) * factorial(a + b + 2) / factorial(a + b + c + 3)


def exact_for(kind: str, powers: tuple[int, ...]) -> bool:
    a, b, c = powers
    return {
        "hexa20": max(powers) <= 5,
        "penta15": a + b <= 4 and c <= 5,
        "tetra10": sum(powers) <= 5,
        "pyram13": sum(powers) <= 5,
    }[kind]


def error(kind: str, rule: SolidPoints, powers: tuple[int, ...]) -> float:
    found = (rule.places ** np.array(powers)).prod(axis=1) @ rule.weights
    return float(abs(found - integral(kind, *powers)))


def test_integration_is_exact_for_its_monomials(kind: str) -> None:
    for powers in (p for p in product(range(6), repeat=3) if exact_for(kind, p)):
        assert error(kind, RULES[kind], powers) < 1e-14, powers


def test_integration_is_no_better_than_it_says(kind: str) -> None:
    beyond = {"hexa20": (6, 0, 0), "penta15": (5, 0, 0), "tetra10": (6, 0, 0), "pyram13": (6, 0, 0)}
    assert error(kind, RULES[kind], beyond[kind]) > 1e-6


def test_eight_points_of_a_tetrahedron_are_of_degree_three() -> None:
    assert eight_points().weights.min() > 0.0
    for powers in (p for p in product(range(4), repeat=3) if sum(p) <= 3):
        assert error("tetra10", eight_points(), powers) < 1e-15
    assert error("tetra10", eight_points(), (4, 0, 0)) > 1e-5


def test_points_are_within_and_weights_positive(kind: str) -> None:
    rule = RULES[kind]
    assert (rule.weights > 0.0).all()
    r, s, t = rule.places.T
    room = {
        "hexa20": 1.0 - np.abs(rule.places).max(axis=1),
        "penta15": np.minimum.reduce([r, s, 1 - r - s, 1 - np.abs(t)]),
        "tetra10": np.minimum.reduce([r, s, t, 1 - r - s - t]),
        "pyram13": np.minimum.reduce([1 - t - np.abs(r), 1 - t - np.abs(s), t]),
    }[kind]
    assert room.min() > 0.0


@pytest.mark.parametrize(("kind", "finer"), [("hexa20", hexahedron_points(5)), ("pyram13", pyramid_points(5))])
def test_stiffness_and_mass_of_a_reference_shape_are_integrated_exactly(kind: str, finer: SolidPoints) -> None:
    """A finer rule changes nothing: neither products of the functions nor of their slopes."""
    shape: SolidShape = SHAPES[kind]
    for functions in (shape.values, lambda x: shape.slopes(x).reshape(len(x), -1)):
        found, exact = (_products(functions(rule.places), rule.weights) for rule in (RULES[kind], finer))
        np.testing.assert_allclose(found, exact, atol=1e-13)


def _products(functions: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return np.asarray(functions.T @ (weights[:, None] * functions))


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_points_of_gauss_and_jacobi(n: int) -> None:
    expected = scipy.special.roots_jacobi(n, 2.0, 0.0)
    np.testing.assert_allclose(gauss_jacobi(n), expected, rtol=0.0, atol=1e-14)
