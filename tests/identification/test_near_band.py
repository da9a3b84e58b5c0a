"""Modes just outside the band: found where they matter, not where noise alone would suggest them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from tests.identification.conftest import Known

from femtune.identification import as_modes, fit_modes
from femtune.identification.input_known import InputKnown, identify_frfs
from femtune.identification.modal_solve import OUT_OF_BAND
from femtune.identification.near_band import MOST, fit_with_neighbours
from femtune.modal import pole_of

_LINES = np.linspace(8.0, 25.0, 250)


def _beside(known: Any, *freq: float) -> Any:
    """The modes and further ones of other shapes."""
    shapes = 0.5 * np.array([[0.9, -0.7], [0.5, 0.8], [0.8, -0.6]])[:, : len(freq)]
    damping = np.concatenate([known.damping_ratio, np.full(len(freq), 0.012)])
    together = np.hstack([known.shapes, shapes])
    return dataclasses.replace(
        known, freq_hz=np.concatenate([known.freq_hz, freq]), damping_ratio=damping, shapes=together
    )


@pytest.mark.slow
@pytest.mark.parametrize("outside", [(25.6,), (7.6,), (25.6, 27.0), (7.6, 25.6)])
def test_without_noise_the_modes_inside_are_exact(three_modes: Any, outside: tuple[float, ...]) -> None:
    frfs = _beside(three_modes, *outside).frfs(_LINES)
    start = pole_of(three_modes.freq_hz * 1.001, three_modes.damping_ratio)
    fit = fit_with_neighbours(frfs, start, None, OUT_OF_BAND)
    # without noise any further pole explains something
    found = np.abs(fit.poles[fit.outside]) / (2 * np.pi)
    for freq in outside:
        assert np.abs(found / freq - 1.0).min() < 1e-3
    modes = as_modes(fit)
    assert modes.labels == ("1", "2", "3")
    np.testing.assert_allclose(modes.freq_hz, three_modes.freq_hz, rtol=1e-6)
    sign = np.sign(np.sum(modes.shapes * three_modes.shapes, axis=0))
    np.testing.assert_allclose(modes.shapes * sign, three_modes.shapes, atol=1e-4)
    plain = as_modes(fit_modes(frfs, start))
    assert np.abs(plain.shapes * sign - three_modes.shapes).max() > 1e-3


@pytest.mark.parametrize("stated", [False, True])
@pytest.mark.quick(0, gate=1)
def test_noise_is_no_mode(three_modes: Any, stated: bool) -> None:
    for seed in range(10):
        frfs = three_modes.frfs(_LINES, 0.02, seed)
        size = 0.02 * np.sqrt(np.mean(np.abs(three_modes.frfs(_LINES).values) ** 2))
        sd = np.full(frfs.values.shape, size) if stated else None
        start = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
        assert not fit_with_neighbours(frfs, start, sd, OUT_OF_BAND).outside.any()


@pytest.mark.quick(0, gate=1)
@pytest.mark.parametrize(("functions", "count"), [(100, 18), (100, 15), (40, 10)])
def test_noise_is_no_mode_where_functions_are_many_and_lines_few(functions: int, count: int) -> None:
    """The noise of each function is found from few errors, of which each further mode takes some away."""
    shapes = np.random.default_rng(3).standard_normal((functions, 3))
    known = Known(np.array([10.0, 15.0, 21.0]), np.array([0.01, 0.015, 0.012]), shapes)
    start = pole_of(known.freq_hz, known.damping_ratio)
    for seed in range(10):
        frfs = known.frfs(np.linspace(8.0, 25.0, count), 0.02, seed)
        assert not fit_with_neighbours(frfs, start, None, OUT_OF_BAND).outside.any()


@pytest.mark.slow
def test_a_mode_is_found_where_functions_are_many_and_lines_few() -> None:
    shapes = np.random.default_rng(3).standard_normal((40, 4))
    known = Known(np.array([10.0, 15.0, 21.0, 25.8]), np.array([0.01, 0.015, 0.012, 0.012]), shapes)
    start = pole_of(known.freq_hz[:3], known.damping_ratio[:3])
    for seed in range(5):
        fit = fit_with_neighbours(known.frfs(np.linspace(8.0, 25.0, 18), 0.02, seed), start, None, OUT_OF_BAND)
        assert fit.outside.sum() == 1
        assert np.abs(fit.poles[fit.outside]) / (2 * np.pi) == pytest.approx(25.8, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("below", "above"), [(7.6, 25.9), (6.5, 29.0), (7.6, 50.0)])
def test_weak_modes_stay_in_the_band_beside_strong_ones_outside(below: float, above: float) -> None:
    """Those outside are a hundred times larger: a fit of two modes is best where both have taken their places."""
    shapes = 0.5 * np.array([[1.0, 0.9, 0.8, 1.0], [0.6, -1.0, 0.7, -0.9], [0.4, 0.3, -1.0, 0.7]])
    shapes[:, 1:3] *= 0.1
    known = Known(np.array([below, 12.0, 18.0, above]), np.array([0.008, 0.005, 0.006, 0.007]), shapes)
    frfs, start = known.frfs(_LINES, 1e-5), pole_of(known.freq_hz[1:3], known.damping_ratio[1:3])
    assert np.abs(fit_modes(frfs, start).poles / start - 1.0).max() > 1e-3
    fit = fit_with_neighbours(frfs, start, None, OUT_OF_BAND)
    np.testing.assert_allclose(fit.poles[~fit.outside], start, rtol=1e-4)


@pytest.mark.slow
def test_there_are_at_most_so_many_on_one_side(three_modes: Any) -> None:
    """Of five, as many are fitted as may be; the modes inside are far better than without them."""
    shapes = 0.5 * np.random.default_rng(4).standard_normal((3, 5))
    freq, damping = np.array([25.6, 26.3, 27.1, 28.4, 30.0]), np.full(5, 0.012)
    known = dataclasses.replace(
        three_modes, freq_hz=np.append(three_modes.freq_hz, freq),
        damping_ratio=np.append(three_modes.damping_ratio, damping), shapes=np.hstack([three_modes.shapes, shapes]),
    )  # fmt: skip
    frfs, start = known.frfs(_LINES), pole_of(three_modes.freq_hz * 1.001, three_modes.damping_ratio)
    fit = fit_with_neighbours(frfs, start, None, OUT_OF_BAND)
    above = np.abs(fit.poles[fit.outside]) > 2 * np.pi * _LINES[-1]
    assert above.sum() == MOST
    errors = [np.abs(as_modes(one).freq_hz / three_modes.freq_hz - 1.0).max() for one in (fit, fit_modes(frfs, start))]
    assert errors[0] < 0.1 * errors[1]


def test_lines_too_few_for_a_further_mode(three_modes: Any) -> None:
    """Four lines are eight numbers of a function, as many as those of four modes."""
    frfs = _beside(three_modes, 25.6).frfs(_LINES[::80])
    start = pole_of(three_modes.freq_hz, three_modes.damping_ratio)
    assert len(frfs.freq_hz) == 4
    assert not fit_with_neighbours(frfs, start, None, ()).outside.any()


@pytest.mark.slow
def test_the_identification_fits_it_and_says_so(three_modes: Any) -> None:
    known = _beside(three_modes, 25.6)
    found = identify_frfs(known.frfs(np.linspace(2.0, 40.0, 600), 0.01), InputKnown((8.0, 25.0), 20))
    np.testing.assert_allclose(found.modes.freq_hz, three_modes.freq_hz, rtol=2e-3)
    notices = {n.code: n.what for n in found.notices}
    assert "at 25.6" in notices["identify.near-band"]
    assert all(remark.mode < 3 for remark in found.remarks)
    assert found.modes.freq_sd_hz is not None
    assert (np.abs(found.modes.freq_hz - three_modes.freq_hz) < 4.0 * found.modes.freq_sd_hz).all()
