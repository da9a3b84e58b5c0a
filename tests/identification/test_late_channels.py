"""Channels that are late by samples are found by their phases; complex shapes and other quantities are not late."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.identification.late_channels import late_channels, late_notices

FREQ = np.array([3.1, 7.4, 8.6, 14.2])
STEP_S = 0.01


def shapes(seed: int, noise: float = 0.02) -> np.ndarray:
    """(6, 4) nearly real shapes of any phase."""
    rng = np.random.default_rng(seed)
    error = noise * (rng.standard_normal((6, 4)) + 1j * rng.standard_normal((6, 4)))
    return (rng.uniform(-1.0, 1.0, (6, 4)) + error) * np.exp(2j * np.pi * rng.random(4))


def delayed(made: np.ndarray, channel: int, delay_s: float) -> np.ndarray:
    made[channel] *= np.exp(-2j * np.pi * FREQ * delay_s)
    return made


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
def test_channels_on_time_are_not_late(noise):
    """Level 0.1 %: of 200 sets of shapes at most three may be named with probability 0.998."""
    assert sum(bool(late_channels(shapes(seed, noise), FREQ, STEP_S)) for seed in range(200)) <= 3


@pytest.mark.parametrize("samples", [1, 2, 7, 25, -3])
def test_the_late_channel_and_its_delay_are_found(samples):
    for seed in range(10):
        (found,) = late_channels(delayed(shapes(seed), 4, samples * STEP_S), FREQ, STEP_S)
        assert (found.channel, found.delay_s) == (4, pytest.approx(samples * STEP_S))


def test_two_late_channels_of_six_are_found():
    """One module of the data acquisition is late; greedy search may miss a set."""
    found = [late_channels(delayed(delayed(shapes(s), 1, 0.03), 5, 0.03), FREQ, STEP_S) for s in range(20)]
    right = [sorted((one.channel, round(one.delay_s, 6)) for one in some) == [(1, 0.03), (5, 0.03)] for some in found]
    assert sum(right) >= 15


def test_a_velocity_among_accelerations_is_not_late():
    made = shapes(0)
    made[2] *= 1j
    assert late_channels(made, FREQ, STEP_S) == ()


def test_two_modes_or_two_channels_tell_no_delay():
    made = delayed(shapes(0), 1, 0.03)
    assert late_channels(made[:, :2], FREQ[:2], STEP_S) == ()
    assert late_channels(made[:2], FREQ, STEP_S) == ()


def test_the_notice_has_the_delay_in_seconds_and_samples():
    (notice,) = late_notices(delayed(shapes(1), 4, 0.03), FREQ, list("abcdef"), STEP_S, counted=True)
    check_shown("identify.late-channel", notice)
