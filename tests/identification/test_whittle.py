"""Likelihood of spectra: derivatives, information and what it finds, beside closed forms and simulated lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.identification.whittle import (
    ModalSpectrum,
    SpectrumLines,
    derivatives,
    expected,
    fit,
    in_bins,
    information,
    misfit,
    moved,
    objective,
    score,
    spread,
)

STEP = 0.01
"""Distance of the lines of a record of 100 s, Hz."""


def spectrum(freq: list[float], ratio: list[float], channels: int, noise: float = 1e-4, seed: int = 0) -> ModalSpectrum:
    rng = np.random.default_rng(seed)
    f, z = np.array(freq), np.array(ratio)
    shapes = rng.uniform(0.3, 1.0, (channels, len(f))) * rng.choice((-1.0, 1.0), (channels, len(f)))
    root = rng.standard_normal((len(f), len(f) + 2))
    own, unit = 2.0 * np.pi * f, 2.0 * np.pi * float(f.mean())
    return ModalSpectrum(
        f, z, shapes, root @ root.T, np.full(channels, noise), np.arange(channels) % 3.0, 2.0 * z * own**2, unit,
        np.zeros(0),
    )  # fmt: skip


def transform(s: ModalSpectrum, hz: np.ndarray, seed: int) -> np.ndarray:
    """(n, k) lines drawn from the model."""
    rng = np.random.default_rng([1, seed])
    lower = np.linalg.cholesky(s.at(2.0 * np.pi * np.maximum(hz, STEP)))
    z = rng.standard_normal((2, len(hz), len(s.noise)))
    return np.einsum("kij,kj->ik", lower, z[0] + 1j * z[1]) / np.sqrt(2.0)


def drawn(s: ModalSpectrum, band: tuple[float, float], seed: int = 0) -> tuple[SpectrumLines, np.ndarray]:
    hz = STEP * np.arange(round(band[1] / STEP) + 2)
    values = transform(s, hz, seed)
    poles = 2.0 * np.pi * s.freq_hz * (1j - s.damping_ratio)
    return in_bins(values, STEP, (hz >= band[0]) & (hz <= band[1]), poles, s.derivatives), values


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("colour", [0, 2])
def test_gradient_and_derivatives_are_those_of_differences(channels: int, colour: int) -> None:
    s = replace(spectrum([3.0, 3.2, 5.0], [0.02, 0.03, 0.01], channels), colour=0.3 * np.ones(colour))
    lines, _ = drawn(s, (2.0, 6.0))
    free = np.array([0, 2])
    # away from the minimum
    s = moved(s, free, 0.01 * np.cos(np.arange(4 + 2 * (channels - 1) + 6 + channels + colour)))
    _, gradient = information(s, lines, free)
    x, y = derivatives(s, lines.omega, free)
    for i in range(len(gradient)):
        step = np.zeros(len(gradient))
        step[i] = 1e-5 * max(1.0, float(np.abs(s.forces).max()) if i >= 4 + 2 * (channels - 1) else 1.0)
        ahead, behind = moved(s, free, step), moved(s, free, -step)
        slope = (objective(ahead, lines) - objective(behind, lines)) / (2.0 * step[i])
        assert slope == pytest.approx(gradient[i], rel=1e-4, abs=1e-3 * np.abs(gradient).max())
        if i < x.shape[2]:
            moves = (ahead.at(lines.omega) - behind.at(lines.omega)) / (2.0 * step[i])
            half = x[:, :, i, None] * y[:, None, :, i].conj()
            assert np.allclose(half + half.conj().transpose(0, 2, 1), moves, rtol=1e-5, atol=1e-6 * np.abs(moves).max())


def test_the_information_is_the_closed_form_of_one_mode() -> None:
    freq, ratio, reach = 10.0, 0.01, 10.0
    s = spectrum([freq], [ratio], 2, noise=1e-9)
    s = replace(s, derivatives=np.zeros(2))
    lines, _ = drawn(s, (freq * (1.0 - reach * ratio), freq * (1.0 + reach * ratio)))
    found = fit(s, lines, np.array([0]), rounds=0)
    cycles, turn = freq / STEP, np.arctan(reach)
    # Au (2014), Mechanical Systems and Signal Processing 43: uncertainty law of well separated modes
    of_freq = 2.0 / np.pi * (turn - reach / (reach**2 + 1.0))
    of_ratio = 2.0 / np.pi * (turn + reach / (reach**2 + 1.0) - 2.0 * turn**2 / reach)
    assert found.covariance[0, 0] == pytest.approx(ratio / (2.0 * np.pi * cycles * of_freq), rel=0.05)
    assert found.covariance[1, 1] == pytest.approx(1.0 / (2.0 * np.pi * ratio * cycles * of_ratio), rel=0.05)


@pytest.mark.slow
def test_estimates_scatter_as_the_information_says() -> None:
    true = spectrum([6.0, 6.3, 9.0], [0.02, 0.02, 0.015], 3, noise=1e-2)
    free, errors, by_time = np.arange(3), [], []
    for seed in range(60):
        lines, values = drawn(true, (4.0, 11.0), seed)
        start = moved(true, free, np.r_[0.002 * np.ones(3), 0.2 * np.ones(3), np.zeros(6 + 6 + 3)])
        found = fit(expected(start, lines, 5), lines, free)
        s, sd = found.spectrum, np.sqrt(np.diag(found.covariance))
        error = np.r_[s.freq_hz / true.freq_hz - 1.0, s.damping_ratio / true.damping_ratio - 1.0]
        errors.append(error / sd[:6])
        by_time.append(spread(found, lines, values, 10) / sd[:6])
        assert misfit(found, lines) < 4.0
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.12)
    assert np.mean(np.abs(errors) < 1.96) == pytest.approx(0.95, abs=0.03)
    assert np.sqrt(np.mean(np.square(by_time))) == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_a_missing_mode_and_a_coloured_load_are_seen() -> None:
    true = spectrum([6.0, 6.3], [0.02, 0.02], 2, noise=1e-2)
    lines, _ = drawn(true, (4.0, 9.0))
    one = replace(
        true, freq_hz=true.freq_hz[:1], damping_ratio=true.damping_ratio[:1], shapes=true.shapes[:, :1],
        forces=true.forces[:1, :1], size=true.size[:1],
    )  # fmt: skip
    assert misfit(fit(expected(one, lines, 10), lines, np.array([0])), lines) > 20.0
    whole = fit(true, lines, np.arange(2))
    assert score(whole, lines, 2) < 14.0
    coloured, _ = drawn(replace(true, colour=np.array([3.0, 0.0])), (4.0, 9.0))
    white = fit(true, coloured, np.arange(2))
    assert score(white, coloured, 2) > 20.0


def test_expectation_maximisation_never_lowers_the_likelihood() -> None:
    true = spectrum([6.0, 7.0], [0.02, 0.02], 3, noise=1e-2)
    lines, _ = drawn(true, (4.0, 9.0))
    s = replace(true, forces=np.diag(np.diag(true.forces)) * 3.0, noise=5.0 * true.noise)
    values = [objective(s, lines)]
    for _ in range(8):
        s = expected(s, lines, 1)
        values.append(objective(s, lines))
    assert np.all(np.diff(values) < 1e-6 * abs(values[0]))
    assert values[-1] < values[0] - 10.0


def test_bins_have_all_usable_lines_and_none_else() -> None:
    values = np.random.default_rng(0).standard_normal((2, 1000)) + 0j
    usable = np.arange(1000) > 100
    usable[500:510] = False
    lines = in_bins(values, STEP, usable, 2.0 * np.pi * np.array([3.0, 7.0]) * (1j - 0.01), np.zeros(2))
    inside = np.concatenate([np.arange(a, b) for a, b in zip(lines.first, lines.last)])
    assert np.array_equal(inside, np.flatnonzero(usable))
    assert lines.count.sum() == usable.sum()
    whole = np.einsum("b,bij->ij", lines.count, lines.power)
    assert np.allclose(whole, values[:, usable] @ values[:, usable].conj().T)


def test_bins_of_different_quantities_have_no_more_than_the_modes() -> None:
    """Lines of one motion in two quantities: their mean product has rank one also in a wide bin."""
    hz = STEP * np.arange(1000)
    motion = np.exp(1j * np.random.default_rng(2).uniform(0.0, 6.28, 1000))
    values = np.stack([motion, (2j * np.pi * hz) ** 2 * motion])
    poles = 2.0 * np.pi * np.array([50.0]) * (1j - 0.01)
    lines = in_bins(values, STEP, hz > 1.0, poles, np.array([0.0, 2.0]))
    assert lines.count.max() > 100.0
    unit = np.stack([np.ones(len(lines.omega)), lines.omega**2])
    of_one = lines.power / (unit.T[:, :, None] * unit.T[:, None, :])
    assert np.linalg.eigvalsh(of_one)[:, 0] == pytest.approx(0.0, abs=1e-12)
