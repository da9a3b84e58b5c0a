"""A hammer's force among the responses is told; spikes, shocks and free decays of responses are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.messages.shown import check_shown

from femtune.dofs import Dof
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
