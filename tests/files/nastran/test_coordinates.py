"""Coordinate systems against results by hand, and frames against differences of positions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.errors import FemtuneError
from femtune.fem.structure import NodeTable
from femtune.files.nastran import Deck
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.coordinates import CoordinateSystem, system_through

DeckOf = Callable[..., Deck]


def nodes(deck: Deck) -> NodeTable:
    return build_structure(deck).structure.nodes


def code(deck: Deck) -> str:
    with pytest.raises(FemtuneError) as error:
        build_structure(deck)
    return error.value.code


def test_rectangular_shifted_and_turned(deck_of: DeckOf) -> None:
    # z along basic x, x along basic y: so y is along basic z
    table = nodes(deck_of("CORD2R,5,,1.,2.,3.,2.,2.,3.\n,1.,3.,3.\nGRID,1,5,10.,20.,30.,5\n"))
    np.testing.assert_allclose(table.xyz[0], [31.0, 12.0, 23.0])
    np.testing.assert_allclose(table.frames[0], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)


def test_cylindrical(deck_of: DeckOf) -> None:
    table = nodes(deck_of("CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,1,5,2.,30.,7.,5\n"))
    np.testing.assert_allclose(table.xyz[0], [np.sqrt(3.0), 1.0, 7.0])
    c, s = np.sqrt(3.0) / 2, 0.5
    np.testing.assert_allclose(table.frames[0], [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-15)


def test_spherical(deck_of: DeckOf) -> None:
    # θ = 90° from z and φ = 90° from x: the point lies on the y axis, e_r = y, e_θ = −z, e_φ = −x
    table = nodes(deck_of("CORD2S,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,1,5,2.,90.,90.,5\n"))
    np.testing.assert_allclose(table.xyz[0], [0.0, 2.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(table.frames[0], [[0, 0, -1], [1, 0, 0], [0, -1, 0]], atol=1e-15)


def test_displacement_frame_follows_the_place_of_the_point(deck_of: DeckOf) -> None:
    table = nodes(deck_of("CORD2C,5,,1.,0.,0.,1.,0.,1.\n,2.,0.,0.\nGRID,1,,1.,3.,0.,5\nGRID,2,,-2.,0.,0.,5\n"))
    np.testing.assert_allclose(table.frames[0][:, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(table.frames[1][:, 0], [-1, 0, 0], atol=1e-15)


def test_on_the_axis_the_radius_is_taken_at_zero_angle(deck_of: DeckOf) -> None:
    table = nodes(deck_of("CORD2C,5,,0.,0.,0.,0.,0.,1.\n,0.,1.,0.\nGRID,1,,0.,0.,4.,5\n"))
    np.testing.assert_allclose(table.frames[0][:, 0], [0, 1, 0], atol=1e-15)


def test_chain_through_a_cylindrical_system(deck_of: DeckOf) -> None:
    # system 6 is given by points (r, θ, z) of 5: origin (2, 90°, 0) = (0, 2, 0), z up, x through (3, 90°, 0)
    text = (
        "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
        "CORD2R,6,5,2.,90.,0.,2.,90.,1.\n,3.,90.,0.\nGRID,1,6,1.,0.,0.,6\n"
    )  # fmt: skip
    table = nodes(deck_of(text))
    np.testing.assert_allclose(table.xyz[0], [0.0, 3.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(table.frames[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_system_by_grid_points_two_on_a_card(deck_of: DeckOf) -> None:
    text = (
        "GRID,1,,1.,0.,0.\nGRID,2,,1.,0.,5.\nGRID,3,,1.,4.,0.\n"
        "CORD1R,7,1,2,3,8,1,3,2\nGRID,4,7,1.,0.,0.\nGRID,5,8,1.,0.,0.\n"
    )
    table = nodes(deck_of(text))
    np.testing.assert_allclose(table.xyz[3], [1.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(table.xyz[4], [1.0, 0.0, 1.0], atol=1e-15)


def test_pitch_of_a_skewed_set_of_points_is_made_square() -> None:
    system = system_through(1, "R", np.zeros(3), np.array([0, 0, 2.0]), np.array([3.0, 0, 9.0]))
    assert system is not None
    np.testing.assert_allclose(system.axes, np.eye(3))


@given(
    st.sampled_from("RCS"),
    st.floats(0.1, 5.0),
    st.floats(5.0, 175.0),
    st.floats(-170.0, 170.0),
    st.integers(0, 10**6),
)  # fmt: skip
def test_frames_are_the_directions_in_which_the_coordinates_grow(
    shape: str, a: float, b: float, c: float, seed: int
) -> None:
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    system = CoordinateSystem(1, shape, np.array([1.0, -2.0, 3.0]), axes)
    x, h = np.array([a, b, c]), 1e-4
    steps = (system.point(x + h * np.eye(3)[i]) - system.point(x - h * np.eye(3)[i]) for i in range(3))
    growth = np.column_stack([step / np.linalg.norm(step) for step in steps])
    np.testing.assert_allclose(system.frame(system.point(x)), growth, atol=1e-7)


def test_circular_definition_is_an_error(deck_of: DeckOf) -> None:
    two = "CORD2R,{},{},0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
    assert code(deck_of(two.format(5, 6) + two.format(6, 5))) == "deck.circular-coordinates"


def test_circle_through_a_grid_point_is_an_error(deck_of: DeckOf) -> None:
    text = "CORD1R,7,1,2,3\nGRID,1,7,0.,0.,0.\nGRID,2,,0.,0.,1.\nGRID,3,,1.,0.,0.\n"
    assert code(deck_of(text)) == "deck.circular-coordinates"


@pytest.mark.slow
def test_endless_chain_is_an_error_and_no_crash(deck_of: DeckOf) -> None:
    lines = [f"CORD2R,{i},{i + 1},0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n" for i in range(1, 3000)]
    assert code(deck_of("".join(lines))) == "deck.circular-coordinates"


def test_unknown_system_and_points_on_a_line(deck_of: DeckOf) -> None:
    assert code(deck_of("GRID,1,4,0.,0.,0.\n")) == "deck.unknown-coordinate-system"
    line = "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\n"
    assert code(deck_of(line)) == "deck.degenerate-coordinates"


def test_huge_coordinates_are_an_error_and_no_overflow(deck_of: DeckOf) -> None:
    assert code(deck_of("GRID,1,,1.+200,1.+200,0.\n")) == "deck.field-value"


def test_elements_on_a_bad_grid_point_do_not_add_errors(deck_of: DeckOf) -> None:
    text = "GRID,1,9,0.,0.,0.\nGRID,2,,1.,0.,0.\nRBAR,1,1,2,123456\nRBE2,2,2,123456,1\nCONM2,3,1,,5.\n"
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(text))
    assert error.value.code == "deck.unknown-coordinate-system"
    assert not hasattr(error.value, "errors")
