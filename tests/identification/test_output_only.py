"""Output-only identification where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import Dof, DofSet
from femtune.identification.averaging import CrossSpectra, cross_spectra
from femtune.identification.fdd import decompose, enhanced, peaks
from femtune.identification.realisation import Observability, block_hankel, correlations, correlations_by_block, era
from femtune.identification.ssi import covariance_driven, data_driven, scatter_of_order, supported_order
from femtune.identification.tfie import mode_at, phase_scatter, steady_lines
from structures.laboratory import accelerations, plant_of_matrices

DOFS = DofSet([Dof(1, "X"), Dof(2, "X"), Dof(3, "X")])
RATE = 20.0


def plant(ratio: float = 0.01):
    stiffness = 400.0 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    return plant_of_matrices(np.eye(3), stiffness, ratio, np.eye(3), DOFS, np.eye(3), DOFS)


def ambient(seed: int, samples: int, ratio: float = 0.01, noise: float = 0.05):
    rng = np.random.default_rng(seed)
    motion = accelerations(plant(ratio), rng.standard_normal((3, samples)), 1.0 / RATE)
    noisy = motion + noise * motion.std(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
    return noisy - noisy.mean(axis=1, keepdims=True)


def mac(a, b):
    return np.abs(a.conj() @ b) ** 2 / (np.abs(a) ** 2).sum() / (np.abs(b) ** 2).sum()


def test_correlations_are_mean_products():
    y = np.random.default_rng(0).standard_normal((3, 500))
    found = correlations(y, [2, 0], 7)
    for i in range(3):
        for b, j in enumerate((2, 0)):
            for k in range(8):
                assert found[i, b, k] == pytest.approx(np.mean(y[i, k:] * y[j, : 500 - k]))


def test_mean_of_the_pieces_is_the_whole():
    y = np.random.default_rng(0).standard_normal((2, 1010))
    pieces = correlations_by_block(y, [0, 1], 10, 5)
    direct = np.stack(
        [[[np.mean(y[i, k : k + 1000] * y[j, :1000]) for k in range(11)] for j in (0, 1)] for i in (0, 1)]
    )
    assert pieces.mean(axis=0) == pytest.approx(direct, abs=1e-12)


def test_hankel_blocks_stand_where_they_should():
    f = np.random.default_rng(0).standard_normal((2, 3, 9))
    h = block_hankel(f, 4, 3)
    for i in range(4):
        for j in range(3):
            assert (h[2 * i : 2 * i + 2, 3 * j : 3 * j + 3] == f[:, :, 1 + i + j]).all()


def test_era_is_exact_on_free_decays():
    truth = plant(0.02).truth
    t = np.arange(60) / RATE
    omega = truth.omega_rad_s
    pole = omega * (-0.02 + 1j * np.sqrt(1.0 - 0.02**2))
    decays = np.einsum("sm,rm,mk->srk", truth.shapes, truth.shapes, np.exp(pole[:, None] * t).real)
    (found,) = era(decays, 1.0 / RATE, 12, 12, 6).poles([6])
    assert found.freq_hz == pytest.approx(truth.freq_hz, rel=1e-10)
    assert found.damping_ratio == pytest.approx([0.02] * 3, rel=1e-8)
    assert [mac(found.shapes[:, i], truth.shapes[:, i]) for i in range(3)] == pytest.approx([1.0] * 3)


def test_orders_come_from_one_factorisation():
    o = np.random.default_rng(0).standard_normal((40, 8))
    for n, a, c in Observability(o, 4, 0.1).state_matrices([2, 5, 8]):
        assert a == pytest.approx(np.linalg.lstsq(o[:-4, :n], o[4:, :n], rcond=None)[0])
        assert (c == o[:4, :n]).all()


@pytest.mark.quick(1)
@pytest.mark.parametrize("method", ["covariance", "data", "era"])
def test_methods_agree_with_the_truth(method):
    y, truth = ambient(1, 100_000), plant().truth
    seen = {
        "covariance": lambda: covariance_driven(y, 1 / RATE, [0, 1, 2], 20, 20).observability,
        "data": lambda: data_driven(y, 1 / RATE, [0, 1, 2], 12, 20),
        "era": lambda: era(correlations(y, [0, 1, 2], 100), 1 / RATE, 40, 40, 20),
    }[method]()
    (found,) = seen.poles([6])
    assert found.freq_hz == pytest.approx(truth.freq_hz, rel=2e-3)
    assert found.damping_ratio == pytest.approx([0.01] * 3, abs=1.5e-3)
    assert min(mac(found.shapes[:, i], truth.shapes[:, i]) for i in range(3)) > 0.999


def test_pieces_of_data_leave_the_projection_as_it_is():
    y = ambient(2, 5000)
    past = np.vstack([y[[0, 2], i : i + 4984] for i in range(8)])
    future = np.vstack([y[:, 8 + i : 8 + i + 4984] for i in range(9)])
    projected = future @ past.T @ np.linalg.solve(past @ past.T, past) / np.sqrt(4984)
    u, s, _ = np.linalg.svd(projected, full_matrices=False)
    found = data_driven(y, 1 / RATE, [0, 2], 8, 6).matrix
    assert np.linalg.norm(found, axis=0) == pytest.approx(s[:6], rel=1e-8)
    assert np.abs(np.sum(found / s[:6] * u[:, :6], axis=0)) == pytest.approx(np.ones(6), rel=1e-6)


@pytest.mark.parametrize("order", [6, 10])
def test_movements_of_poles_are_derivatives(order):
    model, piece, step = covariance_driven(ambient(3, 20_000), 1 / RATE, [0, 1, 2], 10, 12, 8), 3, 1e-4
    moved = scatter_of_order(model, order)
    assert moved.found.poles == pytest.approx(next(model.observability.poles([order])).poles, rel=1e-9)
    ends = []
    for side in (step, -step):
        hankel = (model.left * model.singular_values) @ model.right.T + side * model.scatter[piece]
        u = np.linalg.svd(hankel, full_matrices=False)[0]
        ends += Observability(u[:, :order], 3, 1 / RATE).poles([order])
    slope = (ends[0].poles - ends[1].poles) / (2.0 * step)
    assert slope == pytest.approx(moved.poles[piece], rel=1e-5, abs=1e-9)
    for i in range(3):
        ratios = [e.shapes[:, i] / e.shapes[0, i] for e in ends]
        shape, change = moved.found.shapes[:, i], moved.shapes[piece, :, i]
        of_ratio = change / shape[0] - shape * change[0] / shape[0] ** 2
        assert (ratios[0] - ratios[1]) / (2.0 * step) == pytest.approx(of_ratio, rel=1e-4, abs=1e-8)


def test_frequency_domain_decomposition_finds_frequency_damping_and_shape():
    spectra, truth = cross_spectra(ambient(4, 200_000), RATE, 4096), plant().truth
    found = decompose(spectra)
    lines = peaks(found, (0.3, 9.5), 10.0)
    bells = [enhanced(spectra, found, line) for line in lines]
    assert [b.freq_hz for b in bells] == pytest.approx(truth.freq_hz, rel=3e-3)
    assert [b.damping_ratio for b in bells] == pytest.approx([0.01] * 3, rel=0.2)
    assert min(mac(b.shape, truth.shapes[:, i]) for i, b in enumerate(bells)) > 0.995


def _two_peaks():
    """One motion with peaks of the same size and width at 2 and 3 Hz, on lines of 0.01 Hz."""
    hz = np.linspace(0.0, 10.0, 1001)
    density = sum(1.0 / ((hz - peak) ** 2 + 0.05**2) for peak in (2.0, 3.0))
    shape = np.array([0.6, 0.8])
    return CrossSpectra(hz, density[:, None, None] * np.outer(shape, shape).astype(complex), 10, np.hanning(2000))


@pytest.mark.parametrize(("band", "lines"), [((1.0, 9.0), [200, 300]), ((1.0, 2.4), [200]), ((2.6, 9.0), [300])])
def test_peaks_are_those_of_the_band(band, lines):
    assert peaks(decompose(_two_peaks()), band) == lines


def test_a_bell_ends_in_the_valley_before_the_next_peak_of_its_shape():
    spectra = _two_peaks()
    lower, upper = (enhanced(spectra, decompose(spectra), line).band_hz for line in (200, 300))
    assert lower[1] == pytest.approx(2.5)
    assert upper[0] == pytest.approx(2.5)
    # on the other side to 25 decibels below the peak, (f − 2)² = .05²·(10^2.5 − 1) for one peak alone
    reach = 0.05 * np.sqrt(10.0**2.5 - 1.0)
    assert [2.0 - lower[0], upper[1] - 3.0] == pytest.approx([reach] * 2, rel=0.2)


def test_spectra_hold_the_power():
    y = np.random.default_rng(0).standard_normal((2, 200_000)) * np.array([[1.0], [3.0]])
    spectra = cross_spectra(y, RATE, 512)
    step = spectra.freq_hz[1]
    assert np.trapezoid(spectra.values[:, 0, 0].real, dx=step) == pytest.approx(1.0, rel=0.02)
    assert np.trapezoid(spectra.values[:, 1, 1].real, dx=step) == pytest.approx(9.0, rel=0.02)


@pytest.mark.slow
def test_phases_are_steady_at_modes_only():
    found, truth = phase_scatter(ambient(5, 200_000, 0.003, 0.02), RATE, 2048), plant().truth
    lines = steady_lines(found, (0.3, 9.5), 0.6)
    modes = [mode_at(found, line) for line in lines]
    assert [f for f, _ in modes] == pytest.approx(truth.freq_hz, rel=3e-3)
    assert min(mac(shape, truth.shapes[:, i]) for i, (_, shape) in enumerate(modes)) > 0.99
    between = np.abs(found.freq_hz - 2.5).argmin()
    assert found.sd_rad[between] > 2.0 * max(found.sd_rad[line] for line in lines)


@pytest.mark.slow
def test_the_published_ratio_of_magnitudes_is_too_large_where_noise_is():
    """A channel of pure noise: the complex ratio tends to zero, the mean of magnitudes does not."""
    values = ambient(5, 100_000, 0.003, 0.02)
    silent = 0.3 * values.std() * np.random.default_rng(6).standard_normal(values.shape[1])
    found = phase_scatter(np.vstack([values, silent]), RATE, 2048)
    line = int(np.abs(found.freq_hz - plant().truth.freq_hz[0]).argmin())
    (_, complex_shape), (_, magnitudes) = mode_at(found, line), mode_at(found, line, found.magnitudes)
    assert abs(complex_shape[3]) < 0.25 * abs(magnitudes[3])
    assert mac(magnitudes[:3], plant().truth.shapes[:, 0]) > 0.99


@pytest.mark.long
def test_stated_deviations_cover_the_truth():
    truth, hits, rounds = plant().truth, np.zeros(6), 1000
    for seed in range(rounds):
        moved = scatter_of_order(covariance_driven(ambient(seed, 40_000), 1 / RATE, [0, 1, 2], 8, 8, 25), 6)
        freq = np.abs(moved.found.freq_hz - truth.freq_hz) < T_24 * moved.freq_sd_hz
        damping = np.abs(moved.found.damping_ratio - 0.01) < T_24 * moved.damping_sd
        hits += np.concatenate([freq, damping])
    # the binomial scatter of 1000 rounds is 0.7 %
    assert ((hits / rounds > 0.93) & (hits / rounds < 0.97)).all()


T_24 = 2.064
"""97.5 % point of Student's t for the 25 pieces of the record."""


def test_deviations_of_the_hankel_matrix_are_those_of_a_mean() -> None:
    model, y = covariance_driven(ambient(5, 8_000), 1 / RATE, [0, 1], 4, 4, 6), ambient(5, 8_000)
    pieces = np.stack([block_hankel(p, 5, 4) for p in correlations_by_block(y, [0, 1], 8, 6)])
    np.testing.assert_allclose((model.scatter**2).sum(axis=0), np.var(pieces, axis=0, ddof=1) / 6, rtol=1e-9)


def test_the_order_that_the_correlations_support_is_that_of_the_structure():
    found = [
        supported_order(covariance_driven(ambient(seed, 40_000), 1.0 / RATE, range(3), 20, 30)) for seed in range(6)
    ]
    # three modes; what the scatter explains is decided within a few states
    assert all(order is not None and 6 <= order <= 12 for order in found)
    assert np.median(found) <= 8
    assert supported_order(covariance_driven(ambient(0, 40_000), 1.0 / RATE, range(3), 20, 4)) is None
