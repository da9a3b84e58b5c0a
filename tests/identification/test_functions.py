"""From records to functions: a simulated structure whose functions are known, with noise on either side."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.messages.shown import check_shown

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.identification.averaging import Averaging, input_output_spectra, undo_exponential
from femtune.identification.estimators import FrfEstimate, estimate_frfs
from femtune.identification.periodic import periodic_frfs, stepped_frfs
from femtune.modal import Channel, TimeSeries

_RATE = 256.0
_N = 1024


def _channels(outputs: int, inputs: int, quantity: str = "acceleration") -> tuple[Channel, ...]:
    forces = [Channel(parse_dof(f"{j + 1}Z+"), "force", "N", "input") for j in range(inputs)]
    return (*forces, *(Channel(parse_dof(f"{i + 1}Z+"), quantity, "m/s^2") for i in range(outputs)))


def _plant(x: np.ndarray) -> np.ndarray:
    """Three outputs of digital filters, whose functions are polynomials in e^{−iω}: (u, n) to (3, n)."""
    y = [lfilter([1.0, -0.5], [1.0, -1.2, 0.8], x[0]), lfilter([0.3], [1.0, 0.4], x[0]), lfilter([0, 1.0], [1.0], x[0])]
    if len(x) > 1:
        y = [y[0] + lfilter([0.2], [1.0, -0.6], x[1]), y[1] - x[1], y[2] + lfilter([1.0, 1.0], [1.0], x[1])]
    return np.array(y)


def _truth(freq: np.ndarray, inputs: int = 1) -> np.ndarray:
    z = np.exp(-2j * np.pi * freq / _RATE)
    first = [(1 - 0.5 * z) / (1 - 1.2 * z + 0.8 * z**2), 0.3 / (1 + 0.4 * z), z]
    second = [0.2 / (1 - 0.6 * z), -np.ones_like(z), 1 + z]
    return np.array([first, second][:inputs]).transpose(1, 0, 2)


def _record(seed: int, inputs: int = 1, noise_y: float = 0.0, noise_x: float = 0.0, n: int = 64 * _N) -> TimeSeries:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((inputs, n))
    y = _plant(x) + noise_y * rng.standard_normal((3, n))
    return TimeSeries(np.vstack([x + noise_x * rng.standard_normal(x.shape), y]), _channels(3, inputs), _RATE)


def _estimate(record: TimeSeries, estimator: str = "H1") -> FrfEstimate:
    return estimate_frfs(input_output_spectra([record], Averaging(_N)), estimator)


def _off(found: FrfEstimate, inputs: int = 1, factor: float = 1.0) -> np.ndarray:
    """Mean relative error of each function over the inner lines."""
    keep = slice(10, -10)
    truth = factor * _truth(found.frfs.freq_hz[keep], inputs)
    return np.abs(np.mean(found.frfs.values[:, :, keep] / truth - 1.0, axis=2))


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_clean_records_give_the_functions(estimator: str) -> None:
    found = _estimate(_record(0), estimator)
    assert found.frfs.kind == "accelerance"
    assert _off(found).max() < 5e-3
    assert found.frfs.coherence is not None
    assert np.median(found.frfs.coherence) > 0.999


def test_each_estimator_is_free_of_the_bias_of_its_own_noise() -> None:
    """Noise of the input of a tenth of its power makes H1 1/1.1 of the truth; that of the responses leaves it alone."""
    assert _off(_estimate(_record(1, noise_y=0.5), "H1")).max() < 0.02
    assert _off(_estimate(_record(1, noise_x=0.1**0.5), "H1"), factor=1 / 1.1).max() < 0.02
    assert _off(_estimate(_record(1, noise_x=0.1**0.5), "H2")).max() < 0.02
    assert _off(_estimate(_record(1, noise_y=0.5), "H2")).max() > 0.1


def test_hv_lies_between_h1_and_h2() -> None:
    record = _record(2, noise_y=0.3, noise_x=0.3)
    h1, h2, hv = (_estimate(record, e).frfs.values[:, :, 5:-5] for e in ("H1", "H2", "Hv"))
    np.testing.assert_allclose(np.abs(hv) ** 2, np.abs(h1) * np.abs(h2), rtol=1e-6)


@pytest.mark.parametrize("estimator", ["H1", "Hv"])
def test_two_references_at_once(estimator: str) -> None:
    found = _estimate(_record(3, inputs=2), estimator)
    assert _off(found, 2).max() < 0.02
    assert np.median(found.multiple_coherence) > 0.999
    assert found.frfs.coherence is not None
    assert np.median(found.frfs.coherence) < 0.9


def test_the_standard_deviation_is_the_scatter() -> None:
    """40 records of 15 overlapping segments: errors over their standard deviations have a mean square of one."""
    ratios = []
    for seed in range(40):
        found = _estimate(_record(seed, noise_y=0.5, n=8 * _N))
        keep = slice(20, -20)
        gap = found.frfs.values[:, 0, keep] - _truth(found.frfs.freq_hz[keep])[:, 0]
        ratios.append(np.abs(gap) ** 2 / found.sd[:, 0, keep] ** 2)
    assert np.median(ratios) == pytest.approx(np.log(2.0), rel=0.15)


def test_overlapping_segments_are_worth_fewer() -> None:
    """Hann segments that overlap by half: their correlation is 1/6, so 15 of them are worth 14.2 (Welch 1967)."""
    spectra = input_output_spectra([_record(0, n=8 * _N)], Averaging(_N))
    assert spectra.averages == pytest.approx(15 / (1 + 2 * (14 / 15) / 36), rel=1e-3)


def test_hits_with_an_exponential_window_have_known_added_damping() -> None:
    """Decays of e^{−2t}: a window of τ = 0.5 s adds 2 rad/s, which is taken away again."""
    t = np.arange(_N) / _RATE
    x = np.zeros((1, _N))
    x[0, 0] = 1.0
    y = np.exp(-2.0 * t) * np.sin(2 * np.pi * 20.0 * t)
    record = TimeSeries(np.vstack([x, y]), _channels(1, 1), _RATE)
    found = estimate_frfs(input_output_spectra([record] * 2, Averaging(_N, 0.0, "boxcar", 0.5)))
    half = np.abs(found.frfs.values[0, 0]) > np.abs(found.frfs.values[0, 0]).max() / np.sqrt(2.0)
    width = 2 * np.pi * np.ptp(found.frfs.freq_hz[half])
    assert width == pytest.approx(2 * 4.0, rel=0.25)
    np.testing.assert_allclose(undo_exponential(np.array([-4.0 + 3j]), 0.5), [-2.0 + 3j])


def test_periodic_signals_have_no_leakage() -> None:
    """A multisine of 40 lines over six periods: exact after the transient, with the noise told where there is some."""
    rng = np.random.default_rng(4)
    lines = np.sort(rng.choice(np.arange(4, 400), 40, replace=False)) * _RATE / _N
    t = np.arange(8 * _N) / _RATE
    x = np.sum(np.cos(2 * np.pi * np.outer(lines, t) + rng.uniform(0, 6, (40, 1))), axis=0)[None]
    record = TimeSeries(np.vstack([x, _plant(x)]), _channels(3, 1), _RATE)
    for given in (None, lines):
        found = periodic_frfs([record], _N, given, skip=2)
        np.testing.assert_allclose(found.frfs.freq_hz, lines)
        np.testing.assert_allclose(found.frfs.values, _truth(lines), rtol=1e-9)
    noisy = [_with_noise(record, seed) for seed in range(30)]
    scores = [
        np.abs(f.frfs.values - _truth(lines)) ** 2 / f.sd**2 for f in (periodic_frfs([r], _N, lines, 2) for r in noisy)
    ]
    # of six repeats |t|² with 2 and 10 degrees of freedom has the median 0.7435
    assert np.median(scores) == pytest.approx(0.7435, rel=0.1)


def test_driven_lines_are_all_from_the_first_above_zero_to_the_last_below_half_the_rate() -> None:
    """An offset and half the sampling rate are no lines of a test, whatever the channel holds there."""
    at = np.array([1, 5, _N // 2 - 1])
    t = np.arange(4 * _N)
    x = np.sum(np.cos(2 * np.pi * np.outer(at, t) / _N), axis=0) + 3.0 + 2.0 * (-1.0) ** t
    found = periodic_frfs([TimeSeries(np.vstack([x, 2.5 * x]), _channels(1, 1), _RATE)], _N)
    np.testing.assert_allclose(found.frfs.freq_hz, at * _RATE / _N)
    np.testing.assert_allclose(found.frfs.values, 2.5)


def _with_noise(record: TimeSeries, seed: int) -> TimeSeries:
    noise = np.random.default_rng(seed).standard_normal(record.values.shape)
    return TimeSeries(record.values + 0.1 * noise, record.channels, _RATE)


def test_two_inputs_need_two_experiments() -> None:
    rng = np.random.default_rng(5)
    t = np.arange(4 * _N) / _RATE
    lines = np.arange(8, 200, 7) * _RATE / _N
    records = []
    for _ in range(2):
        phase = rng.uniform(0, 6, (2, len(lines), 1))
        x = np.array([np.sum(np.cos(2 * np.pi * np.outer(lines, t) + p), axis=0) for p in phase])
        records.append(TimeSeries(np.vstack([x, _plant(x)]), _channels(3, 2), _RATE))
    np.testing.assert_allclose(periodic_frfs(records, _N, lines).frfs.values, _truth(lines, 2), rtol=1e-8)
    with pytest.raises(FemtuneError) as caught:
        periodic_frfs(records[:1], _N, lines)
    assert caught.value.code == "identify.experiments"


def test_stepped_lines_need_not_fit_the_length() -> None:
    steps = []
    freq = np.array([[3.1234, 17.77], [31.41, 5.005], [77.123, 90.9]])
    for pair in freq:
        t = np.arange(3000) / _RATE
        x = np.sum(np.cos(2 * np.pi * pair[:, None] * t), axis=0)[None]
        whole = TimeSeries(np.vstack([x, _plant(x)]), _channels(3, 1), _RATE)
        steps.append((whole.select_samples(500, 3000), pair))
    found = stepped_frfs(steps)
    np.testing.assert_allclose(found.frfs.freq_hz, np.sort(freq.ravel()))
    np.testing.assert_allclose(found.frfs.values, _truth(found.frfs.freq_hz), rtol=1e-9)


def _periodic(samples: int) -> TimeSeries:
    return _record(0, n=samples)


@pytest.mark.parametrize(
    ("call", "code"),
    [
        (lambda: estimate_frfs(input_output_spectra([_record(0)], Averaging(_N)), "H3"), "identify.estimator"),
        (lambda: estimate_frfs(input_output_spectra([_record(0, 2)], Averaging(_N)), "H2"), "identify.estimator"),
        (lambda: Averaging(2), "identify.averaging"),
        (lambda: Averaging(64, overlap=1.0), "identify.averaging"),
        (lambda: input_output_spectra([_record(0, n=1000)], Averaging(_N)), "identify.short-record"),
        (lambda: input_output_spectra([_record(0), _record(0, 2)], Averaging(_N)), "identify.records-differ"),
        (lambda: input_output_spectra([_record(0).select_channels([1, 2])], Averaging(_N)), "identify.no-input"),
        (lambda: input_output_spectra([], Averaging(_N)), "identify.no-input"),
        (lambda: periodic_frfs([_periodic(2 * _N + 5)], _N), "identify.few-periods"),
        (lambda: periodic_frfs([_periodic(8 * _N)], _N, np.array([1.1])), "identify.not-a-line"),
        (lambda: stepped_frfs([(_periodic(256), [10.0, 11.0])]), "identify.step-too-short"),
    ],
)
def test_what_cannot_be_done_is_refused(call: Any, code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        call()
    assert caught.value.code == code


def test_records_at_other_rates_are_not_averaged() -> None:
    record = _record(0)
    with pytest.raises(FemtuneError) as caught:
        input_output_spectra([record, TimeSeries(record.values, record.channels, 2.0 * _RATE)], Averaging(_N))
    check_shown("identify.records-differ", caught.value)


def test_one_signal_on_two_inputs_is_refused() -> None:
    record = _record(0, 2)
    values = record.values.copy()
    values[1] = 2.0 * values[0]
    with pytest.raises(FemtuneError) as caught:
        _estimate(TimeSeries(values, record.channels, _RATE))
    assert caught.value.code == "identify.same-inputs"


def test_lost_samples_and_unknown_quantities_are_refused() -> None:
    record = _record(0)
    values = record.values.copy()
    values[2, 7] = np.nan
    with pytest.raises(FemtuneError) as caught:
        _estimate(TimeSeries(values, record.channels, _RATE))
    assert caught.value.code == "record.lost-samples"
    assert caught.value.values == {"samples lost": "2Z+: 1", "first gap": "2Z+: 1 samples from 0.0273438 s"}
    with pytest.raises(FemtuneError) as caught:
        _estimate(TimeSeries(record.values, _channels(3, 1, "strain"), _RATE))
    assert caught.value.code == "identify.response-quantity"
