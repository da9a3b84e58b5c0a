"""Neighbouring modes of one shape are doubtful; close modes of different shapes are not."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet, parse_dof
from femtune.identification.same_shapes import same_shape_remarks
from femtune.modal import ModeSet


def _modes(
    shapes: np.ndarray, freq: tuple[float, ...], noise: float = 0.0, sd: tuple[float, ...] | None = None
) -> ModeSet:
    """Modes with 1 % damping; `noise` is the standard deviation of a shape relative to its size."""
    count = len(shapes)
    spread = np.full(shapes.shape, noise / np.sqrt(count)) * np.linalg.norm(shapes, axis=0)
    return ModeSet(
        np.array(freq), shapes, DofSet([parse_dof(f"{i + 1}Z+") for i in range(count)]),
        damping_ratio=np.full(len(freq), 0.01), shapes_sd=spread, normalisation="unknown",
        freq_sd_hz=np.full(len(freq), 0.01) if sd is None else np.array(sd),
    )  # fmt: skip


def _told(modes: ModeSet) -> list[int]:
    return [r.mode for r in same_shape_remarks(modes) if r.doubtful]


_SHAPE = np.array([1.0, 0.6, -0.4, -0.9, 0.3])
_OTHER = np.array([0.2, -0.7, 1.0, -0.3, 0.5])


def test_two_modes_of_one_shape_are_both_doubtful_or_the_far_less_certain_one() -> None:
    same = np.column_stack([_SHAPE, 1.01 * _SHAPE + 0.02, _OTHER])
    assert _told(_modes(same, (10.0, 10.3, 10.4))) == [0, 1]
    assert _told(_modes(same, (10.0, 10.3, 10.4), sd=(0.01, 0.05, 0.01))) == [1]
    assert _told(_modes(same, (10.0, 10.3, 10.4), sd=(0.05, 0.01, 0.01))) == [0]
    first, second = same_shape_remarks(_modes(same, (10.0, 10.3, 10.4)))
    assert first.notice is second.notice
    check_shown("identify.same-shape", first.notice)


def test_modes_far_apart_and_few_sensors_are_not_judged() -> None:
    same = np.column_stack([_SHAPE, _SHAPE])
    assert _told(_modes(same, (10.0, 10.7))) == [0, 1]
    assert _told(_modes(same, (10.0, 11.0))) == []
    assert _told(_modes(same[:3], (10.0, 10.3))) == []


def test_one_channel_in_large_numbers_does_not_make_shapes_alike() -> None:
    large = np.column_stack([np.append(_SHAPE, 100.0), np.append(_OTHER, 100.0)])
    assert _told(_modes(large, (10.0, 10.1))) == []
    assert _told(_modes(large[:, [0, 0]], (10.0, 10.1))) == [0, 1]


@pytest.mark.parametrize(("sensors", "most"), [(4, 0.02), (6, 0.01), (10, 0.005)])
def test_random_shapes_are_seldom_told_and_the_same_shape_nearly_always(sensors: int, most: float) -> None:
    """Of 4000 pairs with a noise of 5 %: 0.6 and 0.05 % of random ones with 4 and 6 sensors, 99.5 % of equal ones with
    4."""
    rng, noise, pairs = np.random.default_rng(3), 0.05, 100
    random, equal = 0, 0
    for _ in range(pairs):
        shapes = rng.standard_normal((sensors, 2))
        for kind in ("random", "equal"):
            true = shapes if kind == "random" else shapes[:, [0, 0]]
            error = rng.standard_normal(true.shape) * noise / np.sqrt(sensors) * np.linalg.norm(true, axis=0)
            told = bool(_told(_modes(true + error, (10.0, 10.1), noise)))
            random += told and kind == "random"
            equal += told and kind == "equal"
    assert random <= most * pairs
    assert equal >= 0.97 * pairs
