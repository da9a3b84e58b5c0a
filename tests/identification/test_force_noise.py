"""Noise of a recorded force is in the errors of modes, and lines that have more of it count less."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import Dof
from femtune.identification import force_noise
from femtune.identification.force_noise import with_force_noise
from femtune.identification.modal_fit import fit_modes
from femtune.identification.shapes import as_modes
from femtune.identification.whole_record import WholeRecord, whole_record
from femtune.modal import Channel, ModeSet, TimeSeries, pole_of

RATE, SAMPLES, BAND = 128.0, 4096, (6.0, 40.0)
FREQ, DAMPING = np.array([9.0, 17.0, 29.0]), np.array([0.004, 0.006, 0.01])
SHAPES = np.random.default_rng(3).uniform(-1.0, 1.0, (6, 3)) + np.array([[0.5], [0], [0], [0], [0], [0]])
CHANNELS = (*(Channel(Dof(i + 1, "Z")) for i in range(6)), Channel(Dof(1, "Z"), "force", role="input"))
START = pole_of(FREQ, DAMPING)


def measured(seed: int, of_force: float, of_responses: float = 1e-3) -> WholeRecord:
    """A random force over half of a record from rest, with noise relative to the rms of each channel."""
    rng, hz = np.random.default_rng(seed), np.fft.rfftfreq(4 * SAMPLES, 1.0 / RATE)
    force = np.zeros(4 * SAMPLES)
    force[: SAMPLES // 2] = rng.standard_normal(SAMPLES // 2)
    lines, omega, own = np.fft.rfft(force) * (hz < 50.0), 2.0 * np.pi * hz, 2.0 * np.pi * FREQ[:, None]
    modal = -(omega**2) / (own**2 - omega**2 + 2j * DAMPING[:, None] * own * omega) * SHAPES[0][:, None]
    values = np.fft.irfft(np.vstack([SHAPES @ modal * lines, lines]), 4 * SAMPLES)[:, :SAMPLES]
    levels = np.append(np.full(6, of_responses), of_force) * values.std(axis=1)
    noisy = values + levels[:, None] * rng.standard_normal(values.shape)
    whole = whole_record(TimeSeries(noisy, CHANNELS, RATE), "accelerance", *BAND)
    assert whole is not None
    return whole


def scores(modes: ModeSet) -> np.ndarray:
    """Errors over their standard deviations, of frequencies and damping ratios."""
    assert modes.freq_sd_hz is not None
    assert modes.damping_sd is not None
    assert modes.damping_ratio is not None
    return np.append((modes.freq_hz - FREQ) / modes.freq_sd_hz, (modes.damping_ratio - DAMPING) / modes.damping_sd)


@pytest.mark.slow
def test_errors_of_modes_have_the_noise_of_the_force() -> None:
    before, after = [], []
    for seed in range(40):
        whole = measured(seed, 1e-3)
        fit = fit_modes(whole.frfs, START, None, whole=whole)
        before.append(scores(as_modes(fit)))
        after.append(scores(as_modes(with_force_noise(fit, whole))))
    # without it the errors are twice what their standard deviations say
    assert np.sqrt(np.mean(np.square(before))) > 1.6
    # 240 scores: their mean square has a standard deviation of 0.09
    assert 0.7 < np.mean(np.square(after)) < 1.3
    # 95 % of 240 with a probability of 0.999
    assert np.sum(np.abs(after) <= 1.96) >= 217


@pytest.mark.slow
@pytest.mark.parametrize("way", ["fitted again", "errors raised", "errors from some lines"])
def test_errors_of_residues_are_those_that_their_covariance_states(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = SHAPES * SHAPES[0] / (2j * START.imag)
    if way != "fitted again":
        monkeypatch.setattr(force_noise, "MOST_UNKNOWNS", 10)
    scores = []
    for seed in range(40):
        whole = measured(seed, 1e-3)
        if way == "errors from some lines":
            monkeypatch.setattr(force_noise, "MOST_NUMBERS", whole.frfs.values.size * 2 * 3 // 2)
        fit = with_force_noise(fit_modes(whole.frfs, START, None, whole=whole), whole)
        effect = fit.pole_effect[:, 0]
        covariance = fit.own_covariance[:, 0] + effect @ fit.pole_covariance @ effect.transpose(0, 1, 3, 2)
        error = fit.residues[:, 0] - truth
        both = np.stack([error.real, error.imag], axis=-1)[..., None]
        scores.append(0.5 * (both.transpose(0, 1, 3, 2) @ np.linalg.solve(covariance, both))[..., 0, 0])
    # of each mode: half a χ² of two degrees of freedom, which the functions share in part
    assert 0.8 < np.mean(scores) < 1.25
    assert (np.abs(np.mean(scores, axis=(0, 1)) - 1.0) < 0.45).all()


@pytest.mark.slow
def test_a_fit_without_noise_of_the_force_stays() -> None:
    kept = 0
    for seed in range(10):
        whole = measured(seed, 0.0)
        fit = fit_modes(whole.frfs, START, None, whole=whole)
        kept += with_force_noise(fit, whole) is fit
    assert kept >= 9


def test_with_many_responses_only_the_errors_are_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = measured(1, 3e-3)
    fit = fit_modes(whole.frfs, START, None, whole=whole)
    again = with_force_noise(fit, whole)
    monkeypatch.setattr(force_noise, "MOST_UNKNOWNS", 10)
    raised = with_force_noise(fit, whole)
    np.testing.assert_array_equal(raised.poles, fit.poles)
    assert (np.abs(again.poles - fit.poles) > 0.0).all()
    plain, wide, best = (np.sqrt(np.diag(f.pole_covariance)) for f in (fit, raised, again))
    assert (wide > 1.5 * plain).all()
    # a long record: from a quarter of its lines
    monkeypatch.setattr(force_noise, "MOST_NUMBERS", whole.frfs.values.size * 2 * 3 // 4)
    some = np.sqrt(np.diag(with_force_noise(fit, whole).pole_covariance))
    np.testing.assert_allclose(some, wide, rtol=0.35)
    # the fit with the right weights has smaller errors than the other one
    assert (best < 1.02 * wide).all()
    np.testing.assert_allclose(again.synthesised.values, fit.synthesised.values, rtol=0.05, atol=1e-2)
    assert (np.linalg.eigvalsh(again.own_covariance.reshape(-1, 2, 2)) > 0.0).all()
