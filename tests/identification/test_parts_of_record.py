"""Standard deviations of modes that change during a record contain the scatter of its parts."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import Dof
from femtune.identification.force_noise import with_force_noise
from femtune.identification.modal_fit import ModalFit, fit_modes
from femtune.identification.parts_of_record import with_parts_of_time
from femtune.identification.shapes import as_modes, fit_remarks, scaled_shapes
from femtune.identification.whole_record import whole_record
from femtune.modal import Channel, TimeSeries, pole_of

RATE, BLOCK, BAND = 128.0, 1024, (6.0, 40.0)
FREQ, DAMPING = np.array([9.0, 17.0, 29.0]), np.array([0.01, 0.008, 0.012])
SHAPES = np.array([[1.0, 0.7, -0.5], [0.6, -0.9, 0.8]])
CHANNELS = (*(Channel(Dof(i, "Z"), "acceleration") for i in (1, 2)), Channel(Dof(1, "Z"), "force", role="input"))


def fitted(
    seed: int,
    changes: float = 0.0,
    parts: int = 6,
    *,
    bursts: bool = False,
    force: float = 0.0,
    follows: float = 0.0,
    sizes: tuple[float, float] = (0.7, 1.3),
) -> ModalFit:
    """The fit of a record whose frequencies change from hit to hit, or from burst to burst.

    Parameters
    ----------
    changes : relative standard deviation of the frequencies
    force : noise of the force relative to its rms
    follows : relative change of the frequencies with the square of the force
    sizes : of the force
    """
    rng, samples = np.random.default_rng(seed), parts * BLOCK
    omega = 2.0 * np.pi * np.fft.rfftfreq(2 * samples, 1.0 / RATE)
    values = np.zeros((3, samples))
    for i in range(parts):
        single = np.zeros(2 * samples)
        at, size = i * BLOCK + 40, rng.uniform(*sizes)
        if bursts:
            single[at : at + BLOCK // 2] = size * rng.standard_normal(BLOCK // 2)
        else:
            single[at] = size
        lines = np.fft.rfft(single) * (omega < 0.8 * np.pi * RATE)
        own = 2.0 * np.pi * FREQ[:, None] * (1.0 + follows * size**2 + changes * rng.standard_normal((3, 1)))
        modal = -(omega**2) / (own**2 - omega**2 + 2j * DAMPING[:, None] * own * omega) * SHAPES[0][:, None]
        values[:2] += np.fft.irfft(SHAPES @ modal * lines)[:, :samples]
        values[2] += np.fft.irfft(lines)[:samples]
    noise = np.array([0.003, 0.003, force])[:, None] * values.std(axis=1, keepdims=True)
    record = TimeSeries(values + noise * rng.standard_normal(values.shape), CHANNELS, RATE)
    whole = whole_record(record, "accelerance", *BAND)
    assert whole is not None
    fit = with_force_noise(fit_modes(whole.frfs, pole_of(FREQ, DAMPING), None, whole=whole), whole)
    return with_parts_of_time(fit, whole)


def scores(fit: ModalFit) -> np.ndarray:
    """(3,) errors of the frequencies in standard deviations."""
    modes = as_modes(fit)
    assert modes.freq_sd_hz is not None
    return np.asarray((modes.freq_hz - FREQ) / modes.freq_sd_hz)


@pytest.mark.slow
@pytest.mark.parametrize(("bursts", "force"), [(False, 0.0), (True, 0.0), (True, 0.001)])
def test_nothing_is_added_where_nothing_changes(bursts: bool, force: float) -> None:
    raised = [fitted(seed, bursts=bursts, force=force).by_parts is not None for seed in range(20)]
    # one mode in a thousand is by chance
    assert sum(raised) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("bursts", [False, True])
def test_intervals_hold_the_mean_of_frequencies_that_change_from_part_to_part(bursts: bool) -> None:
    fits = [fitted(seed, 0.0005, bursts=bursts) for seed in range(20)]
    added = np.concatenate([fit.by_parts > 1.0 if fit.by_parts is not None else np.zeros(3, bool) for fit in fits])
    error = np.concatenate([scores(fit) for fit in fits])
    noise = [fit.by_noise if fit.by_noise is not None else np.ones(3) for fit in fits]
    assert added.mean() > 0.8
    # 95 % of 60 with a probability of 0.99; by noise alone less than half
    assert np.sum(np.abs(error) <= 1.96) >= 52
    assert np.mean(np.abs(error / np.concatenate(noise)) <= 1.96) < 0.5


def test_the_part_of_noise_is_told() -> None:
    fit = fitted(0, 0.001)
    assert fit.by_noise is not None
    told = [r for r in fit_remarks(fit, scaled_shapes(fit)) if r.notice.code == "identify.parts-disagree"]
    assert [r.mode for r in told] == [0, 1, 2]
    assert not any(r.doubtful for r in told)
    assert f"{1.0 / fit.by_noise[0]:.1f} times those of noise alone" in str(told[0].notice)
    check_shown("identify.parts-disagree", told[0].notice)


@pytest.mark.long
@pytest.mark.parametrize("bursts", [False, True])
def test_frequencies_that_change_by_chance_do_not_follow_the_force(bursts: bool) -> None:
    fits = [fitted(seed, 0.0007, bursts=bursts) for seed in range(16)]
    tested = [
        fit.by_force[fit.by_parts > 1.0, 0] for fit in fits if fit.by_parts is not None and fit.by_force is not None
    ]
    told = np.isfinite(np.concatenate(tested))
    assert len(told) > 30
    # 1 % of 48 with a probability of 0.998
    assert told.sum() <= 3


@pytest.mark.slow
@pytest.mark.parametrize("bursts", [False, True])
@pytest.mark.parametrize("follows", [-0.002, 0.002])
def test_frequencies_that_follow_the_force_are_told(bursts: bool, follows: float) -> None:
    fits = [fitted(seed, bursts=bursts, follows=follows, sizes=(0.5, 1.5)) for seed in range(8)]
    found = np.concatenate([fit.by_force for fit in fits if fit.by_force is not None])
    told = np.isfinite(found[:, 0])
    # six bursts of a random force load a mode by chance, beside their size
    assert told.mean() > (0.4 if bursts else 0.7)
    assert (np.sign(found[told, 0]) == np.sign(follows)).all()
    # the largest of the square is 2.25
    assert (np.abs(found[told, 0]) < 1.3 * 2.25 * abs(follows)).all()


def test_what_follows_the_force_is_told() -> None:
    fit = fitted(0, follows=-0.002, sizes=(0.5, 1.5))
    told = [r for r in fit_remarks(fit, scaled_shapes(fit)) if r.notice.code == "identify.parts-disagree"]
    assert [r.mode for r in told] == [0, 1, 2]
    check_shown("identify.parts-disagree, force", told[0].notice)
