"""TimeSeries: sizes, clocks, and channels by role."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.modal import Channel, TimeSeries

_FORCE = Channel(parse_dof("1Z+"), "force", "N", "input")
_MOTIONS = (Channel(parse_dof("1Z+"), "acceleration", "m/s^2"), Channel(parse_dof("2Z-"), "acceleration", "m/s^2"))


def _record(**facts: Any) -> TimeSeries:
    values = np.arange(30.0).reshape(3, 10)
    return TimeSeries(**({"values": values, "channels": (_FORCE, *_MOTIONS), "sampling_hz": 100.0} | facts))


def test_a_force_and_a_motion_may_share_a_dof() -> None:
    assert _record().dofs("response").labels() == ["1Z+", "2Z-"]
    assert _record().dofs("input").labels() == ["1Z+"]


def test_even_times_become_a_rate() -> None:
    record = _record(sampling_hz=None, times_s=2.0 + np.round(np.arange(10) / 64.0, 5))
    assert record.even_hz == pytest.approx(64.0, rel=1e-4)
    assert record.t0_s == 2.0
    np.testing.assert_allclose(record.time_s, 2.0 + np.arange(10) / 64.0, atol=1e-5)


@pytest.mark.parametrize(
    ("rate", "written"),
    [(256.0, "{:.3f}"), (1000.0 / 3.0, "{:.3f}"), (51.2, "{:.2f}"), (2048.0, "{:.6g}"), (1024.0, "{:.4f}")],
)
def test_times_that_were_rounded_when_they_were_written_are_even(rate: float, written: str) -> None:
    n = 20000
    times = np.array([float(written.format(i / rate)) for i in range(n)])
    record = TimeSeries(np.zeros((1, n)), (_FORCE,), times_s=times)
    assert record.even_hz == pytest.approx(rate, rel=1e-6)
    lost = np.delete(times, 700)
    with pytest.raises(FemtuneError, match="not equally spaced"):
        _ = TimeSeries(np.zeros((1, n - 1)), (_FORCE,), times_s=lost).even_hz


def test_a_clock_that_jitters_by_more_than_its_digits_is_uneven() -> None:
    times = np.round(np.arange(2000) / 100.0 + 0.001 * np.sin(np.arange(2000.0) ** 2), 5)
    with pytest.raises(FemtuneError, match="not equally spaced"):
        _ = TimeSeries(np.zeros((1, 2000)), (_FORCE,), times_s=times).even_hz


def test_uneven_times_stay_and_have_no_rate() -> None:
    record = _record(sampling_hz=None, times_s=np.arange(10.0) ** 2)
    np.testing.assert_array_equal(record.select_samples(2, 5).time_s, [4.0, 9.0, 16.0])
    with pytest.raises(FemtuneError) as caught:
        _ = record.even_hz
    check_shown("record.uneven, of arrays", caught.value)


def test_a_part_keeps_the_clock() -> None:
    part = _record(t0_s=5.0).select_samples(3, 7)
    np.testing.assert_allclose(part.time_s, [5.03, 5.04, 5.05, 5.06])
    np.testing.assert_array_equal(part.values[1], [13.0, 14.0, 15.0, 16.0])
    assert part.duration_s == pytest.approx(0.04)


def test_channels_are_selected_in_the_order_asked_for() -> None:
    some = _record().select_channels([2, 0])
    assert some.channels == (_MOTIONS[1], _FORCE)
    np.testing.assert_array_equal(some.values[:, 0], [20.0, 0.0])


@pytest.mark.parametrize(
    ("facts", "code"),
    [
        ({"values": np.ones((2, 10))}, "record.shape"),
        ({"values": np.ones(3)}, "record.shape"),
        ({"values": np.full((3, 10), np.inf)}, "record.values"),
        ({"values": np.ones((3, 10)) * 1j}, "record.values"),
        ({"sampling_hz": None}, "record.times"),
        ({"times_s": np.zeros(10)}, "record.times"),
        ({"times_s": np.arange(9.0)}, "record.times"),
        ({"sampling_hz": 0.0}, "record.rate"),
        ({"sampling_hz": np.nan}, "record.rate"),
        ({"times_s": np.arange(10.0) ** 2}, "record.rate"),
        ({"channels": (_FORCE, *_MOTIONS[:1] * 2)}, "dof.duplicate"),
    ],
)
def test_what_does_not_fit_is_refused(facts: dict[str, Any], code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _record(**facts)
    assert caught.value.code == code


def test_a_rate_that_contradicts_the_times_is_told_with_both() -> None:
    with pytest.raises(FemtuneError) as caught:
        _record(sampling_hz=512.0, times_s=np.arange(10) / 500.0)
    check_shown("record.rate", caught.value)


@pytest.mark.parametrize("words", [{"quantity": "accel"}, {"role": "output"}])
def test_unknown_words_of_a_channel(words: dict[str, str]) -> None:
    with pytest.raises(FemtuneError) as caught:
        Channel(parse_dof("1X+"), **words)
    assert caught.value.code == "record.channel"


def test_a_channel_is_called_by_its_name_or_its_dof() -> None:
    assert [str(_FORCE), str(Channel(parse_dof("1X+"), name="top"))] == ["1Z+", "top"]
