"""A hammer's force among the responses is told; spikes, shocks and free decays of responses are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import chirp, lfilter
from tests.messages.shown import check_shown

from femtune import identify
from femtune.dofs import Dof
from femtune.errors import Notice
from femtune.identification.record_checks import check_record
from femtune.modal import Channel, TimeSeries, pole_of

from .hits import RATE, codes, measured

RESPONSES = tuple(Channel(Dof(i, "S"), "acceleration") for i in (1, 2, 3))


def unnamed(record: TimeSeries) -> TimeSeries:
    return replace(record, channels=RESPONSES)


def moving(seed: int, samples: int = 6000) -> tuple[np.random.Generator, np.ndarray]:
    """Ambient responses (3, samples) of two modes of a random structure."""
    rng = np.random.default_rng(seed)
    poles = np.exp(pole_of(rng.uniform(3.0, 60.0, 2), rng.uniform(0.003, 0.03, 2)) / RATE)
    y = 0.02 * rng.standard_normal((3, samples))
    for pole in poles:
        q = lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], rng.standard_normal(samples))
        y += np.outer(rng.standard_normal(3), q / q.std())
    return rng, y


def told(values: np.ndarray) -> bool:
    return "record.unnamed-force" in codes(check_record(TimeSeries(values, RESPONSES, RATE)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("hits", [[40], [900], [40, 1300, 3100]])
def test_the_force_of_a_hammer_is_told_among_responses(hits: list[int], sign: float) -> None:
    for seed in range(5):
        record = unnamed(measured(hits, 4096, seed))
        record = replace(record, values=record.values * np.array([[sign], [1.0], [1.0]]))
        (said,) = [n for n in check_record(record) if n.code == "record.unnamed-force"]
        assert said.facts["channel"] == "1S+"
    if len(hits) == 3 and sign > 0.0:
        check_shown("record.unnamed-force", said)


def test_a_named_force_is_not_told() -> None:
    assert "record.unnamed-force" not in codes(check_record(measured([40, 1300, 3100], 4096)))


@pytest.mark.slow
def test_ambient_records_with_spikes_and_shocks_have_no_force() -> None:
    count = 0
    for seed in range(60):
        rng, y = moving(seed)
        count += told(y)
        spiked = y.copy()
        at = rng.choice(5800, rng.integers(1, 8), replace=False) + 100
        spiked[0, at] += rng.uniform(20.0, 60.0)
        count += told(spiked)
        both = y.copy()
        # a burst of one sign in every channel, as a fault of the supply makes it
        both[:, at[0] : at[0] + 4] += 40.0
        count += told(both)
        # a shock that all channels follow
        shock = np.zeros(y.shape[1])
        shock[at] = 50.0
        pole = np.exp(pole_of(np.array([30.0]), np.array([0.01])) / RATE)[0]
        free = lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], shock)
        count += told(0.1 * y + np.outer([1.0, 0.5, -0.7], free))
    assert count == 0


def driven(seed: int, force: np.ndarray, share: float = 0.02) -> np.ndarray:
    """Four responses (4, samples) of three modes to one force, with noise."""
    rng = np.random.default_rng([7, seed])
    freq, ratio = rng.uniform(3.0, 60.0, 3), rng.uniform(0.003, 0.02, 3)
    hz = np.fft.rfftfreq(2 * len(force), 1.0 / RATE)
    h = -(hz**2) / (freq[:, None] ** 2 - hz**2 + 2j * ratio[:, None] * freq[:, None] * hz)
    shapes = rng.uniform(0.3, 1.0, (4, 3)) * rng.choice((-1.0, 1.0), (4, 3))
    y = np.fft.irfft(shapes @ (h * shapes[:1].T * np.fft.rfft(force, 2 * len(force))))[:, : len(force)]
    return y + share * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)


def steady(record: TimeSeries) -> list[Notice]:
    """Notices of a channel without hits."""
    return [n for n in check_record(record) if n.code == "record.unnamed-force" and "count" not in n.facts]


def responses_of(values: np.ndarray) -> TimeSeries:
    channels = tuple(Channel(Dof(i + 1, "S"), "acceleration") for i in range(len(values)))
    return TimeSeries(values, channels, sampling_hz=RATE)


@pytest.mark.parametrize("kind", ["random", "sweep", "of a band"])
def test_the_force_of_a_shaker_is_told_among_responses(kind: str) -> None:
    for seed in range(4):
        samples = 20_000
        force = np.random.default_rng([8, seed]).standard_normal(samples)
        if kind == "sweep":
            force = chirp(np.arange(samples) / RATE, 2.0, samples / RATE, 0.45 * RATE)
        if kind == "of a band":
            hz = np.fft.rfftfreq(samples, 1.0 / RATE)
            force = np.fft.irfft(np.fft.rfft(force) * (hz > 2.0) * (hz < 0.35 * RATE))
        y = driven(seed, force)
        record = responses_of(np.vstack([y[:2], 30.0 * force, y[2:]]))
        (said,) = steady(record)
        assert said.facts["channel"] == "3S+"
        # without it, and with a force that is named, nothing is told
        assert steady(responses_of(y)) == []
        named = replace(record.channels[2], quantity="force", role="input")
        assert steady(replace(record, channels=(*record.channels[:2], named, *record.channels[3:]))) == []
    if kind == "random":
        check_shown("record.unnamed-force, steady", said)


@pytest.mark.slow
def test_ambient_records_have_no_force_of_a_shaker() -> None:
    """Neither with a channel of noise alone, nor with one that hardly moves at a support."""
    count = 0
    for seed in range(40):
        rng, y = moving(seed, 20_000)
        count += len(steady(responses_of(y)))
        count += len(steady(responses_of(np.vstack([y, rng.standard_normal(y.shape[1])]))))
        count += len(steady(responses_of(np.vstack([y, 0.01 * y[0] + 0.02 * rng.standard_normal(y.shape[1])]))))
    assert count == 0


@pytest.mark.slow
def test_a_force_among_responses_is_not_told_as_late(tmp_path: Path) -> None:
    """It has other phases than a response in each mode."""
    force = np.random.default_rng(3).standard_normal(60_000)
    np.save(tmp_path / "record.npy", np.vstack([driven(1, force), force]).T)
    made = identify(tmp_path / "record.npy", output=tmp_path / "out", sampling_hz=RATE, band_hz=[2.0, 70.0])
    told = [alert.code for alert in made.record.alerts]
    assert "record.unnamed-force" in told
    assert not {"identify.late-channel", "identify.quadrature"} & set(told)
