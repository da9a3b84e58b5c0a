"""Modes of records refined by their likelihood: better, divided where two are one, left where the model is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import Dof
from femtune.errors import Notice
from femtune.identification.choice import change_choice
from femtune.identification.harmonics import find_lines
from femtune.identification.operational import (
    Operational,
    by_covariances,
    by_decomposition,
    chosen_modes,
    prepared,
)
from femtune.identification.refined import RefinedModes, refined
from femtune.modal import Channel, TimeSeries

RATE, BAND = 40.0, (0.8, 15.0)
FREQ, RATIO = np.array([1.7, 3.9, 9.0]), np.array([0.012, 0.01, 0.008])


QUANTITIES = ("acceleration", "velocity", "displacement")


def mixed_record(noise: float) -> TimeSeries:
    """Three channels of each of three quantities, whose ends are cut as those of a record are."""
    rng = np.random.default_rng(4)
    count, lead = round(360.0 * RATE), round(60.0 * RATE)
    w = 2.0 * np.pi * np.fft.rfftfreq(count, 1.0 / RATE)
    own = 2.0 * np.pi * FREQ[:, None]
    h = 1.0 / (own**2 - w**2 + 2j * RATIO[:, None] * own * w)
    shapes = rng.uniform(0.3, 1.0, (9, 3)) * rng.choice((-1.0, 1.0), (9, 3))
    force = rng.standard_normal((3, 5)) @ np.fft.rfft(rng.standard_normal((5, count)))
    derived = (1j * w) ** np.repeat([2, 1, 0], 3)[:, None]
    motion = np.fft.irfft(derived * (shapes @ (h * force)), count)[:, lead:]
    motion += noise * motion.std(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
    channels = [Channel(Dof(i + 1, "Z"), QUANTITIES[i // 3]) for i in range(9)]
    return TimeSeries(motion, channels, sampling_hz=RATE)


def record(
    freq: np.ndarray, ratio: np.ndarray, seed: int, phase: float = 0.0, seconds: float = 300.0, channels: int = 4
) -> TimeSeries:
    """Accelerations under white forces."""
    rng = np.random.default_rng([9, seed])
    m, count = len(freq), round((seconds + 60.0) * RATE)
    turned = np.exp(1j * phase * rng.random((channels, m)))
    shapes = rng.uniform(0.3, 1.0, (channels, m)) * rng.choice((-1.0, 1.0), (channels, m)) * turned
    w = 2.0 * np.pi * np.fft.rfftfreq(count, 1.0 / RATE)
    own = 2.0 * np.pi * freq[:, None]
    h = -(w**2) / (own**2 - w**2 + 2j * ratio[:, None] * own * w)
    force = np.fft.rfft(rng.standard_normal((5, count)))
    motion = np.fft.irfft(shapes @ (h * (rng.standard_normal((m, 5)) @ force)), count)[:, round(60.0 * RATE) :]
    motion += 0.02 * motion.std(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
    return TimeSeries(motion, [Channel(Dof(i + 1, "Z"), "acceleration") for i in range(channels)], sampling_hz=RATE)


def both(measured: TimeSeries) -> tuple[RefinedModes, RefinedModes]:
    """Before and after."""
    asked = Operational(BAND, 40)
    found, ready = by_covariances(measured, asked), prepared(measured, asked)
    return RefinedModes(found), refined(found, ready, find_lines(ready, BAND), asked)


@pytest.mark.slow
def test_refined_modes_are_nearer_and_their_intervals_hold() -> None:
    before, after, inside = [], [], []
    for seed in range(12):
        old, new = both(record(FREQ, RATIO, seed))
        assert not new.divided
        at = [int(np.argmin(np.abs(old.modes.modes.freq_hz - f))) for f in FREQ]
        assert set(at) <= set(new.positions)
        for errors, one in ((before, old), (after, new)):
            modes = one.modes.modes.select_modes(at)
            errors.append(np.r_[modes.freq_hz / FREQ - 1.0, 0.1 * (modes.damping_ratio / RATIO - 1.0)])
        modes = new.modes.modes.select_modes(at)
        inside.append(np.abs(modes.freq_hz - FREQ) < 1.96 * modes.freq_sd_hz)
        inside.append(np.abs(modes.damping_ratio - RATIO) < 1.96 * modes.damping_sd)
        assert np.array_equal(new.modes.modes.shapes, old.modes.modes.shapes)
    assert np.mean(np.square(after)) < 0.9 * np.mean(np.square(before))
    assert np.mean(inside) > 0.85


@pytest.mark.slow
def test_one_mode_that_is_two_is_divided_and_single_modes_are_not() -> None:
    asked = Operational(BAND, 40)
    freq, ratio = np.array([1.7, 3.9, 3.9 * 1.006, 9.0]), np.array([0.012, 0.01, 0.01, 0.008])
    measured = record(freq, ratio, 3)
    found, ready = by_covariances(measured, asked), prepared(measured, asked)
    # of the pair, only one is taken
    near = [c.freq_hz for c in found.candidates if c.chosen and abs(c.freq_hz - 3.91) < 0.1]
    one = chosen_modes(found, change_choice(found.candidates, drop=near[1:])) if len(near) > 1 else found
    assert len(one.modes.freq_hz) == 3
    new = refined(one, ready, (), asked)
    assert new.divided == pytest.approx((3.91,), abs=0.03)
    modes = new.modes.modes
    assert modes.freq_hz == pytest.approx(freq, rel=3e-3)
    assert np.linalg.norm(modes.shapes, axis=0) == pytest.approx(np.ones(4))
    assert sum(c.chosen for c in new.modes.candidates) == 4
    assert len(modes.labels) == len(set(modes.labels)) == 4


@pytest.mark.slow
def test_modes_whose_spectra_are_not_the_model_stay_as_they_were() -> None:
    old, new = both(record(FREQ, RATIO, 1, phase=1.5))
    left = [i for i in range(3) if i not in new.positions]
    assert left
    assert new.modes.modes.freq_hz[left] == pytest.approx(old.modes.modes.freq_hz[left], rel=0.0, abs=0.0)
    assert new.modes.modes.damping_sd[left] == pytest.approx(old.modes.modes.damping_sd[left], rel=0.0, abs=0.0)


@pytest.mark.slow
def test_channels_of_different_quantities_with_little_noise_are_refined() -> None:
    """More channels than are used without mixtures, as many mixtures as channels, and noise below cut ends."""
    old, new = both(mixed_record(1e-3))
    modes = new.modes.modes
    at = [int(np.argmin(np.abs(modes.freq_hz - f))) for f in FREQ]
    assert set(at) <= set(new.positions)
    assert not new.divided
    assert np.all(np.abs(modes.freq_hz[at] - FREQ) < 3.0 * modes.freq_sd_hz[at])
    assert np.all(np.abs(modes.damping_ratio[at] - RATIO) < 3.0 * modes.damping_sd[at])
    assert not np.array_equal(modes.freq_hz, old.modes.modes.freq_hz)
    # uncertainty law of well separated modes with little noise, and all lines (Au 2014)
    law = 1.0 / np.sqrt(2.0 * np.pi * RATIO * FREQ * 300.0)
    assert modes.damping_sd[at] / modes.damping_ratio[at] == pytest.approx(law, rel=0.4)


@pytest.mark.slow
def test_modes_whose_bandwidths_overlap_are_refined_together() -> None:
    """Each is in the lines around the others, and there is one outside the band."""
    freq, ratio = np.array([1.7, 3.4, 4.5, 9.0, 17.5]), np.array([0.05, 0.07, 0.07, 0.06, 0.07])
    inside, sd = [], []
    for seed in range(6):
        _, new = both(record(freq, ratio, seed, channels=8))
        modes = new.modes.modes
        at = [int(np.argmin(np.abs(modes.freq_hz - f))) for f in freq[:4]]
        assert len(set(at)) == 4
        # one may contradict the method before by chance
        assert len(set(at) & set(new.positions)) >= 3
        inside.append(np.abs(modes.freq_hz[at] - freq[:4]) < 1.96 * modes.freq_sd_hz[at])
        inside.append(np.abs(modes.damping_ratio[at] - ratio[:4]) < 1.96 * modes.damping_sd[at])
        sd.append(modes.damping_sd[at] / ratio[:4])
    assert np.mean(inside) > 0.85
    # no less than is known of a mode that is alone
    assert np.all(np.median(sd, axis=0) < 1.3 / np.sqrt(2.0 * np.pi * ratio[:4] * freq[:4] * 300.0))


@pytest.mark.slow
def test_a_close_pair_with_large_damping_is_divided() -> None:
    """Two modes a tenth of their bandwidth apart, of which the method has one, and overlapping neighbours."""
    freq, ratio = np.array([1.7, 3.9, 3.94, 9.0]), np.array([0.04, 0.045, 0.05, 0.04])
    asked = Operational(BAND, 40)
    measured = record(freq, ratio, 2, channels=8)
    found, ready = by_covariances(measured, asked), prepared(measured, asked)
    near = [c.freq_hz for c in found.candidates if c.chosen and abs(c.freq_hz - 3.92) < 0.4]
    one = chosen_modes(found, change_choice(found.candidates, drop=near[1:])) if len(near) > 1 else found
    assert len(one.modes.freq_hz) == 3
    modes = refined(one, ready, (), asked).modes.modes
    assert len(modes.freq_hz) == 4
    assert np.all(np.abs(modes.freq_hz - freq) < 3.0 * modes.freq_sd_hz)
    assert np.all(np.abs(modes.damping_ratio - ratio) < 3.0 * modes.damping_sd)


@pytest.mark.slow
def test_a_channel_that_is_not_connected_changes_nothing() -> None:
    """Rounding errors of a constant are no channel with little noise."""
    measured = record(FREQ, RATIO, 0)
    constant = np.vstack([measured.values, np.full(measured.samples, 3.0)])
    channels = [*measured.channels, Channel(Dof(5, "Z"), "acceleration")]
    _, alone = both(measured)
    _, beside = both(TimeSeries(constant, channels, sampling_hz=RATE))
    assert len(alone.positions) == 3
    assert beside.positions == alone.positions
    assert beside.modes.modes.damping_ratio == pytest.approx(alone.modes.modes.damping_ratio, rel=1e-6)


def test_methods_without_poles_and_short_records_are_left() -> None:
    measured = record(FREQ, RATIO, 0, seconds=40.0)
    asked = Operational(BAND, 20)
    peaks = by_decomposition(measured, asked)
    assert refined(peaks, prepared(measured, asked), (), asked).modes is peaks


def test_what_was_refined_is_told() -> None:
    check_shown(
        "identify.likelihood, partly",
        Notice("identify.likelihood/partly", level="info", refined=2, count=3, others="4.16"),
    )
    check_shown("identify.likelihood, none", Notice("identify.likelihood/none", level="info", refined=0, count=3))
    check_shown("identify.likelihood, divided", Notice("identify.likelihood/divided", level="info", frequencies="3.91"))
