"""Sensors whose channels were exchanged are named; noise, errors of the model and inverted sensors are no exchange."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.correlation.free_beam import EVERYWHERE, beam

from femtune.correlation import correlate
from femtune.modal import ModeSet


def told(test: ModeSet, model: ModeSet) -> list[str]:
    return [n.what for n in correlate(test, model).notices if n.code == "correlate.sensors-exchanged"]


def bending(noise: float = 0.0, seed: int = 0) -> ModeSet:
    test = beam(EVERYWHERE).select_modes([2, 3, 4, 5])
    rng = np.random.default_rng(seed)
    return replace(test, shapes=test.shapes + noise * rng.standard_normal(test.shapes.shape))


def with_rows(test: ModeSet, order: dict[int, int]) -> ModeSet:
    rows = np.arange(len(test.dofs))
    rows[list(order)] = list(order.values())
    return replace(test, shapes=test.shapes[rows])


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1])
def test_two_exchanged_sensors_are_named(noise: float) -> None:
    (sentence,) = told(with_rows(bending(noise), {1: 4, 4: 1}), bending())
    assert "2Z+ with 5Z+" in sentence


def test_two_exchanges() -> None:
    (sentence,) = told(with_rows(bending(0.02), {0: 5, 5: 0, 3: 10, 10: 3}), bending())
    assert "1Z+ with 6Z+" in sentence
    assert "4Z+ with 11Z+" in sentence


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
def test_noise_is_no_exchange(noise: float) -> None:
    assert not told(bending(noise, seed=5), bending())


def test_an_inverted_sensor_is_no_exchange() -> None:
    test = bending(0.02)
    shapes = test.shapes.copy()
    shapes[3] *= -1.0
    assert not told(replace(test, shapes=shapes), bending())


@pytest.mark.parametrize("factor", [0.0, 0.4, 2.5])
@pytest.mark.parametrize("row", [0, 3, 7])
def test_a_wrong_factor_of_one_channel_is_no_exchange(factor: float, row: int) -> None:
    """A channel that is dead, or has a wrong sensitivity, is one bad row."""
    test = bending(0.02)
    shapes = test.shapes.copy()
    shapes[row] *= factor
    assert not told(replace(test, shapes=shapes), bending())


@pytest.mark.parametrize("row", [0, 4, 9])
def test_a_noisy_channel_is_no_exchange(row: int) -> None:
    test = bending(0.02)
    shapes = test.shapes.copy()
    shapes[row] += np.random.default_rng(row).standard_normal(shapes.shape[1]) * 0.8
    assert not told(replace(test, shapes=shapes), bending())


@pytest.mark.parametrize("rows", [(1, 5), (2, 3), (0, 8), (7, 11)])
def test_an_exchange_is_named_beside_an_error_of_the_model(rows: tuple[int, int]) -> None:
    """The structure has shapes that are mixed with those of the neighbouring modes: MACs of about 0.9."""
    test = bending(0.02)
    mixed = replace(test, shapes=test.shapes @ (np.eye(4) + 0.35 * np.diag([1.0, -1.0, 1.0], 1)))
    a, b = rows
    (sentence,) = told(with_rows(mixed, {a: b, b: a}), bending())
    assert f"{a + 1}Z+ with {b + 1}Z+" in sentence


def test_an_error_of_the_model_is_no_exchange() -> None:
    """Shapes of a beam whose one half moves more."""
    test = bending(0.01)
    factor = np.linspace(0.7, 1.3, len(EVERYWHERE))[:, None]
    assert not told(replace(test, shapes=factor * test.shapes), bending())
