"""Whole records with one force: no leakage, transients of the ends fitted, noise found from the lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.dofs import Dof
from femtune.identification import InputKnown, identify_frfs
from femtune.identification.hammer import samples_before
from femtune.identification.modal_fit import fit_modes
from femtune.identification.shapes import as_modes
from femtune.identification.whole_record import MOST_VALUES, binned, in_bins, whole_record
from femtune.modal import Channel, TimeSeries, pole_of

RATE, SECONDS, BAND = 128.0, 40.0, (6.0, 40.0)
FREQ, DAMPING = np.array([9.0, 17.0, 29.0]), np.array([0.002, 0.004, 0.01])
SHAPES = np.array([[1.0, 0.7, -0.5], [0.6, -0.9, 0.8]])
CHANNELS = (*(Channel(Dof(i, "Z"), "acceleration") for i in (1, 2)), Channel(Dof(1, "Z"), "force", role="input"))
NOISE = 0.01


def measured(
    seed: int,
    freq: np.ndarray = FREQ,
    damping: np.ndarray = DAMPING,
    shapes: np.ndarray = SHAPES,
    noise: float = NOISE,
) -> tuple[TimeSeries, np.ndarray]:
    """A record cut out of a longer one under a random force, and the noise of its responses."""
    rng, samples = np.random.default_rng(seed), round(SECONDS * RATE)
    length, begin = 4 * samples, round(5.0 * RATE)
    hz = np.fft.rfftfreq(length, 1.0 / RATE)
    force = np.zeros(length)
    force[: samples + 2 * begin] = rng.standard_normal(samples + 2 * begin)
    lines = np.fft.rfft(force) * (hz < 0.4 * RATE)
    omega, own = 2.0 * np.pi * hz, 2.0 * np.pi * freq[:, None]
    modal = -(omega**2) / (own**2 - omega**2 + 2j * damping[:, None] * own * omega) * shapes[0][:, None]
    motion = np.fft.irfft(shapes @ modal * lines, length)[:, begin : begin + samples]
    sd = noise * motion.std(axis=1)
    noisy = motion + sd[:, None] * rng.standard_normal(motion.shape)
    values = np.vstack([noisy, np.fft.irfft(lines, length)[begin : begin + samples]])
    channels = (*CHANNELS[: len(shapes)], CHANNELS[-1])
    return TimeSeries(values, channels, RATE), sd


START = pole_of(1.002 * FREQ, 1.5 * DAMPING)


def test_the_fit_of_a_whole_record_has_no_leakage_and_knows_its_errors() -> None:
    inside, errors = 0, []
    for seed in range(12):
        whole = whole_record(measured(seed)[0], "accelerance", *BAND)
        assert whole is not None
        modes = as_modes(fit_modes(whole.frfs, START, None, whole=whole))
        assert modes.freq_sd_hz is not None
        assert modes.damping_sd is not None
        assert modes.damping_ratio is not None
        score = np.append((modes.freq_hz - FREQ) / modes.freq_sd_hz, (modes.damping_ratio - DAMPING) / modes.damping_sd)
        inside += int(np.sum(np.abs(score) <= 1.96))
        errors.append(modes.damping_ratio / DAMPING - 1.0)
    # 95 % of 72 with a probability of 0.999
    assert inside >= 60
    assert np.sqrt(np.mean(np.square(errors))) < 0.01


def test_without_the_transients_of_the_ends_the_damping_is_wrong() -> None:
    whole = whole_record(measured(0)[0], "accelerance", *BAND)
    assert whole is not None
    plain = as_modes(fit_modes(whole.frfs, START, None))
    assert plain.damping_ratio is not None
    assert np.abs(plain.damping_ratio / DAMPING - 1.0).max() > 0.05


@pytest.mark.slow
def test_a_record_of_two_pieces_has_the_transients_of_both() -> None:
    inside, far = 0, 0
    for seed in range(12):
        record = measured(seed)[0]
        # what comes between them is lost; the second piece begins in motion
        values = np.hstack([record.values[:, :2000], record.values[:, 3100:]])
        pieces = replace(record, values=values)
        for begins in ((0, 2000), (0,)):
            whole = whole_record(pieces, "accelerance", *BAND, begins=begins)
            assert whole is not None
            modes = as_modes(fit_modes(whole.frfs, START, None, whole=whole))
            assert modes.freq_sd_hz is not None
            assert modes.damping_sd is not None
            assert modes.damping_ratio is not None
            of_freq = (modes.freq_hz - FREQ) / modes.freq_sd_hz
            score = np.abs(np.append(of_freq, (modes.damping_ratio - DAMPING) / modes.damping_sd))
            if len(begins) == 2:
                inside += int(np.sum(score <= 1.96))
                error = float(np.abs(modes.damping_ratio / DAMPING - 1.0).max())
                assert error < 0.03
            else:
                far += int(np.sum(score > 1.96))
    # 95 % of 72 with a probability of 0.999
    assert inside >= 60
    assert far > 20


def test_the_noise_of_two_pieces_is_that_of_one() -> None:
    record, sd = measured(3)
    pieces = replace(record, values=np.hstack([record.values[:, :2000], record.values[:, 3100:]]))
    whole = whole_record(pieces, "accelerance", *BAND, begins=(0, 2000))
    assert whole is not None
    assert np.median(whole.noise, axis=1) / np.sqrt(pieces.samples) == pytest.approx(sd, rel=0.15)


def test_the_noise_is_found_between_the_lines() -> None:
    record, sd = measured(3)
    whole = whole_record(record, "accelerance", *BAND)
    assert whole is not None
    # the transform of white noise has √(samples) of it at each line
    found = np.median(whole.noise, axis=1) / np.sqrt(record.samples)
    assert found == pytest.approx(sd, rel=0.15)
    frfs, errors = binned(in_bins(whole, 300))
    assert len(frfs.freq_hz) <= 300
    # single lines are where they were
    assert np.array_equal(binned(in_bins(whole, 10_000))[0].freq_hz, whole.frfs.freq_hz)
    exact = np.array([9.0, 17.0, 29.0])
    assert frfs.freq_hz[0] == pytest.approx(BAND[0], abs=0.1)
    assert errors.shape == frfs.values.shape
    quiet = np.min(np.abs(frfs.freq_hz[:, None] - exact), axis=1) > 3.0
    rough = np.abs(np.diff(frfs.values[0, 0], 2))[quiet[1:-1]] / np.sqrt(6.0)
    # leakage of the ends and rounding of the bins add to the noise
    assert 0.3 < np.median(errors[0, 0, 1:-1][quiet[1:-1]] / rough) < 2.0


def test_modes_are_identified_from_a_whole_record() -> None:
    whole = whole_record(measured(1)[0], "accelerance", *BAND)
    assert whole is not None
    whole = in_bins(whole, 400)
    frfs, sd = binned(whole)
    found = identify_frfs(frfs, InputKnown(BAND, 20), sd, whole)
    assert found.modes.freq_hz == pytest.approx(FREQ, rel=1e-4)
    assert found.modes.damping_ratio == pytest.approx(DAMPING, rel=0.03)
    assert found.measured.freq_hz == pytest.approx(frfs.freq_hz)
    assert found.fit.synthesised.values.shape == frfs.values.shape
    # without the transients of the ends the functions shown are nearer to those of the structure
    exact = found.fit.synthesised.values
    shown, before = (float(np.linalg.norm(one - exact)) for one in (found.measured.values, frfs.values))
    assert shown < 0.5 * before
    # 1 % of noise is 1e-4 of the power of all lines, and more between the resonances
    coherence = found.measured.coherence
    assert coherence is not None
    assert coherence.shape == frfs.values.shape
    near = [int(np.argmin(np.abs(frfs.freq_hz - f))) for f in FREQ]
    assert coherence[:, 0, near].min() > 0.99
    assert coherence.max() < 1.0


def test_records_with_too_many_or_too_few_lines_or_a_silent_force_are_not_for_this() -> None:
    record, _ = measured(0)
    assert whole_record(record, "accelerance", 9.0, 10.0) is None
    silent = record.values.copy()
    silent[2] = 0.0
    assert whole_record(TimeSeries(silent, CHANNELS, RATE), "accelerance", *BAND) is None
    long = TimeSeries(np.zeros((3, 5 * MOST_VALUES // 2)), CHANNELS, RATE)
    assert whole_record(long, "accelerance", 1.0, 60.0) is None


def one_hit(seed: int, before: float = 0.0, noise: float = 1e-3) -> TimeSeries:
    """A hit in a record that ends before its response does; `before`: what moves already, relative to the response."""
    rng, samples = np.random.default_rng(seed), 2048
    force = np.zeros(8 * samples)
    force[40:45] = [0.2, 0.8, 1.0, 0.8, 0.2]
    hz = np.fft.rfftfreq(len(force), 1.0 / RATE)
    low_pass = 0.5 * (1.0 + np.cos(np.pi * np.clip((hz - 44.0) / 18.0, 0.0, 1.0)))
    lines, omega, own = np.fft.rfft(force) * low_pass, 2.0 * np.pi * hz, 2.0 * np.pi * FREQ[:, None]
    modal = -(omega**2) / (own**2 - omega**2 + 2j * DAMPING[:, None] * own * omega) * SHAPES[0][:, None]
    values = np.fft.irfft(np.vstack([SHAPES @ modal * lines, lines]), len(force))[:, :samples]
    values[:2] += before * values[:2].std() * np.sin(2.0 * np.pi * FREQ[0] * np.arange(samples) / RATE)
    values[:2] += noise * values[:2].std(axis=1, keepdims=True) * rng.standard_normal((2, samples))
    return TimeSeries(values, CHANNELS, RATE)


@pytest.mark.slow
def test_a_hit_whose_response_is_cut_has_no_bias() -> None:
    found, plain = [], []
    for seed in range(12):
        record = one_hit(seed)
        whole = whole_record(record, "accelerance", *BAND, rest=samples_before(record))
        assert whole is not None
        modes = as_modes(fit_modes(whole.frfs, START, None, whole=whole))
        # the same functions as if the response had decayed
        cut = as_modes(fit_modes(whole.frfs, START, None))
        for some, out in ((modes, found), (cut, plain)):
            assert some.damping_ratio is not None
            assert some.damping_sd is not None
            out.append((some.damping_ratio - DAMPING) / some.damping_sd)
    # 95 % of 36 with a probability of 0.999
    assert np.sum(np.abs(found) <= 1.96) >= 28
    # the response at 9 Hz has decayed to 16 % at the end
    assert (np.array(plain)[:, 0] > 4.0).all()


def test_a_record_with_one_hit_must_begin_at_rest() -> None:
    record = one_hit(0, before=0.2)
    assert whole_record(record, "accelerance", *BAND, rest=samples_before(record)) is None
    assert whole_record(one_hit(0), "accelerance", *BAND, rest=2) is None


def test_the_decays_that_the_end_cuts_off_are_those_of_the_hit_and_not_of_the_noise_of_its_force() -> None:
    record = one_hit(0)
    before = samples_before(record)
    exact = whole_record(record, "accelerance", *BAND, rest=before)
    values = record.values.copy()
    noise = 1e-3 * np.random.default_rng(1).standard_normal(record.samples)
    values[2] += noise
    whole = whole_record(replace(record, values=values), "accelerance", *BAND, rest=before)
    assert exact is not None
    assert exact.pulse is not None
    assert whole is not None
    assert whole.pulse is not None
    # 5 samples, their low-pass, and those beside them, out of 2048
    assert np.count_nonzero(whole.pulse) < 64
    # without noise all but rounding is kept: 6 decimals of the columns
    everything = replace(exact, pulse=record.values[2] - np.median(record.values[2]))
    columns, all_columns = (one.basis(START, ("upper",)).columns for one in (exact, everything))
    np.testing.assert_allclose(columns, all_columns, rtol=1e-6, atol=1e-6 * np.abs(all_columns).max())
    # U at the lines is the same for the pulse with and without the noise
    noisy, of_noise = (
        replace(exact, pulse=pulse).basis(START, ("upper",)).columns for pulse in (whole.pulse, values[2])
    )
    away, away_of_noise = (np.abs(one - columns).max() for one in (noisy, of_noise))
    assert away < 0.01 * np.abs(columns).max()
    assert away < 0.2 * away_of_noise


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.04, 0.0015])
def test_close_modes_of_one_response_are_two(apart: float) -> None:
    freq, damping = np.array([9.0, 17.0, 17.0 * (1.0 + apart), 29.0]), np.array([0.004, 0.006, 0.007, 0.01])
    whole = whole_record(measured(1, freq, damping, np.array([[1.0, 0.7, 0.6, -0.5]]), 1e-4)[0], "accelerance", *BAND)
    assert whole is not None
    whole = in_bins(whole, 1000)
    frfs, sd = binned(whole)
    found = identify_frfs(frfs, InputKnown(BAND, 40), sd, whole)
    assert len(found.modes) == 4
    assert found.modes.freq_sd_hz is not None
    assert (np.abs(found.modes.freq_hz - freq) < 4.0 * found.modes.freq_sd_hz).all()
    assert found.modes.damping_ratio == pytest.approx(damping, rel=0.2)
    chosen = [c for c in found.candidates if c.chosen]
    assert [c.divided for c in chosen] == [False, apart < 0.01, apart < 0.01, False]
